"""Explanations as matplotlib pictures: axes in, axes out.

Actions are told apart by hue, lightness and hatching at once, so that pictures survive greyscale
and colour-blindness. Steps run to the right; the residual stands apart, hatched.
"""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.explanations.moment.leads import difference
from trdlab.explanations.moment.moment import Moment
from trdlab.files import check_output, write_whole
from trdlab.formatting import amount, decimals_for, number, plain
from trdlab.gridworld import Gridworld
from trdlab.gridworld.gridmap import MOVES
from trdlab.gridworld.render import draw_map
from trdlab.show.gridworld import GridworldReport
from trdlab.show.plots.steps_axis import STEPS, label_steps, positions, share_scale
from trdlab.show.report import Report, Scene
from trdlab.tabular import ExactTable

PICTURE_SUFFIXES = (".png", ".pdf", ".svg")

_ACTION = "#1f4e8c"  # dark; its route is solid
_FOIL = "#e39a2d"  # light; its route is dashed
_MUTED = "#5b6470"
_POLICY = "#2f7d4f"
_MOST_NUMBERS = 9  # written at the bars
_MOST_LABELS = 12
_MOST_ROUTE_STEPS = 1_000
_POINT = 1.25 / 330  # a point of a line's height, as a share of the panel's


def check_picture(path: Path, *, overwrite: bool = False) -> None:
    """Checks that a picture can be written to a path.

    Raises:
        OutputError: unknown ending, no such folder, not writable, or the file exists.
    """
    check_output(path, PICTURE_SUFFIXES, overwrite=overwrite)


def save_report(report: Report, path: Path) -> None:
    """Writes the picture of a report; the ending of `path` says in which format.

    Raises:
        OutputError: it cannot be written.
    """
    figure = report_figure(report)
    write_whole(path, lambda temporary: figure.savefig(temporary, dpi=160))


def report_figure(report: Report) -> Figure:
    """Returns the picture of a report: the map with its routes, the bars, the contrast."""
    moment, axis = report.explanation.moment, report.table.time_axis
    action, foil = report.explanation.action, report.explanation.foil
    layout = ConstrainedLayoutEngine(rect=(0.0, 0.04, 1.0, 0.96))  # the foot of the page is free
    figure = Figure(figsize=(11.0, 5.8), layout=layout)
    figure.suptitle(report.scene.caption, fontsize=12)
    panels: Any = figure.subfigures(1, 2, width_ratios=(1.0, 1.35))
    left, right = panels
    map_ax = left.subplots()
    if isinstance(report, GridworldReport):
        plot_map(map_ax, report.world, report.table, report.state, action, foil)
    else:
        plot_scene(map_ax, report.scene, report.state)
    names = [action] if foil is None else [action, foil]
    axes: list[Axes] = list(
        np.atleast_1d(right.subplots(len(names) + (foil is not None), 1, sharex=True))
    )
    for ax, name, colour in zip(axes, names, (_ACTION, _FOIL), strict=False):
        plot_components(ax, moment.components(name), axis, colour=colour)
        plot_uncertainty(ax, moment, name)
        ax.set_title(_title(moment, name), fontsize=10, loc="left")
    if foil is not None:
        plot_contrast(axes[-1], moment, action, foil)
        for ax in axes[:-1]:
            ax.label_outer()
        share_scale(axes[:-1])
    right.supylabel("expected discounted reward", fontsize=9, color=_MUTED)
    meaning = whiskers(moment)
    figure.text(
        0.5,
        0.012,
        f"γ = {plain(axis.gamma)}, N = {axis.horizon}, w = {axis.width} · after the first action "
        f"the future of {moment.future.policy} · {moment.future.reward} · ends at "
        f"{moment.future.ending}{meaning and f' · {meaning}'}",
        fontsize=8,
        color=_MUTED,
        ha="center",
    )
    return figure


