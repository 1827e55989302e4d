"""Policies that remember: asked once a step, in order, and copied with the states they act in."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.deep.experience import gather
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.policies import EpsilonGreedy, Memoryless, ask
from trdlab.rollouts import Branching, Recording, collect, evaluate
from trdlab.tabular import MDP, ModelEnvironments

AXIS = TimeAxis(0.5, 3)

LONG = 0  # the seed of an episode of four steps

#: Action 0 goes on at no reward, action 1 pays 1 and goes on; one in four episodes ends each step.
WORLD = MDP.from_transitions(
    [
        [
            [(0.75, 0, 0.0, False), (0.25, 0, 0.0, True)],
            [(0.75, 0, 1.0, False), (0.25, 0, 1.0, True)],
        ]
    ]
)


@dataclass
class Third:
    """Takes action 1 at every third step of an episode, which only its memory can tell."""

    asked: list[tuple[list[int], list[bool]]] = field(default_factory=list)

    def act(self, observations: Any, state: Any, begins: np.ndarray) -> tuple[np.ndarray, Any]:
        count = np.zeros(len(observations), int) if state is None else state["steps"][0]
        count = np.where(begins, 0, count)
        self.asked.append((count.tolist(), begins.tolist()))
        return np.eye(2)[(count % 3 == 2).astype(int)], {"steps": (count + 1, None)}


class Nothing:
    """Expects nothing."""

    time_axis, future = AXIS, Future("the third policy")

    def decompose(self, observations: Any) -> RewardDecomposition:
        return RewardDecomposition(np.zeros((len(observations), 2, 4)), AXIS)


def test_a_policy_is_asked_once_a_step_about_every_episode_that_goes_on():
    policy = Third()
    result = evaluate(policy, ModelEnvironments(WORLD, 40, seed=0))
    assert result.returns.tolist() == (result.lengths // 3).tolist()
    assert len(set(result.lengths.tolist())) > 3
    for step, (counts, begins) in enumerate(policy.asked):
        assert counts == [step] * int((result.lengths > step).sum())
        assert begins == [step == 0] * len(counts)


def test_whatever_an_episode_is_played_for_it_is_the_same():
    policy = Third()
    for seed in range(5):
        (episode,) = collect(Nothing(), ModelEnvironments(WORLD, 1, seed=seed), policy=policy)
        alone = evaluate(policy, ModelEnvironments(WORLD, 1, seed=seed))
        assert (alone.lengths[0], alone.returns[0]) == (len(episode), episode.rewards.sum())
        assert episode.actions.tolist() == [int(t % 3 == 2) for t in range(len(episode))]


def test_copies_of_a_moment_remember_what_came_before():
    for step in range(4):
        recording = Recording(Nothing(), ModelEnvironments(WORLD, 1, seed=LONG), policy=Third())
        recording.play_to(step)
        found = Branching(Nothing(), Third(), copies=400).at(recording.playing, 0, seed=step)
        # action 0 now, then action 1 at the next step whose number is 2, 5, … of those not over
        expected = np.array([0.0, 0.75 * 0.5, 0.75**2 * 0.25]) * [
            (step + i) % 3 == 2 for i in range(3)
        ]
        expected[0] = 0.0
        np.testing.assert_allclose(found.observed.mean(axis=0)[:3], expected, atol=0.05)


def test_along_an_episode_copies_remember_too():
    found = Branching(Nothing(), Third(), copies=50).along(
        ModelEnvironments(WORLD, 200, seed=2), every=1
    )
    # where action 1 was taken, it comes again with the fourth step, beyond the explicit ones
    again = found.observed[found.actions == 1][..., 1:3]
    assert not again.any()
    assert found.observed[found.actions == 0][..., 1:3].any()


def test_random_actions_are_those_of_a_mixture():
    policy = EpsilonGreedy(Third(), 0.5)
    probabilities, memory = ask(policy, np.zeros(2, int), {"steps": (np.array([1, 2]), None)},
                                np.array([False, False]))  # fmt: skip
    assert probabilities.tolist() == [[0.75, 0.25], [0.25, 0.75]]
    assert memory["steps"][0].tolist() == [2, 3]
    with pytest.raises(InputError, match=r"ε is 1\.5"):
        EpsilonGreedy(Third(), 1.5)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (np.array([[0.5, 0.5], [np.nan, 1.0]]), r"observation 1 of 2 is no distribution .*nan"),
        (np.array([[0.5, 0.5], [0.7, 0.7]]), r"observation 1 of 2 is no distribution .*0\.7"),
        (np.array([1, 0]), r"answered 2 observations with shape \(2,\)"),
    ],
)
def test_an_answer_that_is_no_distribution_is_named(answer, message):
    with pytest.raises(InputError, match=message):
        evaluate(Memoryless(lambda observations: answer), ModelEnvironments(WORLD, 2, seed=0))


@pytest.mark.parametrize("max_steps", [None, 4])
def test_a_policy_begins_anew_where_the_next_episode_follows(max_steps):
    """Gathering plays on where an episode ends, and forgets what was remembered of it."""
    of = gather(
        lambda count, seed: ModelEnvironments(WORLD, count, seed=seed),
        Third(),
        Future("the third policy"),
        steps=400,
        share=0.0,
        num_envs=8,
        max_steps=max_steps,
    )
    first = np.searchsorted(of.last, of.last[of.steps])
    assert of.actions[of.steps].tolist() == ((of.steps - first) % 3 == 2).astype(int).tolist()
    lengths = np.diff(np.unique(of.last), prepend=-1) - 1
    assert len(lengths) > 50, "far more than 8 episodes"
    assert 400 <= lengths.sum() == len(of.steps)
    assert lengths.max() == 4 if max_steps else lengths.max() > 8
    ended = of.ends[np.unique(of.last) - 1]
    assert ended[lengths != 4].all()
    assert ended.all() == (max_steps is None)
    assert abs((lengths == 1).mean() - 0.25) < 0.1
