"""Checks of attributions: do they depend on what was learned, and do they show what matters?"""

from typing import Literal, NamedTuple

import numpy as np

from trdlab.arrays import BoolArray, FloatArray

DRAWS = 10
"""So often weights are drawn anew."""
MOST_LEFT = 0.5
"""How much of the order may be left with new weights."""
LEAST_FOUND = 0.3
"""How much of the order has to be that of what hiding changes."""
FEWEST = 4
"""Places or entries of which an order tells something."""

Verdict = Literal["good", "bad", "not tested"]


class Check(NamedTuple):
    """What a check has found.

    Args:
        verdict: whether it was passed.
        value: the rank correlation, from −1 to 1; NaN if it was not tested.
    """

    verdict: Verdict
    value: float


NOT_TESTED = Check("not tested", float("nan"))


def redrawn_check(strength: FloatArray, others: FloatArray) -> Check:
    """Returns whether an attribution depends on what the network has learned.

    The number is the mean rank correlation of its strength with those of networks whose weights
    were drawn anew. What stays as it is shows the observation, and not what was learned of it.

    Args:
        strength: `[...]`, of the attribution.
        others: `[R, ...]`, of R such networks.

    Source: Adebayo et al. (2018).
    """
    if strength.size < FEWEST or not np.ptp(strength):
        return NOT_TESTED
    found = [rank_correlation(strength, other) for other in others if np.ptp(other)]
    left = float(np.mean(found)) if found else 0.0
    return Check("good" if left < MOST_LEFT else "bad", left)


def hidden_check(strength: FloatArray, changes: FloatArray, is_shown: BoolArray) -> Check:
    """Returns whether an attribution is strong where hiding what is there changes much.

    Args:
        strength: `[P]`, at P patches or entries.
        changes: `[P]`, by how much what is expected changed when each was hidden.
        is_shown: `[P]`, where there is something to hide: elsewhere hiding is no test.
    """
    one, other = strength[is_shown], np.abs(changes[is_shown])
    if len(one) < FEWEST or not np.ptp(one) or not np.ptp(other):
        return NOT_TESTED
    found = rank_correlation(one, other)
    return Check("good" if found >= LEAST_FOUND else "bad", found)


def rank_correlation(one: FloatArray, other: FloatArray) -> float:
    """Returns Spearman's correlation of two arrays of the same shape, neither of them constant.

    >>> rank_correlation(np.array([1.0, 5.0, 100.0]), np.array([0.3, 0.2, 0.1]))
    -1.0
    """
    return float(np.corrcoef(_ranks(one), _ranks(other))[0, 1].round(12))


def _ranks(values: FloatArray) -> FloatArray:
    """Returns ranks; what is equal shares the mean of its ranks."""
    _, which, counts = np.unique(values.ravel(), return_inverse=True, return_counts=True)
    return np.asarray((counts.cumsum() - (counts - 1) / 2.0)[which])


# ---- what is hidden ----------------------------------------------------------------------------


def hidden_patches(image: FloatArray, side: int) -> FloatArray:
    """Returns an image `[C, H, W]` with each patch hidden in turn: `[P, C, H, W]`, row by row.

    Each of its frames gets there what most of it looks like, its median, so that what stands in the
    patch is gone and nothing new is seen.

    Args:
        image: what is seen.
        side: of a patch; those at the far ends may be smaller.
    """
    height, width = image.shape[-2:]
    blank = np.median(image, axis=(-2, -1)).astype(image.dtype)[..., None, None]  # [C, 1, 1]
    found = []
    for top in range(0, height, side):
        for left in range(0, width, side):
            found.append(image.copy())
            found[-1][..., top : top + side, left : left + side] = blank
    return np.stack(found)


def patch_means(values: FloatArray, side: int) -> FloatArray:
    """Returns the mean of `[H, W]` in each patch: `[rows, columns]`."""
    height, width = values.shape
    tops, lefts = np.arange(0, height, side), np.arange(0, width, side)
    sums = np.add.reduceat(np.add.reduceat(values, tops, axis=0), lefts, axis=1)
    sizes = np.minimum(side, height - tops)[:, None] * np.minimum(side, width - lefts)
    return np.asarray(sums / sizes)
