"""The trust report as plain data, for JSON."""

import math
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from trdlab.explanations.calibration.findings import trust_findings
from trdlab.explanations.calibration.report import TrustReport
from trdlab.explanations.calibration.sentences import trust_sentence
from trdlab.explanations.calibration.trust import Trust

SCHEMA = "trdlab.trust/1"


def trust_to_dict(report: TrustReport) -> dict[str, Any]:
    """Returns a trust report as plain data at full precision.

    The schema is `trdlab.trust/1`: lists run over components (`N+1`, or `N` explicit ones), an
    estimate is `value` with `low` and `high`. What does not exist, and an end of an interval that
    is infinite, is `null`.
    """
    return {
        "schema": SCHEMA,
        "episodes": report.num_episodes,
        "steps": report.num_steps,
        "epsilon": report.epsilon,
        "endings": plain_data(report.endings),
        "trusted": _trust(report.trust),
        "calibration": plain_data(report.calibration),
        "hidden": plain_data(report.hidden),
        "blame": plain_data(report.blame),
        "audit": plain_data(report.audit),
        "ceiling": plain_data(report.ceiling),
        "foils": None
        if report.foil_trust is None
        else _trust(report.foil_trust) | {"calibration": plain_data(report.foils)},
        "faults": [{"kind": type(fault).__name__, **plain_data(fault)} for fault in report.faults],
        "findings": [
            plain_data(finding.to_dict()) | {"sentence": trust_sentence(finding, report)}
            for finding in trust_findings(report)
        ],
    }


def _trust(trust: Trust) -> dict[str, Any]:
    return {
        "last_step": trust.last_step,
        "components": trust.components,
        "at_most": trust.at_most,
        "tested": trust.tested,
        "residual": trust.residual,
        "whole": trust.is_whole,
        "doubtful": trust.doubtful.tolist(),
    }


def plain_data(value: Any) -> Any:
    """Returns a result as what JSON knows; the time axis, which all parts share, is left out."""
    if is_dataclass(value):
        named = (field.name for field in fields(value) if field.name != "time_axis")
        return {name: plain_data(getattr(value, name)) for name in named}
    if isinstance(value, dict):
        return {name: plain_data(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain_data(part) for part in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain_data(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
