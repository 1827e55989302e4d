"""Where on a screen something changed for good when a reward came."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, label

from trdlab.arrays import BoolArray, FloatArray
from trdlab.rollouts.reel import Picture, Reel

Box = tuple[int, int, int, int]
"""Top, left, bottom and right in pixels, the latter two just outside."""

BEFORE, AFTER = 3, 3
"""Pictures on either side of a reward that are compared."""
_VISIBLE = 24  # of 255: a smaller difference is no change
_NEAR = 2  # pixels: what is no further apart is one patch
_LEAST = 0.2  # of the largest patch: a smaller one does not count
_ROWS, _COLUMNS = ("top", "middle", "bottom"), ("left", "centre", "right")


class Change(NamedTuple):
    """What changed for good with a reward.

    Args:
        place: in words, a ninth of the screen; empty where nothing changed.
        box: around it; None where nothing changed.
    """

    place: str
    box: Box | None


def changes(places: Sequence[tuple[Sequence[int], int]], reel: Reel) -> list[Change]:
    """Returns what changed for good with each of some rewards.

    A pixel has changed for good if it differs between each of the last pictures before and each of
    the next ones after. What moves, such as a ball, does not. Of several patches, the one is told
    of that changes least often with other rewards: so it is a brick, and not the score.

    Args:
        places: of each reward, the numbers of the pictures of its episode, and its step.
        reel: the pictures.
    """
    masks = [_changed(numbers, step, reel) for numbers, step in places]
    often: dict[tuple[int, ...], FloatArray] = {}
    for shape in {mask.shape for mask in masks}:
        often[shape] = np.mean([mask for mask in masks if mask.shape == shape], axis=0)
    return [_change(mask, often[mask.shape]) for mask in masks]


def _changed(numbers: Sequence[int], step: int, reel: Reel) -> BoolArray:
    """Returns `[H, W]`: the pixels that changed for good in a step."""
    before = [reel[i] for i in dict.fromkeys(numbers[max(0, step + 1 - BEFORE) : step + 1])]
    after = [reel[i] for i in dict.fromkeys(numbers[step + 1 : step + 1 + AFTER])]
    found: BoolArray = np.ones(before[0].shape[:2], dtype=np.bool_)
    for one in before:
        for other in after:
            found &= _differ(one, other)
    return found


def _differ(one: Picture, other: Picture) -> BoolArray:
    if one.shape != other.shape:
        return np.zeros(one.shape[:2], dtype=np.bool_)
    apart = np.abs(one.astype(np.int16) - other.astype(np.int16))
    return np.asarray((apart > _VISIBLE).any(axis=2))


def _change(mask: BoolArray, often: FloatArray) -> Change:
    """Returns where the rarest patch of a mask `[H, W]` lies, and what it spans.

    Args:
        mask: what has changed.
        often: `[H, W]`, with which share of all rewards each pixel changes.
    """
    patches, count = label(binary_dilation(mask, iterations=_NEAR))
    patches = np.where(mask, patches, 0)
    sizes = np.bincount(patches.ravel(), minlength=count + 1)[1:]
    if not count:
        return Change("", None)
    common = np.bincount(patches.ravel(), often.ravel(), minlength=count + 1)[1:]
    rare = np.where(sizes >= _LEAST * sizes.max(), common / np.maximum(sizes, 1), np.inf)
    rows, columns = np.nonzero(patches == 1 + int(rare.argmin()))
    height, width = mask.shape
    row, column = (
        min(2, int(3 * np.median(at) / size)) for at, size in ((rows, height), (columns, width))
    )
    words = f"{_ROWS[row]} {_COLUMNS[column]}" if (row, column) != (1, 1) else "centre"
    box = (rows.min(), columns.min(), rows.max() + 1, columns.max() + 1)
    return Change(words, tuple(map(int, box)))  # type: ignore[arg-type]
