"""What the replay memory is given by a step, and gives to an update."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.arrays import IntArray
from trdlab.errors import InputError


@dataclass(frozen=True, eq=False)
class Batch:
    """K windows of w steps: K the batch, k the frames in a stack.

    The two stacks of observations may be views of the same frames: read them, write elsewhere.
    They are tensors where the frames lie on a device, all else are arrays.

    Args:
        observations: `[K, k, ...]`, the stack at s_t (`[K, ...]` where there are no stacks).
        actions: `[K]`, a_t, int64.
        rewards: `[K]`, Σ_(i<w) γ^i R_(t+i), float32; after termination steps pay 0.
        discounts: `[K]`, γ^w, or 0 where the episode terminated within the window, float32.
        next_observations: `[K, k, ...]`, the stack at s_(t+w); where the episode terminated
            sooner, at its last observation, which nothing should depend on.
        steps: `[K]`, the steps really taken: w, or fewer where the episode terminated sooner.
        indices: `[K]`, the place of a_t in the memory.
        extras: `[K, ...]` each, what was stored with a_t.
    """

    observations: Any
    actions: IntArray
    rewards: npt.NDArray[np.float32]
    discounts: npt.NDArray[np.float32]
    next_observations: Any
    steps: IntArray
    indices: IntArray
    extras: dict[str, npt.NDArray[Any]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.actions)


def checked(name: str, values: npt.ArrayLike, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """Returns an array that has this shape `[B, ...]`.

    Raises:
        InputError: it has another one.
    """
    array = np.asarray(values)
    if array.shape != shape:
        raise InputError(
            f"The {name} have shape {array.shape}, not {shape}.",
            "Give one entry for each environment; of a stack, the newest frame alone.",
        )
    return array
