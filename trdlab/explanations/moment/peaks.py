"""Rhythm: where what is expected of an action peaks, how sharply, and whether that repeats."""

from collections.abc import Collection
from typing import Literal

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.explanations.claims import Finding, agrees
from trdlab.explanations.moment.limits import LEAST_DISCOUNT, explicit_end
from trdlab.explanations.moment.moment import Moment

SHARE = 0.2
"""What stands out: at least this share of the largest that is expected at any one step."""

NEGLIGIBLE = 0.01
"""What an exact table expects below this share is not worth a sentence."""

ALIKE = 0.05
"""How far what is about the same may be from its mean, as a share of that."""

UNEVEN = 0.25
"""How far the spacings of a rhythm may be from their mean, as a share of it."""

MOST_PEAKS = 4  # that are named one by one

_ROUNDING = 9  # decimals, of a share of the largest

Effect = Literal["reward", "cost"]


def undiscounted(moment: Moment, action: str) -> FloatArray:
    """Returns `[K]`: the components that can be told apart and trusted, without their discount.

    With w = 1 these are expected rewards; a group is discounted to its own first step (errata P9).
    """
    end = explicit_end(moment, action)
    return moment.components(action)[:end] / moment.time_axis.discounts[:end]


def effect_of(value: float) -> Effect:
    """Returns what a reward is called."""
    return "reward" if value > 0.0 else "cost"


def prominence(row: FloatArray, i: int) -> float:
    """Returns how far a row falls on both sides of a place before it comes to one that is higher.

    On the left an equal one counts as higher, so of equals the first stands for all; where there is
    none, nothing limits the place on that side: nothing comes before the action. On the right the
    row has to fall before it ends, for what comes after it is not known.

    >>> [round(prominence(np.array([0.0, 3.0, 2.0, 2.5, 1.0]), i), 1) for i in range(5)]
    [0.0, 2.0, 0.0, 0.5, 0.0]
    """
    higher = np.flatnonzero(row[:i] >= row[i])
    left = row[higher[-1] : i + 1].min() if higher.size else -np.inf
    beyond = np.flatnonzero(row[i:] > row[i])
    right = row[i : i + int(beyond[0]) if beyond.size else len(row)].min()
    return float(row[i] - max(left, right))


def peaks(moment: Moment, action: str) -> list[int]:
    """Returns the components at which what is expected of an action peaks, in order of time.

    A peak stands out by itself and by its prominence: both are at least `SHARE` of the largest. Of
    what was learned the prominence is also no less than what such forecasts are off by there.
    """
    shares = _shares(moment, action)
    allowed = np.maximum(SHARE, _doubt(moment, action))
    return [
        i for i in np.flatnonzero(shares >= SHARE).tolist() if prominence(shares, i) >= allowed[i]
    ]


def stands_out(moment: Moment, action: str) -> BoolArray:
    """Returns `[K]`: which of the trusted explicit components are more than noise (see `least`)."""
    size = np.abs(undiscounted(moment, action))
    return np.asarray((size > 0.0) & (size >= least(moment, action)))


def least(moment: Moment, action: str) -> float:
    """Returns the least that stands out at a step, without its discount.

    Of what was learned that is `SHARE` of the largest that is expected. Of an exact table, which
    has no noise, it is `NEGLIGIBLE` of the largest, or of the reward that would be worth the
    residual if every later step paid it.
    """
    axis = moment.time_axis
    largest = float(np.abs(undiscounted(moment, action)).max(initial=0.0))
    if not moment.is_exact:
        return SHARE * largest
    later = abs(float(moment.components(action)[-1])) * (1.0 - axis.gamma**axis.width)
    begins = float(axis.discounts[-1])
    rate = later / begins if begins >= LEAST_DISCOUNT else 0.0
    return NEGLIGIBLE * max(largest, rate)


def largest(moment: Moment, action: str) -> int:
    """Returns the component with the largest size, of equals the first."""
    return int(np.abs(_shares(moment, action)).argmax())


def steady(moment: Moment, action: str) -> "Steady | None":
    """Returns that every step pays about the same, where that is so."""
    row, end = undiscounted(moment, action), explicit_end(moment, action)
    claim = Steady(action, end, effect_of(row[0]), float(row.mean())) if row.size else None
    return claim if claim is not None and claim.holds(moment) else None


def regular(moment: Moment, action: str, named: Collection[int] = ()) -> tuple[Finding, ...]:
    """Returns a rhythm, or the largest component and the peaks, and how wide the highest peak is.

    Args:
        moment: the decompositions of every action.
        action: the name of one of which something is expected.
        named: components that have been told of; if one is about the largest, that is not said.
    """
    found, end, at = peaks(moment, action), explicit_end(moment, action), largest(moment, action)
    what = effect_of(undiscounted(moment, action)[at])
    claims: list[Finding] = []
    if len(found) > 1:
        claims.append(Rhythm(action, end, what, _period(moment, found), found[0], found[-1]))
    if not any(claim.holds(moment) for claim in claims):
        sizes = np.abs(_shares(moment, action))
        if not any(sizes[i] >= 1.0 - ALIKE for i in named):
            claims.append(Peak(action, end, what, at, float(moment.components(action)[at])))
        row = moment.components(action)
        named_peaks = tuple((i, float(row[i])) for i in _clearest(moment, action, found))
        claims.append(Peaks(action, end, what, named_peaks))
    if found:
        shares = _shares(moment, action)
        highest = max(found, key=lambda i: shares[i])
        first, last = _flanks(shares, highest)
        claims.append(Spread(action, what, highest, last - first + 1, first, last))
    return tuple(claim for claim in claims if claim.holds(moment))


