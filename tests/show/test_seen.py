"""The manner of the paper's figures: what is seen, and beside it the reward of each step."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from moments import calibrated
from trdlab.agents import find_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations import explain
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.show.plots.seen import seen_figure
from trdlab.show.plots.style import action_colours

AXIS = TimeAxis(0.5, 3)
SCREEN = np.arange(5 * 4 * 3, dtype=np.uint8).reshape(5, 4, 3)
NAMES = ("go", "stay")


def moment(**known: object) -> Moment:
    found = RewardDecomposition(np.array([[1.0, 0.5, 0.75, 9.0], [0.0, 1.0, 0.25, 7.0]]), AXIS)
    return Moment(found, NAMES, Future("the greedy policy"), **known)  # type: ignore[arg-type]


def bars(ax: object) -> list[Rectangle]:
    return [of for of in ax.patches if isinstance(of, Rectangle)]  # type: ignore[attr-defined]


def test_the_screen_is_shown_as_it_is():
    screen, _ = seen_figure(Choice(moment(), "go", None), SCREEN).axes
    np.testing.assert_array_equal(screen.images[0].get_array(), SCREEN)


def test_bars_are_the_rewards_without_their_discount():
    _, ax = seen_figure(Choice(moment(), "go", None), SCREEN).axes
    assert [bar.get_height() for bar in bars(ax)] == [1.0, 1.0, 3.0]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["t", "t+1", "t+2"]
    assert "component k: reward of t+k" in ax.get_xlabel()


def test_two_actions_stand_beside_each_other_and_their_difference_below():
    _, ax, below = seen_figure(Choice(moment(), "go", "stay"), SCREEN).axes
    assert [bar.get_height() for bar in bars(ax)] == [1.0, 1.0, 3.0, 0.0, 2.0, 1.0]
    assert [bar.get_height() for bar in bars(below)] == [1.0, -1.0, 2.0]
    colours = action_colours(NAMES)
    assert len({colours[name] for name in NAMES}) == 2


def test_what_is_not_to_be_trusted_is_pale():
    known = calibrated(AXIS, ["good", "good", "open", "good"], [0.1] * 4)
    figure = seen_figure(Choice(moment(calibration=known), "go", None), SCREEN)
    _, ax = figure.axes
    assert [bar.get_alpha() for bar in bars(ax)] == [1.0, 1.0, pytest.approx(0.35)]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["go: trustworthy to t+1", "pale: not to be trusted"]


def test_what_the_policy_hardly_ever_does_is_not_trusted_because_of_what_it_does():
    known = calibrated(AXIS, ["good"] * 4, [0.1] * 4)
    own = moment(calibration=known, policy=np.array([0.99, 0.01]))
    figure = seen_figure(Choice(own, "go", "stay"), SCREEN)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[0] == "go: trustworthy to t+2"
    assert labels[1] == "stay: not tested, or no better than a guess"
    judged = replace(own, foils=known)
    labels = [
        text.get_text()
        for text in seen_figure(Choice(judged, "go", "stay"), SCREEN).legends[0].get_texts()
    ]
    assert labels[1] == "stay: trustworthy to t+2"


def test_an_exact_answer_needs_no_tests():
    explained = explain(find_agent("gridworld:drone"), ("forecast",), episodes=0)
    assert explained.choice is not None
    figure = seen_figure(explained.choice, SCREEN)
    assert {bar.get_alpha() for bar in bars(figure.axes[1])} == {1.0}
