"""What a run is made of: settings in their order of precedence, its name, and what it will take."""

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from trdlab.deep.presets import PRESETS
from trdlab.deep.replay import ReplayBuffer
from trdlab.deep.settings import TrainSettings
from trdlab.environments.interface import Interface
from trdlab.errors import InputError
from trdlab.runs import to_toml
from trdlab.training.machine import resolved
from trdlab.training.setup import (
    default_path,
    describe,
    make_environments,
    origin_line,
    plan,
    read_settings,
)

CART = TrainSettings("gym", "CartPole-v1")


def written(path: Path, *lines: str) -> Path:
    path.write_text("\n".join(lines))
    return path


def test_later_settings_win(tmp_path):
    file = written(tmp_path / "run.toml", "N = 3", "w = 2", "log_every = 7")
    settings = read_settings("gym", "CartPole-v1", "smoke", file, {"w": 4, "hidden": [9]})
    assert settings.agent_steps == PRESETS["gym"]["smoke"][1]["agent_steps"]
    assert settings.log_every == 7  # of the file, before the preset
    assert settings.horizon == 3
    assert settings.width == 4  # of the command, before the file
    assert settings.hidden == (9,)
    assert settings.gamma == 0.99  # the default


def test_the_file_of_a_run_begins_the_same_again_whatever_the_presets_say(tmp_path):
    settings = TrainSettings("gym", "CartPole-v1", seed=3, double=True)
    assert settings.learning_rate_end is None  # and so it stands in no file
    file = written(tmp_path / "config.toml", to_toml(settings.to_config()))
    for name in PRESETS["gym"]:
        assert read_settings("gym", "CartPole-v1", name, file, {}) == settings
    for kind, env, other in (("gym", "Acrobot-v1", "env"), ("atari", "CartPole-v1", "kind")):
        with pytest.raises(InputError, match=rf"config\.toml' is for another {other}\. Here it is"):
            read_settings(kind, env, None, file, {})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["epsilon = 0.1"], r"run\.toml' has an unknown key 'epsilon'\. Did you mean 'epsilon_"),
        (["N = 2.5"], r"run\.toml' has N = 2\.5\. It must be a whole number\."),
        (["N = "], r"run\.toml' is not valid TOML"),
        (["N = -1"], r"-1"),
    ],
)
def test_a_file_that_cannot_be_used_is_named(tmp_path, lines, message):
    with pytest.raises(InputError, match=message):
        read_settings("gym", "CartPole-v1", None, written(tmp_path / "run.toml", *lines), {})
    with pytest.raises(InputError, match=r"none\.toml' cannot be read: No such file"):
        read_settings("gym", "CartPole-v1", None, tmp_path / "none.toml", {})


def test_where_settings_are_from_is_said(tmp_path):
    complete = written(tmp_path / "run.toml", to_toml(CART.to_config()))
    few = written(tmp_path / "few.toml", "N = 3")
    assert origin_line("gym", "CartPole-v1", None, complete) == f"Settings: those of '{complete}'."
    for config in (None, few):
        line = "Settings: the preset classic, made for CartPole-v1."
        assert origin_line("gym", "CartPole-v1", None, config) == line


def test_a_run_has_a_name_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert default_path(CART) == Path("runs/CartPole-v1-N10-w1-seed1")
    (tmp_path / "runs" / "CartPole-v1-N10-w1-seed1").mkdir(parents=True)
    assert default_path(CART) == Path("runs/CartPole-v1-N10-w1-seed1-2")
    drone = TrainSettings("gym", "some.module:trdlab/Drone Gridworld-v0", horizon=4, width=2)
    assert default_path(drone) == Path("runs/Drone-Gridworld-v0-N4-w2-seed1")


@pytest.mark.parametrize(
    ("env", "arguments", "threads"),
    [
        ("CartPole-v1", (), 1),
        ("FrozenLake-v1", (), 1),
        ("trdlab/DroneGridworld-v0", ("observation=pixels",), 6),
    ],
)
def test_auto_is_resolved_and_what_is_seen_comes_back(env, arguments, threads, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "6")
    settings = TrainSettings("gym", env, arguments)
    environments = make_environments(settings, num_envs=3, seed=5)
    assert environments.num_envs == 3
    resolved_ = resolved(settings, environments)
    assert resolved_.threads == threads
    assert resolved_.device in ("cpu", "cuda", "mps")
    kept = resolved(settings.changed({"threads": 3, "device": "cpu"}), environments)
    assert (kept.threads, kept.device) == (3, "cpu")
    described: Any = describe(environments)
    space = Interface.from_dict(described).space
    if isinstance(space, gym.spaces.Box):
        bare = gym.make(env, **({"observation": "pixels"} if arguments else {})).observation_space
        stack = (1,) if arguments else ()
        assert (space.shape, space.dtype) == ((*stack, *bare.shape), bare.dtype)
    else:
        assert space == environments.observation_space
    assert described["num_actions"] == environments.num_actions
    environments.close()


def test_a_plan_is_about_right_and_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("trdlab.training.setup._MEASURED_SECONDS", 0.2)
    settings = CART.changed({"capacity": 3000, "agent_steps": 5000})
    planned = plan(settings)
    assert planned.settings.agent_steps == 5000
    assert planned.settings.device != "auto"
    assert planned.steps_per_second > 0
    assert planned.seconds > 4000 / planned.steps_per_second  # of which it learns
    assert list(tmp_path.iterdir()) == []
    memory = ReplayBuffer(3000, (4,), np.float32, width=1, gamma=0.9)
    zeros = np.zeros((1, 4), np.float32)
    for _ in range(5000):
        memory.add(zeros, [0], [0.0], [False], [False], zeros)
    assert planned.memory == pytest.approx(memory.nbytes, rel=0.1)
