"""Scenes: what stands around the numbers of a solved world, and which state it is."""

import math
from dataclasses import dataclass, field
from functools import singledispatch
from typing import Any

from trdlab.environments.arguments import say_arguments
from trdlab.formatting import amount, plain
from trdlab.gridworld import Gridworld
from trdlab.gridworld.ansi import DRONE, ansi
from trdlab.tabular.named import TabularWorld

_LIMIT = "The environment cuts episodes off after {} steps; the model does not."
_NEVER = "Episodes are over in this state, or never come to it."


@dataclass(frozen=True)
class Scene:
    """What stands around the numbers: which world and state this is.

    Args:
        schema: the name and version of the JSON object.
        heading: the first line.
        caption: the title of the picture.
        place: the state in words, empty where it has only a number.
        rules: what else decides the numbers, such as a slip probability.
        drawing: the map as text, empty where there is none.
        legend: what its symbols mean.
        notes: what the numbers leave out.
        world: what the JSON object says of the world.
        state: what it says of the state, besides its index.
    """

    schema: str
    heading: str
    caption: str
    place: str
    rules: tuple[str, ...]
    drawing: str
    legend: tuple[str, ...]
    notes: tuple[str, ...] = ()
    world: dict[str, Any] = field(default_factory=dict)
    state: dict[str, Any] = field(default_factory=dict)


@singledispatch
def scene_of(world: Gridworld | TabularWorld, state: int) -> Scene:
    """Returns the scene of a state of a solved world."""
    raise TypeError(f"there is no scene of {type(world).__name__}")


@scene_of.register
def _(world: Gridworld, state: int) -> Scene:
    grid, here = world.grid, world.states[state]
    rules = [f"slip {plain(grid.slip)}"] * bool(grid.slip)
    rules += [f"each step costs {plain(grid.step_cost)}"] * bool(grid.step_cost)
    return Scene(
        schema="trdlab.gridworld/2",
        heading=f"{grid.name} · {grid.title}" if grid.title else grid.name,
        caption=grid.title or grid.name,
        place=str(here),
        rules=tuple(rules),
        drawing=ansi(world, state),
        legend=tuple(_legend(world)),
        world={
            "map": {
                "name": grid.name,
                "title": grid.title,
                "rows": list(grid.rows),
                "slip": grid.slip,
                "step_cost": grid.step_cost,
                "num_states": len(world.states),
            }
        },
        state={
            "row": here.row,
            "column": here.column,
            "collected": sorted(map(list, here.collected)),
        },
    )


@scene_of.register
def _(world: TabularWorld, state: int) -> Scene:
    mdp = world.mdp
    told = {k: v for k, v in world.arguments.items() if isinstance(v, bool | str)}
    notes = [_NEVER] * (not world.visited[state] and not mdp.terminal_states[state])
    notes += [_LIMIT.format(world.time_limit)] * (world.time_limit is not None)
    return Scene(
        schema="trdlab.tabular/2",
        heading=f"{world.name} · {mdp.num_states} states, {mdp.num_actions} actions",
        caption=" · ".join(filter(None, (world.name, say_arguments(told)))),
        place=world.describe(state),
        rules=tuple(say_arguments({name: value}) for name, value in told.items()),
        drawing=world.draw(state),
        legend=tuple(world.legend),
        notes=tuple(notes),
        world={
            "environment": {
                "id": world.name,
                "arguments": {k: v for k, v in world.arguments.items() if _is_plain(v)},
                "num_states": mdp.num_states,
                "time_limit": world.time_limit,
            }
        },
        state={
            "coordinates": dict(
                zip((c.name for c in world.coordinates), world.place(state), strict=True)
            ),
            "description": world.describe(state),
            "visited": bool(world.visited[state]),
        },
    )


def _legend(world: Gridworld) -> list[str]:
    """Returns what each symbol on the map means."""
    grid = world.grid
    entries = [f"{DRONE} the drone"]
    for symbol in dict.fromkeys("".join(grid.rows)):
        cell = grid.legend[symbol]
        if symbol == "S" or cell.kind == "floor":
            continue
        words: list[str] = [cell.kind]
        if cell.kind not in ("wall", "one-way"):
            words += [f"{amount(cell.value)}"] * bool(cell.value)
            words += ["each time"] * (cell.kind in ("hazard", "fountain") and not cell.terminal)
            words += ["(ends)"] * cell.terminal
        entries.append(f"{symbol} {' '.join(words)}")
    if grid.wind is not None:
        blows = world.action_names[grid.wind.direction]
        entries.append(f"wind {blows}: {' '.join(map(str, grid.wind.strengths))}")
    return entries


def _is_plain(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, bool | int | str)
