"""A run is an Estimator: in the wrappers, in explanations, and evaluated."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.wrappers import FrameStackObservation

import trdlab
from moments import told as told_of
from trdlab.cli import main
from trdlab.decomposition import TimeAxis
from trdlab.deep.settings import TrainSettings
from trdlab.environments import Environments, NotParallel
from trdlab.environments.interface import Interface
from trdlab.errors import InputError, NotImported
from trdlab.estimator import Estimator, Future
from trdlab.explanations import check, moment_of
from trdlab.explanations.moment.moment import CHOICES
from trdlab.explanations.moment.telling import sections
from trdlab.gridworld.env import GridworldEnv
from trdlab.runs import RunFolder, load_checkpoint
from trdlab.training.loading import evaluate_run, load
from trdlab.training.run import begin, carry_on
from trdlab.training.setup import make_environments
from trdlab.wrappers import TemporalRewardDecomposition, VectorTemporalRewardDecomposition

DRONE = "trdlab/DroneGridworld-v0"


def train(out: Path, env: str = DRONE, **lines: Any) -> Path:
    few = {
        "agent_steps": 300,
        "gamma": 0.95,
        "N": 4,
        "hidden": [16],
        "learning_starts": 50,
        "checkpoint_every": 200,
        "evaluate_episodes": 5,
        "evaluate_epsilon": 0.1,
    }
    with begin(TrainSettings("gym", env).changed(few | lines), out) as run:
        carry_on(run)
    return out


@pytest.fixture(scope="module")
def drone(tmp_path_factory) -> Path:
    return train(tmp_path_factory.mktemp("runs") / "drone")


def test_a_loaded_run_says_what_its_network_says(drone):
    estimator = trdlab.load(drone)
    assert isinstance(estimator, Estimator)
    assert estimator.time_axis == TimeAxis(0.95, horizon=4)
    kept = load_checkpoint(RunFolder.open(drone)).state["q_network"]
    state = estimator.network.state_dict()
    assert all(np.array_equal(state[name].numpy(), kept[name]) for name in state | kept)
    with torch.no_grad():
        expected = estimator.network(torch.arange(9)).numpy()
    np.testing.assert_array_equal(estimator.decompose(np.arange(9)).components, expected)


def test_an_older_checkpoint_says_something_else(drone):
    newest, same, older = (load(drone, step).decompose([0]).components for step in (None, 300, 200))
    assert np.array_equal(newest, same)
    assert not np.array_equal(newest, older)
    with pytest.raises(InputError, match=r"no checkpoint at step 7\. There are: 200, 300\."):
        load(str(drone), 7)


@pytest.mark.parametrize("pixels", [False, True])
def test_in_the_wrappers(drone, tmp_path, pixels):
    lines = {"env_arg": ["observation=pixels"], "agent_steps": 60, "batch_size": 2}
    estimator = load(train(tmp_path / "run", **lines) if pixels else drone)
    made = {"observation": "pixels"} if pixels else {}
    wrappers = [lambda env: FrameStackObservation(env, 1)] if pixels else []
    envs = gym.make_vec(DRONE, 3, vectorization_mode="sync", wrappers=wrappers, **made)
    env = TemporalRewardDecomposition(envs.envs[0], estimator)
    observation, info = env.reset(seed=0)
    said = info["reward_decomposition"]
    assert said.shape == (4, 5)
    np.testing.assert_array_equal(said, estimator.decompose([observation]).components[0])
    *_, info = env.step(1)
    np.testing.assert_array_equal(info["chosen_decomposition"], said[1])
    _, infos = VectorTemporalRewardDecomposition(envs, estimator).reset(seed=0)
    np.testing.assert_allclose(infos["reward_decomposition"], [said] * 3, atol=1e-6)


@pytest.mark.parametrize(
    ("lines", "future"),
    [
        ({}, Future("the greedy policy of the network")),
        (
            {"w": 2, "clip_rewards": True, "life_loss_ends": True},
            Future(
                "the greedy policy of the network (for the first 2 steps, the ε-greedy one it "
                "learned from)",
                clip_rewards=True,
                life_loss_ends=True,
            ),
        ),
    ],
)
def test_in_explanations(tmp_path, lines, future):
    estimator = load(train(tmp_path / "run", **lines))
    assert estimator.future == future
    env = GridworldEnv("drone")
    for state in (0, 1, 5):
        moment = moment_of(estimator, state, env.action_names)
        assert moment.future == future
        choice = moment.choice()
        assert {section.name for section in sections(choice)} >= {"contrast", "forecast"}
        told = told_of(choice)
        for claim in told:
            assert [of.kind for of in check(claim.sentence, [(CHOICES, choice)])] == [claim.kind]
        assert choice.action == env.action_names[int(moment.q_values.argmax())]
        said = [claim.sentence for claim in told]
        assert f"After the first action, {future.policy} acts." in said
        assert ("Of each reward only the sign counts." in said) == future.clip_rewards
        assert f"All steps count, up to {future.ending}." in said


# ---- evaluated -----------------------------------------------------------------------------------


def test_an_evaluation_is_kept_with_what_it_was_made_with(drone):
    told = []
    result, path = evaluate_run(drone, watch=told.append)
    assert path.parent == drone / "evaluations"
    kept = json.loads(path.read_text())
    assert kept == {"agent_steps": 300, **result.to_dict()}
    assert (kept["episodes"], kept["epsilon"], kept["seed"]) == (5, 0.1, 1000)
    assert (told[-1].finished, told[-1].episodes) == (5, 5)
    again, same_path = evaluate_run(drone)
    assert (same_path, again.to_dict()) == (path, result.to_dict())
    _, other = evaluate_run(drone, episodes=3, epsilon=1.0, seed=4, step=200)
    assert other != path
    kept = json.loads(other.read_text())
    assert [kept[key] for key in ("agent_steps", "episodes", "epsilon", "seed")] == [200, 3, 1, 4]


def test_where_there_can_be_one_environment_episodes_come_one_after_another(drone, monkeypatch):
    def alone(settings: TrainSettings, *, num_envs: int, seed: int) -> Environments:
        if num_envs > 1:
            raise NotParallel("There is one already.", "Close it.")
        made.append(seed)
        return make_environments(settings, num_envs=num_envs, seed=seed)

    made, told = [], []
    monkeypatch.setattr("trdlab.training.loading.make_environments", alone)
    result, path = evaluate_run(drone, watch=told.append)
    assert len(set(made)) == len(result.returns) == 5
    assert (told[-1].finished, told[-1].episodes) == (5, 5)
    assert json.loads(path.read_text())["returns"] == result.returns.tolist()


@pytest.mark.parametrize("harm", ["a file", "a link", "nothing"])
def test_an_evaluation_that_cannot_be_kept_is_told_all_the_same(drone, tmp_path, capsys, harm):
    run, elsewhere = Path(shutil.copytree(drone, tmp_path / "run")), tmp_path / "elsewhere"
    shutil.rmtree(run / "evaluations")
    elsewhere.mkdir()
    if harm == "a file":
        (run / "evaluations").touch()
    elif harm == "a link":
        (run / "evaluations").symlink_to(elsewhere)
    with pytest.raises(SystemExit) as end:
        main(["evaluate", str(run)])
    out, err = capsys.readouterr()
    assert end.value.code == 0
    assert "mean return" in out
    assert err.startswith("Kept: " if harm == "nothing" else "Not kept: ")
    assert "Not a directory." in err or "is a link" in err or harm == "nothing"
    assert not list(elsewhere.iterdir())


def test_without_a_checkpoint_there_is_nothing_to_evaluate(tmp_path):
    with begin(TrainSettings("gym", "CartPole-v1"), tmp_path / "run"):
        pass
    for refused in (load, evaluate_run):
        with pytest.raises(InputError, match=r"has no checkpoint yet\. Train on: trdlab resume"):
            refused(tmp_path / "run")
    assert list((tmp_path / "run" / "evaluations").iterdir()) == []


def test_a_run_can_be_moved_and_needs_no_environment(drone, tmp_path):
    moved = Path(shutil.copytree(drone, tmp_path / "elsewhere"))
    for name in ("config.toml", "manifest.json"):  # as on a machine that does not have it
        (moved / name).write_text((moved / name).read_text().replace(DRONE, "gone:Gone-v0"))
    np.testing.assert_array_equal(
        load(moved).decompose([0]).components, load(drone).decompose([0]).components
    )
    with pytest.raises(NotImported, match=r"module 'gone'\. If you trust it, import gone first\."):
        evaluate_run(moved)


@pytest.mark.parametrize(
    ("described", "space"),
    [
        ({"states": 9, "first_state": 2}, gym.spaces.Discrete(9, start=2)),
        (
            {"shape": [4, 84, 84], "dtype": "uint8"},
            gym.spaces.Box(0, 255, (4, 84, 84), np.uint8),
        ),
        (
            {"shape": [3], "dtype": "float32"},
            gym.spaces.Box(-np.inf, np.inf, (3,), np.float32),
        ),
    ],
)
def test_what_an_agent_sees_is_read_from_the_manifest(described, space):
    assert Interface.from_dict({"observation": described, "num_actions": 2}).space == space


def test_importing_trdlab_does_not_import_what_loading_needs():
    source = """
import sys, trdlab
assert "load" in trdlab.__all__
heavy = {"torch", "gymnasium", "numpy"}
assert not heavy & sys.modules.keys()
trdlab.load
assert "torch" not in sys.modules
"""
    assert subprocess.run([sys.executable, "-c", source], check=False).returncode == 0
