"""Faults: what an implementation got wrong, named from the numbers of blame and audit."""

import math
from dataclasses import dataclass

from trdlab.explain.audit import Audit
from trdlab.explain.blame import Blame
from trdlab.statistics import Estimate

SLACK = 0.2
"""How far the exponent of a discount may be from w, as a share of w, before it is a fault."""


@dataclass(frozen=True)
class ShiftedReward:
    """Rewards are counted some components too late, or too early if negative."""

    components: int
    agreement: float


@dataclass(frozen=True)
class WrongDiscount:
    """Components are not multiplied by γ^w from one to the next, but by something else."""

    expected: float
    measured: Estimate
    exponent: Estimate


@dataclass(frozen=True)
class IgnoredEnd:
    """What is expected after the end of an episode counts although it ended."""

    share: Estimate
    resets: bool


Fault = ShiftedReward | WrongDiscount | IgnoredEnd


def diagnose(blame: Blame | None, audit: Audit | None) -> tuple[Fault, ...]:
    """Returns the faults that the numbers are sure of; none of them where there is doubt.

    - A reward is shifted if the blame is (see `AGREEMENT`).
    - The discount is wrong if x, where components are really multiplied by γ^x from one to the
      next, is surely more than a fifth of w away from w. At w = 2, a forgotten power gives 1.
    - An end is ignored if surely more than half of what is expected after it counts.
    """
    faults: list[Fault] = []
    if blame is not None and blame.shift:
        faults.append(ShiftedReward(blame.shift, blame.agreement))
    if audit is not None:
        width, exponent = audit.time_axis.width, discount_exponent(audit)
        if exponent.high < (1.0 - SLACK) * width or exponent.low > (1.0 + SLACK) * width:
            expected = audit.time_axis.gamma**width
            faults.append(WrongDiscount(expected, audit.discount, exponent))
        if audit.past_end.low > 0.5:
            faults.append(IgnoredEnd(audit.past_end, audit.past_reset.low > 0.5))
    return tuple(faults)


def discount_exponent(audit: Audit) -> Estimate:
    """Returns x, where components are multiplied by γ^x from one to the next; w if all is well."""
    gamma, measured = audit.time_axis.gamma, audit.discount

    def exponent(discount: float) -> float:
        if math.isnan(discount) or gamma == 0.0:
            return math.nan
        return math.log(discount) / math.log(gamma) if discount > 0.0 else math.inf

    return Estimate(exponent(measured.value), exponent(measured.high), exponent(measured.low))
