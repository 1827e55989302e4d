"""What each step changes in what was expected: by hand, and against exact tables."""

import numpy as np
import pytest

from by_hand import episode
from trdlab.decomposition import TimeAxis
from trdlab.explanations.episode.played import revise
from trdlab.gridworld import Gridworld, load_map
from trdlab.rollouts.episodes import collect
from trdlab.tabular import exact
from trdlab.tabular.episodes import ModelEnvironments

SHORT = ([1.0, 2.0], TimeAxis(0.5, 2), [[0.0, 1.0, 2.0], [2.0, 1.0, 0.0], [4.0, 2.0, 2.0]])


def test_the_next_forecast_one_step_later_less_the_last_one():
    found = revise(episode(*SHORT))
    assert found.steps.tolist() == found.last.tolist() == [0, 1]
    assert found.ended.tolist() == [False, True]
    assert found.after.tolist() == [[1.0, 1.0, 0.5], [2.0, 0.0, 0.0]]
    assert found.change.tolist() == [[1.0, 0.0, -1.5], [0.0, -1.0, 0.0]]


def test_where_an_episode_was_cut_off_its_last_observation_counts():
    found = revise(episode(*SHORT, terminated=False))
    assert found.change.tolist() == [[1.0, 0.0, -1.5], [0.0, 1.0, 2.0]]
    assert not found.ended.any()


GROUPED = ([1.0, 2.0, 4.0], TimeAxis(0.5, 1, 2), [[1.0, 1.0], [1.0, 0.0], [4.0, 1.0], [9.0, 9.0]])


def test_a_window_is_shortened_by_an_end_but_not_by_a_truncation():
    found = revise(episode(*GROUPED))
    assert found.last.tolist() == [1, 2, 2]
    assert found.change.tolist() == [[1.0, 0.25], [3.0, 0.0], [0.0, -1.0]]
    found = revise(episode(*GROUPED, terminated=False))
    assert found.steps.tolist() == [0, 1]
    assert found.change.tolist() == [[1.0, 0.25], [3.0, 4.5]]


def test_nothing_is_expected_across_a_life_that_counts_as_an_end():
    lost = np.array([True, False, False])
    found = revise(episode(*GROUPED, life_lost=lost, ends=np.array([True, False, True])))
    assert found.last.tolist() == [0, 2, 2]
    assert found.after.tolist() == [[1.0, 0.0], [4.0, 0.0], [4.0, 0.0]]


def test_a_window_with_a_random_action_after_the_first_is_left_out():
    random = np.array([False, True, False, False, False])
    assert revise(episode(*GROUPED, random=random)).steps.tolist() == [1, 2]


def test_without_explicit_components_it_is_the_td_error():
    axis = TimeAxis(0.5, 0)
    found = revise(episode([1.0, 2.0], axis, [[3.0], [2.0], [9.0]]))
    assert found.change.tolist() == [[-1.0], [0.0]]


def test_an_episode_shorter_than_a_group_has_no_revision():
    axis = TimeAxis(0.5, 1, 5)
    cut = episode([1.0], axis, [[1.0, 1.0], [1.0, 1.0]], terminated=False)
    assert len(revise(cut)) == 0


@pytest.mark.parametrize("name", ["drone", "corridor", "loop", "patience", "tie", "windy"])
@pytest.mark.parametrize("axis", [TimeAxis(0.95, 4), TimeAxis(0.9, 3, 3), TimeAxis(0.95, 0)])
def test_where_there_is_no_chance_an_exact_table_never_changes_its_mind(name, axis):
    mdp = Gridworld(load_map(name)).mdp
    table = exact(mdp, axis)
    (played,) = collect(table, ModelEnvironments(mdp, 1, seed=0, time_limit=500))
    change = revise(played).change
    assert len(change) >= len(played) - axis.width + 1
    np.testing.assert_allclose(change, 0.0, atol=1e-9)


@pytest.mark.parametrize("axis", [TimeAxis(0.95, 6), TimeAxis(0.9, 2, 3)])
def test_where_there_is_chance_an_exact_table_is_right_on_average(axis):
    mdp = Gridworld(load_map("bridge").with_slip(0.2)).mdp
    table = exact(mdp, axis)
    episodes = collect(table, ModelEnvironments(mdp, 2000, seed=0))
    means = np.stack([revise(episode).change.sum(axis=0) for episode in episodes])  # [E, N+1]
    error = means.std(axis=0) / np.sqrt(len(means))
    assert means.std(axis=0).max() > 0.5
    assert (np.abs(means.mean(axis=0)) < 4.0 * error + 1e-12).all()
