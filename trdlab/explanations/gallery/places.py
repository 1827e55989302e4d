"""Where on a screen something changed for good when a reward came."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from trdlab.arrays import BoolArray
from trdlab.rollouts.reel import Picture, Reel

Box = tuple[int, int, int, int]
"""Top, left, bottom and right in pixels, the latter two just outside."""

BEFORE, AFTER = 3, 3
"""Pictures on either side of a reward that are compared."""
_VISIBLE = 24  # of 255: a smaller difference is no change
_COMMON = 0.5  # of all rewards: what changes with more of them, such as a score, tells none apart
_FEWEST = 4  # rewards by which that is judged
_ROWS, _COLUMNS = ("top", "middle", "bottom"), ("left", "centre", "right")


class Change(NamedTuple):
    """What changed for good with a reward.

    Args:
        place: in words, a ninth of the screen; empty where nothing changed.
        box: around all of it; None where nothing changed.
    """

    place: str
    box: Box | None


def changes(places: Sequence[tuple[Sequence[int], int]], reel: Reel) -> list[Change]:
    """Returns what changed for good with each of some rewards.

    A pixel has changed for good if it differs between each of the last pictures before and each of
    the next ones after. What moves, such as a ball, does not. Nor does what changes with most
    rewards, such as the score, if there is anything else.

    Args:
        places: of each reward, the numbers of the pictures of its episode, and its step.
        reel: the pictures.
    """
    masks = [_changed(numbers, step, reel) for numbers, step in places]
    common: dict[tuple[int, ...], BoolArray] = {}
    for shape in {mask.shape for mask in masks}:
        alike = [mask for mask in masks if mask.shape == shape]
        counts = sum(mask.astype(np.int64) for mask in alike)
        is_common = np.asarray(counts > _COMMON * len(alike))
        common[shape] = is_common if len(alike) >= _FEWEST else np.zeros_like(is_common)
    own = (mask & ~common[mask.shape] for mask in masks)
    return [
        _change(rest if rest.any() else mask) for mask, rest in zip(masks, own, strict=True)
    ]


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


def _change(mask: BoolArray) -> Change:
    """Returns where the middle of a mask `[H, W]` lies, and what it spans."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return Change("", None)
    height, width = mask.shape
    row, column = (
        min(2, int(3 * np.median(at) / size)) for at, size in ((rows, height), (columns, width))
    )
    words = f"{_ROWS[row]} {_COLUMNS[column]}" if (row, column) != (1, 1) else "centre"
    box = (rows.min(), columns.min(), rows.max() + 1, columns.max() + 1)
    return Change(words, tuple(map(int, box)))  # type: ignore[arg-type]
