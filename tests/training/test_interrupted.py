"""Runs that are killed, stopped and picked up again end like one that never was, to the bit.

The command in a process of its own, on images, with windows of three steps and a memory that
has wrapped several times; interrupted in the middle of episodes.
"""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from trdlab.runs import RunFolder, checkpoint_steps, load_checkpoint, read_arrays, read_metrics
from trdlab.runs.metrics import step_of

STEPS, EVERY, CAPACITY = 400, 40, 96
ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "COLUMNS": "80"}
PATIENCE = 120.0  # seconds until something must have gone wrong


def train(out: Path, num_envs: int) -> list[str]:
    """Returns the words that begin the run."""
    options = {
        "--env-arg": "observation=pixels",
        "--out": out,
        "--num-envs": num_envs,
        "--agent-steps": STEPS,
        "--checkpoint-every": EVERY,
        "--log-every": 4,
        "--capacity": CAPACITY,
        "--N": 2,
        "--w": 3,
        "--batch-size": 4,
        "--update-every": 4,
        "--learning-starts": 24,
        "--target-sync-updates": 9,
        "--epsilon-end": 0.2,
        "--epsilon-steps": 200,
        "--evaluate-episodes": 0,
        "--threads": 1,
    }
    words = ["train", "gym", "trdlab/DroneGridworld-v0"]
    return [*words, *(str(word) for option in options.items() for word in option)]


TEACHER = """
import time
import numpy as np

class Balances:
    \"\"\"Balances the pole, and remembers where it was; draws its actions.

    It takes its time, so that a kill meant for its phase does not come after it.
    \"\"\"

    def act(self, observations, state, begins):
        time.sleep(0.005 * min(len(observations), 4))
        seen = observations
        before = seen if state is None else np.where(begins[:, None], seen, state[0])
        falls = seen[:, 2:3] + seen[:, 3:4] + 0.1 * (seen - before)[:, 2:3]
        right = 1.0 / (1.0 + np.exp(-40.0 * falls))
        return np.concatenate([1.0 - right, right], axis=1), (np.array(observations), None)

def make():
    return Balances()
"""
COLLECTED, OFFLINE = 160, 80


def train_taught(out: Path, num_envs: int, teacher: str) -> list[str]:
    """Returns the words that begin a run which learns from a teacher with a memory."""
    options = {
        "--env-arg": "max_episode_steps=30",
        "--teacher": teacher,
        "--teacher-steps": COLLECTED,
        "--offline-updates": OFFLINE,
        "--distil": "policy",
        "--draw": None,
        "--out": out,
        "--num-envs": num_envs,
        "--agent-steps": STEPS - COLLECTED - OFFLINE,
        "--checkpoint-every": EVERY,
        "--log-every": 4,
        "--capacity": CAPACITY,
        "--N": 2,
        "--w": 2,
        "--hidden": 16,
        "--batch-size": 4,
        "--update-every": 4,
        "--learning-starts": 12,
        "--target-sync-updates": 9,
        "--epsilon-end": 0.2,
        "--evaluate-episodes": 0,
        "--threads": 1,
    }
    words = ["train", "gym", "CartPole-v1"]
    return [*words, *(str(word) for of in options.items() for word in of if word is not None)]


