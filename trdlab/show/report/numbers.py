"""Many numbers in few characters, as they stand in the JSON of a page."""

import sys
from base64 import b64encode
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray

MOST = 65_534
"""Of a share: 0 to 1 are told as 0 to so much. One more is no number."""


def is_single(values: FloatArray) -> bool:
    """Returns whether numbers are those of single precision, and need only half the room.

    >>> is_single(np.float64(np.float32(0.1))), is_single(np.float64(0.1))
    (True, False)
    """
    return bool(np.array_equal(values, np.float32(values), equal_nan=True))


def packed(values: FloatArray) -> dict[str, Any]:
    """Returns an array to the bit: its shape, its type, and its bytes as base64.

    >>> packed(np.array([[1.0], [np.nan]]))
    {'shape': [2, 1], 'type': 'single', 'bytes': 'AACAPwAAwH8='}
    """
    single = is_single(values)
    kind = np.float32 if single else np.float64
    return _packed(values.astype(kind), "single" if single else "double")


def packed_shares(values: FloatArray) -> dict[str, Any]:
    """Returns numbers from 0 to 1 likewise, each right to 0.00001.

    >>> packed_shares(np.array([0.0, 1.0, np.nan]))
    {'shape': [3], 'type': 'share', 'bytes': 'AAD+////'}
    """
    told = np.where(np.isnan(values), MOST + 1, np.round(np.nan_to_num(values) * MOST))
    return _packed(told.astype(np.uint16), "share")


def _packed(values: np.ndarray[Any, Any], kind: str) -> dict[str, Any]:
    little = values if sys.byteorder == "little" else values.byteswap()
    data = b64encode(np.ascontiguousarray(little).tobytes()).decode()
    return {"shape": list(values.shape), "type": kind, "bytes": data}
