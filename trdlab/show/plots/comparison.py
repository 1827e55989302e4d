"""Two agents compared: what both expect, component by component, and the difference."""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from trdlab.explanations.comparison.comparison import SIDES, Comparison
from trdlab.formatting import decimals_between
from trdlab.show.plots import bars, style
from trdlab.show.plots.bars import scale_of, settled
from trdlab.time_axis import axis_title

NAME = "comparison.png"
"""What the picture is called in its folder."""

_WIDTH = 0.38  # of a bar


@style.settings()
def comparison_figure(comparison: Comparison) -> Figure:
    """Returns the means of both agents with intervals, and below them their difference."""
    figure = style.new_figure(6.2, " against ".join(comparison.titles))
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    plot_means(above, comparison).tick_params(labelbottom=False)
    plot_difference(below, comparison).set_xlabel(style.STEPS)
    figure.supylabel("expected discounted reward", fontsize=style.TEXT, color=style.MUTED)
    totals = comparison.means.value.sum(axis=1).tolist()
    decimals = decimals_between(*totals)
    handles: list[Artist] = [
        *(
            Patch(color=colour, label=f"{side}: {style.told(total, decimals)} in all")
            for side, colour, total in zip(SIDES, style.AGENTS, totals, strict=True)
        ),
        bars.residual_handle(),
    ]
    if np.isfinite(comparison.means.low).any():
        handles.append(bars.handle("whiskers: 95 % intervals"))
    count = f"mean of {len(comparison.visits)} states of {2 * comparison.episodes} episodes"
    style.add_legend(figure, handles, f"{axis_title(comparison.time_axis)} · {count}")
    return figure


def plot_means(ax: Axes, comparison: Comparison) -> Axes:
    """Draws what each expects of what it would do, side by side, on `ax`, which is returned."""
    axis, means = comparison.time_axis, comparison.means
    values, ends = settled(means.value, comparison.visits.least), np.stack([means.low, means.high])
    scale, places = scale_of(values, ends), style.positions(axis)
    bars.dress(ax, axis, scale)
    for i, colour in enumerate(style.AGENTS):
        offset, colours = (i - 0.5) * (_WIDTH + 0.02), [colour] * axis.num_components
        bars.draw_bars(ax, values[i], axis, colours, scale, offset=offset, width=_WIDTH)
        bars.draw_whiskers(ax, places + offset, ends[:, i], scale)
    return ax


def plot_difference(ax: Axes, comparison: Comparison) -> Axes:
    """Draws B − A in the colour of the one that expects more, on `ax`, which is returned."""
    axis, found = comparison.time_axis, comparison.difference
    values = settled(found.value, comparison.visits.least)
    ends = np.where(values == 0.0, np.nan, np.stack([found.low, found.high]))
    scale, colours = scale_of(values[None], ends), [style.AGENTS[int(v > 0.0)] for v in values]
    bars.dress(ax, axis, scale)
    bars.draw_bars(ax, values, axis, colours, scale, width=0.6)
    bars.draw_whiskers(ax, style.positions(axis), ends, scale)
    ax.set_title("B − A", fontsize=style.TITLE, loc="left")
    return ax
