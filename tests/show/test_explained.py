"""An explained agent, as text, as plain data, and drawn."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from trdlab.explanations.explained import Explained, Part, parse_parts
from trdlab.explanations.moment.sentences import UnsupportedSentenceError
from trdlab.show.explained import check_explained, summary, to_dict

from trdlab.agents import gridworld_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations import Moment, assess, explain, explain_agent
from trdlab.show.plots.explained import (
    moment_figure,
    part_figure,
    picture_paths,
    trust_figure,
)


@cache
def explained(name: str = "ledge", parts: tuple[Part, ...] = (), step: int = 0) -> Explained:
    agent = gridworld_agent(name, TimeAxis(0.95, 4))
    return explain_agent(agent, parts, step=step, episodes=100)


@pytest.mark.parametrize("name", ["drone", "ledge", "loop"])
def test_every_sentence_of_a_summary_is_supported(name):
    found = explained(name)
    sections = summary(found)
    texts = [text for section in sections for text in section.sentences]
    assert found.explanation is not None
    assert found.report is not None
    assert len(check_explained(" ".join(texts), found)) == len(texts)
    with pytest.raises(UnsupportedSentenceError, match="no statement"):
        check_explained("Trust me.", found)
    assert 4 <= len(texts) <= 10


def test_a_summary_answers_what_why_not_how_far_and_whose():
    told = {section.heading: " ".join(section.sentences) for section in summary(explained("drone"))}
    assert list(told) == ["What down promises", "Why not up", "How far to trust it", "Whose future"]
    what, why_not, how_far, whose = told.values()
    assert "first reward to be expected of down is that of t+1: 1 on average" in what
    assert "with γ = 0.95 down is worth 3.52 and up 3.26." in why_not
    assert "Down gives more immediate rewards than up" in why_not
    assert "As forecast, down paid more than up in all" in why_not
    assert how_far.startswith("The forecast can be trusted ")
    assert whose.startswith("After the first action it is the future of the optimal policy")


def test_the_plain_data_has_the_numbers_and_their_sentences():
    found = explained(parts=("contrast", "calibration"), step=1)
    data = json.loads(json.dumps(to_dict(found), allow_nan=False))
    assert data["schema"] == "trdlab.explanations/1"
    assert data["time_axis"]["labels"] == ["t", "t+1", "t+2", "t+3", "t+4…∞"]
    moment, calibration = data["moment"], data["calibration"]
    assert (moment["seed"], moment["step"]) == (0, 1)
    for action in moment["actions"].values():
        assert sum(action["components"]) == pytest.approx(action["q_value"])
    kinds = [finding["kind"] for finding in moment["findings"]]
    assert "better" in kinds
    assert "first-step-cost" not in kinds  # that is of the forecast
    assert calibration["schema"] == "trdlab.trust/1"
    assert calibration["episodes"] == 100
    assert found.report is not None
    np.testing.assert_array_equal(
        np.array(calibration["calibration"]["skill"]["low"], dtype=float),
        found.report.calibration.skill.low,
    )
    assert len(calibration["ceiling"]["skill"]["value"]) == 5
    assert calibration["trusted"]["last_step"] == found.report.trust.last_step
    text = " ".join(finding["sentence"] for finding in calibration["findings"])
    assert len(check_explained(text, found)) == len(calibration["findings"])


def test_what_was_not_asked_for_is_null():
    agent = gridworld_agent("drone", TimeAxis(0.95, 4))
    forecast = to_dict(explain_agent(agent, ("forecast",), episodes=0))
    assert forecast["calibration"] is None
    kinds = {finding["kind"] for finding in forecast["moment"]["findings"]}
    assert "first-step-reward" in kinds
    assert not {"better", "better-by-discount", "not-trusted-at"} & kinds
    assert to_dict(explained(parts=("calibration",)))["moment"] is None


def test_bars_that_are_not_to_be_trusted_are_faded():
    found = explained("ledge")
    explanation, report = found.explanation, found.report
    assert explanation is not None
    assert report is not None
    trust = replace(report.trust, components=2, tested=2, residual=True)
    of_foils = replace(report.trust, components=3, tested=3, residual=False)
    moment = replace(explanation.moment, trust=trust, foil_trust=of_foils)
    figure = moment_figure(replace(explanation, moment=moment), explanation.foil, "ledge")
    figure.canvas.draw()
    faded = [
        [bar.get_alpha() is not None for bar in ax.patches] for ax in figure.axes if ax.patches
    ]
    assert faded[0] == [False, False, True, True, False]
    assert faded[1] == [False, False, False, True, True]
    assert faded[2] == [False, False, True, True, True], "a difference needs both"
    assert "faded" in figure.texts[-1].get_text()


def test_a_residual_that_swamps_the_rest_is_cut_off_and_said():
    rows = np.array([[1.0, 0.9, 94.5], [1.0, -0.8, 2.0]])
    axis = TimeAxis(0.95, 2)
    moment = Moment(RewardDecomposition(rows, axis), ("left", "right"), Future("a policy"))
    figure = moment_figure(explain(moment, "left", "right"), "right", "")
    action, foil, contrast = figure.axes
    assert action.get_ylim() == foil.get_ylim() == (-1.5, 1.5)
    notes = [[text.get_text() for text in ax.texts] for ax in figure.axes]
    assert notes[0][-1] == "↑ 94.5"
    assert notes[1][-1] == "↑ 2"
    assert notes[2][-1] == "↑ 92.5"
    assert contrast.get_ylim()[1] < 3.0


def test_how_often_a_reward_came_is_drawn_where_there_is_one_amount():
    several = explained("ledge").report  # -1 and 1
    assert several is not None
    assert len(trust_figure(several, "ledge").axes) == 1
    coin = assess(gridworld_agent("loop,slip=0.2", TimeAxis(0.95, 4)), episodes=120)
    skill, chance = trust_figure(coin, "loop").axes
    assert skill.get_ylabel().startswith("skill")
    assert chance.get_title() == "chance of the reward of 1"
    drawn = np.asarray(chance.collections[-1].get_offsets())
    found = coin.calibration.reliability
    assert found is not None
    first = found.counts[:, 0]
    assert drawn[0, 0] == pytest.approx(np.nansum(found.predicted[:, 0] * first) / first.sum())
    assert np.abs(drawn[:, 0] - drawn[:, 1]).max() < 0.1, "an exact table is near the diagonal"


def test_there_is_a_picture_only_of_what_there_is():
    found = explained(parts=("calibration",))
    assert part_figure(found, "forecast") is None
    assert part_figure(found, "contrast") is None
    assert part_figure(found, "calibration") is not None


def test_pictures_are_named_by_what_they_show(tmp_path):
    paths = picture_paths(tmp_path / "new", (), seed=3, step=7)
    names = [path.name for path in paths.values()]
    assert names == [
        "forecast-seed-3-step-7.png",
        "contrast-seed-3-step-7.png",
        "episode-seed-3.png",
        "calibration.png",
    ]


def test_parts_are_named():
    assert parse_parts(None) == ()
    assert parse_parts("calibration, contrast") == ("contrast", "calibration")
    with pytest.raises(InputError, match=r"no explanation 'contrst'\. Did you mean 'contrast'"):
        parse_parts("forecast,contrst")
