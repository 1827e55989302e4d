"""Nouns as plain data at full precision, for JSON; `null` stands for what is not known."""

from dataclasses import asdict
from functools import singledispatch
from typing import Any

from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.telling import in_brief, sections
from trdlab.explanations.rules import plain_data
from trdlab.explanations.sections import Section
from trdlab.explanations.solved import SolvedState
from trdlab.show.document import late
from trdlab.show.scenes import scene_of
from trdlab.time_axis import TimeAxis


@singledispatch
def data(thing: Any) -> dict[str, Any]:
    """Returns a noun of trdlab as plain data.

    Raises:
        TypeError: there is no such form of it.
    """
    return late(data, thing)


@data.register
def _(solved: SolvedState) -> dict[str, Any]:
    scene, choice = scene_of(solved.world, solved.state), solved.choice
    return {
        "schema": scene.schema,
        **scene.world,
        "time_axis": axis_data(solved.table.time_axis),
        "future": choice.moment.future.to_dict(),
        "state": {"index": solved.state, **scene.state},
        "actions": actions_data(choice.moment),
        "action": choice.action,
        "foil": choice.foil,
        "answer": [claim.to_dict() for claim in in_brief(choice)],
        "sections": sections_data(sections(choice)),
        "checks": {"sum_error": solved.sum_error, "error_bound": solved.error_bound},
    }


def axis_data(axis: TimeAxis) -> dict[str, Any]:
    """Returns γ, N and w, and what each component covers."""
    return {**asdict(axis), "labels": axis.labels}


def sections_data(told: tuple[Section, ...]) -> list[dict[str, Any]]:
    """Returns what is told, in its sections."""
    return [section.to_dict() for section in told]


def actions_data(moment: Moment) -> dict[str, Any]:
    """Returns what is known of each action."""
    return {
        name: {
            "components": moment.components(name).tolist(),
            "q_value": moment.q_value(name),
            "undiscounted_total": plain_data(moment.total(name)),
            "probability": None if moment.policy is None else float(moment.policy[i]),
            "stays": None if moment.stays is None else moment.stays[i],
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
