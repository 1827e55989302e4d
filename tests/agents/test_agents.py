"""Agents by their names: exact tables of any model, runs and their checkpoints."""

from pathlib import Path

import numpy as np
import pytest

from small_runs import train
from trdlab.agents import find_agent, gridworld_agent, tabular_agent
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.explanations import moment_at
from trdlab.tabular.episodes import ModelEnvironments

AXIS = TimeAxis(0.95, 4)


@pytest.fixture(scope="session")
def trained(tmp_path_factory) -> Path:
    """Returns a run with two checkpoints; not to be changed."""
    return train(
        tmp_path_factory.mktemp("runs") / "lake",
        "FrozenLake-v1",
        agent_steps=600,
        checkpoint_every=200,
        N=4,
        hidden=[8],
        env_arg=["is_slippery=false"],
    )


def test_moments_are_steps_of_the_agents_own_episodes():
    agent = gridworld_agent("drone", AXIS)
    first, second = moment_at(agent), moment_at(agent, step=1)
    assert first.q_value("down") == pytest.approx(0.95 + 0.95**2 + 0.95**3 + 0.95**4)
    assert second.q_value("right") == pytest.approx(1.0 + 0.95 + 0.95**2 + 0.95**3)
    with pytest.raises(InputError, match="no step 5: the episode is over after 5 steps"):
        moment_at(agent, step=5)
    with pytest.raises(InputError, match="The step is -1"):
        moment_at(agent, step=-1)


def test_actions_are_named_or_numbered():
    agent = gridworld_agent("drone", AXIS)
    assert [agent.action(name) for name in ("up", "1", "9")] == ["up", "down", "9"]


def test_a_gridworld_is_made_with_what_stands_behind_its_name():
    plain, slippery = gridworld_agent("drone", AXIS), gridworld_agent("drone,slip=0.2", AXIS)
    assert (plain.name, slippery.name) == ("drone", "drone,slip=0.2")
    assert moment_at(slippery).q_value("down") < moment_at(plain).q_value("down")
    rich = gridworld_agent("gridworld:drone,treasure=100", TimeAxis(0.95, 8))
    assert moment_at(rich).components("up").max() > 60.0
    anywhere = gridworld_agent("drone,exploring_starts=true", AXIS).make(200, 0)
    assert len(set(anywhere.reset().tolist())) > 5


def test_a_table_acts_in_its_environment_with_its_own_starts_and_limit():
    lake = tabular_agent("FrozenLake-v1,is_slippery=false", TimeAxis(0.9, 6))
    moment = moment_at(lake)
    assert lake.action_names == ("left", "down", "right", "up")
    # six steps from the start to the goal: the reward of 1 comes with the sixth action
    np.testing.assert_allclose(moment.components("down"), [0, 0, 0, 0, 0, 0.9**5, 0])
    assert [what_if.name for what_if in moment.what_ifs] == ["γ"]
    assert moment.uncertainty is not None
    environments = lake.make(3, 0)
    assert isinstance(environments, ModelEnvironments)
    assert environments.time_limit == 100
    taxis = tabular_agent("tabular:Taxi-v4", AXIS).make(400, 0)
    assert len(set(taxis.reset().tolist())) > 100
    assert taxis.time_limit == 200
    assert tabular_agent("Taxi-v4,max_episode_steps=7", AXIS).make(1, 0).time_limit == 7


def test_where_a_model_has_no_limit_four_horizons_pass():
    cliff = tabular_agent("CliffWalking-v1", TimeAxis(0.95, 100))
    assert cliff.make(1, 0).time_limit == 400
    assert gridworld_agent("drone", AXIS).make(1, 0).time_limit == 100


def test_an_exact_table_acts_in_another_model_with_the_same_states():
    still = "tabular:FrozenLake-v1,is_slippery=false"
    abroad = find_agent("tabular:FrozenLake-v1", gamma=0.9, horizon=6, env=still)
    assert moment_at(abroad).q_value("down") < 0.9**5
    assert abroad.origin.words == (
        "tabular:FrozenLake-v1",
        "--gamma",
        "0.9",
        "--N",
        "6",
        "--env",
        still,
    )
    home = find_agent("gridworld:ledge,slip=0.3")
    assert home.origin.words == ("gridworld:ledge,slip=0.3",)
    assert home.origin.place == ("--env", "gridworld:ledge,slip=0.3")


