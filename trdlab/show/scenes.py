"""Scenes: what stands around the numbers of a solved world, and which state it is."""

import math
from typing import Any, NamedTuple

from trdlab.formatting import plain
from trdlab.gridworld import Gridworld
from trdlab.gridworld.ansi import ansi, legend
from trdlab.tabular.named import TabularWorld

_LIMIT = "The environment cuts episodes off after {} steps; the model does not."
_NEVER = "Episodes are over in this state, or never come to it."


class Scene(NamedTuple):
    """What stands around the numbers: which world and state this is.

    Args:
        heading: the first line.
        caption: the title of the picture.
        place: the state in words, empty where it has only a number.
        rules: what else decides the numbers, such as a slip probability.
        drawing: the map as text, empty where there is none.
        legend: what its symbols mean.
        world: what JSON says of the world, and in which schema.
        state: what it says of the state, besides its index.
        notes: what the numbers leave out.
    """

    heading: str
    caption: str
    place: str
    rules: tuple[str, ...]
    drawing: str
    legend: tuple[str, ...]
    world: dict[str, Any]
    state: dict[str, Any]
    notes: tuple[str, ...] = ()


def scene_of(world: Gridworld | TabularWorld, state: int) -> Scene:
    """Returns the scene of a state of a solved world."""
    return _on_map(world, state) if isinstance(world, Gridworld) else _in_table(world, state)


def _on_map(world: Gridworld, state: int) -> Scene:
    grid, here = world.grid, world.states[state]
    collected = sorted(map(list, here.collected))
    rules = [f"slip {plain(grid.slip)}"] * bool(grid.slip)
    rules += [f"each step costs {plain(grid.step_cost)}"] * bool(grid.step_cost)
    told = {name: getattr(grid, name) for name in ("name", "title", "rows", "slip", "step_cost")}
    return Scene(
        heading=f"{grid.name} · {grid.title}" if grid.title else grid.name,
        caption=grid.title or grid.name,
        place=str(here),
        rules=tuple(rules),
        drawing=ansi(world, state),
        legend=legend(world),
        world={"schema": "trdlab.gridworld/2", "map": {**told, "num_states": len(world.states)}},
        state={"row": here.row, "column": here.column, "collected": collected},
    )


def _in_table(world: TabularWorld, state: int) -> Scene:
    from trdlab.environments.arguments import say_arguments  # gridworlds do without it

    mdp, here = world.mdp, world.describe(state)
    told = {k: v for k, v in world.arguments.items() if isinstance(v, bool | str)}
    notes = [_NEVER] * (not world.visited[state] and not mdp.terminal_states[state])
    notes += [_LIMIT.format(world.time_limit)] * (world.time_limit is not None)
    notes += world.notes
    names = [coordinate.name for coordinate in world.coordinates]
    return Scene(
        heading=f"{world.name} · {mdp.num_states} states, {mdp.num_actions} actions",
        caption=" · ".join(filter(None, (world.name, say_arguments(told)))),
        place=here,
        rules=tuple(say_arguments({name: value}) for name, value in told.items()),
        drawing=world.draw(state),
        legend=world.legend,
        notes=tuple(notes),
        world={
            "schema": "trdlab.tabular/2",
            "environment": {
                "id": world.name,
                "arguments": {k: v for k, v in world.arguments.items() if _is_plain(v)},
                "num_states": mdp.num_states,
                "time_limit": world.time_limit,
            },
        },
        state={
            "coordinates": dict(zip(names, world.place(state), strict=True)),
            "description": here,
            "visited": bool(world.visited[state]),
        },
    )


def _is_plain(value: Any) -> bool:
    return isinstance(value, int | str) or (isinstance(value, float) and math.isfinite(value))
