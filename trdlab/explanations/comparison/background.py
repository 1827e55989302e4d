"""Claims about what a comparison rests on: whom to trust how far, the states, the futures."""

import numpy as np

from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison.differences import ComparisonFinding, side_of
from trdlab.explanations.comparison.report import Comparison

# ---- who can be trusted -------------------------------------------------------------------------


class _Trusted(ComparisonFinding):
    """How far the forecasts of one of them can be trusted, as its own report says."""

    side: str

    def _report(self, comparison: Comparison) -> CalibrationReport | None:
        return comparison.reports[side_of(self.side)]


class TrustedUpTo(_Trusted):
    """Up to a step, and no further."""

    step: int

    def holds(self, comparison: Comparison) -> bool:
        report = self._report(comparison)
        return report is not None and self.step == report.trust.last_step and not _whole(report)


class TrustedAllAlong(_Trusted):
    """Over all explicit components."""

    step: int

    def holds(self, comparison: Comparison) -> bool:
        report = self._report(comparison)
        return report is not None and self.step == report.trust.last_step and _whole(report)


class TrustedNowhere(_Trusted):
    """At no step: the first one already is surely no better than a guess, or wrong."""

    def holds(self, comparison: Comparison) -> bool:
        report = self._report(comparison)
        return report is not None and _first(report) == "bad"


class TooFewToJudge(_Trusted):
    """Too few different episodes tell whether the first step can be trusted."""

    episodes: int

    def holds(self, comparison: Comparison) -> bool:
        report = self._report(comparison)
        few = report is not None and _first(report) == "open"
        return few and self.episodes == report.calibration.num_episodes[0]  # type: ignore[union-attr]


class NeverTested(_Trusted):
    """No reward came at the first step in its episodes, or none is known of."""

    def holds(self, comparison: Comparison) -> bool:
        report = self._report(comparison)
        return report is not None and _first(report) == "not tested"


def _whole(report: CalibrationReport) -> bool:
    return report.trust.is_whole


def _first(report: CalibrationReport) -> str | None:
    """Returns the status of the first explicit component, if there is one."""
    return report.calibration.status[0] if report.time_axis.horizon else None


# ---- what it rests on ---------------------------------------------------------------------------


class ComparedAt(ComparisonFinding):
    """The states, half of them of the episodes of each."""

    states: int
    episodes: int

    def holds(self, comparison: Comparison) -> bool:
        return (self.states, self.episodes) == (len(comparison.visits), comparison.episodes)


class SomeCutOff(ComparisonFinding):
    """Some episodes would have gone on, but were not played for longer."""

    episodes: int
    steps: int

    def holds(self, comparison: Comparison) -> bool:
        right = (self.episodes, self.steps) == (comparison.visits.cut, comparison.max_steps)
        return right and self.episodes > 0


class AllAlike(ComparisonFinding):
    """So few of the episodes differ that nothing can be told of others."""

    different: int

    def holds(self, comparison: Comparison) -> bool:
        return np.isnan(comparison.gap.low) and self.different == comparison.visits.different


class EachTells(ComparisonFinding):
    """Both tell of the same kind of future."""

    policy: str
    reward: str
    ending: str

    def holds(self, comparison: Comparison) -> bool:
        told = (self.policy, self.reward, self.ending)
        return all((f.policy, f.reward, f.ending) == told for f in comparison.futures)


class OneTells(ComparisonFinding):
    """They tell of different kinds, one of them of this."""

    side: str
    policy: str
    reward: str
    ending: str

    def holds(self, comparison: Comparison) -> bool:
        future, told = (
            comparison.futures[side_of(self.side)],
            (self.policy, self.reward, self.ending),
        )
        differ = comparison.futures[0] != comparison.futures[1]
        return differ and (future.policy, future.reward, future.ending) == told
