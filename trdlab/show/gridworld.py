"""A solved gridworld, explained: one page of text, or one JSON object."""

import math
import shlex
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from trdlab.decomposition import TimeAxis
from trdlab.explain.explanation import Explanation, explain
from trdlab.explain.tabular import MAX_WHAT_IF_STATES, gridworld_moment
from trdlab.formatting import amount, plain
from trdlab.gridworld import Gridworld, load_map, map_names
from trdlab.gridworld.ansi import DRONE, ansi
from trdlab.show.sentences import sentence
from trdlab.show.text import action_table, fit, story
from trdlab.tabular import ExactTable, Ties, exact

SCHEMA = "trdlab.gridworld/1"
_UNSEARCHED = (
    "What would flip the preference was not searched: "
    f"this map has over {MAX_WHAT_IF_STATES} states."
)


@dataclass(frozen=True)
class GridworldReport:
    """A gridworld, its exact table, one of its states, and the explanation of that state.

    Args:
        world: the gridworld.
        table: its exact decomposition.
        state: the index of the explained state.
        explanation: what was found about it.
        map_name: what the map was loaded from, a name or a file.
    """

    world: Gridworld
    table: ExactTable
    state: int
    explanation: Explanation
    map_name: str

    @property
    def sum_error(self) -> float:
        """The largest difference, over all states and actions, of Σ components and Q."""
        return float(np.abs(self.table.decomposition.value - self.table.solution.q_values).max())

    @property
    def error_bound(self) -> float:
        """How far the Q-values can be from the exact ones (proven)."""
        return float(self.table.solution.error_bound.max())


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
    return GridworldReport(world, table, index, explain(moment, action, foil), map_name)


def map_list(*, ascii_only: bool = False) -> RenderableType:
    """Returns a table of the built-in maps and what they teach."""
    table = Table(box=None, padding=(0, 3, 0, 0), header_style="bold", pad_edge=False)
    for heading in ("map", "rows x columns", "states", "what it shows"):
        table.add_column(heading)
    for name in map_names():
        grid = load_map(name)
        rows, columns = grid.shape
        states = len(Gridworld(grid).states)
        row = (name, f"{rows} x {columns}", str(states), grid.title)
        table.add_row(*(Text(fit(cell, ascii_only=ascii_only)) for cell in row))
    return table


def page(report: GridworldReport, *, ascii_only: bool = False) -> RenderableType:
    """Returns the report as text: map, actions, story, the check, and what to try next.

    Args:
        report: what is shown.
        ascii_only: for terminals without UTF-8.
    """
    grid, axis, explanation = report.world.grid, report.table.time_axis, report.explanation
    moment = explanation.moment
    here = f"state {report.state} ({report.world.states[report.state]})"
    rules = [f"γ = {plain(axis.gamma)}", f"N = {axis.horizon}", f"w = {axis.width}", here]
    rules += [f"slip {plain(grid.slip)}"] * bool(grid.slip)
    rules += [f"each step costs {plain(grid.step_cost)}"] * bool(grid.step_cost)
    check = (
        f"✓ Components sum to Q (largest difference {report.sum_error:.0e}); "
        f"Q is exact to {report.error_bound:.0e} (proven)."
    )

    def line(text: str, style: str = "") -> Text:
        return Text(fit(text, ascii_only=ascii_only), style=style)

    legend = Text("\n".join(fit(entry, ascii_only=ascii_only) for entry in _legend(report.world)))
    map_and_legend = Columns([Text(ansi(report.world, report.state)), legend], padding=(0, 4))
    return Group(
        line(f"{grid.name} · {grid.title}" if grid.title else grid.name, "bold"),
        line(" · ".join(rules), "dim"),
        Padding(map_and_legend, (1, 0, 1, 2)),
        line("Expected discounted reward of each action, by the step it is expected at"),
        action_table(
            moment, report.explanation.action, report.explanation.foil, ascii_only=ascii_only
        ),
        line(""),
        story(explanation, ascii_only=ascii_only),
        *([line(_UNSEARCHED, "dim")] if explanation.foil and not moment.what_ifs else []),
        line(""),
        line(check, "green"),
        line(f"Try: {_next_step(report)}", "dim"),
    )


def to_dict(report: GridworldReport) -> dict[str, Any]:
    """Returns the report as plain data at full precision; `null` where no total exists."""
    world, moment, explanation = report.world, report.explanation.moment, report.explanation
    state = world.states[report.state]
    return {
        "schema": SCHEMA,
        "map": {
            "name": world.grid.name,
            "title": world.grid.title,
            "rows": list(world.grid.rows),
            "slip": world.grid.slip,
            "step_cost": world.grid.step_cost,
            "num_states": len(world.states),
        },
        "time_axis": {**asdict(report.table.time_axis), "labels": report.table.time_axis.labels},
        "future": asdict(moment.future),
        "state": {
            "index": report.state,
            "row": state.row,
            "column": state.column,
            "collected": sorted(map(list, state.collected)),
        },
        "actions": {
            name: {
                "components": moment.components(name).tolist(),
                "q_value": moment.q_value(name),
                "undiscounted_total": _or_none(moment.total(name)),
                "probability": float(report.table.solution.policy[report.state, i]),
                "changes_state": bool(moment.changes_state and moment.changes_state[i]),
            }
            for i, name in enumerate(moment.action_names)
        },
        "action": explanation.action,
        "foil": explanation.foil,
        "findings": [
            finding.to_dict() | {"sentence": sentence(finding, explanation)}
            for finding in explanation.findings
        ],
        "checks": {"sum_error": report.sum_error, "error_bound": report.error_bound},
    }


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


def _next_step(report: GridworldReport) -> str:
    """Returns a command that shows something new about this very map."""
    world, axis = report.world, report.table.time_axis
    base = f"trdlab gridworld --map {shlex.quote(report.map_name)} --gamma {plain(axis.gamma)}"
    if axis.width > 1:
        return f"{base} --N {axis.num_steps} --w 1 (the same steps one by one)"
    if any(source.kind == "treasure" for source in world.sources):
        return f"{base} --N {axis.horizon} --treasure 5 --plot treasure.png"
    return f"{base} --N {2 * axis.horizon + 2} (a longer horizon)"


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value
