"""Evaluations: whole episodes, raw returns, the same whoever finishes first."""

import json
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import GymEnvironments, Step
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.rollouts.evaluation import Evaluation, evaluate, joined
from trdlab.rollouts.playing import Progress

END, CUT = "the game is over", "cut off"


class Scripted:
    """Environments that pay what is written when action 1 is taken, and nothing otherwise.

    A frame shows the number of the step. What comes after an episode is another one like it.
    """

    num_actions, first_action, action_names = 2, 0, ("wait", "take")
    frame_skip, frames_per_second, time_limit = 1, None, None
    padding = "reset"

    def __init__(self, *stories: Sequence[float], cut: int = 99, stack: int | None = None) -> None:
        self.stories, self.num_envs, self.cut, self.stack = stories, len(stories), cut, stack
        self.observation_space = gym.spaces.Box(0, 1e6, (1,), np.float32)

    def reset(self) -> np.ndarray:
        self.steps, self.taken = np.zeros(self.num_envs, dtype=np.int64), 0
        return self.steps[:, None].astype(np.float32)

    def step(self, actions: np.ndarray, active: np.ndarray) -> Step:
        pays = np.array([story[at] for story, at in zip(self.stories, self.steps, strict=True)])
        self.steps += active
        self.taken += int(active.sum())
        frames = self.steps[:, None].astype(np.float32)
        over = self.steps == [len(story) for story in self.stories]
        cut = (self.steps == self.cut) & ~over
        self.steps[over | cut] = 0
        following = self.steps[:, None].astype(np.float32)
        nobody = np.zeros(self.num_envs, dtype=np.bool_)
        return Step(frames, pays * actions, over, cut, nobody, following)


class Taking:
    """Prefers to take, in all but some steps; notes what it is shown."""

    time_axis, future = TimeAxis(0.9, 1), Future("the greedy policy of the test")

    def __init__(self, *waits_in: int) -> None:
        self.waits_in, self.shown = waits_in, []

    def decompose(self, observations: Any) -> RewardDecomposition:
        self.shown.append(np.array(observations))
        newest = observations[..., -1] if observations.ndim == 2 else observations[:, -1, 0]
        components = np.zeros((len(observations), 2, 2))
        components[:, 1, 0] = np.where(np.isin(newest, self.waits_in), -1.0, 1.0)
        components[:, 0, 1] = 0.5
        return RewardDecomposition(components, self.time_axis)


def test_returns_lengths_and_ends_by_hand():
    told: list[Progress] = []
    environments = Scripted([1, 2, -4], [10], [1, 1, 1, 1, 1, 1], [0.5, 0.25], cut=5)
    result = evaluate(Taking(), environments, watch=told.append)
    assert result.returns.tolist() == [-1, 10, 5, 0.75]
    assert result.lengths.tolist() == [3, 1, 5, 2]
    assert result.truncated.tolist() == [False, False, True, False]
    assert [(now.steps, now.finished, now.episodes) for now in told] == [
        (1, 1, 4), (2, 2, 4), (3, 3, 4), (4, 3, 4), (5, 4, 4)
    ]  # fmt: skip
    assert environments.taken == result.lengths.sum() == 11  # nobody acts on who has finished
    waiting = evaluate(Taking(0, 2), environments)
    assert waiting.returns.tolist() == [2, 0, 3, 0.25]


def test_what_comes_after_an_episode_does_not_count():
    alone = evaluate(Taking(1), Scripted([3, 1, 4]))
    beside = evaluate(Taking(1), Scripted([1], [3, 1, 4], [1] * 50))
    assert (beside.returns[1], beside.lengths[1]) == (alone.returns[0], alone.lengths[0]) == (7, 3)


def test_those_that_have_finished_are_not_asked_about():
    estimator = Taking()
    evaluate(estimator, Scripted([1], [1, 1, 1], [1, 1]))
    assert [len(shown) for shown in estimator.shown] == [3, 2, 1]


def test_an_agent_sees_stacks_as_in_training():
    estimator = Taking()
    evaluate(estimator, Scripted([1, 1, 1], stack=2))
    assert [shown[0, :, 0].tolist() for shown in estimator.shown] == [[0, 0], [0, 1], [1, 2]]


