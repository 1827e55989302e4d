"""Calibration: estimators whose errors are known, in a world that is known."""

from collections.abc import Callable
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from by_hand import Given, episode, exact_tails, occupancy
from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import Step
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import Calibration, calibrate
from trdlab.explanations.calibration.errors import errors_of, is_off
from trdlab.explanations.calibration.report import score_of
from trdlab.explanations.calibration.residual import residual_of
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Memoryless
from trdlab.rollouts.episodes import Episode, collect
from trdlab.rollouts.realised import pool, what_followed
from trdlab.statistics import unseen
from trdlab.tabular import ExactTable, exact
from trdlab.tabular.episodes import ModelEnvironments

AXIS = TimeAxis(0.95, 20)


@cache
def circuit(axis: TimeAxis = AXIS) -> ExactTable:
    """A slippery circuit without an end, paid once each round."""
    return exact(Gridworld(load_map("loop").with_slip(0.2)).mdp, axis)


def played(
    table: ExactTable,
    change: Callable[[FloatArray], FloatArray] = lambda rewards: rewards,
    *,
    num: int = 60,
    seed: int = 0,
    epsilon: float = 0.0,
    time_limit: int | None = 100,
) -> tuple[Episode, ...]:
    """Plays the policy of a table, predicting its expected rewards `[S, A, N]` after a change."""
    axis, components = table.time_axis, table.decomposition.components.copy()
    components[..., :-1] = change(components[..., :-1] / axis.discounts[:-1]) * axis.discounts[:-1]
    environments = ModelEnvironments(table.mdp, num, seed=seed, time_limit=time_limit)
    return collect(
        Given(components, axis, Future("the given policy")),
        environments,
        policy=Memoryless(lambda states: table.solution.policy[states]),
        epsilon=epsilon,
        seed=seed,
    )


def late(rewards: FloatArray) -> FloatArray:
    """Returns rewards predicted two steps late."""
    return np.concatenate([np.zeros_like(rewards[..., :2]), rewards[..., :-2]], axis=-1)


def noisy(rewards: FloatArray) -> FloatArray:
    """Returns rewards that from step 10 on are worth nothing."""
    noise = np.random.default_rng(1).normal(size=rewards.shape)
    return np.where(np.arange(rewards.shape[-1]) < 10, rewards, rewards + noise)


def smeared(rewards: FloatArray) -> FloatArray:
    """Returns rewards of which a quarter is predicted for each of the neighbouring steps."""
    padded = np.pad(rewards, ((0, 0), (0, 0), (1, 1)))
    return 0.25 * padded[..., :-2] + 0.5 * padded[..., 1:-1] + 0.25 * padded[..., 2:]


# ---- what followed -------------------------------------------------------------------------------


def test_what_followed_is_the_discounted_reward_of_each_step_and_zero_after_the_end():
    observed, known = what_followed(episode([1.0, 0.0, 2.0, 4.0], TimeAxis(0.5, 2)))
    assert known.all()
    assert observed.tolist() == [
        [1.0, 0.0, 0.25 * 2.0 + 0.125 * 4.0],
        [0.0, 1.0, 0.25 * 4.0],
        [2.0, 2.0, 0.0],
        [4.0, 0.0, 0.0],
    ]


def test_what_followed_sums_groups():
    observed, known = what_followed(episode([1.0, 2.0, 4.0, 8.0, 16.0], TimeAxis(0.5, 1, 2)))
    assert known.all()
    assert observed[0].tolist() == [1.0 + 1.0, 1.0 + 1.0 + 1.0]
    assert observed[4].tolist() == [16.0, 0.0]


def test_what_a_truncation_cut_off_is_not_known():
    observed, known = what_followed(episode([1.0, 1.0, 1.0], TimeAxis(0.5, 2), terminated=False))
    assert known.tolist() == [[True, True, False], [True, True, False], [True, False, False]]
    assert (observed[~known] == 0.0).all()
    _, grouped = what_followed(episode([1.0, 1.0, 1.0], TimeAxis(0.5, 1, 2), terminated=False))
    assert grouped.tolist() == [[True, False], [True, False], [False, False]]


def test_of_a_residual_the_short_episodes_alone_tell_nothing():
    axis = TimeAxis(0.5, 1)
    ended = [episode([1.0, 1.0, 1.0 + i], axis) for i in range(12)]
    long = episode([1.0] * 9, axis, terminated=False)
    assert pool(ended).known.all()
    assert not pool([*ended, long]).known[:, -1].any()
    assert residual_of(ended).observed_tails.size > 0
    assert residual_of([*ended, long]).observed_tails.size == 0, "nor does the N that would suffice"


