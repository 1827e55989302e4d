"""How numbers look: one precision for all numbers that are read together."""

import math
from collections.abc import Iterable
from itertools import pairwise

_SMALLEST_FIXED = 1e-4
_LARGEST_FIXED = 1e7

DOUBT = 0.05
"""Chances that were learned are not told nearer to 0 or 1."""


def decimals_for(values: Iterable[float]) -> int:
    """Returns the decimals at which a group of numbers is read: two, or more if many are small.

    >>> decimals_for([0, 0.95, 3.258]), decimals_for([0, 0.0123]), decimals_for([1, 0.003, 0.002])
    (2, 4, 3)
    """
    sizes = [abs(v) for v in values if math.isfinite(v) and v != 0.0]
    largest = max(sizes, default=0.0)
    if largest == 0.0 or largest >= 0.1:
        lost = [sum(size < 0.5 * 0.1**decimals for size in sizes) for decimals in (2, 3)]
        return 2 + sum(4 * count > len(sizes) for count in lost)
    return 2 - math.floor(math.log10(max(largest, _SMALLEST_FIXED)))


def decimals_between(a: float, b: float) -> int:
    """Returns the decimals at which two different numbers look different (at most 9).

    >>> decimals_between(3.26, 3.52), decimals_between(3.2601, 3.2604)
    (2, 4)
    """
    decimals = decimals_for((a, b))
    differ = not math.isclose(a, b, rel_tol=1e-12)
    while differ and decimals < 9 and f"{a:.{decimals}f}" == f"{b:.{decimals}f}":
        decimals += 1
    return decimals


def number(value: float, decimals: int = 2) -> str:
    """Returns a number as it is printed: an exact zero is `0`, all else has fixed decimals.

    >>> number(3.2580), number(0.0), number(-0.001), number(2.5e-9, 4)
    ('3.26', '0', '0.00', '2.50e-09')
    """
    if value == 0.0:
        return "0"
    if not math.isfinite(value):
        return "none" if math.isnan(value) else ("-" if value < 0 else "") + "inf"
    if abs(value) >= _LARGEST_FIXED or (decimals > 2 and abs(value) < _SMALLEST_FIXED):
        return f"{value:.{max(2, decimals - 2) if abs(value) >= _LARGEST_FIXED else 2}e}"
    text = f"{value:.{decimals}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def amount(value: float, decimals: int | None = None) -> str:
    """Returns a reward as people write it: whole numbers without decimals.

    >>> amount(4.0000000001), amount(4.327), amount(-1.0), amount(4e-12)
    ('4', '4.33', '-1', '4.00e-12')
    """
    if math.isfinite(value) and abs(value) < _LARGEST_FIXED and math.isclose(value, round(value)):
        return str(round(value))
    return number(value, decimals_for([value]) if decimals is None else decimals)


def decimals_to_tell(values: Iterable[float]) -> int:
    """Returns the decimals at which a group is read and different numbers look different.

    >>> [decimals_to_tell(pair) for pair in ([3.26, 3.52], [4.0, 3.99999], [1e12, 1.001e12])]
    [2, 5, 5]
    """
    told = list(values)
    decimals = decimals_for(told)
    while decimals < 15 and _look_alike(told, decimals):
        decimals += 1
    return decimals


def _look_alike(values: list[float], decimals: int) -> bool:
    """Returns whether two different numbers are printed alike."""
    ordered = sorted(value for value in values if math.isfinite(value))
    return any(
        not math.isclose(a, b, rel_tol=1e-12) and number(a, decimals) == number(b, decimals)
        for a, b in pairwise(ordered)
    )


def said(value: float, digits: int = 3) -> str:
    """Returns a number as sentences say it: significant digits, without zeros at their end.

    Whole numbers keep all their digits.

    >>> said(2.7075), said(4.0), said(-0.0475), said(1234.5), said(2.71e-12)
    ('2.71', '4', '-0.0475', '1234', '2.71e-12')
    """
    if value == 0.0 or not math.isfinite(value):
        return number(value)
    if not _SMALLEST_FIXED <= abs(value) < _LARGEST_FIXED:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        return f"{_bare(mantissa)}e{exponent}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return _bare(f"{value:.{decimals}f}")


def signed(value: float) -> str:
    """Returns what something adds, to two digits.

    >>> signed(2.713), signed(-0.8), signed(0.0)
    ('+2.7', '-0.8', '0')
    """
    return "+" * (value > 0.0) + said(value, 2)


def digits_to_tell(values: Iterable[float], least: int = 3) -> int:
    """Returns the significant digits at which different numbers look different (at most 15).

    >>> [digits_to_tell(pair) for pair in ([3.26, 3.52], [4.0, 3.99999], [1e12, 1.001e12])]
    [3, 6, 4]
    """
    told: list[float] = []
    for value in values:
        if not any(math.isclose(value, other, rel_tol=1e-12) for other in told):
            told.append(value)
    for digits in range(least, 15):
        if len({said(value, digits) for value in told}) == len(told):
            return digits
    return 15 if len(told) > 1 else least


def _bare(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def plain(value: float) -> str:
    """Returns a given number, such as γ, with as many digits as it needs (at most 12).

    >>> plain(0.95), plain(4.0), plain(0.999999)
    ('0.95', '4', '0.999999')
    """
    return f"{value:.12g}"


def percent(share: float) -> str:
    """Returns a share in percent; what is neither nothing nor all does not look like it.

    >>> percent(0.231), percent(0.998), percent(1.0)
    ('23', '99.8', '100')
    """
    for decimals in range(5):
        text = f"{100 * share:.{decimals}f}"
        if share in (0.0, 1.0) or float(text) not in (0.0, 100.0):
            break
    return text


def chance_of(share: float) -> str:
    """Returns a chance with its article.

    >>> chance_of(0.05), chance_of(0.08), chance_of(0.11), chance_of(0.803)
    ('a 5 % chance', 'an 8 % chance', 'an 11 % chance', 'an 80 % chance')
    """
    number = percent(share)
    is_eight = number.startswith("8") or number.partition(".")[0] in ("11", "18")
    return f"{'an' if is_eight else 'a'} {number} % chance"


def likely(chance: float) -> str:
    """Returns a chance that was learned, which is never as good as sure.

    >>> likely(0.153), likely(0.997), likely(0.0)
    ('about a 15 % chance', 'a chance of about 95 % or more', 'a chance of about 5 % or less')
    """
    if not DOUBT <= chance <= 1.0 - DOUBT:
        end = f"{percent(DOUBT)} % or less" if chance < 0.5 else f"{percent(1.0 - DOUBT)} % or more"
        return f"a chance of about {end}"
    return f"about {chance_of(chance)}"


def significant(value: float, digits: int = 5) -> str:
    """Returns a number with a fixed count of significant digits, trailing zeros kept.

    >>> significant(0.868876), significant(4.327012)
    ('0.86888', '4.3270')
    """
    return f"{value:#.{digits}g}"


def vector(values: Iterable[float]) -> str:
    """Returns a reward vector as the paper prints it.

    >>> vector([0, 0, 3.258])
    '[0, 0, 3.26]'
    """
    row = list(values)
    decimals = decimals_for(row)
    return "[" + ", ".join(number(v, decimals) for v in row) + "]"