def _shares(moment: Moment, action: str) -> FloatArray:
    """Returns `[K]`: what is expected, as a share of the largest, which is 1 if it is a cost too.

    Shares that differ only by rounding are equal.
    """
    row = undiscounted(moment, action)
    if not row.any():
        return row
    return np.asarray(np.round(row / row[np.abs(row).argmax()], _ROUNDING))


def _doubt(moment: Moment, action: str) -> FloatArray:
    """Returns `[K]`: what such forecasts are off by, in the unit of `_shares`; 0 if not known."""
    row, errors = undiscounted(moment, action), moment.error_of(action)
    if errors is None or moment.is_exact or not row.any():
        return np.zeros(len(row))
    error = np.nan_to_num(errors[: len(row)]) / moment.time_axis.discounts[: len(row)]
    return np.asarray(error / np.abs(row).max())


def _clearest(moment: Moment, action: str, found: list[int]) -> tuple[int, ...]:
    """Returns the most prominent peaks, of equals the earlier, in order of time."""
    shares = _shares(moment, action)
    order = sorted(found, key=lambda i: -prominence(shares, i))
    return tuple(sorted(order[:MOST_PEAKS]))


def _period(moment: Moment, found: list[int]) -> tuple[int, int]:
    """Returns the smallest and the largest spacing of peaks, in steps."""
    spacings = np.diff(found) * moment.time_axis.width
    return int(spacings.min()), int(spacings.max())


def _flanks(shares: FloatArray, peak: int) -> tuple[int, int]:
    """Returns the first and last place around a peak that are above half its prominence."""
    below = shares < shares[peak] - prominence(shares, peak) / 2.0
    before, after = np.flatnonzero(below[:peak]), np.flatnonzero(below[peak:])
    first = int(before[-1]) + 1 if before.size else 0
    return first, peak + int(after[0]) - 1 if after.size else len(shares) - 1


class Steady(Finding):
    """Each of three or more steps is within `ALIKE` of their mean; w = 1."""

    action: str
    end: int
    effect: str
    mean: float

    def holds(self, moment: Moment) -> bool:
        row = undiscounted(moment, self.action)
        if (
            self.end != explicit_end(moment, self.action)
            or len(row) < 3
            or moment.time_axis.width != 1
        ):
            return False
        mean = float(row.mean())
        return (
            mean != 0.0
            and bool((np.abs(row - mean) <= ALIKE * abs(mean)).all())
            and self.effect == effect_of(mean)
            and agrees(self.mean, mean)
        )


class Peak(Finding):
    """The largest of several components, without their discount, of those before `end`.

    Of what was learned it has to be a peak.
    """

    action: str
    end: int
    effect: str
    component: int
    discounted: float

    def holds(self, moment: Moment) -> bool:
        shares, i = np.abs(_shares(moment, self.action)), self.component
        if self.end != explicit_end(moment, self.action) or i >= self.end:
            return False
        value = float(moment.components(self.action)[i])
        return (
            int(np.count_nonzero(stands_out(moment, self.action))) > 1
            and bool((np.delete(shares, i) < shares[i]).all())
            and (moment.is_exact or i in peaks(moment, self.action))
            and self.effect == effect_of(value)
            and agrees(self.discounted, value)
        )


class Peaks(Finding):
    """The most prominent of several peaks: their components, and what each is worth now."""

    action: str
    end: int
    effect: str
    peaks: tuple[tuple[int, float], ...]

    def holds(self, moment: Moment) -> bool:
        found, row = peaks(moment, self.action), moment.components(self.action)
        return (
            self.end == explicit_end(moment, self.action)
            and len(found) > 1
            and tuple(i for i, _ in self.peaks) == _clearest(moment, self.action, found)
            and all(agrees(worth, float(row[i])) for i, worth in self.peaks)
            and self.effect == _effect(moment, self.action)
        )


class Rhythm(Finding):
    """Three or more peaks whose spacings are nearly equal: each is within `UNEVEN` of their mean.

    The period is the smallest and the largest of them, in steps. In an exact table each may also be
    one component off. Noise has peaks too: of what was learned, and has not been judged, there have
    to be four.
    """

    action: str
    end: int
    effect: str
    period: tuple[int, int]
    first: int
    last: int

    def holds(self, moment: Moment) -> bool:
        found = peaks(moment, self.action)
        is_judged = moment.is_exact or moment.error_of(self.action) is not None
        if self.end != explicit_end(moment, self.action) or len(found) < (3 if is_judged else 4):
            return False
        spacings = np.diff(found)
        mean = float(spacings.mean())
        return (
            bool((np.abs(spacings - mean) <= max(UNEVEN * mean, 1.0 * moment.is_exact)).all())
            and (self.first, self.last) == (found[0], found[-1])
            and self.period == _period(moment, found)
            and self.effect == _effect(moment, self.action)
        )


class Spread(Finding):
    """The highest peak of what was learned is wider than a step, at half its prominence; w = 1."""

    action: str
    effect: str
    component: int
    steps: int
    first: int
    last: int

    def holds(self, moment: Moment) -> bool:
        if moment.is_exact or moment.time_axis.width != 1:
            return False
        shares, found = _shares(moment, self.action), peaks(moment, self.action)
        if self.component not in found or (shares[found] > shares[self.component]).any():
            return False
        return (
            (self.first, self.last) == _flanks(shares, self.component)
            and self.steps == self.last - self.first + 1 > 1
            and self.last < len(shares) - 1
            and self.effect == _effect(moment, self.action)
        )


def _effect(moment: Moment, action: str) -> Effect:
    return effect_of(undiscounted(moment, action)[largest(moment, action)])
