"""An explained agent: its sentences in their sections, as plain data, and drawn."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from trdlab.agents import gridworld_agent
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Outlook
from trdlab.explanations import assess, explain
from trdlab.explanations.calibration.claims import REPORTS
from trdlab.explanations.episode.played import EPISODES
from trdlab.explanations.explanation import Explanation, Part, parse_parts
from trdlab.explanations.moment.moment import CHOICES
from trdlab.explanations.moment.outcome import TRIALS
from trdlab.explanations.rules import Claim, UnsupportedSentenceError, check
from trdlab.show.plots.calibration import trust_figure
from trdlab.show.plots.figures import part_figure, picture_paths


@cache
def explained(name: str = "ledge", parts: tuple[Part, ...] = (), step: int = 0) -> Explanation:
    agent = gridworld_agent(name, TimeAxis(0.95, 4))
    return explain(agent, parts, step=step, episodes=100)


def read(text: str, of: Explanation) -> list[Claim]:
    """Reads sentences back, each against what it can speak of."""
    played = None if of.story is None else of.story.played
    known = ((CHOICES, of.choice), (REPORTS, of.report), (TRIALS, of.trial), (EPISODES, played))
    return check(text, [(language, about) for language, about in known if about is not None])


@pytest.mark.parametrize("name", ["drone", "ledge", "loop", "bridge", "tie"])
def test_every_sentence_is_supported_and_the_answer_is_five_of_them_at_most(name):
    found = explained(name)
    told = [sentence for section in found.sections for sentence in section.sentences]
    assert [claim.sentence for claim in read(" ".join(told), found)] == told
    answer = [claim.sentence for claim in found.answer]
    assert 3 <= len(answer) <= 5
    assert len(read(" ".join(answer), found)) == len(answer)
    with pytest.raises(UnsupportedSentenceError, match="no statement"):
        read("Trust me.", found)


def test_the_sections_answer_why_what_whose_and_how_far():
    told = {part.heading: " ".join(part.sentences) for part in explained("drone").sections}
    assert list(told) == [
        "Why down, not up",
        "What would change that",
        "What to expect of down",
        "Whose future",
        "Tried out",
        "The episode with seed 0",
        "How it does",
        "How far to trust it",
        "What comes later than it tells",
        "Other actions",
        "What this rests on",
    ]
    assert told["Why down, not up"].startswith(
        "Down gives more immediate rewards: 2.71 in the first 4 steps, while up gives nothing."
    )
    assert "down is worth 3.52, up 3.26." in told["Why down, not up"]
    assert told["What to expect of down"].startswith("With down, the first reward comes 1 step")
    assert told["Whose future"].startswith("After the first action, the optimal policy acts.")
    assert told["Tried out"].startswith("As forecast, down was worth 0.266 more than up.")
    assert told["How far to trust it"].startswith("For ")


def test_the_answer_begins_with_how_the_agent_does():
    assert [claim.kind for claim in explained("drone").answer] == [
        "scored-the-same",
        "more-immediate",
        "better-by-discount",
        "came-exactly",
        "better",
    ]


def test_only_what_is_asked_for_is_told():
    found = explained(parts=("contrast", "calibration"), step=1)
    names = [section.name for section in found.sections]
    assert names == ["contrast", "flips", "context", "trial", "score", "trust", "later", "others",
                     "judged"]  # fmt: skip
    agent = gridworld_agent("drone", TimeAxis(0.95, 4))
    forecast = explain(agent, ("forecast",), episodes=0)
    assert [section.name for section in forecast.sections] == ["forecast", "context"]


def test_the_plain_data_has_the_numbers_and_their_sentences():
    found = explained(parts=("contrast", "calibration"), step=1)
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["schema"] == "trdlab.explain/2"
    assert data["time_axis"]["labels"] == ["t", "t+1", "t+2", "t+3", "t+4…∞"]
    assert (data["seed"], data["step"]) == (0, 1)
    moment, calibration = data["moment"], data["calibration"]
    for action in moment["actions"].values():
        assert sum(action["components"]) == pytest.approx(action["q_value"])
    assert found.choice is not None
    assert (moment["action"], moment["foil"]) == (found.choice.action, found.choice.foil)
    assert calibration["schema"] == "trdlab.trust/2"
    assert calibration["judged"]["episodes"] == 100
    assert found.report is not None
    np.testing.assert_array_equal(
        np.array(calibration["calibration"]["skill"]["low"], dtype=float),
        found.report.calibration.skill.low,
    )
    assert len(calibration["ceiling"]["skill"]["value"]) == 5
    assert calibration["trusted"]["last_step"] == found.report.trust.last_step
    told = [finding["sentence"] for part in data["sections"] for finding in part["findings"]]
    assert [claim.sentence for claim in read(" ".join(told), found)] == told
    assert [finding["sentence"] for finding in data["answer"]] == [
        claim.sentence for claim in found.answer
    ]


def test_what_was_not_asked_for_is_null():
    agent = gridworld_agent("drone", TimeAxis(0.95, 4))
    forecast = explain(agent, ("forecast",), episodes=0).to_dict()
    nothing = ("calibration", "trial", "episode")
    assert {name: forecast[name] for name in nothing} == dict.fromkeys(nothing)
    calibration = explained(parts=("calibration",)).to_dict()
    assert calibration["moment"] is calibration["trial"] is calibration["episode"] is None


def test_how_often_a_reward_came_is_drawn_where_there_is_one_amount():
    several = explained("ledge").report  # -1 and 1
    assert several is not None
    assert len(trust_figure(several, "ledge").axes) == 1
    coin = assess(gridworld_agent("loop,slip=0.2", TimeAxis(0.95, 4)), episodes=120)
    skill, chance = trust_figure(coin, "loop").axes
    assert skill.get_ylabel().startswith("skill")
    assert chance.get_title() == "the reward of 1"
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
    assert found.plot().get_suptitle() == part_figure(found, "calibration").get_suptitle()


def test_pictures_are_named_by_what_they_show(tmp_path):
    paths = picture_paths(tmp_path / "new", (), seed=3, step=7)
    names = [path.name for path in paths.values()]
    assert names == [
        "forecast-seed-3-step-7.png",
        "contrast-seed-3-step-7.png",
        "episode-seed-3.png",
        "calibration.png",
        "outcomes-seed-3-step-7.png",
    ]
    (only,) = picture_paths(tmp_path, ("episode",), seed=3, step=7)
    assert only == "episode"


def test_outcomes_are_told_and_drawn_only_where_there_are_some():
    plain = explained(parts=("forecast", "contrast"), step=1)
    assert part_figure(plain, "outcomes") is None
    assert plain.choice is not None
    rows, reach = plain.choice.moment.decomposition.components, {"coin": 4, "crash": 4}
    learned = Outlook(
        variance=np.full((4, 4), np.nan),  # JSON has no such number
        survival=np.ones((4, 5)),
        chances={},
        parts={"coin": rows},
        events={"crash": np.full((4, 4), 0.25)},
        amounts={},
        reach=reach,
    )
    choice = replace(plain.choice, moment=replace(plain.choice.moment, outlook=learned))
    asked = replace(plain, choice=choice, parts=())
    assert part_figure(asked, "outcomes") is not None
    names = [section.name for section in asked.sections]
    assert names[names.index("forecast") + 1] == "outcomes"
    told = [claim.kind for claim in asked.answer]
    assert sum(kind in ("decides", "comes-otherwise", "made-of") for kind in told) == 1
    assert all(read(claim.sentence, asked) for claim in asked.answer)
    data = json.loads(json.dumps(asked.to_dict(), allow_nan=False))
    own = data["moment"]["actions"][choice.action]["outlook"]
    assert own["events"] == {"crash": [0.25] * 4}
    assert (own["reach"], own["survival_reach"], own["variance"]) == (reach, 0, [None] * 4)
    only = [section.name for section in replace(asked, parts=("forecast",)).sections]
    assert only == ["forecast", "outcomes", "context"]


def test_parts_are_named():
    assert parse_parts(None) == ()
    assert parse_parts("calibration, contrast") == ("contrast", "calibration")
    with pytest.raises(InputError, match=r"no explanation 'contrst'\. Did you mean 'contrast'"):
        parse_parts("forecast,contrst")
