"""Nouns as plain data at full precision, for JSON; `null` stands for what is not known."""

from collections.abc import Iterable
from dataclasses import asdict
from functools import singledispatch
from typing import Any

from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.telling import in_brief, sections
from trdlab.explanations.rules import Claim, plain_data
from trdlab.explanations.sections import Section
from trdlab.explanations.solved import SolvedState
from trdlab.show.document import late
from trdlab.show.scenes import scene_of
from trdlab.time_axis import TimeAxis


@singledispatch
def data(thing: Any) -> dict[str, Any]:
    """Returns a noun of trdlab as plain data."""
    return late(data, thing)


@data.register
def _(solved: SolvedState) -> dict[str, Any]:
    scene, choice = scene_of(solved.world, solved.state), solved.choice
    return {
        **scene.world,
        "time_axis": axis_data(solved.table.time_axis),
        "future": choice.moment.future.to_dict(),
        "state": {"index": solved.state, **scene.state},
        "actions": actions_data(choice.moment),
        "action": choice.action,
        "foil": choice.foil,
        **told_data(in_brief(choice), sections(choice)),
        "checks": {"sum_error": solved.sum_error, "error_bound": solved.error_bound},
    }


def axis_data(axis: TimeAxis) -> dict[str, Any]:
    """Returns γ, N and w, and what each component covers."""
    return {**asdict(axis), "labels": axis.labels}


def told_data(answer: Iterable[Claim], told: Iterable[Section]) -> dict[str, Any]:
    """Returns the few sentences that matter most, and all that there is to tell."""
    return {
        "answer": [claim.to_dict() for claim in answer],
        "sections": [section.to_dict() for section in told],
    }


def actions_data(moment: Moment) -> dict[str, Any]:
    """Returns what is known of each action."""
    return {name: _action(moment, i, name) for i, name in enumerate(moment.action_names)}


def _action(moment: Moment, i: int, name: str) -> dict[str, Any]:
    known = moment.uncertainty
    spread = ("deviation", "return_deviation", "survival") if known is not None else ()
    return {
        "components": moment.components(name).tolist(),
        "q_value": moment.q_value(name),
        "undiscounted_total": plain_data(moment.total(name)),
        "probability": None if moment.policy is None else float(moment.policy[i]),
        "stays": None if moment.stays is None else moment.stays[i],
        **{of: getattr(known, of)[i].tolist() for of in spread},
        **({} if moment.outlook is None else {"outlook": plain_data(moment.outlook[i])}),
    }
