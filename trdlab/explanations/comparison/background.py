"""Claims about what a comparison rests on: whom to trust how far, the states, the futures."""

import numpy as np

from trdlab.explanations.calibration import verdicts
from trdlab.explanations.comparison.differences import ComparisonFinding, side_of
from trdlab.explanations.comparison.report import Comparison

# ---- who can be trusted -------------------------------------------------------------------------


class _Trusted(ComparisonFinding):
    """How far the forecasts of one of them can be trusted, as its own report says."""

    side: str

    def _says(self, comparison: Comparison, verdict: verdicts.TrustFinding) -> bool:
        report = comparison.reports[side_of(self.side)]
        return report is not None and verdict.holds(report)


class TrustedUpTo(_Trusted):
    """Up to a step, and no further."""

    step: int

    def holds(self, comparison: Comparison) -> bool:
        return self._says(comparison, verdicts.TrustedTo(self.step))


class TrustedAllAlong(_Trusted):
    """Over all explicit components."""

    step: int

    def holds(self, comparison: Comparison) -> bool:
        return self._says(comparison, verdicts.TrustedThroughout(self.step))


class TrustedNowhere(_Trusted):
    """At no step, though enough episodes tell of the first one."""

    def holds(self, comparison: Comparison) -> bool:
        report = comparison.reports[side_of(self.side)]
        is_told = report is not None and report.calibration.states[0] != "too few episodes"
        return is_told and self._says(comparison, verdicts.NotTrusted())


class TooFewToJudge(_Trusted):
    """At no step, and that is because too few different episodes tell of the first one."""

    episodes: int

    def holds(self, comparison: Comparison) -> bool:
        few = self._says(comparison, verdicts.TooFewAt(0, self.episodes))
        return few and self._says(comparison, verdicts.NotTrusted())


class TrustedUntested(_Trusted):
    """Up to a step, where the reward was always the same, and no further."""

    step: int

    def holds(self, comparison: Comparison) -> bool:
        return self._says(comparison, verdicts.ConstantTo(self.step))


class NeverTested(_Trusted):
    """The reward was always the same in its episodes."""

    def holds(self, comparison: Comparison) -> bool:
        return self._says(comparison, verdicts.NothingTested())


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
