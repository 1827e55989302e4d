"""Whose future, in which reward, and what ends it: the words and the counting are one."""

import numpy as np
import pytest

from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.rollouts import collect
from trdlab.tabular import MDP, ModelEnvironments


class Ten:
    """Expects 1 of an environment that pays 10: the sign of the reward, as its future says."""

    time_axis = TimeAxis(0.9, 1)

    def __init__(self, **counts: bool) -> None:
        self.future = Future("the greedy policy", **counts)

    def decompose(self, observations: np.ndarray) -> RewardDecomposition:
        return RewardDecomposition(np.tile([1.0, 0.0], (len(observations), 1, 1)), self.time_axis)


def pays(**counts: bool) -> list[float]:
    mdp = MDP.from_transitions([[[(1.0, 0, 10.0, False)]]])
    environments = ModelEnvironments(mdp, 1, seed=0, time_limit=3)
    (episode,) = collect(Ten(**counts), environments)
    assert episode.ends.tolist() == [False, False, counts.get("time_limit_ends", False)]
    assert episode.time_limit == (None if counts.get("time_limit_ends") else 3)
    return episode.rewards.tolist()


def test_what_a_future_says_is_what_it_is_judged_by():
    assert Future("p").to_dict() == {
        "policy": "p",
        "reward": "reward as the environment pays it",
        "ending": "the end of the episode",
    }
    assert pays() == [10.0] * 3
    assert Future("p", clip_rewards=True).reward == "sign of each reward"
    assert pays(clip_rewards=True) == [1.0] * 3
    assert Future("p", time_limit_ends=True).ending == "the end of the episode, or the time limit"
    assert pays(time_limit_ends=True) == [10.0] * 3


def test_futures_are_read_back_from_their_words():
    lives = Future("p", clip_rewards=True, life_loss_ends=True)
    assert Future.from_dict(lives.to_dict()) == lives
    with pytest.raises(InputError, match="No future counts the 'euros'"):
        Future.from_dict({"policy": "p", "reward": "euros", "ending": "the end of the episode"})


def test_words_in_place_of_what_they_say_are_refused():
    with pytest.raises(InputError, match="clip_rewards of a Future is 'sign of each reward'"):
        Future("p", "sign of each reward")  # type: ignore[arg-type]
