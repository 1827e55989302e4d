"""Many numbers as JSON that is short, and exact where it has to be."""

import math
from collections.abc import Iterable

import numpy as np

from trdlab.arrays import FloatArray


def is_single(values: FloatArray) -> bool:
    """Returns whether numbers are those of single precision, and need only its digits.

    >>> is_single(np.float64(np.float32(0.1))), is_single(np.float64(0.1))
    (True, False)
    """
    return bool(np.array_equal(values, np.float32(values), equal_nan=True))


def exactly(values: FloatArray, *, single: bool) -> str:
    """Returns an array as JSON with the fewest digits that tell its numbers; NaN is null.

    Args:
        values: of any shape.
        single: whether the numbers are read as those of single precision.

    >>> exactly(np.float64(np.float32([0.1, 2.0])), single=True)
    '[0.1,2]'
    >>> exactly(np.array([[0.1], [np.nan]]), single=False)
    '[[0.1],[null]]'
    """
    return _nested(values.shape, iter(_digits(values.astype(np.float32 if single else np.float64))))


def nearly(values: FloatArray, digits: int = 3) -> str:
    """Returns an array as JSON, rounded such that its largest number has so many digits.

    >>> nearly(np.array([12.345, 0.01234])), nearly(np.array([0.01234, 0.0]))
    ('[12.3,0]', '[0.0123,0]')
    """
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    decimals = digits - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    return exactly(np.round(values, decimals), single=False)


def _digits(values: FloatArray) -> Iterable[str]:
    for text in values.ravel().astype(str).tolist():
        if text.endswith(".0"):
            yield "0" if text in ("0.0", "-0.0") else text[:-2]
        else:
            yield text if text[-1].isdigit() else "null"


def _nested(shape: tuple[int, ...], texts: Iterable[str]) -> str:
    if len(shape) == 0:
        return next(iter(texts))
    source = iter(texts)
    return "[" + ",".join(_nested(shape[1:], source) for _ in range(shape[0])) + "]"
