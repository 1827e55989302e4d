"""The array types that signatures name, and when two computed numbers are the same one."""

from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.floating[Any]]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

RELATIVE_ZERO = 1e-12
"""Two computed numbers closer than this, relative to the larger, are the same number."""


def same(a: float, b: float) -> bool:
    """Returns whether two computed numbers are the same up to rounding.

    >>> same(0.1 + 0.2, 0.3), same(0.0, 1e-300)
    (True, False)
    """
    return abs(a - b) <= RELATIVE_ZERO * max(abs(a), abs(b))
