"""The explanation: findings about a moment, ready to be rendered as text, picture or JSON."""

from dataclasses import dataclass

from trdlab.explanations.claims import Finding
from trdlab.explanations.moment.contrast import contrast
from trdlab.explanations.moment.forecast import forecast
from trdlab.explanations.moment.limits import limits
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.sensitivity import what_would_flip

Findings = tuple[Finding, ...]


@dataclass(frozen=True)
class Explanation:
    """Findings about a moment, each supported by its numbers.

    Args:
        moment: what is explained.
        action: the name of the explained action.
        foil: the name of the action it is contrasted with, None for a forecast alone.
        contrast: how the futures of action and foil differ.
        flips: what would change the preference between them.
        forecast: what the action is expected to pay, and when.
        limits: what of that cannot be trusted.
        context: whose future it is, and where ties leave it open.
    """

    moment: Moment
    action: str
    foil: str | None
    contrast: Findings
    flips: Findings
    forecast: Findings
    limits: Findings
    context: Findings

    @property
    def findings(self) -> Findings:
        """All of them, in the order they are told."""
        return self.contrast + self.flips + self.forecast + self.limits + self.context


def explain(moment: Moment, action: str | None = None, foil: str | None = None) -> Explanation:
    """Explains one action: contrasts it with a foil, forecasts it, and says whose future it is.

    Args:
        moment: the decompositions of every action, and what is known beside.
        action: the name of an action; by default what the policy does (see `Moment.pair`).
        foil: the name of another; by default the best other one that changes the state.

    Raises:
        InputError: there is no such action, or action and foil are the same.
    """
    action, foil = moment.pair(action, foil)
    ties: list[Finding] = [TiedActions(moment.tied)] if moment.tied else []
    later: list[Finding] = [TiedLater(moment.tied_later)] if moment.tied_later else []
    return Explanation(
        moment=moment,
        action=action,
        foil=foil,
        contrast=() if foil is None else contrast(moment, action, foil),
        flips=() if foil is None else what_would_flip(moment, action, foil),
        forecast=forecast(moment, action),
        limits=limits(moment),
        context=(WhoseFuture(**moment.future.to_dict()), *ties, *later),
    )


class WhoseFuture(Finding):
    """Who acts after the first action, which reward counts, and what ends it."""

    policy: str
    reward: str
    ending: str

    def holds(self, moment: Moment) -> bool:
        told = {"policy": self.policy, "reward": self.reward, "ending": self.ending}
        return told == moment.future.to_dict()


class TiedActions(Finding):
    """Several optimal actions tie here, and their futures differ."""

    actions: tuple[str, ...]

    def holds(self, moment: Moment) -> bool:
        return len(self.actions) > 1 and self.actions == moment.tied


class TiedLater(Finding):
    """Optimal actions tie in later states, and their futures differ."""

    states: int

    def holds(self, moment: Moment) -> bool:
        return self.states > 0 and self.states == moment.tied_later
