"""Copies of states: ceilings, foils and counterfactuals, against the exact values."""

from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from by_hand import exact_ceiling, occupancy
from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import GymEnvironments
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import calibrate
from trdlab.explanations.calibration.ceiling import ceiling_of
from trdlab.gridworld import Gridworld, load_map
from trdlab.rollouts.branches import Branching
from trdlab.rollouts.counterfactual import compared, try_actions
from trdlab.rollouts.episodes import Recording, collect
from trdlab.statistics import Estimates
from trdlab.tabular import ExactTable, ModelEnvironments, exact, from_environment

AXIS = TimeAxis(0.95, 12)
DRONE = Gridworld(load_map("drone").with_slip(0.2))


@cache
def bridge() -> ExactTable:
    return exact(Gridworld(load_map("bridge")).mdp, AXIS)


def inside(found: Estimates, true: FloatArray) -> FloatArray:
    """Returns which of the known intervals hold the truth."""
    told = ~np.isnan(found.low)
    return ((found.low <= true + 1e-9) & (true - 1e-9 <= found.high))[told].astype(np.float64)


def test_model_environments_draw_from_the_model_and_are_restored_to_the_bit():
    environments = ModelEnvironments(bridge().mdp, 500, seed=0, time_limit=9)
    environments.reset()
    right = np.full(500, 3)
    rewards = [environments.step(right).rewards.mean() for _ in range(3)]
    assert rewards[1] == pytest.approx(0.9 * 0.05 * -4.0, abs=0.06)  # slips off the bridge
    saved = environments.state_dict()
    once = environments.step(right)
    assert environments.load_state_dict(saved).tolist() == saved["states"].tolist()
    again = environments.step(right)
    assert (once.frames == again.frames).all()
    assert (once.following == again.following).all()
    for _ in range(5):
        step = environments.step(np.full(500, 2))
    assert step.truncated.any()  # those that began with the others and are still there
    assert not (step.truncated & step.terminated).any()
    with pytest.raises(InputError, match="no distribution"):
        ModelEnvironments(bridge().mdp, 1, seed=0, starts=np.ones(3))


def test_the_ceiling_of_an_exact_model_is_found_from_copies():
    environments = ModelEnvironments(bridge().mdp, 300, seed=101)
    branches = Branching(bridge(), copies=6, steps=300).along(environments, every=3)
    found = ceiling_of(branches)
    true = exact_ceiling(bridge(), occupancy(bridge()))
    assert inside(found.skill, true).mean() >= 0.8
    assert np.abs(found.skill.value - true).max() < 0.06
    assert not found.deterministic


def test_an_exact_table_has_the_skill_of_the_ceiling():
    found = calibrate(collect(bridge(), ModelEnvironments(bridge().mdp, 300, seed=2)))
    assert inside(found.skill, exact_ceiling(bridge(), occupancy(bridge()))).mean() >= 0.85


def test_what_came_in_few_episodes_speaks_against_no_forecast():
    table = exact(DRONE.mdp, AXIS)  # which is right, also of what comes in one episode of a hundred
    for seed in range(40):
        found = calibrate(collect(table, ModelEnvironments(DRONE.mdp, 50, seed=seed)))
        assert "bad" not in found.status


def test_where_a_coin_decides_the_ceiling_is_zero():
    from trdlab.tabular import MDP

    fair = [(0.5, 0, 1.0, False), (0.5, 0, 0.0, False)]
    table = exact(MDP.from_transitions([[fair]]), TimeAxis(0.9, 3))
    environments = ModelEnvironments(table.mdp, 100, seed=0, time_limit=40)
    found = ceiling_of(Branching(table, copies=4).along(environments, every=5)).skill
    assert np.abs(found.value[:3]).max() < 0.1
    assert ((found.low <= 0.0) & (found.high >= 0.0))[:3].all()


def test_gymnasium_environments_are_copied_with_fresh_chance():
    lake = from_environment(gym.make("FrozenLake-v1"))
    table = exact(lake, TimeAxis(0.95, 3))
    environments = GymEnvironments("FrozenLake-v1", 2, seed=0)
    environments.reset()
    copies = environments.branch(np.zeros(60, dtype=np.int64), seed=1)
    reached = copies.step(np.full(60, 2)).frames
    assert set(reached.tolist()) == {0, 1, 4}  # right, slipping up or down
    assert environments.step(np.array([2, 2])).frames.shape == (2,)  # those stay as they were
    branches = Branching(table, copies=3).along(
        GymEnvironments("FrozenLake-v1", 12, seed=0), every=10
    )
    assert not ceiling_of(branches).deterministic


def test_without_chance_the_ceiling_says_so():
    cart = GymEnvironments("CartPole-v1", 12, seed=0)

    class Sway:
        time_axis, future = TimeAxis(0.9, 5), Future("the greedy policy")

        def decompose(self, observations: Any) -> RewardDecomposition:
            components = np.zeros((len(observations), 2, 6))
            components[:, 1, 0] = observations[:, 2]  # pushes to where the pole leans
            return RewardDecomposition(components, self.time_axis)

    found = ceiling_of(Branching(Sway(), copies=2).along(cart, every=7))
    assert found.deterministic
    assert found.skill.value[3] == pytest.approx(1.0)
    assert np.isnan(found.skill.value[0])  # 1 at every step: nothing varies


def test_foils_of_an_exact_table_are_predicted_without_bias():
    branching, covered = Branching(exact(DRONE.mdp, AXIS), copies=4, steps=300), []
    for seed in range(20):
        environments = ModelEnvironments(DRONE.mdp, 200, seed=seed)
        branches = branching.along(environments, every=2, foils=True, seed=seed)
        assert set(branches.actions.tolist()) == {0, 1, 2, 3}
        found = calibrate(branches)
        covered.append(inside(found.bias, np.zeros(13)))
        assert found.skill.low[1] > 0.2
    assert np.mean(covered) >= 0.9
    assert np.mean(covered, axis=0).min() >= 0.75


def test_a_counterfactual_contrast_agrees_with_the_exact_one():
    table = exact(DRONE.mdp, AXIS)
    environments = ModelEnvironments(DRONE.mdp, 1, seed=0)
    playing = Recording(table, environments).playing
    branching = Branching(table, copies=200, steps=400)
    true = (table.decomposition[0, 1] - table.decomposition[0, 0]).components
    covered = []
    for seed in range(40):
        found = compared(try_actions(branching, playing, 1, 0, seed=seed), seed=seed)
        assert found.predicted == pytest.approx([*true, true.sum()])
        assert np.abs(found.observed.value - found.predicted).max() < 0.4
        covered.append(inside(found.observed, found.predicted))
    # that holds of what is rare, too, which comes in few of these tries or in none
    assert np.mean(covered, axis=0).min() >= 0.85


def test_counterfactuals_refuse_what_is_not_there():
    table, environments = bridge(), ModelEnvironments(bridge().mdp, 1, seed=0)
    with pytest.raises(InputError, match=r"There is no step 500: the episode is over after \d+"):
        Recording(table, environments).play_to(500)
    playing = Recording(table, environments).playing
    with pytest.raises(InputError, match="both 1"):
        try_actions(Branching(table), playing, 1, 1)
    with pytest.raises(InputError, match=r"no action 7.*0 to 3"):
        try_actions(Branching(table), playing, 7, 1)
    with pytest.raises(InputError, match="reach 12 steps"):
        Branching(table, steps=5)
    with pytest.raises(InputError, match="at least 2 of both"):
        ceiling_of(Branching(table, copies=1).along(environments, every=2))
