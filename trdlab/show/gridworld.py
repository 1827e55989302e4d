"""A solved gridworld, explained."""

import shlex
from dataclasses import dataclass
from typing import Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from trdlab.decomposition import TimeAxis
from trdlab.explanations.moment.exact import gridworld_moment
from trdlab.explanations.moment.explanation import explain
from trdlab.formatting import amount, plain
from trdlab.gridworld import Gridworld, load_map, map_names
from trdlab.gridworld.ansi import DRONE, ansi
from trdlab.show.page import fit
from trdlab.show.report import Report, Scene
from trdlab.tabular import Ties, exact

SCHEMA = "trdlab.gridworld/1"


@dataclass(frozen=True)
class GridworldReport(Report):
    """A report, and the gridworld that it speaks of.

    Args:
        world: the gridworld.
    """

    world: Gridworld


def report(
    map_name: str,
    *,
    gamma: float,
    horizon: int,
    width: int = 1,
    slip: float | None = None,
    treasure: float | None = None,
    state: str = "0",
    action: str | None = None,
    foil: str | None = None,
    ties: Ties = "lowest",
) -> GridworldReport:
    """Loads a map, solves it, and explains one of its states.

    Args:
        map_name: the name of a built-in map, or a file.
        gamma: the discount factor.
        horizon: N.
        width: w.
        slip: a slip probability to use in place of the map's own.
        treasure: what treasures pay, in place of the map's own.
        state: the number of a state, or `row,column`.
        action: the action to explain, by default what the policy does.
        foil: the action to contrast it with, by default the best other one.
        ties: whose future is told where optimal actions tie.

    Raises:
        InputError: any of these cannot be used.
    """
    axis = TimeAxis(gamma, horizon, width)
    grid = load_map(map_name)
    grid = grid if slip is None else grid.with_slip(slip)
    grid = grid if treasure is None else grid.with_value("treasure", treasure)
    world = Gridworld(grid)
    index = world.find_state(state)
    table = exact(world.mdp, axis, ties=ties)
    moment = gridworld_moment(world, table, index)
    given = {
        "--slip": slip,
        "--treasure": treasure,
        "--state": None if state == "0" else state,
        "--action": action,
        "--foil": foil,
        "--ties": None if ties == "lowest" else ties,
    }
    scene = _scene(world, index, _next_step(world, map_name, axis, given))
    return GridworldReport(scene, table, index, explain(moment, action, foil), world)


def map_entries() -> list[dict[str, Any]]:
    """Returns what there is to say of each built-in map, as plain data."""
    entries = []
    for name in map_names():
        grid = load_map(name)
        rows, columns = grid.shape
        states = len(Gridworld(grid).states)
        entries.append(
            {"name": name, "rows": rows, "columns": columns, "states": states, "title": grid.title}
        )
    return entries


def map_list(*, ascii_only: bool = False) -> RenderableType:
    """Returns a table of the built-in maps and what they teach."""
    table = Table(box=None, padding=(0, 3, 0, 0), header_style="bold", pad_edge=False)
    for heading in ("map", "rows x columns", "states", "what it shows"):
        table.add_column(heading)
    for entry in map_entries():
        size = f"{entry['rows']} x {entry['columns']}"
        row = (entry["name"], size, str(entry["states"]), entry["title"])
        table.add_row(*(Text(fit(cell, ascii_only=ascii_only)) for cell in row))
    return table


def _scene(world: Gridworld, index: int, next_step: str) -> Scene:
    grid, state = world.grid, world.states[index]
    rules = [f"slip {plain(grid.slip)}"] * bool(grid.slip)
    rules += [f"each step costs {plain(grid.step_cost)}"] * bool(grid.step_cost)
    return Scene(
        schema=SCHEMA,
        kind="map",
        heading=f"{grid.name} · {grid.title}" if grid.title else grid.name,
        caption=grid.title or grid.name,
        place=str(state),
        rules=tuple(rules),
        drawing=ansi(world, index),
        legend=tuple(_legend(world)),
        next_step=next_step,
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
            "row": state.row,
            "column": state.column,
            "collected": sorted(map(list, state.collected)),
        },
    )


def _legend(world: Gridworld) -> list[str]:
    """Returns a line for each symbol on the map."""
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


def _next_step(
    world: Gridworld, map_name: str, axis: TimeAxis, given: dict[str, str | float | None]
) -> str:
    """Returns a command that shows something new about this very map, all else being equal."""
    words = ["trdlab", "gridworld", "--map", map_name, "--gamma", plain(axis.gamma)]
    for option, value in given.items():
        if value is not None:
            words += [option, value if isinstance(value, str) else plain(value)]
    base = shlex.join(words)
    if axis.width > 1:
        return f"{base} --N {axis.num_steps} --w 1 (the same steps one by one)"
    treasures = [source.value for source in world.sources if source.kind == "treasure"]
    if treasures and given["--treasure"] is None:
        richer = plain(treasures[0] + 1.0)
        return f"{base} --N {axis.horizon} --treasure {richer} --plot treasure.png"
    return f"{base} --N {2 * axis.horizon + 2} (a longer horizon)"
