"""Where a preference flips as γ or a reward varies, the policy re-optimised."""

import math
from collections.abc import Callable
from decimal import Decimal
from itertools import pairwise

import numpy as np

from trdlab.arrays import same
from trdlab.explanations.claims import Finding, Shown, agrees
from trdlab.explanations.moment.moment import Moment, WhatIf

SAMPLES = 64
_PRECISION = 1e-13
_DIP_STEPS = 34  # each leaves _GOLDEN of an interval: a ten-millionth in the end
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

Gap = Callable[[float], float]


def what_would_flip(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    """Returns where the preference flips as each quantity varies, or that it never does.

    The policy is re-optimised at every value. A preference that stays the same but for ties counts
    as never flipping. Where the actions tie as it is, there is no preference to flip.

    Raises:
        InputError: there is no such action.
    """
    i, j = moment.index(action), moment.index(foil)
    if same(moment.q_value(action), moment.q_value(foil)):
        return ()
    found: list[Finding] = []
    for what_if in moment.what_ifs:
        name, low, high = what_if.name, what_if.low, what_if.high
        at = find_flips(lambda x, w=what_if: w.gap(i, j, x), low, high)  # type: ignore[misc]
        if at:
            found.append(Flips(action, foil, name, what_if.current, low, high, at))
        else:
            better, worse = moment.ordered(action, foil)
            found.append(NeverFlips(better, worse, name, low, high))
    return tuple(found)


def find_flips(gap: Gap, low: float, high: float, *, samples: int = SAMPLES) -> tuple[float, ...]:
    """Returns the values between `low` and `high` at which `gap` changes its sign, in order.

    The interval is sampled evenly and each sign change is refined. Where |gap| dips between
    three samples of one sign, or towards an end of the interval, its bottom is sought too, for a
    pair of flips may hide there. A gap that touches zero without crossing it is no flip. Samples
    prove nothing about what lies between them.

    Args:
        gap: a continuous function, for example Q(action) − Q(foil) as γ varies.
        low: the lower end.
        high: the upper end.
        samples: into how many pieces the interval is cut at first.

    >>> [round(x, 6) for x in find_flips(lambda x: x * x - 0.25, -1, 1)]
    [-0.5, 0.5]
    """
    known = {float(x): gap(float(x)) for x in np.linspace(low, high, samples + 1)}
    known |= {x: gap(x) for x in _beside_zeros(known)}
    known = dict(sorted(known.items()))
    known |= {x: gap(x) for x in _bottoms(gap, known)}
    nonzero = [(x, known[x]) for x in sorted(known) if known[x] != 0.0]
    return tuple(
        _root(gap, x, y, at_x, at_y)
        for (x, at_x), (y, at_y) in pairwise(nonzero)
        if at_x * at_y < 0.0
    )


def _beside_zeros(known: dict[float, float]) -> list[float]:
    """Returns a point in each interval that begins or ends in a zero: the sign within counts."""
    return [x + 0.382 * (y - x) for x, y in pairwise(known) if known[x] * known[y] == 0.0]


def _bottoms(gap: Gap, known: dict[float, float]) -> list[float]:
    """Returns where |gap| is least, between each three samples of one sign that show a dip."""
    points = list(known)
    found = [
        _bottom(gap, min(x, y), max(x, y), known[x])
        for x, y in (points[:2], points[:-3:-1])  # the first interval, and the last one backward
        if known[x] * known[y] > 0.0 and abs(known[x]) < abs(known[y])
    ]
    for x, y, z in zip(points, points[1:], points[2:], strict=False):
        before, here, after = known[x], known[y], known[z]
        one_sign = before * after > 0.0 and before * here >= 0.0
        if one_sign and abs(here) < min(abs(before), abs(after)):
            found.append(_bottom(gap, x, z, before))
    return found


def _bottom(gap: Gap, low: float, high: float, sign: float) -> float:
    """Golden-section search for the least sign · gap, which stops below zero."""
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a, at_b = sign * gap(a), sign * gap(b)
    for _ in range(_DIP_STEPS):
        if min(at_a, at_b) < 0.0:
            return a if at_a < at_b else b
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = sign * gap(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = sign * gap(b)
    return (low + high) / 2.0


def _root(gap: Gap, low: float, high: float, at_low: float, at_high: float) -> float:
    """Ridders' method: halves the bracket at least, and doubles the digits on smooth gaps."""
    root = (low + high) / 2.0
    while high - low > _PRECISION * max(1.0, abs(low), abs(high)):
        middle = (low + high) / 2.0
        at_middle = gap(middle)
        if at_middle == 0.0:
            return middle
        step = (middle - low) * at_middle / math.sqrt(at_middle**2 - at_low * at_high)
        last, root = root, middle + math.copysign(1.0, at_low - at_high) * step
        at_root = gap(root)
        if at_root == 0.0 or abs(root - last) <= _PRECISION * max(1.0, abs(root)):
            return root
        known = sorted([(low, at_low), (middle, at_middle), (root, at_root), (high, at_high)])
        for (a, at_a), (b, at_b) in pairwise(known):
            if at_a * at_b < 0.0:
                low, at_low, high, at_high = a, at_a, b, at_b
    return root


class Flips(Finding):
    """The values of one quantity at which the preference between two actions flips."""

    action: str
    foil: str
    quantity: str
    current: float
    low: float
    high: float
    at: tuple[float, ...]

    def holds(self, moment: Moment) -> bool:
        what_if = _what_if(moment, self.quantity)
        if what_if is None or not agrees(self.current, what_if.current):
            return False
        if not (agrees(self.low, what_if.low) and agrees(self.high, what_if.high)):
            return False
        if sorted(self.at) != list(self.at) or not self.at:
            return False
        i, j = moment.index(self.action), moment.index(self.foil)
        signs = [np.sign(what_if.gap(i, j, x)) for x in _around(self, what_if)]
        return all(a * b < 0 for a, b in zip(signs[::2], signs[1::2], strict=True)) and all(
            a == b for a, b in zip(signs[1:-1:2], signs[2::2], strict=True)
        )


class NeverFlips(Finding):
    """No flip was found: the preference is the same at all sampled values of one quantity."""

    better: str
    worse: str
    quantity: str
    low: float
    high: float

    def holds(self, moment: Moment) -> bool:
        what_if = _what_if(moment, self.quantity)
        if what_if is None:
            return False
        if not (agrees(self.low, what_if.low) and agrees(self.high, what_if.high)):
            return False
        i, j = moment.index(self.better), moment.index(self.worse)
        gaps = [what_if.gap(i, j, x) for x in np.linspace(what_if.low, what_if.high, 23)]
        return min(gaps) >= 0.0 and max(gaps) > 0.0


def _what_if(moment: Moment, name: str) -> WhatIf | None:
    return next((what_if for what_if in moment.what_ifs if what_if.name == name), None)


def _around(flips: Flips, what_if: WhatIf) -> list[float]:
    """Returns a value just below and just above each flip, half a unit of its last digit away."""
    around = []
    for root in flips.at:
        half = 1e-7 * max(1.0, abs(root))
        if isinstance(root, Shown):
            half = 0.5000001 * 10.0 ** int(Decimal(root.text).as_tuple().exponent)
        around += [max(root - half, what_if.low), min(root + half, what_if.high)]
    return around
