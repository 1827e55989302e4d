"""Claims about what is wrong with a forecast, what it hides, and what it was judged by."""

from typing import ClassVar

from trdlab.explanations.calibration.errors import is_off
from trdlab.explanations.calibration.faults import is_discount_wrong, is_end_ignored
from trdlab.explanations.calibration.report import TrustReport
from trdlab.explanations.calibration.residual import SHARE
from trdlab.explanations.calibration.verdicts import TrustFinding
from trdlab.explanations.claims import agrees
from trdlab.statistics import Estimate

WORTH_SAYING = 0.005
"""A smaller share is not said."""

# ---- what is wrong -------------------------------------------------------------------------------


class TooLate(TrustFinding):
    """Rewards are predicted some steps too late."""

    sign: ClassVar[int] = 1

    steps: int

    def holds(self, report: TrustReport) -> bool:
        shift = 0 if report.blame is None else report.blame.shift
        return self.steps > 0 and shift * report.time_axis.width == self.sign * self.steps


class TooEarly(TooLate):
    """Rewards are predicted some steps too early."""

    sign: ClassVar[int] = -1


class AmountOff(TrustFinding):
    """Surely more, or less, is predicted than comes."""

    times: float

    def holds(self, report: TrustReport) -> bool:
        if report.blame is None:
            return False
        amount = report.blame.amount
        return is_off(amount) and agrees(self.times, amount.value)


class Smeared(TrustFinding):
    """Neighbouring steps surely share what belongs to one of them."""

    def holds(self, report: TrustReport) -> bool:
        return report.blame is not None and report.blame.smear.low > 0.0


class DiscountOff(TrustFinding):
    """Components are surely not multiplied by γ^w from one to the next."""

    measured: float
    expected: float

    def holds(self, report: TrustReport) -> bool:
        if report.audit is None:
            return False
        axis, found = report.time_axis, report.audit.discount
        return (
            is_discount_wrong(report.audit)
            and agrees(self.measured, found.value)
            and agrees(self.expected, axis.gamma**axis.width)
        )


class GoesOnAfterEnd(TrustFinding):
    """What is expected after an end surely counts by more than half."""

    share: float

    def holds(self, report: TrustReport) -> bool:
        if report.audit is None:
            return False
        return is_end_ignored(report.audit) and agrees(self.share, report.audit.past_end.value)


class GoesOnInNext(GoesOnAfterEnd):
    """So does what is expected at the start of an episode: the next one is mistaken for this."""

    def holds(self, report: TrustReport) -> bool:
        return super().holds(report) and report.audit.past_reset.low > 0.5  # type: ignore[union-attr]


# ---- what is hidden, and what it was judged by ---------------------------------------------------


class ResidualTrusted(TrustFinding):
    """The residual is surely predicted better than by a constant guess."""

    component: int

    def holds(self, report: TrustReport) -> bool:
        return self.component == report.time_axis.horizon and _residual_skill(report).low > 0.0


class ResidualUnsure(TrustFinding):
    """The residual may be predicted no better than by a constant guess."""

    component: int

    def holds(self, report: TrustReport) -> bool:
        return self.component == report.time_axis.horizon and _residual_skill(report).low <= 0.0


class ResidualUnjudged(TrustFinding):
    """Too few different episodes, or none, came to an end that shows the residual."""

    component: int
    episodes: int

    def holds(self, report: TrustReport) -> bool:
        told = report.calibration
        is_cut = told.states[-1] == "unknown" and report.endings.truncated > 0
        unjudged = told.states[-1] in ("too few episodes", "unknown") and not is_cut
        here = self.component == report.time_axis.horizon
        return here and unjudged and bool(self.episodes == told.num_episodes[-1])


class ResidualCut(TrustFinding):
    """Some episodes were cut off, and those that ended are the short ones."""

    component: int
    cut: int

    def holds(self, report: TrustReport) -> bool:
        here = self.component == report.time_axis.horizon
        unknown = report.calibration.states[-1] == "unknown"
        return here and unknown and 0 < self.cut == report.endings.truncated


class HiddenValue(TrustFinding):
    """The share of what is predicted that lies in the residual."""

    component: int
    share: float

    def holds(self, report: TrustReport) -> bool:
        share = report.hidden.value.value
        residual = self.component == report.time_axis.horizon > 0
        return residual and share >= WORTH_SAYING and agrees(self.share, share)


class HiddenGap(TrustFinding):
    """The same of the difference between the best action and the next best."""

    component: int
    share: float

    def holds(self, report: TrustReport) -> bool:
        share = report.hidden.gap.value
        residual = self.component == report.time_axis.horizon > 0
        return residual and share >= WORTH_SAYING and agrees(self.share, share)


class WouldSuffice(TrustFinding):
    """The least N that leaves no more than a share of the observed rewards to the residual."""

    horizon: int
    share: float

    def holds(self, report: TrustReport) -> bool:
        n, width, tails = self.horizon, report.time_axis.width, report.hidden.observed_tails
        if not report.time_axis.horizon < n or not (n - 1) * width < len(tails) - 1:
            return False
        at = min(n * width, len(tails) - 1)
        enough = tails[at] <= SHARE < tails[(n - 1) * width]
        return bool(enough) and agrees(self.share, SHARE)


class JudgedOn(TrustFinding):
    """The episodes it was judged by."""

    episodes: int
    steps: int
    ended: int
    cut: int

    def holds(self, report: TrustReport) -> bool:
        counts = (report.num_episodes, report.num_steps)
        ends = (report.endings.terminated, report.endings.truncated)
        return (self.episodes, self.steps) == counts and (self.ended, self.cut) == ends


class LivesEnd(TrustFinding):
    """How often a life was lost, where that counts as an end."""

    ends: ClassVar[bool] = True

    count: int

    def holds(self, report: TrustReport) -> bool:
        told = report.endings
        return 0 < self.count == told.life_losses and told.life_loss_ends == self.ends


class LivesGoOn(LivesEnd):
    """The same where it does not."""

    ends: ClassVar[bool] = False


class SomeRandom(TrustFinding):
    """The share of random actions, after which nothing was judged."""

    share: float

    def holds(self, report: TrustReport) -> bool:
        return report.epsilon > 0.0 and agrees(self.share, report.epsilon)


def _residual_skill(report: TrustReport) -> Estimate:
    """Returns the skill of the residual; NaN, of which nothing holds, where it is not judged."""
    return report.calibration.skill[-1]
