"""Faults: what an implementation got wrong, named from the numbers of blame and audit."""

import math
from dataclasses import dataclass

from trdlab.explanations.calibration.consistency import Audit
from trdlab.explanations.calibration.errors import Blame
from trdlab.statistics import Estimate

EXPLAINED = 0.95
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

    The others are named only if hardly anything else is wrong between components, which is so if
    `EXPLAINED` of them fits what follows.

    - The discount is wrong if x, where components are really multiplied by γ^x from one to the
      next, is surely more than a fifth of w away from w, and on the same side for near components
      and for far ones: else something is wrong, but not the discount. At w = 2, a forgotten power
      gives 1.
    - An end is ignored if surely more than half of what is expected after it counts.
    """
    faults: list[Fault] = []
    if blame is not None and blame.shift:
        faults.append(ShiftedReward(blame.shift, blame.agreement))
    if audit is not None:
        if is_discount_wrong(audit):
            expected = audit.time_axis.gamma**audit.time_axis.width
            faults.append(WrongDiscount(expected, audit.discount, discount_exponent(audit)))
        if is_end_ignored(audit):
            faults.append(IgnoredEnd(audit.past_end, audit.past_reset.low > 0.5))
    return tuple(faults)


def is_discount_wrong(audit: Audit) -> bool:
    """Returns whether the discount is surely wrong (see `diagnose`)."""
    all_of_them, gamma = discount_exponent(audit), audit.time_axis.gamma
    near, far = (_exponent(of, gamma) for of in (audit.discount_near, audit.discount_far))
    least, most = ((1.0 + sign * SLACK) * audit.time_axis.width for sign in (-1.0, 1.0))
    if not audit.explained >= EXPLAINED:
        return False
    parts = [part for part in (near, far) if not math.isnan(part)]
    below = all_of_them.high < least and all(part < least for part in parts)
    return below or (all_of_them.low > most and all(part > most for part in parts))


def is_end_ignored(audit: Audit) -> bool:
    """Returns whether what is expected after an end surely counts (see `diagnose`)."""
    return audit.explained >= EXPLAINED and audit.past_end.low > 0.5


def discount_exponent(audit: Audit) -> Estimate:
    """Returns x, where components are multiplied by γ^x from one to the next; w if all is well."""
    of, gamma = audit.discount, audit.time_axis.gamma
    return Estimate(*(_exponent(discount, gamma) for discount in (of.value, of.high, of.low)))


def _exponent(discount: float, gamma: float) -> float:
    if math.isnan(discount) or gamma == 0.0:
        return math.nan
    return math.log(discount) / math.log(gamma) if discount > 0.0 else math.inf