def plot_map(
    ax: Axes, world: Gridworld, table: ExactTable, state: int, action: str, foil: str | None = None
) -> Axes:
    """Draws a state of a gridworld, the policy, and the route that each action leads to.

    A route follows the likeliest outcome of the action, then of the policy's likeliest actions,
    until the episode ends or comes back to where it was.

    Args:
        ax: the axes to draw on.
        world: the gridworld.
        table: its table; the routes follow its policy.
        state: the index of the state.
        action: the name of the explained action; its route is solid.
        foil: the name of its foil; its route is dashed.

    Returns:
        `ax`.
    """
    draw_map(ax, world, state)
    _plot_policy(ax, world, table, state)
    solid, dashed = (action, _ACTION, "-", -0.12), (foil, _FOIL, (0, (3, 1.5)), 0.12)
    for name, colour, line, offset in (dashed, solid) if foil else (solid,):
        states = route(table, state, world.action_names.index(name))
        places = [world.states[s].place for s in states]
        x = [column + 0.5 + offset for _, column in places]
        y = [row + 0.5 + offset for row, _ in places]
        ax.plot(x, y, color=colour, linestyle=line, linewidth=2.5, zorder=5, label=name)
        if len(places) > 1:
            ax.annotate(
                "",
                (x[-1], y[-1]),
                (x[-2], y[-2]),
                arrowprops={"arrowstyle": "-|>", "color": colour, "mutation_scale": 16},
                zorder=6,
            )
    ax.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.02),
        ncols=2,
        frameon=False,
        title="route after (wedges: the policy)",
        fontsize=9,
        title_fontsize=8,
        reverse=True,
    )
    return ax


def plot_scene(ax: Axes, scene: Scene, state: int) -> Axes:
    """Writes the map of a state as text, with its legend.

    Args:
        ax: the axes to write on.
        scene: the world and the state.
        state: the index of the state.

    Returns:
        `ax`.
    """
    ax.axis("off")
    lines = scene.drawing.splitlines()
    size = min(26.0, 280.0 / max([1, *map(len, lines)]))
    ax.text(0.5, 1.0, scene.drawing, family="monospace", fontsize=size, ha="center", va="top")
    below = 0.95 - len(lines) * size * _POINT
    words = [f"state {state}", scene.place, "", *scene.legend]
    ax.text(0.5, below, "\n".join(words), ha="center", va="top", linespacing=1.4)
    return ax


def _plot_policy(ax: Axes, world: Gridworld, table: ExactTable, state: int) -> None:
    """Draws a small wedge at the edge of each cell through which the policy leaves it."""
    here = world.states[state]
    for index, at in enumerate(world.states):
        if at.collected != here.collected or world.is_terminal(index):
            continue
        for action, (down, right) in enumerate(MOVES):
            if table.solution.policy[index, action] > 0.0:
                x, y = at.column + 0.5 + 0.42 * right, at.row + 0.5 + 0.42 * down
                tip, side = (0.07 * right, 0.07 * down), (0.09 * down, 0.09 * right)
                wedge = [
                    (x + tip[0], y + tip[1]),
                    (x - side[0], y - side[1]),
                    (x + side[0], y + side[1]),
                ]
                ax.fill(*zip(*wedge, strict=True), color=_POLICY, linewidth=0, zorder=4)


def route(table: ExactTable, state: int, action: int) -> list[int]:
    """Returns the states of the likeliest episode that begins with an action, until it repeats.

    Args:
        table: the model, and the policy to follow.
        state: where it begins.
        action: the index of the first action.
    """
    mdp, policy = table.mdp, table.solution.policy
    states = [state]
    for _ in range(_MOST_ROUTE_STEPS):
        row = states[-1] * mdp.num_actions + action
        outcomes = slice(mdp.offsets[row], mdp.offsets[row + 1])
        likeliest = mdp.offsets[row] + int(mdp.probabilities[outcomes].argmax())
        following = int(mdp.next_states[likeliest])
        ended = bool(mdp.terminated[likeliest])
        if following in states[1:]:
            return [*states, following]
        if following != states[-1]:
            states.append(following)
        if ended:
            break
        action = int(policy[following].argmax())
    return states


