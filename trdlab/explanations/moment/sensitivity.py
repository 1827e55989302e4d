"""Where a preference flips as γ or a reward varies, the policy re-optimised."""

import math
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np

from trdlab.explanations.moment.leads import better_of
from trdlab.explanations.moment.moment import CHOICES, Choice, WhatIf
from trdlab.explanations.rules import Claim, Fields, Found, every
from trdlab.formatting import digits_to_tell, plain, said

SAMPLES = 64  # pieces into which an interval is cut at first
_PRECISION = 1e-13
_DIP_STEPS = 34  # each leaves _GOLDEN of an interval: a ten-millionth in the end
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

Gap = Callable[[float], float]


def sensitivity(choice: Choice) -> list[Claim]:
    """Returns where the preference flips as each quantity varies, or that it never does.

    The nearest flips come first, those of rewards before that of γ. The policy is re-optimised at
    every value. A preference that stays the same but for ties counts as never flipping; where the
    actions tie as it is, there is no preference to flip.
    """
    return every(choice, flips, *in_all, searched)


def find_flips(gap: Gap, low: float, high: float) -> tuple[float, ...]:
    """Returns the values between `low` and `high` at which `gap` changes its sign, in order.

    The gap is continuous. The interval is sampled evenly and each sign change is refined. Where
    |gap| dips between three samples of one sign, or towards an end of the interval, its bottom is
    sought too, for a pair of flips may hide there. A gap that touches zero without crossing it is
    no flip. Samples prove nothing about what lies between them.

    >>> [round(x, 6) for x in find_flips(lambda x: x * x - 0.25, -1, 1)]
    [-0.5, 0.5]
    """
    known = {float(x): gap(float(x)) for x in np.linspace(low, high, SAMPLES + 1)}
    # where an interval begins or ends in a zero, the sign within counts
    within = [x + 0.382 * (y - x) for x, y in pairwise(known) if known[x] * known[y] == 0.0]
    known |= {x: gap(x) for x in within}
    known = dict(sorted(known.items()))
    known |= {x: gap(x) for x in _bottoms(gap, known)}
    nonzero = [(x, known[x]) for x in sorted(known) if known[x] != 0.0]
    return tuple(
        _root(gap, x, y, at_x, at_y)
        for (x, at_x), (y, at_y) in pairwise(nonzero)
        if at_x * at_y < 0.0
    )


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


@lru_cache(maxsize=64)
def _found(choice: Choice) -> tuple[tuple[WhatIf, str, str, tuple[float, ...]], ...]:
    """Returns, of each quantity, the better action, the worse one and where that flips."""
    better = next(iter(better_of(choice)), None)
    if better is None:
        return ()
    a, b = better["better"], better["worse"]
    i, j = choice.moment.index(a), choice.moment.index(b)
    return tuple(
        (of, a, b, find_flips(partial(of.gap, i, j), of.low, of.high))
        for of in choice.moment.what_ifs
    )


@CHOICES.rule(
    "{worse} would be better if {quantity:text} {were:text} {at:names} instead of {present:given}."
)
def flips(choice: Choice) -> Iterator[Fields]:
    """The nearest values, below and above the present one, at which the other action is better."""
    for of, better, worse, roots in sorted(_found(choice), key=_change):
        below = [root for root in roots[::-1] if root < of.current]
        above = [root for root in roots if root > of.current]
        for side in (below, above):
            if side:
                end = side[1] if len(side) > 1 else of.low if side is below else of.high
                yield {"better": better, "worse": worse} | _bounds(of, side, (side[0] + end) / 2)


@CHOICES.kinds(
    {
        "never-flips": (
            "Whatever {quantity:text} {did:text}, within the values tried, {better} is better "
            "than {worse}."
        ),
        "several-flips": (
            "The preference changes sides at each of these values of {quantity:text}: {at:names}."
        ),
    }
)
def in_all(choice: Choice) -> Iterator[Found]:
    """Quantities that never flip it, or more often than at the nearest values."""
    for of, better, worse, roots in _found(choice):
        if not roots:
            fields = {"quantity": of.name, "did": of.verb("was", "paid", "cost")}
            yield "never-flips", fields | {"worse": worse, "better": better}
        elif len(roots) > 1:
            sizes = [abs(root) for root in roots]
            at = tuple(said(size, digits_to_tell(sizes)) for size in sizes)
            yield "several-flips", {"quantity": of.name, "at": at}


@CHOICES.rule(
    "{samples:count} values{of:text} were tried, every one with its own best policy: "
    "{ranges:names}."
)
def searched(choice: Choice) -> Iterator[Fields]:
    """Two changes between two neighbouring values can be missed."""
    found = [of for of, *_ in _found(choice)]
    if found:
        ends = [sorted((abs(of.low), abs(of.high))) for of in found]  # a cost is a positive number
        ranges = tuple(
            f"{of.name} from {plain(least)} to {plain(most)}"
            for of, (least, most) in zip(found, ends, strict=True)
        )
        each = " of each" if len(ranges) > 1 else ""
        yield {"samples": SAMPLES + 1, "of": each, "ranges": ranges}


def _change(found: tuple[WhatIf, str, str, tuple[float, ...]]) -> tuple[bool, float]:
    """Returns by which share a quantity has to change for the preference to flip; γ comes last."""
    of, _, _, roots = found
    least = min((abs(root - of.current) for root in roots), default=math.inf)
    return of.name == "γ", least / abs(of.current) if of.current else math.inf


def _bounds(of: WhatIf, side: list[float], inside: float) -> Fields:
    """Returns how a sentence says for which values of a quantity the preference is another."""
    nearest, present = abs(side[0]), abs(of.current)
    digits = digits_to_tell([nearest, present])
    fields = {"quantity": of.name, "present": present, "inside": inside, "bounds": tuple(side[:2])}
    at = said(nearest, digits)
    if len(side) > 1:
        low, high = sorted((nearest, abs(side[1])))
        at = f"{said(low, digits)} and {said(high, digits)}"
        were = of.verb("were between", "paid between", "cost between")
    elif nearest > present:
        were = of.verb("were above", "paid more than", "cost more than")
    else:
        were = of.verb("were below", "paid less than", "cost less than")
    return fields | {"were": were, "at": (at,)}
