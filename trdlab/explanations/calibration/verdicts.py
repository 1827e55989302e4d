"""Claims about how far a forecast can be trusted, and why no further."""

from typing import Literal

import numpy as np

from trdlab.explanations.calibration.calibration import Calibration
from trdlab.explanations.calibration.report import TrustReport
from trdlab.explanations.calibration.trust import is_wrong, trusted
from trdlab.explanations.claims import Claim, agrees
from trdlab.statistics import Estimate

LITTLE = 0.1
"""A ceiling below this leaves little to know."""


class TrustFinding(Claim):
    """A claim about a trust report."""

    def holds(self, report: TrustReport) -> bool:
        """Returns whether the claim is true of a report, tested by its definition."""
        raise NotImplementedError


# ---- how far ------------------------------------------------------------------------------------


class TrustedTo(TrustFinding):
    """Every component up to a step is trusted, and the next one is not."""

    step: int

    def holds(self, report: TrustReport) -> bool:
        passed, tested = _passed(report.calibration)
        return tested > 0 and passed == _ends(self.step, report) < report.time_axis.horizon


class TrustedThroughout(TrustFinding):
    """Every explicit component is trusted."""

    step: int

    def holds(self, report: TrustReport) -> bool:
        passed, tested = _passed(report.calibration)
        return tested > 0 and passed == _ends(self.step, report) == report.time_axis.horizon


class NotTrusted(TrustFinding):
    """No step is to be trusted: the first one already is not."""

    def holds(self, report: TrustReport) -> bool:
        passed, _ = _passed(report.calibration)
        return passed == 0 < report.time_axis.horizon


class ConstantTo(TrustFinding):
    """Up to a step, before the first failure, the reward was always the same, and forecast so."""

    step: int

    def holds(self, report: TrustReport) -> bool:
        passed, tested = _passed(report.calibration)
        here = passed == _ends(self.step, report)
        return tested == 0 < passed < report.time_axis.horizon and here


class NothingTested(TrustFinding):
    """The reward was always the same at every step, and forecast so."""

    def holds(self, report: TrustReport) -> bool:
        passed, tested = _passed(report.calibration)
        return tested == 0 and passed == report.time_axis.horizon > 0


class CouldReach(TrustFinding):
    """The last step up to which the intervals do not rule trust out."""

    step: int

    def holds(self, report: TrustReport) -> bool:
        calibration, c = report.calibration, (self.step + 1) // report.time_axis.width
        constant = calibration.is_("nothing to predict")
        out = np.where(constant, is_wrong(calibration), calibration.skill.high <= 0.0)[:-1]
        reached = int(np.append(out, True).argmax())
        beyond = not trusted(calibration)[:c].all()
        return (self.step + 1) % report.time_axis.width == 0 and reached == c and beyond


# ---- why no further ------------------------------------------------------------------------------


class _FirstFailure(TrustFinding):
    """A reason why the first component that is not trusted is not."""

    component: int

    def _is_first(self, report: TrustReport) -> bool:
        sure = trusted(report.calibration)[:-1]
        c = self.component
        return 0 <= c < len(sure) and bool(sure[:c].all()) and not sure[c]


class NoSkillAt(_FirstFailure):
    """It is surely no better than a constant guess."""

    def holds(self, report: TrustReport) -> bool:
        high = report.calibration.skill.high
        return self._is_first(report) and bool(high[self.component] <= 0.0)


class NoSkillFrom(_FirstFailure):
    """So are all the explicit components after it, and there are some."""

    def holds(self, report: TrustReport) -> bool:
        high, c = report.calibration.skill.high[:-1], self.component
        return self._is_first(report) and c < len(high) - 1 and bool((high[c:] <= 0.0).all())


class UnsureAt(_FirstFailure):
    """It may or may not be better than a constant guess."""

    def holds(self, report: TrustReport) -> bool:
        skill, c = report.calibration.skill, self.component
        return self._is_first(report) and bool(skill.low[c] <= 0.0 < skill.high[c])


class WrongAt(_FirstFailure):
    """The reward was always the same, and the forecast is another."""

    def holds(self, report: TrustReport) -> bool:
        constant = report.calibration.is_("nothing to predict") & is_wrong(report.calibration)
        return self._is_first(report) and bool(constant[self.component])


class TooFewAt(_FirstFailure):
    """Too few different episodes tell of it."""

    episodes: int

    def holds(self, report: TrustReport) -> bool:
        calibration, c = report.calibration, self.component
        few = self._is_first(report) and calibration.states[c] == "too few episodes"
        return few and bool(self.episodes == calibration.num_episodes[c])


