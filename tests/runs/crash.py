"""Kills processes while they save checkpoints, and checks each time what they leave.

Run as a program, because it forks: `python crash.py next|again|random FOLDER`.
"""

import os
import random
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from trdlab.files import is_leftover
from trdlab.runs import RunFolder, checkpoint_steps, load_checkpoint, save_checkpoint

EFFECTS = {"open", "os.mkdir", "os.rename", "os.remove", "os.rmdir"}
BLOCKS = 3


def blocks(step: int) -> dict[str, bytes]:
    return {str(n): bytes([n % 256]) * n for n in range(step - BLOCKS, step)}  # each step adds one


def save(run: RunFolder, step: int) -> None:
    """Saves a checkpoint all of whose parts tell its step."""
    state = {"weights": {"w": np.full(1000, step)}, "step": step, "open": bytes([step % 256])}
    save_checkpoint(run, step, state, blocks(step))


def check(run: RunFolder, at_least: int) -> int:
    """Returns the step of the newest checkpoint, if all of it belongs together."""
    loaded = load_checkpoint(run)
    assert loaded.step >= at_least
    assert loaded.state["step"] == loaded.step
    assert (loaded.state["weights"]["w"] == loaded.step).all()
    assert loaded.state["open"] == bytes([loaded.step % 256])
    assert loaded.blocks == blocks(loaded.step)
    return loaded.step


def check_tidy(run: RunFolder, step: int) -> None:
    """Checks that there is nothing but the last two checkpoints."""
    assert checkpoint_steps(run) == [step - 1, step]
    assert len(list(run.checkpoints.iterdir())) == 2
    assert not [path for path in run.path.rglob("*") if is_leftover(path)]
    assert len(list(run.replay.iterdir())) == BLOCKS + 1


def child(work: Callable[[], None]) -> int:
    """Starts a process and returns its number."""
    if pid := os.fork():
        return pid
    status = 1
    try:
        work()
        status = 0
    finally:
        os._exit(status)


def killed(pid: int) -> bool:
    """Waits for a process, and returns whether it was killed rather than done."""
    status = os.waitpid(pid, 0)[1]
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, "it failed by itself"
    return os.WIFSIGNALED(status)


def die_before(effect: int) -> None:
    """Has this process killed before its n-th effect on the disk, or in the midst of a write."""

    def count() -> None:
        nonlocal effect
        effect -= 1
        if effect < 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def write_bytes(path: Path, data: bytes) -> int:
        whole(path, data[: len(data) // 2])
        count()
        return whole(path, data)

    whole, Path.write_bytes = Path.write_bytes, write_bytes
    sys.addaudithook(lambda event, _: count() if event in EFFECTS else None)


def each_effect(run: RunFolder, ahead: int) -> int:
    """Kills a process before each effect of saving so many steps ahead; returns how many."""
    save(run, 10)
    step, kills = 11, 0
    while True:
        save(run, step)  # works whatever the last one left, and tidies up
        check_tidy(run, step)

        def work() -> None:
            die_before(kills)  # noqa: B023  it is called at once
            save(run, step + ahead)  # noqa: B023

        if not killed(child(work)):
            check_tidy(run, step + ahead)
            return kills
        kills, step = kills + 1, check(run, step) + 1


def random_moments(run: RunFolder) -> int:
    """Kills a process that saves in a loop, at random moments; returns how often."""
    rng, step = random.Random(1), 10
    save(run, step)

    def work() -> None:
        for later in range(step + 1, step + 10_000):  # each process goes on where the last was
            save(run, later)

    for _ in range(30):
        pid = child(work)
        time.sleep(rng.uniform(0.001, 0.05))
        os.kill(pid, signal.SIGKILL)
        assert killed(pid)
        step = check(run, step)
    return 30


if __name__ == "__main__":
    os.fsync = lambda number: None  # what the system was told, it knows; only the power is not cut
    new = RunFolder.create(Path(sys.argv[2]), {})
    print(
        random_moments(new) if sys.argv[1] == "random" else each_effect(new, sys.argv[1] == "next")
    )
