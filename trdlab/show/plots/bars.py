"""Bars of components: each where its steps are, with whiskers, and nothing outside the axes.

The scale is that of the bars. What does not fit on it ends at an arrow with its number.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from trdlab.arrays import RELATIVE_ZERO, BoolArray, FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.formatting import decimals_for
from trdlab.show.plots import style

CUT = "cut"
"""The `gid` of texts that say how far something goes that is cut off."""

_MOST_LETTERS = 46  # of all numbers above one row of bars
_MOST_CUTS = 4  # whiskers that are cut get a number each; of more only the furthest does
_SWAMPS = 4.0  # times the largest explicit component, from which on a residual is cut off
_MATTERS = 0.01  # of the residual: explicit components that add up to less do not set the scale
_ROOM = 1.5  # times the largest explicit component, that is shown then
_REACH = 2.5  # times the bars, beyond which whiskers are cut off
_LINE = 13.0  # points from one number to the next below it
_MARGIN = 0.08  # of the scale, free at both ends


class Scale(NamedTuple):
    """The least and the largest value that axes show, with a margin beyond them."""

    low: float
    high: float

    def holds(self, values: FloatArray) -> BoolArray:
        """Returns whether values can be seen; NaN cannot."""
        slack = 1e-9 * (self.high - self.low)
        return np.asarray((values >= self.low - slack) & (values <= self.high + slack))

    def show(self, ax: Axes) -> None:
        """Makes axes show it, and what they already show if they share it with others."""
        if self.low == self.high:  # nothing but zeros: no other number means anything
            ax.set(ylim=(-_MARGIN, 1.0), yticks=(0.0,))
            return
        margin = _MARGIN * (self.high - self.low)
        low, high = self.low - margin, self.high + margin
        if not ax.get_autoscaley_on():
            low, high = min(low, ax.get_ylim()[0]), max(high, ax.get_ylim()[1])
        ax.set_ylim(low, high)


def settled(values: FloatArray, error: float = 0.0) -> FloatArray:
    """Returns values with zeros for what is within an error, or only there by rounding."""
    least = max(error, RELATIVE_ZERO * float(np.abs(values).max(initial=0.0)))
    return np.where(np.abs(values) <= least, 0.0, values)


def scale_of(rows: FloatArray, *ends: FloatArray | None) -> Scale:
    """Returns the scale on which bars can be compared.

    A residual beside which explicit components that matter could not be seen does not count, nor do
    whiskers that are much longer than the bars.

    Args:
        rows: `[R, N+1]`, the components of the bars.
        ends: arrays of where whiskers end and points stand; NaN for none.
    """
    sizes = np.abs(rows)
    largest, residual = float(sizes[:, :-1].max(initial=0.0)), float(sizes[:, -1].max())
    matters = sizes[:, :-1].sum(axis=1).max() > _MATTERS * residual
    room = _ROOM * largest if matters and residual > _SWAMPS * largest else np.inf
    bars = np.clip(rows, -room, room)
    tallest = float(np.abs(bars).max())
    others = np.concatenate([np.ravel(of) for of in ends if of is not None] or [np.zeros(0)])
    others = others[np.isfinite(others)]
    near = others[np.abs(others) <= _REACH * tallest] if tallest else others
    low, high = min(0.0, *bars.flat, *near), max(0.0, *bars.flat, *near)
    return Scale(
        min(low, -_ROOM * tallest) if (others < low).any() else low,
        max(high, _ROOM * tallest) if (others > high).any() else high,
    )


def plot_components(
    ax: Axes,
    components: FloatArray,
    axis: TimeAxis,
    *,
    colour: str | tuple[str, str] = style.EXPECTED,
    scale: Scale | None = None,
) -> Axes:
    """Draws a bar per component: explicit ones filled, the residual hatched and set apart.

    What each is stands above it, where there is room. A residual that leaves the scale is cut off
    at an arrow.

    Args:
        ax: the axes to draw on; they are returned.
        components: `[N+1]`.
        axis: what they mean.
        colour: of the bars; of a difference, that of positive and that of negative ones.
        scale: what the axes show; by default all that is drawn.
    """
    components = settled(components)
    scale = scale_of(components[None]) if scale is None else scale
    up, down = (colour, colour) if isinstance(colour, str) else colour
    dress(ax, axis, scale)
    texts, places = numbers(components), style.positions(axis)
    for x, text, is_whole in zip(places, texts, scale.holds(components), strict=False):
        how = {"xycoords": ax.get_xaxis_transform(), "gid": None if is_whole else CUT}
        style.note(ax, text, (x, 1.0), (0, 3), ha="center", **how)
    colours = [up if value > 0.0 else down for value in components]
    draw_bars(ax, components, axis, colours, scale, told=bool(texts))
    return ax


def numbers(components: FloatArray) -> list[str]:
    """Returns what stands above the bars of components: nothing where there is no room."""
    decimals = decimals_for(components)
    texts = [style.told(float(value), decimals) for value in components]
    has_room = len(texts) * (max(map(len, texts)) + 1) <= _MOST_LETTERS
    return texts if has_room else []


def dress(ax: Axes, axis: TimeAxis, scale: Scale) -> None:
    """Gives axes for bars their scale, their labels, and the line of zero."""
    ax.axhline(0.0, color=style.MUTED, linewidth=0.8, zorder=3)
    style.label_steps(ax, axis, style.positions(axis))
    scale.show(ax)
    style.tidy(ax)


def draw_bars(
    ax: Axes,
    components: FloatArray,
    axis: TimeAxis,
    colours: Sequence[str],
    scale: Scale,
    *,
    told: bool = False,
    offset: float = 0.0,
    width: float = 0.8,
) -> None:
    """Draws bars as far as the scale goes; what leaves it gets its number, unless that is told."""
    heights, places = np.clip(components, *scale), style.positions(axis) + offset
    lines = (heights != 0.0).astype(float)  # no line where there is no bar
    bars = ax.bar(places, heights, width, color=colours, edgecolor=colours, linewidth=lines)
    bars[-1].set(facecolor="white", hatch="////")
    for i in np.flatnonzero(~scale.holds(components)).tolist():
        _cut(ax, places[i], components[i], scale, colours[i], is_told=told)


def draw_whiskers(
    ax: Axes, x: FloatArray, ends: FloatArray, scale: Scale, points: FloatArray | None = None
) -> None:
    """Draws lines between `ends` `[2, K]`, with `points` `[K]` on them, as far as the scale goes.

    What leaves it is an arrow with its number; of many such ends the furthest has it. Of one that
    is gone as a whole the bar is cut off, too, and has its own arrow; `points` have none but this.
    """
    known = np.isfinite(ends).all(axis=0)
    x, ends = x[known], ends[:, known]
    ax.vlines(x, *np.clip(ends, *scale), color=style.INK, linewidth=1.2)
    gone = (ends[0] > scale.high) | (ends[1] < scale.low)  # all of it, on one side
    far = np.abs(ends).argmax(axis=0)  # [K]
    for which, row in enumerate(ends):
        inside = scale.holds(row)
        ax.plot(x[inside], row[inside], "_", color=style.INK, markersize=5, zorder=4)
        is_end = ~gone if points is None else ~gone | (far == which)
        out = np.flatnonzero(~inside & is_end)
        telling = out if len(out) <= _MOST_CUTS else out[[np.abs(row[out]).argmax()]]
        for i in out:
            _cut(ax, x[i], row[i], scale, style.INK, is_told=i not in telling)
    if points is not None:
        seen = scale.holds(points[known])
        at = x[seen], points[known][seen]
        ax.plot(*at, "D", color=style.INK, mfc="white", markersize=5, zorder=5)


def residual_handle() -> Patch:
    """Returns what a legend shows of the residual."""
    return Patch(fc="white", ec=style.MUTED, hatch="////", label="hatched: all later steps")


def handle(
    label: str, line: str = "-", marker: str = "", colour: str = style.INK, fill: str = "white"
) -> Line2D:
    """Returns what a legend shows of a line or a marker."""
    return Line2D([], [], ls=line, marker=marker, ms=5, mfc=fill, color=colour, label=label)


def _cut(ax: Axes, x: float, value: float, scale: Scale, colour: str, *, is_told: bool) -> None:
    """Marks that something goes on beyond the scale, and tells how far unless that is told."""
    up, is_right = value > scale.high, x > 0.8 * ax.get_xlim()[1]
    at = (x, scale.high if up else scale.low)
    ax.plot(*at, "^" if up else "v", color=colour, markersize=6, clip_on=False, zorder=6)
    if not is_told:
        above = sum(note.get_gid() == CUT and _meet(note, at) for note in ax.texts)  # as of a bar
        shift = (-6 if is_right else 6, (-1 if up else 1) * _LINE * above)
        text = style.told(value, decimals_for([value]))
        side = {"ha": "right" if is_right else "left", "va": "top" if up else "bottom"}
        box = {"fc": "white", "ec": "none", "alpha": 0.85, "pad": 0.4}
        style.note(ax, text, at, shift, gid=CUT, bbox=box, **side)


def _meet(note: Any, at: style.Point) -> bool:
    """Returns whether a note belongs to the same end of the same component."""
    return bool(abs(note.xy[0] - at[0]) < 0.5 and note.xy[1] == at[1])