class NothingToPredict(TrustFinding):
    """How many of the explicit components had the same reward always."""

    count: int
    total: int

    def holds(self, report: TrustReport) -> bool:
        constant = report.calibration.is_("nothing to predict")[:-1]
        return bool(0 < self.count == constant.sum() < len(constant) == self.total)


class UnknownAt(_FirstFailure):
    """It is not known of any step what followed."""

    def holds(self, report: TrustReport) -> bool:
        unknown = report.calibration.is_("unknown")
        return self._is_first(report) and bool(unknown[self.component])


# ---- what can be known ---------------------------------------------------------------------------


class NoChance(TrustFinding):
    """No two copies of a state ever went differently."""

    def holds(self, report: TrustReport) -> bool:
        return report.ceiling is not None and report.ceiling.deterministic


class CannotBeKnown(TrustFinding):
    """A perfect forecast of a component would surely have little skill; never less than none."""

    component: int
    at_most: float

    def holds(self, report: TrustReport) -> bool:
        limit, _ = _limit_and_skill(report, self.component)
        return limit.high < LITTLE and agrees(self.at_most, max(limit.high, 0.0))


class IsNotKnown(TrustFinding):
    """A perfect forecast of a component would surely have more skill."""

    component: int
    ceiling: float
    skill: float

    def holds(self, report: TrustReport) -> bool:
        limit, skill = _limit_and_skill(report, self.component)
        same = agrees(self.ceiling, limit.value) and agrees(self.skill, skill.value)
        return same and limit.high >= LITTLE and skill.high < limit.low


class AsGoodAsCanBe(TrustFinding):
    """The skill of a component is not surely less than that of a perfect forecast."""

    component: int
    skill: float

    def holds(self, report: TrustReport) -> bool:
        limit, skill = _limit_and_skill(report, self.component)
        near = limit.high >= LITTLE and skill.high >= limit.low > 0.0
        return near and agrees(self.skill, skill.value)


# ---- of other actions ----------------------------------------------------------------------------


class FoilsTrustedTo(TrustFinding):
    """Forecasts of actions that the policy would not have taken are trusted up to a step."""

    step: int

    def holds(self, report: TrustReport) -> bool:
        if report.foils is None:
            return False
        passed, tested = _passed(report.foils)
        return tested > 0 and passed == _ends(self.step, report) < report.time_axis.horizon


class FoilsTrustedThroughout(TrustFinding):
    """They are trusted at every explicit component."""

    step: int

    def holds(self, report: TrustReport) -> bool:
        if report.foils is None:
            return False
        passed, tested = _passed(report.foils)
        return tested > 0 and passed == _ends(self.step, report) == report.time_axis.horizon


class FoilsNotTrusted(TrustFinding):
    """They are trusted at no step: the first one is surely no better than a guess, or wrong."""

    def holds(self, report: TrustReport) -> bool:
        return report.time_axis.horizon > 0 and _foils_fail(report) == "surely"


class FoilsUnjudged(TrustFinding):
    """Too little was seen of them to tell whether the first step can be trusted."""

    def holds(self, report: TrustReport) -> bool:
        return report.time_axis.horizon > 0 and _foils_fail(report) == "perhaps"


def _foils_fail(report: TrustReport) -> Literal["surely", "perhaps"] | None:
    """Returns whether forecasts of foils fail at the first step; None if not, or not judged."""
    found = report.foils
    if found is None or trusted(found)[0]:
        return None
    is_constant = found.states[0] == "nothing to predict"
    return "surely" if is_constant or found.skill.high[0] <= 0.0 else "perhaps"


def _limit_and_skill(report: TrustReport, component: int) -> tuple[Estimate, Estimate]:
    """Returns the ceiling and the skill of a component; NaN, of which nothing holds, if unknown."""
    unknown = Estimate(np.nan, np.nan, np.nan)
    if report.ceiling is None or not 0 <= component < report.time_axis.horizon:
        return unknown, unknown
    return report.ceiling.skill[component], report.calibration.skill[component]


def _ends(step: int, report: TrustReport) -> int:
    """Returns how many components end with a step, −1 if none ends there."""
    components, within = divmod(step + 1, report.time_axis.width)
    return -1 if within else components


def _passed(calibration: Calibration) -> tuple[int, int]:
    """Returns how many explicit components in a row are trusted, and how many were tested."""
    passed = int(np.append(trusted(calibration)[:-1], False).argmin())
    return passed, int(calibration.is_("judged")[:passed].sum())
