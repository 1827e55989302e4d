"""Agents: named, played, and judged by what came."""

import random
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import moments
import trdlab
import trdlab.envs
from by_hand import Given, try_out
from trdlab.agents import Agent, gridworld_agent
from trdlab.decomposition import TimeAxis
from trdlab.environments import Environments, GymEnvironments
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations import assess, check, explain, moment_at
from trdlab.explanations.calibration import claims as calibration
from trdlab.explanations.calibration.faults import faults
from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Memoryless
from trdlab.rollouts import Effort, collect
from trdlab.tabular import MDP, ExactTable, ModelEnvironments, exact

AXIS = TimeAxis(0.95, 4)


def slippery(tmp_path: Path, slip: float) -> str:
    path = tmp_path / f"drone-{slip}.txt"
    path.write_text(f"slip: {slip}\n---\n>...T\nS####\n>cccC\n", encoding="utf-8")
    return str(path)


def test_an_exact_table_is_trusted_over_its_whole_horizon():
    report = assess(gridworld_agent("ledge", AXIS), episodes=300, effort=Effort())
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
    report = assess(gridworld_agent("drone", AXIS), episodes=60, effort=Effort())
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


def test_the_score_counts_every_episode_however_many_are_alike():
    score = assess(gridworld_agent("ledge", AXIS), episodes=12).score
    assert (score.episodes, score.different) == (12, 3)  # eleven pay 1, one costs 1
    assert score.returns.value == pytest.approx(10.0 / 12.0)  # of the three ways it is 1/3


@pytest.mark.parametrize("name", ["ledge", "drone"])
def test_one_episode_does_not_tell_that_all_are_the_same(name):
    score = next(iter(calibration.in_brief(assess(gridworld_agent(name, AXIS), episodes=1))))
    assert score.sentence.endswith(" in one episode.")


def test_copies_that_were_not_followed_do_not_tell_that_there_is_no_chance():
    report = assess(gridworld_agent("ledge", TimeAxis(0.95, 0)), episodes=20, effort=Effort())
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
    agent = replace(agent, estimator=Given(components, AXIS, table.future))
    report = assess(agent, episodes=200)
    assert report.trust.last_step == 1
    assert report.trust.doubtful.tolist() == [False, False, True, True, True]
    moment = moment_at(agent)
    choice = replace(moment, calibration=report.calibration).choice("right", "up")
    off = np.abs(moment.difference("right", "up"))
    (doubt,) = (claim for claim in moments.told(choice) if claim.kind == "untested-difference")
    assert doubt.components == (2, 3, 4)
    assert doubt.share == pytest.approx(off[2:].sum() / off.sum())
    assert doubt.sentence.endswith("is not to be trusted.")
    assert check(doubt.sentence, [(CHOICES, choice)])
    assert "trusted" not in " ".join(told(moment.choice("right", "up")))


def test_a_table_is_exact_only_in_its_own_model():
    own, other = Gridworld(load_map("ledge")), Gridworld(load_map("ledge").with_slip(0.6))
    table = exact(own.mdp, AXIS)
    for place, is_exact in (
        (None, True),
        ("gridworld:ledge", True),
        ("gridworld:ledge,exploring_starts=true", True),
        (own, True),
        (gym.make("trdlab/LedgeGridworld-v0"), True),
        (gym.wrappers.TransformReward(gym.make("trdlab/LedgeGridworld-v0"), lambda r: -r), False),
        ("gridworld:ledge,slip=0.6", False),
        ("trdlab/LedgeGridworld-v0", False),  # it may be anything
        (other, False),
    ):
        for agent in (gridworld_agent("ledge", AXIS, env=place), trdlab.agent(table, env=place)):
            assert moment_at(agent).is_exact == is_exact, place
    moved = trdlab.agent(gridworld_agent("ledge", AXIS), env=other)
    explained = explain(moved, episodes=100)
    claims = [claim.sentence for part in explained.sections for claim in part.claims]
    assert not any("5 %" in sentence for sentence in claims)  # it slips as often in its model
    assert any("is not to be trusted" in sentence for sentence in claims)


def told(choice: Choice) -> list[str]:
    return [claim.sentence for claim in moments.told(choice)]


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
    report = assess(agent, episodes=12, epsilon=0.0, effort=Effort(episodes=2))
    assert (report.ceiling is not None) == (report.foils is not None) == copyable
    assert report.lost == "" if copyable else "Once-v0 cannot be copied: " in report.lost


class Tossed(gym.Env):
    """Pays 0 or 1 at each of twelve steps, by a generator that nobody can copy or seed anew."""

    observation_space, action_space = gym.spaces.Discrete(12), gym.spaces.Discrete(4)

    def reset(self, *, seed=None, options=None):
        rng = np.random.default_rng(seed)
        self.at, self.tosses = 0, (rng.integers(2) for _ in range(12))
        return 0, {}

    def step(self, action):
        self.at += 1
        return min(self.at, 11), float(next(self.tosses)), self.at == 12, False, {}


def test_copies_that_share_their_chance_do_not_tell_that_all_can_be_known():
    axis = TimeAxis(0.95, 2, 2)  # of two steps in one no episode tells that each is a toss
    halves = Given(np.full((12, 4, 3), 0.5), axis, Future("any policy"))
    agent = trdlab.agent(halves, env=Tossed)
    report = assess(agent, episodes=40, effort=Effort())
    assert report.ceiling is not None
    assert report.ceiling.deterministic
    assert report.chance
    said = [claim.sentence for part in calibration.sections(report) for claim in part.claims]
    assert not any("all that comes can be known" in sentence for sentence in said)
    assert any("the replays may share their luck" in sentence for sentence in said)
    trial = try_out(agent, "action 0", "action 1", copies=3)
    assert trial is not None
    tried = trial.found
    assert tried.same_every_time
    assert tried.observed.low[0] < tried.observed.high[0]  # though all six copies went alike


@pytest.mark.parametrize("seed", range(4))
def test_moments_are_found_in_short_episodes_beside_a_few_that_never_end(seed):
    over, stuck = (0.95, 0, 1.0, True), (0.05, 1, 0.0, False)
    mdp = MDP.from_transitions([[[over, stuck]], [[(1.0, 1, 0.0, False)]]])

    def make(num_envs: int, seed: int) -> Environments:
        return ModelEnvironments(mdp, num_envs, seed=seed)

    agent = Agent("short", exact(mdp, AXIS), ("wait",), make)
    report = assess(agent, episodes=60, max_steps=400, effort=Effort(episodes=2), seed=seed)
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
