"""An episode: what was done, what was expected all along, and the rewards that came."""

from itertools import groupby, pairwise
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration.calibration import Trust
from trdlab.explanations.episode.played import Played
from trdlab.explanations.episode.story import Story, place
from trdlab.gridworld import Gridworld
from trdlab.gridworld.render import draw_map
from trdlab.show.plots import style
from trdlab.show.plots.map import map_height, plot_route
from trdlab.time_axis import axis_title

_SHADES = (style.COST, "#ffffff", style.EXPECTED)
_COLOURS = LinearSegmentedColormap.from_list("costs to rewards", _SHADES)
_REWARDS = LinearSegmentedColormap.from_list("rewards", _SHADES[1:])
_VEIL = 0.6  # of white, over what is not to be trusted
_BESIDE = (-0.04, -0.01)  # of the axes: where the evidence for a row is shown
_HARDLY = 0.02  # negative values below this share of the largest need no colour of their own
_MOST_LABELS = 8
_MOST_DOTS = 60
_MOST_NAMES = 6  # of actions, in the legend
_LETTERS = 52.0  # as wide as the steps of an episode
_NEAR = 0.04  # of the episode: numbers nearer than this share a place
_LINE = 0.19  # inches
_MAP = 0.75  # of the height that a map has elsewhere


@style.settings()
def story_figure(
    told: Story, title: str = "", *, trust: Trust | None = None, world: Gridworld | None = None
) -> Figure:
    """Returns the picture of an episode; the sentence of each key moment stands below it.

    Args:
        told: the story.
        title: of the picture.
        trust: how far such forecasts can be trusted, if that is known.
        world: the gridworld it was played in; its map is drawn, with the way that was taken.
    """
    played, states = told.played, told.played.episode.states
    says = (f"{number}  {claim.sentence}" for number, claim in enumerate(told.moments, 1))
    lines = [line for sentence in says for line in wrap(sentence, style.LETTERS)]
    handles = _handles(played) + style.ground_handles(() if trust is None else trust.status)
    top = 0.0 if world is None or states is None else _MAP * map_height(world)
    figure = style.new_figure(4.6 + top + _LINE * (len(lines) + len(handles) / 2), title)
    ratios = [*[top] * bool(top), 0.3, 2.4, 0.9]
    *maps, strip, ax, below = figure.subplots(len(ratios), 1, height_ratios=ratios)
    if world is not None and states is not None:
        plot_route(draw_map(maps[0], world, states[0]), world, states.tolist())
    plot_actions(strip, played)
    plot_story(ax, below, told, trust)
    extend = _extend(played.episode.predicted)
    bar = figure.colorbar(ax.images[-1], ax=ax, pad=0.02, aspect=14, extend=extend)
    bar.ax.tick_params(labelsize=style.TEXT)
    style.add_legend(figure, handles, *lines, axis_title(played.episode.time_axis))
    return figure


def plot_actions(ax: Axes, played: Played) -> Axes:
    """Draws the action of each step in its colour on `ax`, which is returned.

    Names stand where there is room.
    """
    actions, names, begin = played.episode.actions, played.action_names, 0
    colours, box = style.action_colours(names), {"fc": "white", "ec": "none", "alpha": 0.75}
    for action, run in groupby(actions.tolist()):
        name, length = names[action], len(list(run))
        ax.barh(0.0, length, 1.0, begin - 0.5, color=colours[name], ec="white", lw=0.4)
        if length * _LETTERS / len(actions) > len(name) + 1:
            middle = begin + 0.5 * (length - 1)
            how = {"ha": "center", "va": "center", "bbox": box | {"pad": 1.0}}
            style.note(ax, name, (middle, 0.0), (0, 0), **how)
        begin += length
    ax.set(xlim=(-0.5, len(actions) - 0.5), ylim=(-0.5, 0.5))
    ax.set_axis_off()
    return ax


def plot_story(ax: Axes, below: Axes, told: Story, trust: Trust | None = None) -> Axes:
    """Draws what was expected at each step, the rewards that came, and the numbered key moments.

    On `ax`, which is returned, a column is a step of the episode, and a row is how many steps
    ahead; the residual stands apart on top. A reward that is expected at its right step runs down a
    diagonal until it comes: on `below`, with the same steps. Beside each row is the evidence for
    it; what has not proved better than a guess is pale. The images of `ax` are in discounted
    reward, for a colour bar.
    """
    _plot_expected(ax, told, trust)
    _plot_rewards(below, told)
    _mark_moments(ax, below, told)
    for panel in (ax, below):
        for step in np.flatnonzero(told.played.episode.ends):  # nothing was left to come
            panel.axvline(step + 0.5, color=style.INK, linewidth=1.2, zorder=3, clip_on=False)
    return ax


def _handles(played: Played) -> list[Patch]:
    """Returns what the legend shows of the actions: those that were taken most often."""
    names, counts = played.action_names, np.bincount(played.episode.actions)
    often = np.argsort(-counts, kind="stable")[:_MOST_NAMES]
    colours = style.action_colours(names)
    taken = [names[action] for action in sorted(often.tolist()) if counts[action]]
    return [Patch(color=colours[name], label=name) for name in taken]


