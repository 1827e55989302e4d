"""Maps of where an agent looks for each component, small enough for a page."""

import zlib
from base64 import b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError

LEVELS = 7
"""Above zero, and as many below."""
_TOGETHER = 50  # steps that are packed, and unpacked, together
_IMAGE = 3  # axes of an observation that is one: [C, H, W]


def packed_maps(
    estimator: Any, observations: FloatArray, actions: Sequence[int]
) -> dict[str, Any] | None:
    """Returns the maps of an action at each step, in `LEVELS`; None where there are none.

    Each map is as strong at its strongest place as any other, since one is looked at at a time.

    Args:
        estimator: what is asked, if it can tell (`saliency`).
        observations: `[T, ...]`.
        actions: T of them.
    """
    if not hasattr(estimator, "saliency") or observations.ndim != 1 + _IMAGE:
        return None
    chunks, shape = [], (0, 0)
    for first in range(0, len(observations), _TOGETHER):
        part = slice(first, first + _TOGETHER)
        try:
            maps = estimator.saliency(observations[part], np.array(actions[part]))
        except InputError:  # it has no convolutions
            return None
        most = np.abs(maps).max(axis=(2, 3), keepdims=True)  # [B, N+1, 1, 1]
        levels = np.round(LEVELS * maps / np.where(most > 0.0, most, 1.0)).astype(np.int8)
        shape = levels.shape[2:]
        rows = np.ascontiguousarray(np.moveaxis(levels, 1, -1))  # [B, h, w, N+1]: packs best
        chunks.append(b64encode(zlib.compress(rows.tobytes(), 9)).decode())
    return {
        "levels": LEVELS,
        "height": shape[0],
        "width": shape[1],
        "together": _TOGETHER,
        "packed": chunks,
    }
