"""One state of a solved world, explained: as a page of text, or as plain data for JSON."""

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from trdlab.explanations.moment.exact import MAX_WHAT_IF_STATES
from trdlab.explanations.moment.explanation import Explanation
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.sentences import sentence
from trdlab.formatting import plain
from trdlab.show.page import action_table, fit, story
from trdlab.tabular import ExactTable

_MOST_ERROR = 1e-6  # of the largest Q-value, beyond which it is not called exact


@dataclass(frozen=True)
class Scene:
    """What stands around the numbers: which world and state this is, and what can be tried next.

    Args:
        schema: the name and version of the JSON object.
        kind: what the world is called, such as `map`.
        heading: the first line.
        caption: the title of the picture.
        place: the state in words, empty where it has only a number.
        rules: what else decides the numbers, such as a slip probability.
        drawing: the map as text, empty where there is none.
        legend: what its symbols mean, a line for each.
        notes: what the numbers leave out.
        next_step: a command that shows something new.
        world: what the JSON object says of the world.
        state: what it says of the state, besides its index.
    """

    schema: str
    kind: str
    heading: str
    caption: str
    place: str
    rules: tuple[str, ...]
    drawing: str
    legend: tuple[str, ...]
    next_step: str
    notes: tuple[str, ...] = ()
    world: dict[str, Any] = field(default_factory=dict)
    state: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Report:
    """A world's exact table, one of its states, and the explanation of that state.

    Args:
        scene: which world and state it is.
        table: the exact decomposition.
        state: the index of the explained state.
        explanation: what was found about it.
    """

    scene: Scene
    table: ExactTable
    state: int
    explanation: Explanation

    @property
    def sum_error(self) -> float:
        """The largest difference, over all states and actions, of Σ components and Q."""
        return float(np.abs(self.table.decomposition.value - self.table.solution.q_values).max())

    @property
    def largest(self) -> float:
        """The largest Q-value, as an amount."""
        return float(np.abs(self.table.solution.q_values).max())

    @property
    def error_bound(self) -> float:
        """How far the Q-values can be from the exact ones (proven)."""
        return float(self.table.solution.error_bound.max())


def page(report: Report, *, ascii_only: bool = False) -> RenderableType:
    """Returns the report as text: map, actions, story, the check, and what to try next.

    Args:
        report: what is shown.
        ascii_only: for terminals without UTF-8.
    """
    scene, axis, explanation = report.scene, report.table.time_axis, report.explanation
    here = f"state {report.state}" + f" ({scene.place})" * bool(scene.place)
    rules = [f"γ = {plain(axis.gamma)}", f"N = {axis.horizon}", f"w = {axis.width}", here]
    unsearched = (
        "What would flip the preference was not searched: "
        f"this {scene.kind} has over {MAX_WHAT_IF_STATES} states."
    )

    def line(text: str, style: str = "") -> Text:
        return Text(fit(text, ascii_only=ascii_only), style=style)

    summed = f"Components sum to Q (largest difference {report.sum_error:.0e});"
    bound = f"{report.error_bound:.0e}"
    check = (
        line(f"✓ {summed} Q is exact to {bound} (proven).", "green")
        if report.error_bound <= _MOST_ERROR * max(1.0, report.largest)
        else line(f"{summed} γ is so close to 1 that Q is only known to {bound}.", "red")
    )

    is_searched = explanation.foil is None or bool(explanation.moment.what_ifs)
    return Group(
        line(scene.heading, "bold"),
        line(" · ".join([*rules, *scene.rules]), "dim"),
        _map_and_legend(scene, ascii_only=ascii_only),
        *(line(note, "dim") for note in scene.notes),
        *([line("")] if scene.notes else []),
        line("Expected discounted reward of each action, by the step it is expected at"),
        action_table(
            explanation.moment, explanation.action, explanation.foil, ascii_only=ascii_only
        ),
        line(""),
        story(explanation, ascii_only=ascii_only),
        *([] if is_searched else [line(unsearched, "dim")]),
        line(""),
        check,
        line(f"Try: {scene.next_step}", "dim"),
    )


def to_dict(report: Report) -> dict[str, Any]:
    """Returns the report as plain data at full precision; `null` where no total exists."""
    explanation, moment = report.explanation, report.explanation.moment
    return {
        "schema": report.scene.schema,
        **report.scene.world,
        "time_axis": {**asdict(report.table.time_axis), "labels": report.table.time_axis.labels},
        "future": moment.future.to_dict(),
        "state": {"index": report.state, **report.scene.state},
        "actions": actions_to_dict(moment),
        "action": explanation.action,
        "foil": explanation.foil,
        "findings": [
            finding.to_dict() | {"sentence": sentence(finding, explanation)}
            for finding in explanation.findings
        ],
        "checks": {"sum_error": report.sum_error, "error_bound": report.error_bound},
    }


def actions_to_dict(moment: Moment) -> dict[str, Any]:
    """Returns what is known of each action as plain data; `null` where something is not."""
    return {
        name: {
            "components": moment.components(name).tolist(),
            "q_value": moment.q_value(name),
            "undiscounted_total": _or_none(moment.total(name)),
            "probability": None if moment.policy is None else float(moment.policy[i]),
            "changes_state": None if moment.changes_state is None else moment.changes_state[i],
            **_uncertainty(moment, i),
        }
        for i, name in enumerate(moment.action_names)
    }


def _uncertainty(moment: Moment, action: int) -> dict[str, Any]:
    known = moment.uncertainty
    if known is None:
        return {}
    return {
        "deviation": known.deviation[action].tolist(),
        "return_deviation": float(known.return_deviation[action]),
        "survival": known.survival[action].tolist(),
    }


def _map_and_legend(scene: Scene, *, ascii_only: bool) -> RenderableType:
    if not scene.drawing:
        return Text("")
    legend = Text("\n".join(fit(entry, ascii_only=ascii_only) for entry in scene.legend))
    drawing = Text(fit(scene.drawing, ascii_only=ascii_only))
    return Padding(Columns([drawing, legend], padding=(0, 4)), (1, 0, 1, 2))


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value
