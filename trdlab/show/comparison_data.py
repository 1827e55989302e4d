"""A comparison of two agents as plain data, for JSON."""

from dataclasses import asdict
from typing import Any

from trdlab.explanations.calibration.claims import to_dict
from trdlab.explanations.comparison.findings import comparison_findings
from trdlab.explanations.comparison.report import SIDES, Comparison
from trdlab.explanations.rules import plain_data
from trdlab.show.comparison import FURTHEST, LANGUAGE, explain_command
from trdlab.statistics import Estimates

SCHEMA = "trdlab.compare/1"


def comparison_to_dict(comparison: Comparison) -> dict[str, Any]:
    """Returns a comparison as plain data at full precision.

    The schema is `trdlab.compare/1`: lists run over components (`N+1`), an estimate is `value`
    with `low` and `high`; what does not exist is `null`.
    """
    visits, axis = comparison.visits, comparison.time_axis
    return {
        "schema": SCHEMA,
        "agents": {
            side: {
                "name": comparison.names[i],
                "words": list(comparison.words[i]),
                "future": asdict(comparison.futures[i]),
                "mean": plain_data(_of_side(comparison.means, i)),
            }
            for i, side in enumerate(SIDES)
        },
        "place": list(comparison.place),
        "seconds_per_step": comparison.seconds_per_step,
        "max_steps": comparison.max_steps,
        "time_axis": {**asdict(axis), "labels": axis.labels},
        "episodes": comparison.episodes,
        "different_episodes": visits.different,
        "cut_off": visits.cut,
        "states": len(visits),
        "difference": plain_data(comparison.difference),
        "apart": plain_data(comparison.apart),
        "of_any_action": plain_data(comparison.of_any_action),
        "gap": plain_data(comparison.gap),
        "shift": plain_data(comparison.shift),
        "agreement": plain_data(comparison.agreement),
        "furthest": [_furthest(comparison, m) for m in visits.furthest(FURTHEST)],
        "findings": [
            plain_data(finding.to_dict()) | {"sentence": LANGUAGE.say(finding, comparison)}
            for finding in comparison_findings(comparison)
        ],
        "calibration": {
            side: None if report is None else to_dict(report)
            for side, report in zip(SIDES, comparison.reports, strict=True)
        },
    }


def _furthest(comparison: Comparison, m: int) -> dict[str, Any]:
    visits = comparison.visits
    return {
        "player": SIDES[visits.player[m]],
        "seed": int(visits.seed[m]),
        "step": int(visits.step[m]),
        "distance": float(visits.apart[m]),
        "command": explain_command(comparison, m) or None,
        **{
            side: {
                "action": comparison.action_names[visits.actions[i, m]],
                "components": visits.expected[i, m].tolist(),
            }
            for i, side in enumerate(SIDES)
        },
    }


def _of_side(means: Estimates, side: int) -> Estimates:
    return Estimates(means.value[side], means.low[side], means.high[side])
