"""How much memory a replay memory will take, told before anything is done for it."""

import os
from collections.abc import Mapping
from contextlib import suppress
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from trdlab.deep.frames import chunk_frames, compresses
from trdlab.deep.ring import TRANSITION_NBYTES
from trdlab.errors import TrdlabError

if TYPE_CHECKING:
    from trdlab.deep.networks import DecompositionNetwork

COMPRESSED = 0.23
"""The part of an 84×84 Atari frame that compression leaves in an unfavourable game (measured by
`benchmarks/replay.py`: 0.02 for Breakout, 0.14 for Space Invaders; 0.23 for Yars' Revenge)."""


def memory_needed(
    capacity: int,
    shape: tuple[int, ...],
    dtype: npt.DTypeLike = np.uint8,
    *,
    num_envs: int = 1,
    compress: bool | None = None,
    frame_nbytes: float | None = None,
    extras: Mapping[str, tuple[tuple[int, ...], npt.DTypeLike]] | None = None,
) -> int:
    """Returns the bytes that a full `ReplayBuffer` with these options will take.

    Args:
        capacity: in transitions.
        shape: of a frame.
        dtype: of a frame.
        num_envs: B.
        compress: whether frames are compressed; as decided by the buffer without it.
        frame_nbytes: what a frame takes in the memory, if it has been measured (see
            `ReplayBuffer.bytes_per_frame`). Without it, that of an unfavourable Atari game.
        extras: what else is stored with a transition.

    >>> round(memory_needed(1_000_000, (84, 84)) / 1e9, 1)
    1.7
    """
    raw, length = prod(shape) * np.dtype(dtype).itemsize, -(-capacity // num_envs)
    chunk = chunk_frames(length, raw)
    if frame_nbytes is None:
        smaller = compresses(shape, dtype) if compress is None else compress
        frame_nbytes = (raw * COMPRESSED + raw / chunk if smaller else raw) + 4
    frames = num_envs * (length + chunk)  # a chunk is forgotten as a whole
    others = sum(prod(of) * np.dtype(kind).itemsize for of, kind in (extras or {}).values())
    return int(frames * frame_nbytes) + num_envs * length * (TRANSITION_NBYTES + others)


def check_memory(
    needed: int, capacity: int, available: int | None = None, of: str = "A replay memory"
) -> None:
    """Refuses a replay memory that does not fit.

    Args:
        needed: its bytes, see `memory_needed`.
        capacity: its transitions.
        available: the bytes that are free; found out without it.
        of: what needs them.

    Raises:
        TrdlabError: it does not fit into nine tenths of what is free.

    >>> check_memory(2_000_000_000, 1_000_000, available=1_000_000_000)
    Traceback (most recent call last):
    trdlab.errors.TrdlabError: A replay memory of 1000000 transitions takes about 2.00 GB, and \
1.00 GB is free. Choose a capacity of at most 450000, or free some memory.
    """
    free = available_memory() if available is None else available
    if free is None or needed <= 0.9 * free:
        return
    fits = int(capacity * 0.9 * free / needed)
    digits = max(0, len(str(fits)) - 2)
    raise TrdlabError(
        f"{of} of {capacity} transitions takes about {needed / 1e9:.2f} GB, and "
        f"{free / 1e9:.2f} GB is free.",
        f"Choose a capacity of at most {fits // 10**digits * 10**digits}, or free some memory.",
    )


def learner_nbytes(network: "DecompositionNetwork", batch_size: int) -> int:
    """Returns the bytes that learning with a network takes, roughly: those that grow with it.

    Five numbers for each weight (online, target, gradient and Adam's two), and four for what each
    layer makes of each window of a batch.

    Args:
        network: as `build_network` returns it; with or without weights.
        batch_size: the windows in a batch.

    >>> import gymnasium as gym
    >>> from trdlab.decomposition import TimeAxis
    >>> from trdlab.deep.networks import build_network
    >>> space = gym.spaces.Box(-1, 1, (4,))
    >>> network = build_network(space, 2, TimeAxis(0.99, 9), hidden=[100], seed=None)
    >>> learner_nbytes(network, 10)  # 4·(5·2520 + 10·4·(4 + 100 + 20))
    70240
    """
    weights = sum(weight.numel() for weight in network.parameters())
    made: int = prod(network.observation_shape)
    for layer in network.modules():
        made += getattr(layer, "out_features", 0)
    return 4 * (5 * weights + 4 * batch_size * made)


def check_learner(needed: int, available: int | None) -> None:
    """Refuses a network that does not fit, with the batch that it is to learn from.

    Args:
        needed: its bytes, see `learner_nbytes`.
        available: the bytes that are free; None if unknown.

    Raises:
        TrdlabError: it does not fit into nine tenths of what is free.
    """
    if available is not None and needed > 0.9 * available:
        raise TrdlabError(
            f"Learning with this network and batch takes about {needed / 1e9:.2f} GB, and "
            f"{available / 1e9:.2f} GB is free.",
            "Choose smaller layers, a smaller N or a smaller batch, or free some memory.",
        )


def available_memory() -> int | None:
    """Returns the bytes that are free, as the system or the container says; None if unknown."""
    found = []
    with suppress(OSError, ValueError, StopIteration, IndexError):  # Linux
        lines = Path("/proc/meminfo").read_text().splitlines()
        found.append(1024 * int(next(x for x in lines if x.startswith("MemAvail")).split()[1]))
    with suppress(OSError, ValueError):  # a container; "max" where it has no limit
        group = Path("/sys/fs/cgroup")
        limit = int((group / "memory.max").read_text())
        found.append(limit - int((group / "memory.current").read_text()))
    if not found:
        with suppress(AttributeError, OSError, ValueError):  # all that macOS tells
            found.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return max(0, min(found)) if found else None
