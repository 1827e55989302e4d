"""Limits: what of a moment's forecasts lies beyond the range that can be trusted."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.explanations.claims import Finding
from trdlab.explanations.moment.moment import Moment

if TYPE_CHECKING:
    from trdlab.explanations.calibration.calibration import Calibration
    from trdlab.explanations.calibration.report import CalibrationReport
    from trdlab.explanations.calibration.trust import Trust

LEAST_DISCOUNT = float(np.finfo(np.float64).tiny) ** 0.25  # what is smaller cannot be taken out


def judged(moment: Moment, report: "CalibrationReport") -> Moment:
    """Returns a moment with what a report knows of such forecasts.

    That is how far they can be trusted, what they are off by, and whether rewards are of one kind.

    Args:
        moment: what is expected.
        report: on the estimator that expects it.
    """
    reliability = report.calibration.reliability
    return replace(
        moment,
        trust=report.trust,
        foil_trust=report.foil_trust,
        error=_root_mean_square(report.calibration),
        foil_error=None if report.foils is None else _root_mean_square(report.foils),
        only_reward=None if reliability is None else reliability.amount,
    )


def _root_mean_square(calibration: "Calibration") -> FloatArray:
    error = calibration.error
    return np.where(np.isfinite(error.low), np.sqrt(error.value), np.nan)


def doubtful(moment: Moment, action: str) -> BoolArray:
    """Returns `[N+1]`: what is not to be trusted of an action; nothing where that is not judged."""
    return _doubtful(moment.trust_of(action), moment)


def explicit_end(moment: Moment, action: str) -> int:
    """Returns the first component that a forecast is silent of: the residual, or one before it.

    It is one that is not to be trusted, or so far away that its discount cannot be taken out.
    """
    silent = doubtful(moment, action) | (moment.time_axis.discounts < LEAST_DISCOUNT)
    silent[-1] = True
    return int(silent.argmax())


def limits(moment: Moment) -> tuple[Finding, ...]:
    """Returns what is not to be trusted of a moment; nothing where that has not been judged."""
    first = int(_doubtful(moment.trust, moment).argmax())
    residual = moment.time_axis.horizon
    claims = (
        TrustedWhole(),
        NowhereTrusted(),
        NotTrustedAt(residual),
        NotTrustedFrom(first),
        NotTrustedBetween(first, residual),
    )
    return next(((claim,) for claim in claims if claim.holds(moment)), ())


class TrustedWhole(Finding):
    """Every component is trusted, the residual too."""

    def holds(self, moment: Moment) -> bool:
        return moment.trust is not None and not _doubtful(moment.trust, moment).any()


class NowhereTrusted(Finding):
    """No component is trusted, nor is the residual."""

    def holds(self, moment: Moment) -> bool:
        return moment.trust is not None and bool(_doubtful(moment.trust, moment).all())


class NotTrustedAt(Finding):
    """The residual alone is not trusted."""

    component: int

    def holds(self, moment: Moment) -> bool:
        *explicit, residual = _doubtful(moment.trust, moment).tolist()
        return residual and not any(explicit) and self.component == len(explicit) > 0


class NotTrustedFrom(Finding):
    """An explicit component is the first that is not trusted, and nothing after it is."""

    component: int

    def holds(self, moment: Moment) -> bool:
        *explicit, residual = _doubtful(moment.trust, moment).tolist()
        return residual and any(explicit) and explicit.index(True) == self.component > 0


class NotTrustedBetween(Finding):
    """An explicit component is the first that is not trusted, yet the residual is."""

    component: int
    residual: int

    def holds(self, moment: Moment) -> bool:
        *explicit, residual = _doubtful(moment.trust, moment).tolist()
        begins = any(explicit) and explicit.index(True) == self.component
        return begins and not residual and self.residual == len(explicit)


def _doubtful(trust: "Trust | None", moment: Moment) -> BoolArray:
    if trust is None:
        return np.zeros(moment.time_axis.num_components, dtype=np.bool_)
    return trust.doubtful
