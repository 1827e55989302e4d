"""What else is expected of an action and its foil: what happens, and what the reward is made of."""

from itertools import cycle

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, PercentFormatter

from trdlab.arrays import FloatArray
from trdlab.estimator import Outlook
from trdlab.explanations.moment.moment import Choice
from trdlab.show.plots import bars, style
from trdlab.show.plots.bars import Scale, scale_of
from trdlab.show.plots.moment import names_of
from trdlab.time_axis import TimeAxis, axis_title

_PANEL = 1.45  # inches that a panel takes
_PAYS, _COSTS = (style.EXPECTED, "#6f93ba", "#b9cde2"), (style.COST, "#df8aa2", "#f3cdd6")
_VEIL = 0.75  # how much of what cannot be told is hidden


@style.settings()
def outcomes_figure(choice: Choice, known: Outlook, title: str = "") -> Figure:
    """Returns a panel for each event and amount, and one of the parts for action and foil each.

    What cannot be told lies behind a grey veil.
    """
    names, others = names_of(choice), (*known.events, *known.amounts)
    panels = [*others, *(names if known.parts else ())]
    figure = style.new_figure(1.3 + _PANEL * len(panels), title)
    axes = np.atleast_1d(figure.subplots(len(panels), 1)).tolist()
    for i, (ax, name) in enumerate(zip(axes, panels, strict=True)):
        (plot_outcome if i < len(others) else plot_parts)(ax, choice, known, name)
        ax.tick_params(labelbottom=ax is axes[-1])
    axes[-1].set_xlabel(style.STEPS)
    colours = style.action_colours(choice.moment.action_names)
    shown = {name: colours[name] for name in names if others} | part_colours(known)
    handles: list[Artist] = [Patch(color=colour, label=name) for name, colour in shown.items()]
    handles += [bars.handle("all together", "", "_")] * bool(known.parts)
    handles += [bars.residual_handle()] * bool(known.parts or known.amounts)
    handles += style.ground_handles(["open"])
    style.add_legend(figure, handles, axis_title(choice.time_axis))
    return figure


def plot_outcome(ax: Axes, choice: Choice, known: Outlook, name: str) -> Axes:
    """Draws the chance of an event, or an amount, of action and foil on `ax`, which is returned."""
    axis, names, of = choice.time_axis, names_of(choice), {**known.events, **known.amounts}[name]
    rows = np.zeros((len(names), axis.num_components))  # [1 or 2, N+1]; events have no residual
    rows[:, : of.shape[1]] = of[[choice.moment.index(action) for action in names]]
    colours, scale = style.action_colours(choice.moment.action_names), scale_of(rows)
    bars.dress(ax, axis, scale)
    width = 0.8 / len(names)
    for i, action in enumerate(names):
        how = {"offset": (i - 0.5 * (len(names) - 1)) * width, "width": width}
        _stack(ax, axis, rows[i][None], [colours[action]], scale, **how)
    if name in known.events:
        ax.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    title = name if name in known.events else f"{name}, discounted"
    return _veiled(ax, axis, known.reach.get(name, 0), title)


def plot_parts(ax: Axes, choice: Choice, known: Outlook, action: str) -> Axes:
    """Stacks what each part of the reward of an action is worth on `ax`, which is returned.

    Costs go down; a dash is all of them together. The scale is that of action and foil.
    """
    axis, at = choice.time_axis, [choice.moment.index(name) for name in names_of(choice)]
    rows = np.stack([*known.parts.values()], axis=1)  # [A, P, N+1]
    ends = [side.sum(axis=1)[at] for side in (rows.clip(min=0.0), rows.clip(max=0.0))]
    scale, own = scale_of(np.concatenate(ends)), rows[choice.moment.index(action)]
    bars.dress(ax, axis, scale)
    _stack(ax, axis, own, [*part_colours(known).values()], scale)
    total = own.sum(axis=0)
    seen = np.where(scale.holds(total), total, np.nan)
    ax.plot(style.positions(axis), seen, "_", color=style.INK, markersize=9, zorder=3)
    reach = min(known.reach.get(part, 0) for part in known.parts)
    return _veiled(ax, axis, reach, f"{action}, made of its parts")


def part_colours(known: Outlook) -> dict[str, str]:
    """Returns the colour of each part: a blue one if it pays on the whole, a red one if not."""
    colours = {True: cycle(_PAYS), False: cycle(_COSTS)}
    return {name: next(colours[bool(rows.sum() >= 0.0)]) for name, rows in known.parts.items()}


def _stack(
    ax: Axes, axis: TimeAxis, rows: FloatArray, colours: list[str], scale: Scale, **how: float
) -> None:
    """Draws rows `[P, N+1]` on each other, what is negative below zero (see `bars.draw_bars`)."""
    for side in (rows.clip(min=0.0), rows.clip(max=0.0)):
        for p in reversed(range(len(rows))):  # the sum of the first ones is in front
            pile, own = side[: p + 1].sum(axis=0), [colours[p]] * rows.shape[1]
            bars.draw_bars(ax, pile, axis, own, scale, told=p + 1 < len(rows), **how)


def _veiled(ax: Axes, axis: TimeAxis, reach: int, title: str) -> Axes:
    ends = style.positions(axis)[[reach, -1]] + (-0.5, 0.5)
    ax.axvspan(*ends, color=style.EVIDENCE["open"], alpha=_VEIL, linewidth=0, zorder=4)
    ax.yaxis.set_major_locator(MaxNLocator(nbins=4))
    ax.set_title(title, fontsize=style.TITLE, loc="left")
    return ax
