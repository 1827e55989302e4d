"""The package as a user meets it: one call each, with sensible defaults."""

import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch

import trdlab
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import GymEnvironments
from trdlab.errors import InputError
from trdlab.estimator import Estimator, Future
from trdlab.gridworld import Gridworld, load_map
from trdlab.gridworld.env import GridworldEnv
from trdlab.tabular import MDP, ExactTable, ModelEnvironments, exact
from trdlab.training.loading import evaluate_run

DOWN = [0.0, 0.95, 0.95**2, 0.95**3, 0.95**4]


class Falling:
    """Expects of CartPole what it was told: one reward a step, whichever way it pushes."""

    time_axis, future = TimeAxis(0.9, 2), Future("the greedy policy")
    paid = (1.0, 0.9, 7.1)

    def decompose(self, observations: np.ndarray) -> RewardDecomposition:
        return RewardDecomposition(
            np.tile([1.0, 0.9, 7.1], (len(observations), 2, 1)), self.time_axis
        )


@pytest.mark.parametrize(
    "what",
    [
        "drone",
        "gridworld:drone",
        Gridworld(load_map("drone")),
        Gridworld(load_map("drone")).mdp,
        GridworldEnv("drone"),
        gym.make("trdlab.envs:trdlab/DroneGridworld-v0"),
        "trdlab/DroneGridworld-v0",
    ],
)
def test_whatever_carries_a_model_is_solved(what):
    solved = trdlab.solve(what)
    assert isinstance(solved.estimator, ExactTable)
    np.testing.assert_allclose(solved.estimator.decomposition.components[0, 1], DOWN)
    (episode,) = solved.play(1, seed=0)
    assert episode.terminated
    assert episode.rewards.tolist() == [0.0, 1.0, 1.0, 1.0, 1.0]


def test_what_carries_no_model_is_refused_by_what_is_missing():
    with pytest.raises(InputError, match="CartPole-v1 has no transition table 'P'"):
        trdlab.solve(gym.make("CartPole-v1"))
    with pytest.raises(InputError, match="This int is no model: it has no mdp and no table P"):
        trdlab.solve(3)
    with pytest.raises(InputError, match=r"no environment 'dron'\. Did you mean 'drone'"):
        trdlab.solve("dron")


def test_agents_of_names_models_tables_and_estimators():
    named = trdlab.agent("gridworld:ledge,slip=0.3", horizon=2)
    assert (named.name, named.estimator.time_axis) == ("ledge,slip=0.3", TimeAxis(0.95, 2))
    assert trdlab.agent(named).estimator is named.estimator
    world = Gridworld(load_map("drone"))
    table = exact(world.mdp, TimeAxis(0.9, 3))
    for env in (
        None,
        world,
        "gridworld:drone",
        GridworldEnv("drone"),
        lambda: GridworldEnv("drone"),
    ):
        made = trdlab.agent(table, env=env)
        assert made.estimator is table
        assert len(made.action_names) == 4
    assert trdlab.agent(table, env=world).action_names == ("up", "down", "left", "right")
    away = trdlab.agent(trdlab.solve("FrozenLake-v1"), env="FrozenLake-v1",
                        env_arguments={"is_slippery": False})  # fmt: skip
    assert isinstance(away.make(1, 0), GymEnvironments)


@pytest.mark.parametrize(
    "env", ["CartPole-v1", gym.make("CartPole-v1"), lambda: gym.make("CartPole-v1")]
)
def test_an_estimator_of_ones_own_acts_in_an_id_an_environment_or_a_factory(env):
    agent = trdlab.agent(Falling(), env=env, action_names=["left", "right"], name="falls")
    assert (agent.name, agent.action_names) == ("falls", ("left", "right"))
    assert agent.seconds_per_step == pytest.approx(0.02)
    (episode,) = agent.play(1, seed=0)
    assert 5 < len(episode) < 15
    assert set(episode.actions.tolist()) == {0}
    right = trdlab.agent(
        Falling(), env=env, policy=lambda seen: np.tile([0.0, 1.0], (len(seen), 1))
    )
    assert set(right.play(1, seed=0)[0].actions.tolist()) == {1}


@pytest.mark.parametrize(
    ("what", "given", "message"),
    [
        (3, {}, "This int is no agent: it has no decompose and no time_axis and no future"),
        (gym.make("CartPole-v1"), {}, "This CartPoleEnv is an environment, and no agent"),
        (Falling(), {}, "Nothing says where this Falling acts"),
        (Falling(), {"env": "Acrobot-v1"}, r"Acrobot-v1 into shape \(1, 2, 3\).*\(1, 3, 3\)"),
        (Falling(), {"env": 7}, "This int is no environment: it has no reset and no step"),
        (Falling(), {"env": "CartPole-v1", "gamma": 0.5}, "This Falling has its own γ, N and w"),
        (Falling(), {"env": "CartPole-v1", "action_names": "a"}, "There are 1 names for 2 actions"),
        ("gridworld:drone", {"env": "CartPole-v1"}, "does not fit the agent: it has 4 float32"),
        (trdlab.solve("drone"), {"env": "gridworld:ledge"}, "it has 8 states, and .* 14 states"),
    ],
)
def test_what_is_no_agent_says_what_is_missing(what, given, message):
    with pytest.raises(InputError, match=message):
        trdlab.agent(what, **given)