def test_beyond_a_time_limit_nothing_is_known_even_if_the_episode_ended_in_time():
    _, known = what_followed(episode([1.0, 1.0, 1.0], TimeAxis(0.5, 2), time_limit=3))
    assert known.tolist() == [[True, True, True], [True, True, True], [True, False, True]]


def test_a_lost_life_that_ends_the_future_is_followed_by_nothing():
    ends = np.array([False, True, False])
    lost = episode([1.0, 2.0, 4.0], TimeAxis(0.5, 2), ends=ends, terminated=False)
    observed, known = what_followed(lost)
    assert observed[:2].tolist() == [[1.0, 1.0, 0.0], [2.0, 0.0, 0.0]]
    assert known.tolist() == [[True] * 3, [True] * 3, [True, False, False]]


def test_what_follows_a_random_action_is_not_held_against_the_prediction():
    random = np.array([False, True, False, False, True])  # the last one past the end
    _, known = what_followed(episode([1.0, 1.0, 1.0], TimeAxis(0.5, 2), random=random, epsilon=0.1))
    # of step 0 only its own reward; the coin past the end hides as if there were a step
    assert known.tolist() == [[True, False, False], [True, True, False], [True, True, False]]


class Scripted:
    """One environment of 4 steps whose frames count them; a life is lost in the second."""

    num_envs, num_actions, first_action = 1, 2, 0
    action_names, stack, padding = (), 2, "zero"
    time_limit, frame_skip, frames_per_second = None, 1, None
    observation_space = gym.spaces.Box(0, 9, (1,), np.int64)
    now = 0

    def reset(self) -> Any:
        self.now = 5
        return np.array([[5]])

    def step(self, actions: Any, active: Any = None) -> Step:
        self.now += 1
        over = np.array([self.now == 9])
        frames = np.array([[self.now]])
        return Step(
            frames=frames,
            rewards=np.array([3.0]),
            terminated=over,
            truncated=np.array([False]),
            life_lost=np.array([self.now == 7]),
            following=np.where(over, 5, frames),
        )


class Last:
    """Predicts the sum of the frames it sees, for action 1."""

    time_axis = TimeAxis(0.5, 1)

    def __init__(self, **counts: bool) -> None:
        self.future = Future("the greedy policy", **counts)

    def decompose(self, observations: Any) -> RewardDecomposition:
        components = np.zeros((len(observations), 2, 2))
        components[:, 1, 0] = observations.sum(axis=(1, 2))
        return RewardDecomposition(components, self.time_axis)


def test_collect_keeps_what_was_predicted_up_to_the_true_last_observation():
    clipped = Last(clip_rewards=True, life_loss_ends=True)
    (episode,) = collect(clipped, Scripted())  # type: ignore[arg-type]
    assert episode.actions.tolist() == [1, 1, 1, 1]
    assert episode.predicted[:, 0].tolist() == [5, 11, 13, 15]  # 0 + 5, 5 + 6, 6 + 7, 7 + 8
    assert episode.expected[:, 0].tolist() == [5, 11, 13, 15, 17]  # and 8 + 9 at the end
    assert episode.rewards.tolist() == [1.0] * 4  # clipped
    assert episode.ends.tolist() == [False, True, False, True]
    assert score_of([episode]).life_losses == 1
    (raw,) = collect(Last(), Scripted())  # type: ignore[arg-type]
    assert raw.rewards.tolist() == [3.0] * 4
    assert raw.ends.tolist() == [False, False, False, True]


def test_random_actions_do_not_bias_what_is_known():
    table = exact(Gridworld(load_map("bridge")).mdp, AXIS)
    found = calibrate(played(table, num=600, epsilon=0.1, time_limit=None))
    inside = (found.bias.low <= 1e-12) & (found.bias.high >= -1e-12)
    assert inside[:-1].mean() >= 0.8
    assert found.status[-1] == "not tested"  # where a random action may come, the rest is not known
    with pytest.raises(InputError, match=r"ε is 1\.0"):
        played(table, epsilon=1.0)


# ---- calibration ---------------------------------------------------------------------------------