class Command:
    """Runs `trdlab`, each time in a new process, forked from one that has imported everything.

    Importing PyTorch takes three seconds. A forked process is killed like any other.
    """

    source = """
import json, os, signal, sys
import torch._dynamo, trdlab.cli.app, trdlab.gridworld.render, trdlab.training.loading
from trdlab.cli import main

os.fsync = lambda number: None  # what a killed process has written is not lost
signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it is ignored

for line in sys.stdin:
    words, error = json.loads(line)
    child = os.fork()
    if child == 0:
        os.dup2(os.open(error, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        os.dup2(2, 1)
        main(words)
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""

    def __init__(self, folder: Path) -> None:
        self.error = folder / "stderr"
        self.server = subprocess.Popen(
            [sys.executable, "-c", self.source],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=ENVIRONMENT | {"PYTHONPATH": str(folder)},
        )

    def start(self, words: list[str]) -> None:
        assert self.server.stdin is not None
        self.server.stdin.write(json.dumps([words, str(self.error)]) + "\n")
        self.server.stdin.flush()
        self.pid = self._answer()

    def send(self, number: int) -> None:
        os.kill(self.pid, number)

    def code(self) -> int:
        """Waits until it has ended."""
        return self._answer()

    def said(self) -> str:
        return self.error.read_text()

    def to_the_end(self, words: list[str]) -> None:
        self.start(words)
        assert self.code() == 0, self.said()

    def _answer(self) -> int:
        assert self.server.stdout is not None
        return int(self.server.stdout.readline())


@pytest.fixture(scope="module")
def command(tmp_path_factory) -> Iterator[Command]:
    command = Command(tmp_path_factory.mktemp("command"))
    with command.server:
        yield command


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "It has ended, or stands still."
        time.sleep(0.002)


def has_told(out: Path, steps: int) -> Callable[[], bool]:
    """Returns whether there is a line of metrics of that step or a later one."""
    path = out / "metrics.jsonl"

    def told() -> bool:
        rows = read_metrics(path) if path.exists() else []
        return bool(rows) and step_of(rows[-1]) >= steps

    return told


def result(out: Path) -> tuple[dict[str, Any], dict[str, bytes], list[dict[str, Any]]]:
    """Returns all that a run leaves, but for the time that it took."""
    checkpoint = load_checkpoint(RunFolder.open(out))
    assert checkpoint.step == STEPS
    state = {key: value for key, value in checkpoint.state.items() if key != "run"}
    rows = [{**row, "seconds": None} for row in read_metrics(out / "metrics.jsonl")]
    return state, checkpoint.blocks, rows


def differences(a: Any, b: Any, path: str = "") -> list[str]:
    """Returns the places where two nested states differ, in a single bit or in a type."""
    if isinstance(a, dict) and isinstance(b, dict):
        keys = sorted(a.keys() | b.keys())
        return [at for key in keys for at in differences(a.get(key), b.get(key), f"{path}/{key}")]
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        pairs = enumerate(zip(a, b, strict=True))
        return [at for number, pair in pairs for at in differences(*pair, f"{path}/{number}")]
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        alike = (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
        return [] if alike else [path]
    return [] if type(a) is type(b) and a == b else [path]


def check_same(out: Path, other: Path) -> None:
    for part, (a, b) in enumerate(zip(result(out), result(other), strict=True)):
        assert differences(a, b) == [], part


@pytest.fixture(scope="module")
def uninterrupted(command, tmp_path_factory) -> Callable[[int], Path]:
    """Returns a function that returns the folder of the run that is never disturbed."""
    folder = tmp_path_factory.mktemp("whole")

    def run(num_envs: int) -> Path:
        out = folder / f"{num_envs}-environments"
        if not out.exists():
            command.to_the_end(train(out, num_envs))
        return out

    return run


def test_the_run_is_what_it_is_meant_to_be(uninterrupted):
    state, blocks, rows = result(uninterrupted(1))
    assert state["memory"]["settings"]["shape"] == [84, 84]
    assert state["memory"]["settings"]["capacity"] == CAPACITY
    assert blocks
    assert state["q_network"]["body.0.weight"].shape == (32, 1, 8, 8)
    assert len(rows) == STEPS / 4
    assert rows[-1]["updates"] == (STEPS - 24) // 4
    assert rows[-1]["episodes"] > 5


@pytest.mark.parametrize("num_envs", [1, 4])
def test_ten_kills_at_random_moments(command, uninterrupted, tmp_path, num_envs):
    rng, out = np.random.default_rng(num_envs), tmp_path / "run"
    moments = np.sort(rng.integers(EVERY, STEPS - EVERY, size=10))
    moments[0] = 8  # before there is a checkpoint
    words, resumed_from, in_episodes = train(out, num_envs), [], 0
    for moment in moments.tolist():
        command.start(words)
        wait_until(has_told(out, moment))
        time.sleep(rng.uniform(0.0, 0.05))
        command.send(signal.SIGKILL)
        assert command.code() == -signal.SIGKILL
        words = ["resume", str(out)]
        run = RunFolder.open(out)
        resumed_from.append(max(checkpoint_steps(run), default=0))
        if resumed_from[-1]:
            in_episodes += read_arrays(run, "environments")[1]["lengths"].min() > 0
    assert resumed_from[0] == 0
    assert resumed_from[-1] >= STEPS // 2
    assert in_episodes >= 5
    command.to_the_end(words)
    check_same(out, uninterrupted(num_envs))


@pytest.mark.parametrize("num_envs", [1, 4])
def test_kills_in_every_phase_of_learning_from_a_teacher(command, tmp_path, num_envs):
    (tmp_path / "pole.py").write_text(TEACHER)
    teacher = f"python:{tmp_path / 'pole.py'}:make"
    whole, out = tmp_path / "whole", tmp_path / "run"
    command.to_the_end(train_taught(whole, num_envs, teacher))
    rng, words, phases = np.random.default_rng(num_envs), train_taught(out, num_envs, teacher), []
    for moment in (8, 60, 140, 162, 200, 246, 254, 330):
        command.start(words)
        wait_until(has_told(out, moment))
        time.sleep(rng.uniform(0.0, 0.05))
        command.send(signal.SIGKILL)
        assert command.code() == -signal.SIGKILL
        phases.append(read_metrics(out / "metrics.jsonl")[-1]["phase"])
        words = ["resume", str(out), "--teacher", teacher]
    assert set(phases) == {"teacher", "offline", "online"}
    command.to_the_end(words)
    check_same(out, whole)
    rows = result(out)[2]  # a phase is over where the next one begins
    assert [row["phase"] for row in rows] == ["teacher"] * 39 + ["offline"] * 20 + ["online"] * 41
    assert [step_of(row) for row in rows] == list(range(4, STEPS + 1, 4))


def test_a_stopped_run_is_saved_at_that_very_step_and_goes_on_from_there(
    command, uninterrupted, tmp_path
):
    out = tmp_path / "my run"
    words = train(out, 1)
    for sent, code, moment in (
        (signal.SIGINT, 130, 101),
        (signal.SIGTERM, 143, 161),
        (signal.SIGHUP, 129, 203),
    ):
        command.start(words)
        wait_until(has_told(out, moment))
        command.send(sent)
        assert command.code() == code
        newest = checkpoint_steps(RunFolder.open(out))[-1]
        assert moment <= newest < STEPS
        assert read_metrics(out / "metrics.jsonl")[-1]["agent_steps"] == newest // 4 * 4
        stopped, go_on = command.said().splitlines()[-2:]
        assert stopped == f"Stopped and saved at {newest} agent steps."
        assert go_on == f"Go on: trdlab resume '{out}'"
        words = shlex.split(go_on.partition("trdlab ")[2])
    command.to_the_end(words)
    check_same(out, uninterrupted(1))


SLOW = """
import time
from pathlib import Path
import gymnasium as gym
from gymnasium.envs.classic_control import CartPoleEnv

class Slow(CartPoleEnv):
    steps = 0

    def __init__(self, mark):
        super().__init__()
        self.mark = Path(mark)

    def step(self, action):
        Slow.steps += 1
        if Slow.steps == 70:
            self.mark.touch()
            time.sleep(600)
        return super().step(action)

gym.register("Slow-v0", Slow)
"""


@pytest.mark.parametrize(("second", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, -15)])
def test_a_second_signal_ends_it_at_once(command, tmp_path, second, code):
    (command.error.parent / "slow_world.py").write_text(SLOW)
    out, mark = tmp_path / "run", tmp_path / "mark"
    words = ["train", "gym", "slow_world:Slow-v0", "--env-arg", f"mark={mark}", "--out", str(out)]
    command.start([*words, "--checkpoint-every", "50", "--num-envs", "1"])
    wait_until(mark.exists)
    command.send(signal.SIGINT)
    time.sleep(0.3)
    os.kill(command.pid, 0)  # it is there: the step is finished first
    command.send(second)
    assert command.code() == code
    assert "Traceback" not in command.said()
    assert checkpoint_steps(RunFolder.open(out)) == [50]