def test_a_notebooks_first_cell_explains_the_drone():
    explained = trdlab.explain("gridworld:drone", episodes=20)
    assert explained.choice.action == "down"
    assert explained.report.judged.episodes == 20
    one = trdlab.explain(
        "gridworld:drone", step=1, action=3, parts="forecast", episodes=0, horizon=8
    )
    assert (one.choice.action, one.report, one.time_axis.horizon) == ("right", None, 8)


def test_calibration_and_comparison_are_one_call_each():
    report = trdlab.calibrate("gridworld:ledge", episodes=100)
    assert report.judged.episodes == 100
    assert report.ceiling is not None
    comparison = trdlab.compare(
        "gridworld:ledge", "gridworld:ledge,slip=0.3", episodes=3, gamma=0.9
    )
    assert [agent.name for agent in comparison.agents] == ["ledge", "ledge,slip=0.3"]
    assert comparison.time_axis.gamma == 0.9
    world = Gridworld(load_map("ledge"))
    again = trdlab.compare(trdlab.solve("ledge"), world, episodes=3)
    origins = [agent.origin for agent in again.agents]
    assert [origin and origin.name for origin in origins] == ["gridworld:ledge", None]
    assert not again.difference.value.any()


def test_a_report_that_is_there_is_not_made_again():
    report, told = trdlab.calibrate("gridworld:ledge", episodes=20), []
    first = trdlab.explain("gridworld:ledge", report=report, watch=told.append)
    assert first.report is report
    assert first.choice.moment.calibration is report.calibration
    assert not told  # nothing was played to judge by
    agent = trdlab.solve("ledge")
    own = trdlab.calibrate(agent, episodes=20)
    assert trdlab.explain(agent, report=own, parts="calibration").report is own
    assert "agent" not in own.to_dict()
    for other in ("gridworld:ledge,slip=0.3", "gridworld:drone"):
        with pytest.raises(InputError, match=r"report is of another agent\. Make it with trdlab"):
            trdlab.explain(other, report=report)
    stubborn = trdlab.agent(agent, policy=lambda seen: np.eye(4)[np.zeros(len(seen), int)])
    with pytest.raises(InputError, match="is of another agent"):
        trdlab.explain(stubborn, report=own)
    with pytest.raises(InputError, match=r"a report, and 5 episodes\. Leave out one"):
        trdlab.explain(agent, report=own, episodes=5)


def test_what_was_seen_at_a_step_is_told():
    found = trdlab.explain("gridworld:drone", step=2, parts="forecast", episodes=0)
    assert found.observation == found.state
    env = gym.make("CartPole-v1")
    acting = trdlab.agent(Falling(), env="CartPole-v1")
    seen = trdlab.explain(acting, seed=5, step=1, parts="forecast", episodes=0).observation
    assert seen.shape == env.observation_space.shape
    again = trdlab.explain(acting, seed=5, step=1, parts="contrast", episodes=0).observation
    np.testing.assert_array_equal(seen, again)
    assert trdlab.explain(acting, parts="episode", episodes=0).observation is None


def test_actions_are_called_as_people_say():
    agent = trdlab.agent("gridworld:drone", action_names=["hoch", "runter", "links", "rechts"])
    found = trdlab.explain(agent, foil="hoch", episodes=0)
    assert found.choice.action == "runter"
    assert "Runter gives more immediate rewards" in str(found)
    with pytest.raises(InputError, match=r"'a', 'a', 'b', 'c'\. Each has a name of its own"):
        trdlab.agent("gridworld:drone", action_names=["a", "a", "b", "c"])


def test_training_is_one_call(tmp_path):
    threads = torch.get_num_threads()
    agent = trdlab.train(
        "trdlab/DroneGridworld-v0", out=tmp_path / "run", agent_steps=400, horizon=3, hidden=[8],
        learning_starts=100,
    )  # fmt: skip
    torch.set_num_threads(threads)
    assert agent.estimator.time_axis.horizon == 3
    assert isinstance(trdlab.load(tmp_path / "run"), Estimator)
    assert trdlab.agent(tmp_path / "run").name == trdlab.agent(f"{tmp_path}/run@400").name[:3]
    with pytest.raises(InputError, match=r"unknown key 'agent_step'\. Did you mean 'agent_steps'"):
        trdlab.train("CartPole-v1", agent_step=3)
    with pytest.raises(InputError, match=r"has no name\. Give a Gymnasium id"):
        trdlab.train(gym.make("CartPole-v1"))


