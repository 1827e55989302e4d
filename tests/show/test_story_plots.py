"""The picture of an episode, short and long, with and without costs and trust."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.explanations.calibration.calibration import Trust
from trdlab.explanations.episode.played import Played
from trdlab.explanations.episode.story import tell
from trdlab.rollouts.episodes import Episode
from trdlab.show.plots import style
from trdlab.show.plots.episode import plot_actions, plot_story, story_figure

AXIS = TimeAxis(0.95, 4)


def played(total: int, axis: TimeAxis, *, cost: bool = False) -> Played:
    """An episode with a reward every 20 steps that is always foreseen, and a surprise."""
    t = np.arange(total)
    rewards = np.where(t % 20 == 2, -1.0 if cost else 1.0, 0.0)
    expected = np.zeros((total + 1, axis.num_components))
    for k in range(min(total, axis.num_steps)):
        expected[: total - k, k // axis.width] += axis.gamma**k * rewards[k:]
    expected[total // 2, 0] += 2.0
    known = RewardDecomposition(expected[:total, None], axis)
    return Played(
        Episode(
            decomposition=known,
            expected=expected,
            actions=np.zeros(total, dtype=np.int64),
            rewards=rewards,
            life_lost=np.zeros(total, dtype=np.bool_),
            ends=t == total - 1,
            terminated=True,
            random=np.zeros(total + axis.num_steps, dtype=np.bool_),
        ),
        ("wait",),
    )


@pytest.mark.parametrize("total", [1, 3, 500, 4_000])
@pytest.mark.parametrize("axis", [TimeAxis(0.95, 40), TimeAxis(0.9, 3, 3), TimeAxis(0.95, 0)])
def test_any_episode_can_be_drawn(total, axis):
    figure = story_figure(tell(played(total, axis)), "an episode")
    figure.canvas.draw()


def test_the_columns_are_steps_the_rows_are_steps_ahead_and_costs_have_a_colour():
    axis = TimeAxis(0.95, 4)
    for cost in (False, True):
        told = tell(played(30, axis, cost=cost))
        ax, below = Figure().subplots(2, 1)
        assert plot_story(ax, below, told) is ax
        residual, explicit = ax.images
        np.testing.assert_allclose(explicit.get_array(), told.played.episode.predicted[:, :4].T)
        np.testing.assert_allclose(residual.get_array(), told.played.episode.predicted[:, 4:].T)
        low, high = explicit.get_clim()
        assert residual.get_clim() == (low, high)
        assert low == (-high if cost else 0.0)
        assert [label.get_text() for label in ax.get_yticklabels()][-2:] == ["t+3", "t+4…∞"]


def test_actions_are_named_along_the_steps_where_there_is_room():
    of = played(100, AXIS)
    both = RewardDecomposition(np.repeat(of.episode.decomposition.components, 2, axis=1), AXIS)
    taken = replace(of.episode, actions=np.repeat([0, 1, 0], [60, 2, 38]), decomposition=both)
    of = replace(of, episode=taken, action_names=("wait", "jump"))
    strip = plot_actions(Figure().subplots(), of)
    assert [(text.get_text(), text.xy[0]) for text in strip.texts] == [
        ("wait", 29.5),
        ("wait", 80.5),
    ]
    labels = [text.get_text() for text in story_figure(tell(of)).legends[0].get_texts()]
    assert labels[:2] == ["wait", "jump"]


def test_moments_are_numbered_as_their_sentences_are():
    told = tell(played(500, TimeAxis(0.95, 40)))
    figure = story_figure(told, "an episode")
    marks = [text.get_text() for text in figure.axes[1].texts]
    assert ", ".join(marks) == ", ".join(str(i + 1) for i in range(len(told.moments)))
    lines = figure.legends[0].get_title().get_text().splitlines()
    assert [line[0] for line in lines if line[0].isdigit()] == ", ".join(marks).split(", ")


def test_beside_each_row_is_the_evidence_for_it_and_what_is_not_proved_is_pale():
    axis = TimeAxis(0.95, 3)
    told, trust = tell(played(30, axis)), Trust(axis, ("good", "bad", "open", "not tested"))
    ax, below = Figure().subplots(2, 1)
    plot_story(ax, below, told, trust)
    beside = [patch for patch in ax.patches if not patch.get_clip_on()]
    colours = [to_hex(patch.get_facecolor()) for patch in beside]
    assert colours == [style.EVIDENCE[found] for found in trust.status]
    assert len(ax.patches) - len(beside) == 3, "the pale rows"
    figure = story_figure(told, trust=trust)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    grounds = ["better than a guess", "no better than a guess", "open, or not tested"]
    assert labels == ["wait", *grounds]