def plot_components(ax: Axes, components: FloatArray, axis: TimeAxis, *, colour: str) -> Axes:
    """Draws a bar per component: explicit ones filled, the residual hatched and set apart.

    Args:
        ax: the axes to draw on.
        components: `[N+1]`.
        axis: what they mean.
        colour: the colour of the bars.

    Returns:
        `ax`.
    """
    places = positions(axis)
    ax.bar(places[:-1], components[:-1], color=colour, width=0.8)
    ax.bar(places[-1:], components[-1:], fc="white", ec=colour, hatch="////", width=0.8)
    ax.axhline(0.0, color="black", linewidth=0.8)
    decimals = decimals_for(components)
    if axis.num_components <= _MOST_NUMBERS:
        for x, y in zip(places, components, strict=True):
            ax.annotate(
                number(float(y), decimals),
                (x, y),
                xytext=(0, 2 if y >= 0 else -2),
                textcoords="offset points",
                ha="center",
                va="bottom" if y >= 0 else "top",
                fontsize=8,
                bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 0.6},
                zorder=5,
            )
    label_steps(ax, axis, places)
    ax.set_xlabel(STEPS, fontsize=9, color=_MUTED)
    ax.margins(y=0.2)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8)
    return ax


def plot_uncertainty(ax: Axes, moment: Moment, action: str) -> Axes:
    """Adds whiskers to an action's bars, and the chance of still being alive where it is known.

    A whisker is one standard deviation of the reward; where that is not known, what such forecasts
    are off by (see `whiskers`). Survival is a thin line of steps, read on the right; it is left out
    where the episode cannot end within the components.

    Args:
        ax: the axes with the bars.
        moment: the decompositions, and their uncertainty or error.
        action: the name of the action.

    Returns:
        `ax`.
    """
    a, places = moment.index(action), positions(moment.time_axis)
    means, length = moment.components(action), _lengths(moment)[a]
    shown = length > 0.0  # not so if it is NaN
    ax.errorbar(places[shown], means[shown], length[shown], fmt="none", ecolor="black", capsize=2.0)
    if moment.uncertainty is not None and moment.uncertainty.survival[a, -1] < 1.0:
        right = ax.twinx()
        right.step(
            places, moment.uncertainty.survival[a], where="mid", color=_POLICY, linewidth=1.0
        )
        right.set(ylim=(0.0, 1.15), yticks=(0.0, 0.5, 1.0))
        right.set_ylabel("still running", fontsize=8, color=_POLICY)
        right.tick_params(labelsize=7, colors=_POLICY)
        right.spines[["top", "left"]].set_visible(False)
    return ax


def whiskers(moment: Moment) -> str:
    """Returns what the whiskers of `plot_uncertainty` mean, empty where there are none."""
    if not (_lengths(moment) > 0.0).any():
        return ""
    if moment.uncertainty is not None:
        return "whiskers: one standard deviation"
    return "whiskers: what such forecasts are off by (root mean square)"


def _lengths(moment: Moment) -> FloatArray:
    """Returns `[A, N+1]`: how long whiskers are, 0 or NaN where there are none."""
    if moment.uncertainty is not None:
        return moment.uncertainty.deviation
    none = np.zeros(moment.time_axis.num_components)
    errors = [moment.error_of(action) for action in moment.action_names]
    return np.stack([none if error is None else error for error in errors])


def plot_contrast(ax: Axes, moment: Moment, action: str, foil: str) -> Axes:
    """Draws action minus foil, component by component: up where the action pays more.

    Args:
        ax: the axes to draw on.
        moment: the decompositions.
        action: the name of an action.
        foil: the name of another.

    Returns:
        `ax`.
    """
    delta = difference(moment, action, foil)
    plot_components(ax, delta, moment.time_axis, colour=_MUTED)
    for bar, value in zip(ax.patches, delta, strict=False):
        colour = _ACTION if value > 0 else _FOIL
        bar.set_edgecolor(colour)
        if bar.get_hatch() is None:
            bar.set_facecolor(colour)
    gap = moment.q_value(action) - moment.q_value(foil)
    ax.set_title(f"{action} − {foil}: {_short(gap)} in all", fontsize=10, loc="left")
    return ax


def _title(moment: Moment, action: str) -> str:
    total = moment.total(action)
    undiscounted = "" if np.isnan(total) else f", {amount(total)} undiscounted"
    return f"{action}: Q = {_short(moment.q_value(action))}{undiscounted}"


def _short(value: float) -> str:
    return number(value, decimals_for([value]))
