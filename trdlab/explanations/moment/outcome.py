"""Claims about two actions that were tried: whether what was forecast of them came."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from trdlab.explanations.claims import Claim, agrees
from trdlab.rollouts.counterfactual import Counterfactual
from trdlab.statistics import Estimate
from trdlab.time_axis import step_label

IN_ALL = "in all"
WORTH_SAYING = 0.1
"""The share of Σ|difference| below which a component is not told of."""

Outcome = Literal["came", "missed", "open"]


@dataclass(frozen=True, eq=False)
class Trial:
    """Two actions that were tried, with their names.

    Args:
        found: what was forecast and what followed.
        action_names: A names.
        seconds_per_step: how long a step takes as people play, if that is known.
    """

    found: Counterfactual
    action_names: tuple[str, ...]
    seconds_per_step: float | None = None

    @property
    def action(self) -> str:
        """The name of one action."""
        return self.action_names[self.found.action]

    @property
    def foil(self) -> str:
        """The name of the other."""
        return self.action_names[self.found.foil]

    @property
    def scope(self) -> str:
        """How far rewards were summed: `in all`, or `up to t+3`."""
        last = self.found.time_axis.num_steps - 1
        return IN_ALL if self.found.whole else f"up to {step_label(last)}"

    def gap(self, more: str, less: str, entry: int) -> tuple[float, Estimate]:
        """Returns more − less of a component, or of the sum at −1: as forecast, and as it came."""
        said, came = float(self.found.predicted[entry]), self.found.observed[entry]
        if (more, less) == (self.action, self.foil):
            return said, came
        return -said, Estimate(-came.value, -came.high, -came.low)


class TrialClaim(Claim):
    """A claim about two actions that were tried."""

    def holds(self, trial: Trial) -> bool:
        """Returns whether the claim is true of a trial, tested by its definition."""
        raise NotImplementedError


def trial_findings(trial: Trial) -> tuple[TrialClaim, ...]:
    """Returns whether what was forecast came: how often it was tried, the sum, and when.

    Of the explicit components those are told at which each action was forecast to be furthest
    ahead of the other.
    """
    found, who = trial.found, (trial.action, trial.foil, trial.found.copies)
    if np.isnan(found.observed.value[-1]):
        return (NotSeen(*who),)
    same = found.same_every_time
    opening = AlwaysTheSame(*who, trial.scope) if same else TriedOften(*who)
    told = (_told(trial, entry) for entry in (-1, *_furthest(trial)))
    return (opening, *(claim for claim in told if claim is not None))


def _told(trial: Trial, entry: int) -> TrialClaim | None:
    """Returns what came of the difference forecast at a component, or of the sum at −1."""
    ahead = trial.found.predicted[entry] > 0.0
    more, less = (trial.action, trial.foil) if ahead else (trial.foil, trial.action)
    said, came = trial.gap(more, less, entry)
    if said == 0.0 or np.isnan(came.low):  # nothing was forecast, or nothing can be told
        return None
    if entry == -1:
        in_all = {"came": CameInAll, "missed": MissedInAll, "open": OpenInAll}
        return in_all[_outcome(came)](more, less, came, said, trial.scope)
    at = {"came": CameAt, "missed": MissedAt, "open": OpenAt}
    return at[_outcome(came)](more, less, came, said, entry)


class TriedOften(TrialClaim):
    """How often each action was tried, from copies of one state."""

    action: str
    foil: str
    copies: int

    def holds(self, trial: Trial) -> bool:
        return self._fits(trial) and not trial.found.same_every_time

    def _fits(self, trial: Trial) -> bool:
        who = (trial.action, trial.foil, trial.found.copies)
        return (self.action, self.foil, self.copies) == who


class AlwaysTheSame(TriedOften):
    """The same where all copies of an action brought the same, as far as was seen."""

    scope: str

    def holds(self, trial: Trial) -> bool:
        is_same = trial.found.same_every_time and self.scope == trial.scope
        return is_same and self._fits(trial)


class NotSeen(TriedOften):
    """The copies were cut off before it was seen what came."""

    def holds(self, trial: Trial) -> bool:
        return self._fits(trial) and bool(np.isnan(trial.found.observed.value[-1]))


class _Gap(TrialClaim):
    """One action was forecast to pay more than the other; what came of that."""

    outcome: ClassVar[Outcome]

    more: str
    less: str
    came: Estimate
    said: float

    def _fits(self, trial: Trial, entry: int) -> bool:
        if {self.more, self.less} != {trial.action, trial.foil}:
            return False
        said, came = trial.gap(self.more, self.less, entry)
        claimed = (self.said, self.came.value, self.came.low, self.came.high)
        true = (said, came.value, came.low, came.high)
        return all(map(agrees, claimed, true)) and said > 0.0 and _outcome(came) == self.outcome


class CameInAll(_Gap):
    """It surely paid more."""

    outcome: ClassVar[Outcome] = "came"

    scope: str

    def holds(self, trial: Trial) -> bool:
        return self.scope == trial.scope and self._fits(trial, -1)


class MissedInAll(CameInAll):
    """It surely did not."""

    outcome: ClassVar[Outcome] = "missed"


class OpenInAll(CameInAll):
    """It may or may not have."""

    outcome: ClassVar[Outcome] = "open"


class CameAt(_Gap):
    """It surely paid more at a component: that at which it was forecast to be furthest ahead."""

    outcome: ClassVar[Outcome] = "came"

    component: int

    def holds(self, trial: Trial) -> bool:
        furthest = self.component in _furthest(trial)
        return furthest and self._fits(trial, self.component)


class MissedAt(CameAt):
    """It surely did not."""

    outcome: ClassVar[Outcome] = "missed"


class OpenAt(CameAt):
    """It may or may not have."""

    outcome: ClassVar[Outcome] = "open"


def _outcome(came: Estimate) -> Outcome:
    return "came" if came.low > 0.0 else "missed" if came.high <= 0.0 else "open"


def _furthest(trial: Trial) -> list[int]:
    """Returns the components at which each action was forecast to be furthest ahead.

    One that holds less than `WORTH_SAYING` of all that differs is not worth a sentence.
    """
    explicit = trial.found.predicted[: trial.found.time_axis.horizon]
    least = WORTH_SAYING * np.abs(explicit).sum()
    furthest = {int(explicit.argmax()), int(explicit.argmin())} if explicit.size else set()
    return sorted(i for i in furthest if abs(explicit[i]) >= least)
