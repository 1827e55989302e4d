"""What pictures of components share: where bars stand, what is written below them, their scale."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from trdlab.arrays import FloatArray
from trdlab.time_axis import TimeAxis

STEPS = "agent steps from now (t is the action taken now)"

_GAP = 0.6  # between the explicit components and the residual, in bars
_MOST_LETTERS = 70  # beneath one picture
_SWAMPS = 4.0  # times the largest explicit component, from which on a residual is cut off
_ROOM = 1.5  # times the largest explicit component, that is shown then


def positions(axis: TimeAxis, gap: float = _GAP) -> FloatArray:
    """Returns `[N+1]`: where components stand, in a row and the residual set apart."""
    places = np.arange(axis.num_components, dtype=np.float64)
    places[-1] += gap if axis.horizon else 0.0
    return places


def label_steps(ax: Axes, axis: TimeAxis, places: FloatArray) -> None:
    """Writes below some of the components what steps they cover, the residual among them."""
    every = -(-sum(map(len, axis.labels)) // _MOST_LETTERS)
    shown = [i for i in range(0, axis.horizon, every) if axis.horizon - i >= every / 2]
    shown.append(axis.horizon)
    ax.set_xticks(places[shown], [axis.labels[i] for i in shown])


def share_scale(axes: Sequence[Axes]) -> None:
    """Gives all axes the same range of values."""
    low = min(ax.get_ylim()[0] for ax in axes)
    high = max(ax.get_ylim()[1] for ax in axes)
    for ax in axes:
        ax.set_ylim(low, high)


def room_for(rows: FloatArray) -> tuple[float, float] | None:
    """Returns the range of values that explicit components need, if residuals would swamp them.

    Args:
        rows: `[R, N+1]`, what is drawn on one scale.
    """
    largest = float(np.abs(rows[:, :-1]).max(initial=0.0))
    if largest == 0.0 or np.abs(rows[:, -1]).max() <= _SWAMPS * largest:
        return None
    low, high = rows.min() < 0.0, rows.max() > 0.0
    return -largest * (_ROOM if low else 0.05), largest * (_ROOM if high else 0.05)


def cut_off(ax: Axes, room: tuple[float, float], bars: Sequence[tuple[float, float]]) -> None:
    """Shows a range of values, and writes at bars that leave it how far they reach.

    Args:
        ax: the axes with the bars.
        room: the range, as `room_for` returns it.
        bars: the place and the value of each that may leave it; their texts go below each other.
    """
    ax.set_ylim(*room)
    for line, (x, value) in enumerate(bars):
        if room[0] <= value <= room[1]:
            continue
        up = value > 0.0
        ax.annotate(
            f"{'↑' if up else '↓'} {value:.4g}",
            (x, 1.0 if up else 0.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, (-2 - 11 * line) * (1 if up else -1)),
            textcoords="offset points",
            ha="center",
            va="top" if up else "bottom",
            fontsize=8,
            bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 0.6},
        )