def test_bias_error_skill_and_correlation_by_hand():
    axis = TimeAxis(0.5, 1)
    rewards, predicted = [0.0, 2.0, 0.0, 2.0], [0.5, 1.5, 0.5, 2.5]
    components = np.zeros((4, 1, 2))
    components[:, 0, 0] = predicted
    decomposition = RewardDecomposition(components, axis)
    found = calibrate([episode(rewards, axis, decomposition=decomposition)])
    assert found.bias.value[0] == pytest.approx(0.25)
    assert found.error.value[0] == pytest.approx(0.25)
    assert found.variance[0] == pytest.approx(1.0)
    assert found.skill.value[0] == pytest.approx(0.75)
    assert (found.status[0], found.num_episodes[0], found.enough[0]) == ("open", 1, 10)
    assert np.isnan(found.skill.low[0])


def test_intervals_are_those_of_drawing_whole_episodes():
    episodes = played(circuit(TimeAxis(0.95, 2)), num=12)
    found = calibrate(episodes)
    observed = [what_followed(episode)[0][:, 0] for episode in episodes]
    predicted = [episode.predicted[:, 0] for episode in episodes]
    rng, skills = np.random.default_rng(3), []
    for _ in range(2_000):
        drawn = rng.integers(12, size=12)
        o = np.concatenate([observed[e] for e in drawn])
        p = np.concatenate([predicted[e] for e in drawn])
        skills.append(1.0 - ((p - o) ** 2).mean() / o.var())
    low, high = np.quantile(skills, [0.025, 0.975])
    assert found.skill.low[0] == pytest.approx(low, abs=0.02)
    assert found.skill.high[0] == pytest.approx(high, abs=0.02)


def constant(reward: float, expected: float, episodes: int = 50) -> Calibration:
    """Calibrates one and the same forecast of rewards that are always the same, at N = 3."""
    axis, rng = TimeAxis(0.5, 3), np.random.default_rng(0)

    def one() -> Episode:  # different in what is expected of the last step only
        components = np.broadcast_to(expected * axis.discounts, (20, 1, 4)).copy()
        components[-1] *= rng.uniform(0.99, 1.0)
        decomposition = RewardDecomposition(components, axis)
        return episode([reward] * 20, axis, decomposition=decomposition, terminated=False)

    return calibrate([one() for _ in range(episodes)])


@pytest.mark.parametrize(
    ("expected", "episodes", "status"),
    [
        (2.1, 50, "good"),  # within a tenth
        (1.0, 50, "bad"),
        (1.5, 3, "open"),  # what comes with a chance of up to 0.71 could have been missed
        (0.0, 50, "bad"),
    ],
)
def test_a_reward_that_is_always_the_same_is_forecast_right_or_wrong(expected, episodes, status):
    found = constant(2.0, expected, episodes)
    assert found.status == (status,) * 3 + ("not tested",)
    assert found.constant.tolist() == [True, True, True, False]
    assert np.isnan(found.skill.value).all()
    assert found.trust.components == (3 if status == "good" else 0)


def test_rewards_that_never_come_and_are_not_expected_are_no_evidence():
    found = constant(0.0, 0.0)
    assert set(found.status) == {"not tested"}
    assert found.trust.last_step is None
    assert found.trust.doubtful.all()
    assert constant(0.0, 1.0).status[:3] == ("bad",) * 3, "a reward that was expected all the time"


def test_what_differs_in_few_episodes_is_open_and_it_is_said_how_many_would_tell():
    axis = TimeAxis(0.5, 1)
    expected = [[[0.2 + 1e-3 * i, 0.0]] * 2 for i in range(20)]
    episodes = [episode([float(i < 2)], axis, expected[i]) for i in range(20)]
    found = calibrate(episodes)
    assert found.skill.value[0] < 0.0
    assert found.status[0] == "open"
    # o² is 0.81 in two episodes and 0.01 in 18: in size like (1.8)² / 1.314 ≈ 2.5, and 10 would do
    assert found.enough[0] == 90
    assert found.bias.high[0] - found.bias.value[0] > unseen(20)


def test_before_a_reward_that_comes_it_is_right_to_expect_none():
    axis = TimeAxis(0.5, 4)
    rows = [axis.discounts * np.eye(5)[2] * (t == 0) for t in range(4)]  # 1 in two steps, at first
    found = calibrate([episode([0.0, 0.0, 1.0], axis, rows) for _ in range(12)])
    assert found.status == ("open", "open", "open", "not tested", "not tested")
    branching = [episode([0.0, 0.0, 0.0, float(i % 2)], axis) for i in range(4)]
    assert calibrate(branching).status[0] == "open"


