"""Agents: named, played, and judged by what came."""

import random
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from trdlab.agents import Agent, gridworld_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import Environments, GymEnvironments
from trdlab.errors import InputError
from trdlab.explanations import assess, check, explain, moment_at, sentences
from trdlab.explanations.calibration.faults import faults
from trdlab.policies import Memoryless
from trdlab.rollouts import Copying, collect
from trdlab.tabular import MDP, ExactTable, ModelEnvironments, exact

AXIS = TimeAxis(0.95, 4)


def slippery(tmp_path: Path, slip: float) -> str:
    path = tmp_path / f"drone-{slip}.txt"
    path.write_text(f"slip: {slip}\n---\n>...T\nS####\n>cccC\n", encoding="utf-8")
    return str(path)


def test_an_exact_table_is_trusted_over_its_whole_horizon():
    report = assess(gridworld_agent("ledge", AXIS), episodes=300, copying=Copying())
    assert report.trust.is_whole
    assert report.judged.epsilon == 0.0
    assert report.errors is not None
    assert report.errors.shift == 0
    assert faults(report) == []
    assert report.ceiling is not None
    skill, limit = report.calibration.skill, report.ceiling.skill
    assert (skill.low <= limit.high)[:-1].all()
    assert (limit.low <= skill.high)[:-1].all()


def test_where_all_episodes_are_the_same_some_actions_are_random():
    report = assess(gridworld_agent("drone", AXIS), episodes=60, copying=Copying())
    assert (report.judged.epsilon, report.score.epsilon) == (1.0 / 6.0, 0.0)
    assert (report.score.different, report.score.returns.value) == (1, 4.0)
    assert report.trust.is_whole
    assert report.calibration.error.value[:-1].max() == pytest.approx(0.0, abs=1e-20)
    assert report.ceiling is not None
    assert report.ceiling.deterministic
    told = assess(gridworld_agent("drone", AXIS), episodes=60, epsilon=0.0)
    assert told.judged.epsilon == 0.0
    assert told.trust.last_step is None
    assert set(told.calibration.status) == {"open"}


def test_copies_that_were_not_followed_do_not_tell_that_there_is_no_chance():
    report = assess(gridworld_agent("ledge", TimeAxis(0.95, 0)), episodes=20, copying=Copying())
    assert report.ceiling is not None
    assert not report.ceiling.deterministic


def test_another_environment_shows_what_a_model_leaves_out(tmp_path):
    own, other = (slippery(tmp_path, slip) for slip in (0.0, 0.3))
    at_home = assess(gridworld_agent(own, AXIS), episodes=100)
    abroad = assess(gridworld_agent(own, AXIS, env=other), episodes=100)
    assert at_home.trust.is_whole
    assert not abroad.trust.is_whole


def test_what_is_wrong_from_some_step_on_is_marked_in_every_explanation():
    agent = gridworld_agent("ledge", TimeAxis(0.95, 4))
    table = agent.estimator
    assert isinstance(table, ExactTable)
    components = table.decomposition.components.copy()
    components[..., 2:] += np.random.default_rng(0).normal(size=components[..., 2:].shape)
    wrong = replace(table, decomposition=RewardDecomposition(components, AXIS))
    agent = replace(agent, estimator=wrong)
    trust = assess(agent, episodes=200).trust
    assert trust.last_step == 1
    assert trust.doubtful.tolist() == [False, False, True, True, True]
    explanation = explain(replace(moment_at(agent), trust=trust))
    said = "From t+2 on such forecasts have not proved better than a guess."
    assert said in sentences(explanation)
    check(said, explanation)
    assert "guess" not in " ".join(sentences(explain(moment_at(agent))))


class Once(gym.Env):
    """An environment of one step that pays 1; it can have neither copies nor a second time."""

    observation_space = gym.spaces.Discrete(12)
    action_space = gym.spaces.Discrete(4)

    def __init__(self, copyable: bool = True) -> None:
        self.copyable = copyable

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return 0 if self.copyable else random.SystemRandom().randrange(12), {}

    def step(self, action):
        return 0, 1.0, True, False, {}

    def __deepcopy__(self, memo):
        if not self.copyable:
            raise TypeError("no")
        return Once()


@pytest.mark.parametrize("copyable", [True, False])
def test_there_is_a_ceiling_only_where_states_can_be_copied(copyable, monkeypatch):
    monkeypatch.setitem(gym.registry, "Once-v0", gym.envs.registration.EnvSpec("Once-v0", Once))
    drone = gridworld_agent("drone", AXIS)

    def make(num_envs: int, seed: int) -> Environments:
        made = {"copyable": copyable}
        return GymEnvironments("Once-v0", num_envs, seed=seed, env_arguments=made)

    agent = Agent("once", drone.estimator, ("wait", "take", "a", "b"), make)
    report = assess(agent, episodes=12, epsilon=0.0, copying=Copying(episodes=2))
    assert (report.ceiling is not None) == (report.foils is not None) == copyable
    assert report.lost == "" if copyable else "Once-v0 cannot be copied: " in report.lost


@pytest.mark.parametrize("seed", range(4))
def test_moments_are_found_in_short_episodes_beside_a_few_that_never_end(seed):
    over, stuck = (0.95, 0, 1.0, True), (0.05, 1, 0.0, False)
    mdp = MDP.from_transitions([[[over, stuck]], [[(1.0, 1, 0.0, False)]]])

    def make(num_envs: int, seed: int) -> Environments:
        return ModelEnvironments(mdp, num_envs, seed=seed)

    agent = Agent("short", exact(mdp, AXIS), ("wait",), make)
    report = assess(agent, episodes=60, max_steps=400, copying=Copying(episodes=2), seed=seed)
    assert report.ceiling is not None
    assert report.ceiling.num_moments >= 2
    assert report.judged.truncated > 0


def test_a_step_is_of_the_episode_that_the_story_tells():
    agent = gridworld_agent("ledge", AXIS)
    uniform = replace(agent, policy=Memoryless(lambda states: np.full((len(states), 4), 0.25)))
    for seed in range(5):
        environments = uniform.make(1, seed)
        (episode,) = collect(agent.estimator, environments, policy=uniform.policy, seed=seed)
        for step in range(len(episode)):
            moment = moment_at(uniform, seed=seed, step=step)
            np.testing.assert_array_equal(
                moment.decomposition.components, episode.decomposition[step].components
            )


def test_an_agent_needs_an_episode_to_be_judged_by():
    with pytest.raises(InputError, match="There are 0 episodes"):
        assess(gridworld_agent("drone", AXIS), episodes=0)
