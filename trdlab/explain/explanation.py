"""The explanation: findings about a moment, ready to be rendered as text, picture or JSON."""

from dataclasses import dataclass
from typing import Any

from trdlab.explain.contrast import contrast
from trdlab.explain.findings import Finding, TiedActions, TiedLater, WhoseFuture
from trdlab.explain.forecast import forecast
from trdlab.explain.moment import Moment


@dataclass(frozen=True)
class Explanation:
    """Findings about a moment, each supported by its numbers.

    Args:
        moment: what is explained.
        action: the name of the explained action.
        foil: the name of the action it is contrasted with, None for a forecast alone.
        findings: what was found, in the order it is told.
    """

    moment: Moment
    action: str
    foil: str | None
    findings: tuple[Finding, ...]

    def to_dict(self) -> dict[str, Any]:
        """Returns action, foil and findings as plain data."""
        findings = [finding.to_dict() for finding in self.findings]
        return {"action": self.action, "foil": self.foil, "findings": findings}


def explain(moment: Moment, action: str | None = None, foil: str | None = None) -> Explanation:
    """Explains one action: contrasts it with a foil, forecasts it, and says whose future it is.

    Args:
        moment: the decompositions of every action, and what is known beside.
        action: the name of an action; by default the best one that changes the state.
        foil: the name of another; by default the best other one that changes the state.

    Raises:
        InputError: there is no such action, or action and foil are the same.
    """
    action, foil = moment.pair(action, foil)
    findings: list[Finding] = []
    if foil is not None:
        findings += contrast(moment, action, foil)
    findings += forecast(moment, action)
    findings.append(WhoseFuture(moment.future.policy))
    if moment.tied:
        findings.append(TiedActions(moment.tied))
    if moment.tied_later:
        findings.append(TiedLater(moment.tied_later))
    return Explanation(moment, action, foil, tuple(findings))
