"""Planted faults are named, each by its name; healthy estimators raise none."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from by_hand import Given, episode
from trdlab.arrays import FloatArray
from trdlab.bellman import target
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations.calibration.consistency import Consistency, consistency_of
from trdlab.explanations.calibration.faults import (
    amount_off,
    faults,
    is_discount_wrong,
    off_from,
)
from trdlab.explanations.calibration.report import CalibrationReport, judge
from trdlab.explanations.rules import Claim
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Memoryless
from trdlab.rollouts.episodes import Episode, collect
from trdlab.tabular import MDP, exact, learn
from trdlab.tabular.episodes import ModelEnvironments

SINGLE, PAIRS = TimeAxis(0.95, 12), TimeAxis(0.95, 6, 2)
GREEDY = Future("the greedy policy")
WORLDS = ("drone", "windy")


@cache
def world(name: str) -> MDP:
    return Gridworld(load_map(name).with_slip(0.2)).mdp


def played(name: str, components: FloatArray, axis: TimeAxis, seed: int, num: int = 200) -> Any:
    """Plays the greedy policy of some components, whatever is wrong with them."""
    environments = ModelEnvironments(world(name), num, seed=seed, time_limit=200)
    return collect(Given(components, axis, GREEDY), environments, seed=seed)


def diagnosed(episodes: tuple[Episode, ...]) -> list[Claim]:
    return faults(judge(GREEDY, episodes))


@cache
def early(mdp: MDP) -> tuple[FloatArray, FloatArray]:
    """A policy, and components of a learner that took R_(t+1) for R_t while evaluating it."""
    table = exact(mdp, replace(SINGLE, horizon=SINGLE.horizon + 1))
    return table.solution.policy, table.decomposition.components[..., 1:] / SINGLE.gamma


@cache
def unpowered(name: str) -> FloatArray:
    """Components whose learner discounts groups of two steps by γ, not γ²."""
    mdp, axis = world(name), PAIRS
    states = np.arange(mdp.num_states)
    components = np.zeros((*mdp.shape, axis.num_components))
    for _ in range(300):
        actions = components.sum(axis=2).argmax(axis=1)
        own = mdp.expected_rewards
        rewards = own + axis.gamma * mdp.expect(own[states, actions])
        following = components[states, actions].T
        later = [mdp.expect(mdp.expect(part)[states, actions]) for part in following]
        components = target(rewards, axis.gamma, np.stack(later, axis=-1))
    return components


@cache
def endless(name: str, axis: TimeAxis) -> FloatArray:
    """Components whose learner goes on in the next episode where one ends."""
    mdp = world(name)
    following = np.where(mdp.terminated, mdp.start, mdp.next_states)
    goes_on = replace(mdp, next_states=following, terminated=np.zeros_like(mdp.terminated))
    return exact(goes_on, axis).decomposition.components


@cache
def healthy(name: str, axis: TimeAxis) -> FloatArray:
    return exact(world(name), axis).decomposition.components


@cache
def learned(name: str) -> FloatArray:
    return learn(world(name), SINGLE, agent_steps=200_000, seed=3).decomposition.components


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", WORLDS)
def test_a_healthy_estimator_raises_no_alarm(name: str, seed: int):
    for axis in (SINGLE, PAIRS):
        assert diagnosed(played(name, healthy(name, axis), axis, seed)) == []


@pytest.mark.parametrize("seed", range(5))
def test_an_estimator_that_has_learned_raises_no_alarm(seed: int):
    assert diagnosed(played("bridge", learned("bridge"), SINGLE, seed)) == []


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", [*WORLDS, "loop"])
def test_a_reward_shifted_by_one_step_is_named(name: str, seed: int):
    policy, components = early(world(name))
    episodes = collect(
        Given(components, SINGLE, GREEDY),
        ModelEnvironments(world(name), 200, seed=seed, time_limit=100),
        policy=Memoryless(lambda states: policy[states]),
        seed=seed,
    )
    (fault,) = diagnosed(episodes)
    assert fault.sentence == "The agent expects rewards 1 step too early."


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", WORLDS)
def test_a_forgotten_power_of_gamma_is_named(name: str, seed: int):
    (fault,) = diagnosed(played(name, unpowered(name), PAIRS, seed, num=500))
    assert fault.kind == "discount-off"
    assert fault.right == pytest.approx(0.95**2)
    assert fault.measured == pytest.approx(0.95, abs=0.025)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", WORLDS)
def test_a_discount_taken_twice_is_named(name: str, seed: int):
    components = healthy(name, replace(SINGLE, gamma=0.95**2))
    (fault,) = diagnosed(played(name, components, SINGLE, seed, num=500))
    assert fault.kind == "discount-off"
    assert fault.measured == pytest.approx(0.95**2, abs=0.02)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", WORLDS)
def test_an_ignored_end_is_named(name: str, seed: int):
    for axis in (SINGLE, PAIRS):
        (fault,) = diagnosed(played(name, endless(name, axis), axis, seed))
        assert fault.kind == "end-ignored"
        assert fault.share == pytest.approx(1.0, abs=0.2)


def test_what_is_expected_after_the_end_itself_is_seen():
    # the learner bootstraps from last observations, of which it always expects 1 in two steps
    mdp, axis = world("bridge"), SINGLE
    junk = np.zeros(axis.num_components)
    junk[2] = 1.0
    ends = mdp.per_action(mdp.probabilities * mdp.terminated)  # [S, A]
    components, states = healthy("bridge", axis).copy(), np.arange(mdp.num_states)
    for _ in range(300):
        actions = components.sum(axis=2).argmax(axis=1)
        later = np.stack([mdp.expect(part) for part in components[states, actions].T], axis=-1)
        components = target(mdp.expected_rewards, axis.gamma, later + ends[..., None] * junk)
    components[mdp.terminal_states] = junk
    (fault,) = diagnosed(played("bridge", components, axis, 0))
    assert (fault.kind, fault.is_next) == ("end-ignored", False)


# ---- what only looks like a fault ----------------------------------------------------------------


def young(horizon: int, lengths: tuple[int, int], noise: float, seed: int) -> CalibrationReport:
    """An agent paid 1 a step that has learned its first three components, and no later one."""
    axis, rng = TimeAxis(0.9, horizon), np.random.default_rng(seed)
    episodes = []
    for _ in range(50):
        total = int(rng.integers(*lengths, endpoint=True))
        left = total - np.arange(total + 1)[:, None]  # [T+1, 1]
        k = np.arange(horizon + 1)
        rows = ((k < left) & (k < 3)) + noise * rng.normal(size=(total + 1, horizon + 1))
        episodes.append(episode([1.0] * total, axis, rows * axis.discounts))
    return judge(GREEDY, episodes)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("horizon", "lengths", "noise"), [(9, (10, 10), 0.02), (10, (10, 60), 0.1), (40, (20, 50), 0.2)]
)
def test_a_young_agent_expects_too_little_and_nothing_too_early(horizon, lengths, noise, seed):
    report = young(horizon, lengths, noise, seed)
    assert faults(report) == []
    (late,) = off_from(report)
    assert (late.span[0], late.amount) == (3, "too little")
    (share,) = amount_off(report)
    assert share.share < 0.7


def test_what_a_young_agent_is_told():
    report = young(8, (10, 10), 0.01, 0)
    late, share = (*off_from(report), *amount_off(report))
    assert late.sentence.startswith(
        "The agent expects too little of what comes 3 to 7 steps later: "
    )
    assert late.sentence.endswith(" on average, where 1.56 came.")
    assert share.sentence == "In the first 8 steps the agent expects 0.613 times what comes."


def cut(rows: FloatArray, axis: TimeAxis) -> Episode:
    """An episode that pays 1 a step and is cut off, by what was expected at every observation."""
    total = len(rows) - 1
    ends = np.zeros(total, dtype=np.bool_)
    return episode([1.0] * total, axis, rows, terminated=False, ends=ends)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("horizon", [3, 10, 40])
def test_a_young_agent_is_told_of_no_discount(horizon: int, seed: int):
    # its residual has come to half of what is to come, and each component is off by some percent
    axis, rng = TimeAxis(0.99, horizon), np.random.default_rng(seed)
    right = axis.discounts * np.append(np.ones(horizon), 0.5 / (1.0 - axis.gamma))
    off = rng.normal(1.0, 0.03, axis.num_components)
    lengths = rng.integers(100, 200, 50)
    noise = [rng.normal(1.0, 0.01, (total + 1, axis.num_components)) for total in lengths]
    assert diagnosed(tuple(cut(right * off * of, axis) for of in noise)) == []


@pytest.mark.parametrize("seed", range(5))
def test_a_young_agent_that_sees_the_end_is_told_of_none(seed: int):
    # after ten steps it expects a tenth too much, and in the end a fifth of what it did at first
    axis, rng, k = TimeAxis(0.99, 10), np.random.default_rng(seed), np.arange(11)
    episodes = []
    for total in rng.integers(100, 120, 50):
        left = total - np.arange(total + 1)[:, None]
        rows = axis.discounts * (k < left)
        rows[:, -1:] *= 1.1 * (1.0 - axis.gamma ** (left - 10)) / (1.0 - axis.gamma)
        rows[-1] = 0.2 * rows[0]
        rows *= rng.normal(1.0, 0.01, rows.shape)
        episodes.append(episode([1.0] * total, axis, rows))
    assert diagnosed(tuple(episodes)) == []


# ---- steps that fit each other -------------------------------------------------------------------


def predicted(rows: list[list[float]], axis: TimeAxis, **changes: Any) -> Episode:
    """An episode without a reward, by what was expected at every observation."""
    return episode([0.0] * (len(rows) - 1), axis, rows, **changes)


def test_the_gap_between_steps_by_hand():
    axis = TimeAxis(0.5, 2)
    found = consistency_of([predicted([[1.0, 2.0, 3.0], [4.0, 1.0, 1.0], [9.0, 9.0, 9.0]], axis)])
    assert (found.num_transitions, found.num_ends) == (2, 1)
    # step 0: 2 − ½·4 and 3 − ½·(1 + 1); step 1 ended, so 1 and 1 should be nothing
    assert found.gap.value.tolist() == [0.5, 1.5]


def test_the_discount_by_hand():
    axis, wrong = TimeAxis(0.5, 3), [[1.0, 0.25, 0.25, 9.0]]
    found = consistency_of([cut(np.array(wrong * 5), axis)] * 12)
    # a·1 and a·¼ are to be the gaps ¼ − ½·1 and ¼ − ½·¼, so a = (−¼·1 + ⅛·¼) / (1 + 1/16) = −7/34
    assert found.discount.value == pytest.approx(1 / 2 - 7 / 34)
    assert found.discount_explains.value == pytest.approx((7 / 34) ** 2 * (17 / 16) / (5 / 64))


@given(
    factor=st.floats(0.1, 0.95),
    gamma=st.sampled_from([0.0, 0.3, 0.99]),
    horizon=st.integers(2, 12),
    width=st.integers(1, 3),
)
def test_a_factor_between_all_components_is_the_discount_and_all_that_is_wrong(
    factor: float, gamma: float, horizon: int, width: int
):
    rows = np.tile(np.append(factor ** np.arange(horizon), 7.0), (9, 1))
    axis = TimeAxis(gamma, horizon, width)
    found = consistency_of([cut(rows, axis)] * 12)
    assert found.discount.value == pytest.approx(factor)
    if abs(factor - gamma**width) > 1e-6:
        assert found.discount_explains.value == pytest.approx(1.0)


def test_a_residual_that_lags_behind_tells_no_discount():
    # of 1 a step, 1 is to come after the first two steps: ½·½/(1 − ½); half of that is expected
    axis = TimeAxis(0.5, 2)
    found = consistency_of([cut(np.array([[1.0, 0.5, 0.25]] * 5), axis)] * 12)
    assert found.gap.value.tolist() == [0.0, 0.25 - 0.5 * (0.5 + 0.25)]
    assert found.discount.value == 0.5


def test_pairs_leave_out_what_random_actions_and_truncations_hide():
    axis = TimeAxis(0.5, 1, 2)
    rows = [[1.0, 1.0]] * 7  # six steps and the last observation
    cut = {"terminated": False, "ends": np.zeros(6, dtype=np.bool_)}
    assert consistency_of([predicted(rows, axis)]).num_transitions == 6
    assert consistency_of([predicted(rows, axis, **cut)]).num_transitions == 5  # one reaches beyond
    assert consistency_of([predicted(rows, axis, **cut)]).num_ends == 0
    random = np.array([False, False, True, False, False, False, False, False])
    assert consistency_of([predicted(rows, axis, random=random)]).num_transitions == 5
    assert consistency_of([predicted(rows, axis, time_limit=6)]).num_transitions == 5
    with pytest.raises(InputError, match="0 pairs of steps"):
        consistency_of(
            [predicted(rows[:2], axis, terminated=False, ends=np.zeros(1, dtype=np.bool_))]
        )


def test_an_audit_that_says_nothing_names_nothing():
    silent: Consistency = consistency_of([predicted([[0.0, 0.0]] * 4, TimeAxis(0.5, 1))] * 12)
    assert np.isnan(silent.discount.value)
    assert not is_discount_wrong(silent)