class OnlyOne(gym.Env):
    """Pays 1 at each of three steps, and cannot be there twice."""

    observation_space, action_space = gym.spaces.Discrete(4), gym.spaces.Discrete(2)
    running = 0

    def __init__(self) -> None:
        if OnlyOne.running:
            raise RuntimeError("the port is in use")
        OnlyOne.running += 1

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = int(self.np_random.integers(2))
        return self.at, {}

    def step(self, action):
        self.at += 1
        return min(self.at, 3), 1.0, self.at >= 3, False, {}

    def close(self):
        OnlyOne.running -= 1


def test_what_can_be_there_only_once_is_played_one_after_another():
    class Sure:
        time_axis, future = TimeAxis(0.5, 3), Future("any policy")

        def decompose(self, states: np.ndarray) -> RewardDecomposition:
            left = 3 - np.asarray(states)[:, None, None]  # [B, 1, 1]
            paid = np.where(np.arange(4) < left, 0.5 ** np.arange(4), 0.0)
            return RewardDecomposition(np.tile(paid, (1, 2, 1)), self.time_axis)

    explained = trdlab.explain(Sure(), env=OnlyOne, episodes=12)
    assert OnlyOne.running == 0
    assert explained.report.judged.episodes == 12
    assert explained.report.judged.terminated == 12
    assert explained.report.calibration.error.value[:3].tolist() == [0.0] * 3
    assert explained.report.ceiling is None
    assert "OnlyOne" in explained.report.lost
    assert explained.trial is None


def test_what_can_be_there_only_once_is_trained_and_then_evaluated(tmp_path, monkeypatch):
    spec = gym.envs.registration.EnvSpec("OnlyOne-v0", OnlyOne)
    monkeypatch.setitem(gym.registry, "OnlyOne-v0", spec)
    small = {"num_envs": 1, "agent_steps": 200, "learning_starts": 100, "horizon": 2, "hidden": [8]}
    threads = torch.get_num_threads()
    trdlab.train("OnlyOne-v0", out=tmp_path / "run", **small)
    result, _ = evaluate_run(tmp_path / "run", episodes=3)
    torch.set_num_threads(threads)
    assert OnlyOne.running == 0
    assert result.returns.tolist() == [2.0 + (length == 3) for length in result.lengths]


def test_no_verb_is_hidden_by_a_module_and_none_imports_torch():
    source = """
import sys, trdlab
import trdlab.agents.agent, trdlab.explanations, trdlab.training, trdlab.verbs
for verb in ("agent", "solve", "train", "load", "calibrate", "explain", "compare"):
    assert callable(getattr(trdlab, verb)), verb
trdlab.explain("gridworld:drone", episodes=12)
assert "torch" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", source], check=True, cwd=Path(__file__).parent)


def test_the_model_of_a_table_alone_is_acted_in():
    coin = MDP.from_transitions([[[(1.0, 0, 1.0, True)], [(1.0, 0, 0.0, False)]]])
    agent = trdlab.agent(coin, gamma=0.5, horizon=1)
    assert agent.action_names == ("action 0", "action 1")
    assert isinstance(agent.make(2, 0), ModelEnvironments)
    assert trdlab.explain(agent, episodes=12).choice.action == "action 0"


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        (
            "agent",
            "<Agent: drone · TimeAxis(gamma=0.95, horizon=4, width=1) · the optimal policy · ",
        ),
        ("estimator", "<ExactTable: <MDP: 14 states, 4 actions> · TimeAxis(gamma=0.95, "),
        ("world", "<Gridworld: drone · 14 states>"),
    ],
)
def test_what_holds_arrays_is_shown_in_one_line(name, shown):
    agent = trdlab.agent("gridworld:drone")
    noun = agent if name == "agent" else getattr(agent, name)
    assert repr(noun).startswith(shown)
    assert len(repr(noun)) < 160
    assert str(agent.world).splitlines() == [">...T", "S####", ">cccC"]


def test_notebooks_show_a_map_with_its_legend_and_a_table_where_it_begins():
    agent = trdlab.agent("gridworld:ledge")
    shown = agent.world._repr_html_()
    assert shown.startswith("<pre>S..C\nHH..\n\nC coin 1 (ends)\n")
    shown = trdlab.agent("gridworld:drone").estimator._repr_html_()
    assert shown.startswith("<p>&lt;ExactTable: &lt;MDP: 14 states, 4 actions&gt; · ")
    assert "(state 0)" in shown
    down = ("0", "0.95", "0.90", "0.86", "0.81", "3.52")
    assert "<tr>" + "".join(f"<td>{cell}</td>" for cell in down) + "</tr>" in shown