def test_a_run_acts_in_its_own_environment_or_in_one_that_is_named(trained):
    agent = find_agent(str(trained))
    assert agent.name == "lake"
    assert agent.origin.words == (str(trained),)
    assert agent.origin.place == ("--env", "FrozenLake-v1", "--env-arg", "is_slippery=false")
    abroad = find_agent(str(trained), env="FrozenLake-v1")
    assert abroad.origin.words == (str(trained), "--env", "FrozenLake-v1")


def test_a_run_acts_in_an_exact_model_and_a_table_in_an_environment(trained):
    model = "tabular:FrozenLake-v1,is_slippery=false"
    run = find_agent(str(trained), env=model)
    assert isinstance(run.make(1, 0), ModelEnvironments)
    assert run.origin.words == (str(trained), "--env", model)
    place = {"env": "FrozenLake-v1", "env_arguments": ["is_slippery=false"]}
    table = find_agent(model, gamma=0.9, horizon=6, **place)
    assert (
        table.origin.words[-4:]
        == table.origin.place
        == ("--env", "FrozenLake-v1", "--env-arg", "is_slippery=false")
    )
    moment = moment_at(table, step=5)  # at the goal's side
    assert moment.components("right")[0] == 1.0
    with pytest.raises(InputError, match="does not fit the agent: it has 14 states"):
        find_agent(str(trained), env="gridworld:drone")


def test_a_checkpoint_is_named_by_its_step(trained):
    old, new, newest = (find_agent(f"{trained}{at}") for at in ("@400", "@600", ""))
    assert old.name == "lake@400"
    first = np.array([0])
    values = [agent.estimator.decompose(first).components for agent in (old, new, newest)]
    assert (values[0] != values[1]).any()
    np.testing.assert_array_equal(values[1], values[2])
    with pytest.raises(InputError, match=r"no checkpoint at step 7\. There are: 400, 600\."):
        find_agent(f"{trained}@7")
    with pytest.raises(InputError, match=r"'last' is no step .* There are: 400, 600, and best\."):
        find_agent(f"{trained}@last")


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("drone", {}, "no run 'drone'. For the map: gridworld:drone"),
        ("drone,slip=0.2", {}, "For the map: gridworld:drone,slip=0.2"),
        ("Taxi-v4", {}, "For the exact table: tabular:Taxi-v4"),
        ("gridworld:dron", {}, "Did you mean 'drone'"),
        ("gridworld:drone,slop=1", {}, "takes no argument 'slop'. Did you mean 'slip'"),
        ("gridworld:drone,slip", {}, "The argument 'slip' is not KEY=VALUE"),
        ("gridworld:drone,slip=2", {}, "The slip probability is 2"),
        ("gridworld:drone,exploring_starts=2", {}, "It must be true or false"),
        ("gridworld:drone", {"env_arguments": ["slip=1"]}, "Write gridworld:drone,slip=1"),
        ("gridworld:drone", {"env": "gridworld:ledge"}, "'gridworld:ledge' does not fit the agent"),
        ("gridworld:drone", {"env": "CartPole-v1"}, "does not fit the agent: it has 4 float32"),
        ("gridworld:drone", {"env": "CartPol-v1"}, "Did you mean 'CartPole-v1'"),
        (
            "gridworld:drone",
            {"env": "gridworld:drone", "env_arguments": ["slip=1"]},
            "drone,slip=1",
        ),
        ("tabular:FrozenLake-v1", {"env": "gridworld:bridge"}, "does not fit the agent"),
        ("tabular:FrozenLak-v1", {}, "Did you mean 'FrozenLake-v1'"),
        ("tabular:FrozenLake-v1,slippery=1", {}, "Did you mean 'is_slippery'"),
        ("tabular:CartPole-v1", {}, "CartPole-v1 has no transition table"),
        ("runs/none", {}, "There is no 'runs/none'"),
        ("runs/none@5", {}, "There is no 'runs/none'"),
        ("runs/none", {"gamma": 0.9}, "is a run with its own"),
        ("x" * 5000, {}, "'xxx.{57}…' names no agent: File name too long"),
    ],
)
def test_agents_that_cannot_be_found(name, given, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        find_agent(name, **given)
