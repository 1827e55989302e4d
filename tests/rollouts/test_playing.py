"""Playing: a lone episode is the same wherever it is played, and is cut off where it should be."""

from dataclasses import replace

import numpy as np
import pytest

from trdlab.agents import Agent, gridworld_agent
from trdlab.decomposition import TimeAxis
from trdlab.environments import Environments
from trdlab.errors import InputError
from trdlab.explanations import assess
from trdlab.policies import Memoryless
from trdlab.rollouts import collect
from trdlab.rollouts.playing import Progress, usual_limit
from trdlab.rollouts.realised import what_followed
from trdlab.tabular.episodes import ModelEnvironments

AXIS = TimeAxis(0.9, 2, 2)


def undecided() -> Agent:
    """Returns an agent that takes each action as likely as any other."""
    agent = gridworld_agent("ledge,slip=0.3", AXIS)
    return replace(agent, policy=Memoryless(lambda states: np.full((len(states), 4), 0.25)))


def test_a_limit_of_ours_is_like_one_of_the_environment():
    agent = undecided()
    assert agent.world is not None
    mdp = agent.world.mdp
    own, ours = (ModelEnvironments(mdp, 60, seed=3, time_limit=limit) for limit in (6, 50))
    how = {"policy": agent.policy, "seed": 4}
    expected = collect(agent.estimator, own, **how)
    found = collect(agent.estimator, ours, max_steps=6, **how)
    assert any(not episode.terminated for episode in found)
    for one, other in zip(found, expected, strict=True):
        assert (one.time_limit, one.terminated, len(one)) == (6, other.terminated, len(other))
        np.testing.assert_array_equal(one.actions, other.actions)
        np.testing.assert_array_equal(one.expected, other.expected)
        for known, true in zip(what_followed(one), what_followed(other), strict=True):
            np.testing.assert_array_equal(known, true)
        assert not what_followed(one)[1][3:, 1].any()  # t+2 … t+3 of step 3 reaches beyond step 5


def test_an_episode_of_no_step_is_refused():
    with pytest.raises(InputError, match="Episodes have 0 steps"):
        undecided().play(1, seed=0, max_steps=0)


def test_episodes_last_four_horizons_at_least():
    assert usual_limit(TimeAxis(0.9, 4)) == 1_000
    assert usual_limit(TimeAxis(0.9, 200, 2)) == 1_600


def test_it_is_told_how_far_episodes_are():
    heard: list[Progress] = []
    agent = gridworld_agent("ledge,slip=0.3", AXIS)
    assess(agent, episodes=12, effort=agent.effort, watch=heard.append)
    assert list(dict.fromkeys(progress.what for progress in heard)) == [
        "episodes to judge by",
        "episodes with copies",
        "episodes with copies of first actions",
    ]
    first = [progress for progress in heard if progress.what == "episodes to judge by"]
    assert {progress.episodes for progress in first} == {12}
    done = [progress.finished for progress in first]
    assert done == sorted(done)
    assert done[-1] == 12


@pytest.mark.parametrize(
    ("name", "epsilon", "played", "judged_by"),
    [
        ("drone", 0.0, [60], 1),  # all alike: no more of them, and that one once
        ("drone", None, [60, 300], 300),  # then with some random actions
        ("ledge", None, [60, 240], 300),
        ("drone", 0.1, [300], 300),
    ],
)
def test_episodes_that_are_all_alike_are_not_played_again(name, epsilon, played, judged_by):
    agent, made = gridworld_agent(name, AXIS), []

    def make(num_envs: int, seed: int) -> Environments:
        made.append(num_envs)
        return agent.make(num_envs, seed)

    report = assess(replace(agent, make=make), episodes=300, epsilon=epsilon)
    assert (made, report.judged.episodes) == (played, judged_by)
