"""In which precision updates are quicker here: measured, since processors differ by ten times."""

import time
from dataclasses import replace
from typing import Any, get_args

import gymnasium as gym
import numpy as np

from trdlab.deep.networks import build_network
from trdlab.deep.settings import Precision, TrainSettings
from trdlab.deep.update import Batch, Learner

_ROUNDS = 4
_CLEARLY = 0.9  # of the time: to save less is no reason to be less exact, and may be chance


def quicker_precision(
    space: gym.Space[Any], num_actions: int, settings: TrainSettings
) -> Precision:
    """Returns `bfloat16` if updates take clearly less time in it, else `float32`.

    Measured in a second or two, in as many threads as PyTorch uses now.

    Args:
        space: of what the agent sees.
        num_actions: A.
        settings: how it learns; with a real device.
    """
    batch = _blank_batch(space, settings.batch_size)
    learners = {
        precision: Learner(
            build_network(space, num_actions, settings.time_axis, hidden=settings.hidden),
            replace(settings.update_settings, precision=precision),
            settings.device,
        )
        for precision in get_args(Precision)
    }
    seconds: dict[Precision, list[float]] = {precision: [] for precision in learners}
    for _ in range(1 + _ROUNDS):
        for precision, learner in learners.items():
            begun = time.perf_counter()
            learner.update(batch)
            seconds[precision].append(time.perf_counter() - begun)
    least = {precision: min(of[1:]) for precision, of in seconds.items()}  # the first prepares
    return "bfloat16" if least["bfloat16"] < _CLEARLY * least["float32"] else "float32"


def _blank_batch(space: gym.Space[Any], size: int) -> Batch:
    observations = np.zeros((size, *(space.shape or ())), space.dtype)
    if isinstance(space, gym.spaces.Discrete):
        observations += space.start
    numbers = np.zeros(size, np.float32)
    return Batch(observations, np.zeros(size, np.int64), numbers, numbers, observations)
