"""Maps: where each action leads, where an episode went, and the picture of a solved world."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from trdlab.arrays import FloatArray
from trdlab.explanations.solved import SolvedState
from trdlab.gridworld import Gridworld
from trdlab.gridworld.gridmap import MOVES
from trdlab.gridworld.render import ABOVE_ROUTES, draw_map
from trdlab.show.plots import bars, style
from trdlab.show.plots.moment import moment_figure, names_of, without_noise
from trdlab.show.scenes import Scene, scene_of
from trdlab.tabular import ExactTable

_MOST_ROUTE_STEPS = 1_000
_LINES, _LANES = ("-", (0, (2.2, 1.0))), (-0.12, 0.12)  # of the action's route and of the foil's
_TALLEST = 3.2  # inches


def solved_figure(solved: SolvedState) -> Figure:
    """Returns the picture of a solved world: its map, and below it the bars of a state."""
    choice, world, state = solved.choice, solved.world, solved.state
    scene = scene_of(world, state)

    def draw(ax: Axes) -> None:
        if isinstance(world, Gridworld):
            plot_map(ax, world, solved.table, state, names_of(choice))
        else:
            plot_scene(ax, scene, state)

    words = max(1.6 * len(scene.drawing.splitlines()), 3.0 + len(scene.legend))
    height = map_height(world) if isinstance(world, Gridworld) else 0.2 * words
    bound = float(solved.table.solution.error_bound[state].max())
    return moment_figure(
        replace(choice, moment=without_noise(choice.moment, bound)),
        scene.caption,
        above=(height, draw),
    )


@style.settings()
def world_figure(world: Gridworld, state: int = 0) -> Figure:
    """Returns the picture of a gridworld in one of its states."""
    figure = style.new_figure(0.3 + map_height(world), world.grid.title)
    draw_map(figure.subplots(), world, state)
    return figure


def map_height(world: Gridworld) -> float:
    """Returns how many inches a map takes that is as wide as a picture, or as tall as is good."""
    rows, columns = world.grid.shape
    return min(_TALLEST, 0.9 * style.WIDTH * rows / columns)


def plot_map(
    ax: Axes, world: Gridworld, table: ExactTable, state: int, actions: Sequence[str]
) -> Axes:
    """Draws a state of a gridworld on `ax`, which is returned, with the policy and routes.

    There is a `route` after each of one or two `actions`; that after the second is dashed.
    """
    draw_map(ax, world, state)
    _draw_policy(ax, world, table, state)
    colours, handles = style.action_colours(world.action_names), []
    for name, line, lane in zip(actions, _LINES, _LANES, strict=False):
        states = route(table, state, world.action_names.index(name))
        drawn = plot_route(ax, world, states, colours[name], line=line, lane=lane)
        drawn.set_label(f"route after {name}")
        handles.append(drawn)
    handles.append(bars.handle("the policy", "", ">", style.MUTED, style.MUTED))
    place: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 0.3}
    ax.legend(handles=handles, ncols=3, frameon=False, fontsize=style.TEXT, **place)
    return ax


def plot_route(
    ax: Axes,
    world: Gridworld,
    states: Sequence[int],
    colour: str = style.INK,
    *,
    line: Any = "-",
    lane: float = 0.0,
) -> Line2D:
    """Draws a way over a map, on the ground: it hides nothing, and stops before what it leads to.

    Args:
        ax: the axes with the map.
        world: the gridworld.
        states: those that the way goes through.
        colour: of the line.
        line: its style, as matplotlib has it.
        lane: how far beside the middle of the cells it goes.

    Returns:
        The line.
    """
    places = [place for place, _ in groupby(world.states[state].place for state in states)]
    points = np.array(places, dtype=np.float64)[:, ::-1] + 0.5 + lane  # [K, 2] of x, y
    if len(points) > 1:
        ahead = points[-1] - points[-2]
        ahead /= max(np.abs(ahead).max(), 1.0)
        if world.grid.cell(*places[-1]).kind != "floor":
            points[-1] -= 0.53 * ahead + lane * np.abs(ahead)
        head = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 14, "linewidth": 0}
        head |= {"shrinkA": 0, "shrinkB": 0}
        way = points[-1], points[-1] - 0.3 * ahead
        ax.annotate("", *way, arrowprops=head, zorder=ABOVE_ROUTES + 1.0)
        points[-1] -= 0.1 * ahead
    (drawn,) = ax.plot(*points.T, color=colour, linestyle=line, linewidth=2.5, zorder=3)
    return drawn


def plot_scene(ax: Axes, scene: Scene, state: int) -> Axes:
    """Writes the map of a state as text with its legend on `ax`, which is returned."""
    ax.axis("off")
    lines = [f"state {state}", *fill(scene.place, 36).splitlines(), *scene.legend]
    ax.text(0.25, 1.0, scene.drawing, family="monospace", fontsize=17, ha="center", va="top")
    left = 0.5 if scene.drawing else 0.3
    ax.text(left, 1.0, "\n".join(lines), fontsize=style.TEXT, va="top", linespacing=1.4)
    return ax


def route(table: ExactTable, state: int, action: int) -> list[int]:
    """Returns the states of the likeliest episode that begins with an action, until it repeats."""
    mdp, policy, states = table.mdp, table.solution.policy, [state]
    for _ in range(_MOST_ROUTE_STEPS):
        row = states[-1] * mdp.num_actions + action
        outcomes = slice(mdp.offsets[row], mdp.offsets[row + 1])
        likeliest = mdp.offsets[row] + int(mdp.probabilities[outcomes].argmax())
        following = int(mdp.next_states[likeliest])
        if following in states[1:]:
            return [*states, following]
        states += [following] * (following != states[-1])
        if mdp.terminated[likeliest]:
            break
        action = int(policy[following].argmax())
    return states


def _draw_policy(ax: Axes, world: Gridworld, table: ExactTable, state: int) -> None:
    """Draws a small wedge at the edge of each cell through which the policy leaves it."""
    wedges: list[FloatArray] = []
    for index, at in enumerate(world.states):
        if at.collected == world.states[state].collected and not world.is_terminal(index):
            for action in np.flatnonzero(table.solution.policy[index]):
                down, right = MOVES[action]
                middle, ahead = np.array([at.column, at.row]) + 0.5, np.array([right, down])
                side, back = 0.1 * ahead[::-1], middle + 0.38 * ahead
                wedges.append(np.stack([middle + 0.47 * ahead, back - side, back + side]))
    ax.add_collection(PolyCollection(wedges, facecolors=style.MUTED, linewidths=0, zorder=2))