def test_one_episode_played_again_and_again_is_one_episode():
    world = Gridworld(load_map("drone"))  # without chance
    episodes = played(exact(world.mdp, TimeAxis(0.95, 4)), num=30)
    found = calibrate(episodes)
    assert not {"good", "bad"} & set(found.status)
    assert set(found.num_episodes) == {1}
    assert errors_of(pool(episodes)).shift == 0


def test_reliability_is_on_the_diagonal_for_an_exact_table():
    found = calibrate(played(circuit(), num=200)).reliability
    assert found is not None
    assert found.amount == pytest.approx(1.0)
    assert found.counts.sum(axis=1)[0] == 200 * 100
    many = found.counts > 300
    assert many.sum() > 20
    assert np.abs(found.predicted - found.observed)[many].max() < 0.06


def test_rewards_of_several_amounts_have_no_reliability():
    world = Gridworld(load_map("windy").with_slip(0.2))  # −0.1 a step, 0.9 the last one
    assert calibrate(played(exact(world.mdp, AXIS), num=40)).reliability is None


# ---- estimators with known errors ----------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_perfect_table_is_trusted_to_the_end(seed: int):
    calibration = calibrate(played(circuit(), seed=seed))
    assert calibration.is_("not tested").tolist() == [False] * 20 + [True]  # it never ends
    found = calibration.trust
    assert found.is_whole
    assert found.last_step == 19


@pytest.mark.parametrize("seed", range(3))
def test_noise_beyond_step_10_ends_the_trust_there(seed: int):
    found = calibrate(played(circuit(), noisy, seed=seed)).trust
    assert (found.components, found.last_step) == (10, 9)


@pytest.mark.parametrize("seed", range(3))
def test_rewards_predicted_two_steps_late_are_found_and_not_trusted(seed: int):
    episodes = played(circuit(), late, seed=seed)
    assert calibrate(episodes).trust.last_step is None
    found = errors_of(pool(episodes))
    assert found.shift == 2
    assert not is_off(found.amount)


@pytest.mark.parametrize("seed", range(3))
def test_rewards_scaled_by_one_and_a_half_are_found(seed: int):
    found = errors_of(pool(played(circuit(), lambda rewards: 1.5 * rewards, seed=seed)))
    assert found.shift == 0
    assert is_off(found.amount)
    assert found.amount.low < 1.5 < found.amount.high


@pytest.mark.parametrize("seed", range(3))
def test_smeared_rewards_are_found(seed: int):
    found = errors_of(pool(played(circuit(), smeared, seed=seed)))
    assert found.shift == 0
    assert not is_off(found.amount)
    assert found.smear.low > 0.2


def test_a_shift_is_found_beside_a_wrong_amount():
    found = errors_of(pool(played(circuit(), lambda rewards: 1.5 * late(rewards))))
    assert found.shift == 2
    assert found.amount.low < 1.5 < found.amount.high


def test_groups_are_calibrated_and_trusted_in_steps():
    found = calibrate(played(circuit(TimeAxis(0.95, 5, 4)))).trust
    assert found.last_step == 19


def test_blame_refuses_what_has_no_neighbours():
    assert errors_of(pool(played(circuit(TimeAxis(0.95, 1))))) is None


# ---- the residual --------------------------------------------------------------------------------


def test_what_the_residual_hides_by_hand():
    axis = TimeAxis(0.5, 1)
    components = np.array([[[1.0, 1.0], [0.0, -1.0]], [[0.0, 3.0], [2.0, 0.0]]])  # [T, A, N+1]
    decomposition = RewardDecomposition(components, axis)
    found = residual_of([episode([1.0, 0.0], axis, decomposition=decomposition)])
    assert found.value.value == pytest.approx(4.0 / 5.0)  # of 1, 1 and 0, 3
    assert found.gap.value == pytest.approx(5.0 / 8.0)  # of 1, 2 and −2, 3


def test_the_horizon_that_suffices_is_read_off_the_rewards():
    table = exact(Gridworld(load_map("patience").with_slip(0.2)).mdp, TimeAxis(0.95, 2))
    found = residual_of(played(table, num=400, time_limit=None))
    tails = exact_tails(table, occupancy(table), 60)
    assert found.observed_tails[:15] == pytest.approx(tails[:15], abs=0.03)
    least = int(np.flatnonzero(tails <= 0.05)[0])
    assert found.sufficient in (least - 1, least, least + 1)