@pytest.mark.parametrize("epsilon", [0.5, 1.0])
def test_epsilon_is_the_share_of_random_actions(epsilon):
    environments = Scripted(*[[1] * 50] * 200)
    result = evaluate(Taking(), environments, epsilon=epsilon, seed=3)
    assert result.returns.mean() / 50 == pytest.approx(1 - epsilon / 2, abs=0.02)
    same = evaluate(Taking(), environments, epsilon=epsilon, seed=3)
    other = evaluate(Taking(), environments, epsilon=epsilon, seed=4)
    assert result.returns.tolist() == same.returns.tolist() != other.returns.tolist()


def test_random_actions_do_not_depend_on_who_finishes_first():
    long = [1.0] * 30
    few = evaluate(Taking(), Scripted(long, [1.0]), epsilon=0.5, seed=1)
    many = evaluate(Taking(), Scripted(long, long), epsilon=0.5, seed=1)
    assert few.returns[0] == many.returns[0]


def test_episodes_are_cut_off_where_one_asks_for_it():
    result = evaluate(Taking(), Scripted([1, 2, -4], [10], [1] * 6), max_steps=3)
    assert result.returns.tolist() == [-1, 10, 3]
    assert result.lengths.tolist() == [3, 1, 3]
    assert result.truncated.tolist() == [False, False, True]
    assert result.to_dict()["max_steps"] == 3
    with pytest.raises(InputError, match=r"Episodes have 0 steps\. Ask for at least 1\."):
        evaluate(Taking(), Scripted([5]), max_steps=0)


def test_episodes_one_after_another_are_those_of_one_evaluation():
    stories = [[1.0] * 30, [2.0], [3.0] * 5]
    parts = [evaluate(Taking(), Scripted(story), epsilon=0.5, seed=1) for story in stories]
    result = joined(parts)
    assert result.lengths.tolist() == [30, 1, 5]
    assert result.returns.tolist() == [part.returns[0] for part in parts]
    assert (result.epsilon, result.seed) == (0.5, 1)


def test_what_neither_acts_nor_decomposes_is_refused():
    with pytest.raises(InputError, match="This str neither acts nor decomposes"):
        evaluate("greedy", Scripted([1]))  # type: ignore[arg-type]


def test_a_gymnasium_environment_as_its_own_loop_would_play_it():
    class Leaning:
        """Pushes towards the side that the pole leans to."""

        time_axis, future = TimeAxis(0.9, 0), Future("the greedy policy of the test")

        def decompose(self, observations: Any) -> RewardDecomposition:
            leans = np.asarray(observations)[:, 2] + np.asarray(observations)[:, 3]
            return RewardDecomposition(np.stack([-leans, leans], 1)[..., None], self.time_axis)

    environments = GymEnvironments("CartPole-v1", 3, seed=5)
    firsts = environments.reset()
    result = evaluate(Leaning(), GymEnvironments("CartPole-v1", 3, seed=5))
    for env, first in enumerate(firsts):
        pole = gym.make("CartPole-v1").unwrapped
        pole.reset(seed=0)
        pole.state = observation = first.astype(np.float64)
        steps, over = 0, False
        while not over and steps < 500:
            observation, _, over, _, _ = pole.step(int(observation[2] + observation[3] > 0))
            steps += 1
        assert result.lengths[env] == pytest.approx(steps, abs=1)  # it began as float32
        assert result.returns[env] == result.lengths[env]


def test_means_have_intervals_and_all_of_it_is_json():
    returns = np.array([0.0, 1, 2, 3, 4, 5, 6, 7, 8, 100])
    result = Evaluation(returns, np.arange(1, 11), returns == 100, epsilon=0.1, seed=2)
    assert result.mean.value == 13.6
    assert result.interquartile_mean.value == pytest.approx(4.5, abs=0.01)
    for of in (result.mean, result.interquartile_mean):
        assert 0 <= of.low < of.value < of.high <= 100
    told = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert told["schema"] == "trdlab.evaluation/1"
    assert told["mean"] == {"value": 13.6, "low": result.mean.low, "high": result.mean.high,
                            "level": 0.95}  # fmt: skip
    assert (told["episodes"], told["epsilon"], told["seed"]) == (10, 0.1, 2)
    assert told["returns"] == returns.tolist()
    assert told["lengths"] == list(range(1, 11))
    assert told["truncated"] == [False] * 9 + [True]


def test_a_single_episode_has_no_spread():
    result = Evaluation(np.array([7.0]), np.array([3]), np.array([False]), 0.0, 0)
    assert (result.mean.low, result.mean.value, result.mean.high) == (7, 7, 7)