def _plot_expected(ax: Axes, told: Story, trust: Trust | None) -> None:
    axis, expected = told.played.episode.time_axis, told.played.episode.predicted  # [T, N+1]
    horizon = axis.horizon
    top = horizon + max(0.5, 0.04 * horizon) if horizon else 0.0  # the residual, apart from others
    low, high = _limits(expected)
    how: dict[str, Any] = {"cmap": _COLOURS if low < 0.0 else _REWARDS, "vmin": low, "vmax": high}
    blocks = [(expected[:, -1:], top)] + ([(expected[:, :-1], 0.0)] if horizon else [])
    for block, bottom in blocks:
        steps, rows = block.shape
        extent = (-0.5, steps - 0.5, bottom - 0.5, bottom + rows - 0.5)
        ax.imshow(block.T, origin="lower", extent=extent, aspect="auto", **how)
    for row, found in enumerate(() if trust is None else trust.status):
        at = row if row < horizon else top
        ends, look = (at - 0.5, at + 0.5), {"linewidth": 0, "zorder": 2}
        ax.axhspan(*ends, *_BESIDE, color=style.EVIDENCE[found], clip_on=False, **look)
        if found != "good":
            ax.axhspan(*ends, color="white", alpha=_VEIL, **look)
    shown = [*range(0, horizon, -(-max(horizon, 1) // _MOST_LABELS)), horizon]
    ax.set_yticks([*shown[:-1], top], [axis.label(row) for row in shown])
    ax.set(xlim=(-0.5, len(expected) - 0.5), ylim=(-0.5, top + 0.5), ylabel="expected at")
    style.tidy(ax).tick_params(labelbottom=False)
    if trust is not None:
        ax.tick_params(axis="y", length=0, pad=16)


def _plot_rewards(ax: Axes, told: Story) -> None:
    rewards, is_over = told.played.episode.rewards, told.played.episode.terminated
    at = np.flatnonzero(rewards)
    ax.vlines(at, 0.0, rewards[at], color=style.INK, linewidth=1.5 if at.size < 200 else 0.6)
    for marker, some in (("o", at[rewards[at] > 0.0]), ("v", at[rewards[at] < 0.0])):
        if some.size < _MOST_DOTS:
            ax.plot(some, rewards[some], marker, color=style.INK, markersize=4)
    ax.axhline(0.0, color=style.MUTED, linewidth=0.8)
    if rewards.any():
        ax.margins(y=0.25)
    else:
        ax.set(ylim=(-0.1, 1.0), yticks=(0.0,))
    ax.set(xlim=(-0.5, len(rewards) - 0.5), ylabel="reward", xlabel="step of the episode")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=8))
    ax.yaxis.set_major_locator(MaxNLocator(nbins=3))
    how: Any = {"fontsize": style.TEXT, "color": style.MUTED, "pad": 3.5}
    style.tidy(ax).set_title("ended" if is_over else "cut off", loc="right", **how)


def _mark_moments(ax: Axes, below: Axes, told: Story) -> None:
    """Numbers the moments; where some are near each other, their numbers stand together."""
    places = [place(claim) for claim in told.moments]
    for step in set(places):
        for panel in (ax, below):
            panel.axvline(step, color=style.INK, linewidth=0.7, linestyle=(0, (2, 2)), zorder=3)
    for claim in told.moments:
        if "last" in claim.fields:
            rows = [claim.component] * 2
            for colour, width in (("white", 3.5), (style.INK, 1.5)):
                ax.plot([claim.first, claim.last], rows, color=colour, linewidth=width, zorder=4)
    near = _NEAR * len(told.played.episode)
    starts = [0, *(i + 1 for i, (a, b) in enumerate(pairwise(places)) if b - a > near)]
    how = {"xycoords": ax.get_xaxis_transform(), "ha": "center", "fontweight": "bold"}
    for start, stop in zip(starts, [*starts[1:], len(places)], strict=True):
        if start < stop:
            text = ", ".join(str(number + 1) for number in range(start, stop))
            at = (float(np.mean(places[start:stop])), 1.0)
            style.note(ax, text, at, (0, 3), **how)


def _limits(expected: FloatArray) -> tuple[float, float]:
    """Returns the values `[T, N+1]` that the colours end at: those of the explicit components."""
    largest = float(np.abs(expected[:, :-1]).max(initial=0.0)) or float(np.abs(expected).max())
    has_costs = float(expected.min()) < -_HARDLY * largest
    return (-largest if has_costs else 0.0), largest or 1.0


def _extend(expected: FloatArray) -> Any:
    """Returns at which ends of the colour bar the residual goes on."""
    low, high = _limits(expected)
    ends = expected[:, -1].min() < low - _HARDLY * high, expected[:, -1].max() > high
    names = {(True, True): "both", (True, False): "min", (False, True): "max"}
    return names.get(ends, "neither")
