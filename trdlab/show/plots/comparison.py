"""The picture of a comparison: what both expect, component by component, and the difference."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from trdlab.decomposition import TimeAxis
from trdlab.explanations.comparison.comparison import Comparison
from trdlab.show.plots.pictures import check_pictures
from trdlab.show.plots.steps_axis import STEPS, cut_off, label_steps, positions, room_for
from trdlab.statistics import Estimates
from trdlab.time_axis import axis_title

NAME = "comparison.png"

_COLOURS = ("#1f4e8c", "#e39a2d")  # dark for A, light for B
_MUTED = "#5b6470"


def picture_path(folder: Path) -> Path:
    """Returns where the picture goes, once it is known that it can be written.

    Args:
        folder: where to; it is made if there is none.

    Raises:
        OutputError: it exists, or cannot be written.
    """
    path = folder / NAME
    check_pictures([path])
    return path


def comparison_figure(comparison: Comparison) -> Figure:
    """Returns the means of both agents with intervals, and below them their difference."""
    figure = Figure(figsize=(8.0, 5.6), layout="constrained")
    figure.suptitle(" against ".join(titles(comparison)), fontsize=11)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    plot_means(above, comparison)
    plot_difference(below, comparison)
    above.label_outer()
    figure.supylabel("expected discounted reward, on average", fontsize=9, color=_MUTED)
    has_intervals = bool(np.isfinite(comparison.difference.low).any())
    count = f"{len(comparison.visits)} states of {2 * comparison.episodes} episodes"
    whiskers = "whiskers: 95 % intervals" if has_intervals else "too few for intervals"
    figure.supxlabel(
        f"{STEPS}\n{axis_title(comparison.time_axis)} · {count} · {whiskers}",
        fontsize=8,
        color=_MUTED,
    )
    return figure


def plot_means(ax: Axes, comparison: Comparison) -> Axes:
    """Draws what each expects of what it would do, side by side; the residual is hatched.

    Args:
        ax: the axes to draw on.
        comparison: what is drawn.

    Returns:
        `ax`.
    """
    axis, means = comparison.time_axis, comparison.means
    totals, handles = means.value.sum(axis=1), []
    for i, title in enumerate(titles(comparison)):
        own = Estimates(means.value[i], means.low[i], means.high[i])
        _bars(ax, own, axis, (_COLOURS[i],) * axis.num_components, 0.4 * i - 0.2, 0.38)
        handles.append(Patch(color=_COLOURS[i], label=f"{title} ({totals[i]:.3g} in all)"))
    ax.legend(handles=handles, fontsize=8, frameon=False)
    _dressed(ax, axis)
    room, x = room_for(means.value), float(positions(axis)[-1])
    if room is not None:
        ends = means.value[:, -1].tolist()
        cut_off(ax, room, [(x + 0.4 * i - 0.2, value) for i, value in enumerate(ends)])
    return ax


def plot_difference(ax: Axes, comparison: Comparison) -> Axes:
    """Draws B − A for each component, in the colour of the one that expects more.

    Args:
        ax: the axes to draw on.
        comparison: what is drawn.

    Returns:
        `ax`.
    """
    axis, difference = comparison.time_axis, comparison.difference
    colours = tuple(_COLOURS[int(value > 0.0)] for value in difference.value)
    _bars(ax, difference, axis, colours, 0.0, 0.6)
    ax.set_title("B − A: up where B expects more", fontsize=9, loc="left", color=_MUTED)
    _dressed(ax, axis)
    room = room_for(difference.value[None])
    if room is not None:
        cut_off(ax, room, [(float(positions(axis)[-1]), float(difference.value[-1]))])
    return ax


def _bars(
    ax: Axes,
    found: Estimates,
    axis: TimeAxis,
    colours: tuple[str, ...],
    offset: float,
    width: float,
) -> None:
    x = positions(axis) + offset
    explicit, residual = list(colours[:-1]), colours[-1]
    ax.bar(x[:-1], found.value[:-1], width, color=explicit)
    ax.bar(x[-1:], found.value[-1:], width, fc="white", ec=residual, hatch="////")
    shown = np.isfinite(found.low)
    ends = np.stack([found.value - found.low, found.high - found.value])[:, shown]
    ax.errorbar(
        x[shown], found.value[shown], np.maximum(ends, 0.0), fmt="none", ecolor="black", capsize=1.5
    )


def _dressed(ax: Axes, axis: TimeAxis) -> Axes:
    label_steps(ax, axis, positions(axis))
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8)
    ax.margins(y=0.15)
    return ax
