"""Where a preference flips: all sign changes of a gap over an interval, refined."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np

SAMPLES = 64
_PRECISION = 1e-13
_DIP_STEPS = 40

Gap = Callable[[float], float]


def find_flips(gap: Gap, low: float, high: float, *, samples: int = SAMPLES) -> tuple[float, ...]:
    """Returns the values between `low` and `high` at which `gap` changes its sign, in order.

    The interval is sampled evenly and each sign change is refined. Where |gap| dips between
    three samples of one sign, its bottom is sought too, for a pair of flips may hide there. A gap
    that touches zero without crossing it is no flip.

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
    found = []
    for x, y, z in zip(points, points[1:], points[2:], strict=False):
        before, here, after = known[x], known[y], known[z]
        one_sign = before * after > 0.0 and before * here >= 0.0
        if one_sign and abs(here) < min(abs(before), abs(after)):
            found.append(_bottom(gap, x, z, before))
    return found


def _bottom(gap: Gap, low: float, high: float, sign: float) -> float:
    for _ in range(_DIP_STEPS):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        at_a, at_b = sign * gap(a), sign * gap(b)
        if min(at_a, at_b) < 0.0:
            return a if at_a < at_b else b
        low, high = (low, b) if at_a < at_b else (a, high)
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
