"""Peaks: where what is expected of an action peaks, how sharply, and whether that repeats."""

from collections.abc import Collection, Iterator

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.moment.moment import CHOICES, Choice, Moment
from trdlab.explanations.moment.steps import (
    SHARE,
    explicit_end,
    largest,
    off_by,
    shares,
    stands_out,
    undiscounted,
)
from trdlab.explanations.rules import Claim, Fields, every

ALIKE = 0.05  # of their mean: how far from it what is about the same may be
UNEVEN = 0.25  # of their mean: how far from it the spacings of a rhythm may be
MOST_PEAKS = 4  # that are named one by one


def regular(choice: Choice, named: Collection[int] = ()) -> list[Claim]:
    """Returns a rhythm, or the largest component and the peaks, and how wide the highest peak is.

    Where one of the components that have been `named` is about the largest, that is not said.
    """
    sizes = np.abs(shares(choice.moment, choice.action))
    is_told = any(i < len(sizes) and sizes[i] >= 1.0 - ALIKE for i in named)
    single = every(choice, *(() if is_told else (peak,)), several_peaks)
    return (every(choice, rhythm) or single) + every(choice, spread)


@CHOICES.rule("With {action}, each of {count:first} {mean:pays} ({about:text}not discounted).")
def steady(choice: Choice) -> Iterator[Fields]:
    """Each of three or more steps is within `ALIKE` of their mean; w = 1."""
    row = undiscounted(choice.moment, choice.action)
    if len(row) < 3 or choice.time_axis.width != 1:
        return
    mean = float(row.mean())
    if mean != 0.0 and (np.abs(row - mean) <= ALIKE * abs(mean)).all():
        is_same = (
            choice.moment.is_sure(choice.action)
            and np.ptp(shares(choice.moment, choice.action)) == 0.0
        )
        about = "" if is_same else "more or less, "
        fields = {"count": len(row), "action": choice.action, "about": about}
        yield fields | {"mean": float(row[0]) if is_same else mean}


@CHOICES.rule(
    "The largest {effect:text} of {action} {last_step:within} comes {component:when}: it is "
    "{worth:worth}{amount:number}{average:average}."
)
def peak(choice: Choice) -> Iterator[Fields]:
    """The largest of several components, without their discount; of what was learned, a peak."""
    moment, action = choice.moment, choice.action
    sizes = np.abs(shares(moment, action))
    if np.count_nonzero(stands_out(moment, action)) < 2:
        return
    i = int(sizes.argmax())
    is_alone = bool((np.delete(sizes, i) < sizes[i]).all())
    if is_alone and (moment.is_exact or i in peaks(moment, action)):
        is_group = choice.time_axis.width > 1  # what it is worth now is told of that
        told = moment.components(action) if is_group else undiscounted(moment, action)
        is_sure = moment.is_sure(action, slice(i, i + 1))
        fields = {"component": i, "worth": is_group, "average": is_sure}
        yield _about(choice) | fields | {"amount": abs(float(told[i]))}


@CHOICES.rule("{last_step:within} the {effect:text} expected of {action} peaks {components:whens}.")
def several_peaks(choice: Choice) -> Iterator[Fields]:
    """The most prominent of several peaks."""
    found, sizes = peaks(choice.moment, choice.action), shares(choice.moment, choice.action)
    if len(found) > 1:
        clearest = sorted(found, key=lambda i: -prominence(sizes, i))[:MOST_PEAKS]
        yield _about(choice) | {"components": tuple(sorted(clearest))}


@CHOICES.rule(
    "{last_step:within} the {effect:text} expected of {action} peaks every {period:text} steps, "
    "the first time {first:when}, the last time {last:when}."
)
def rhythm(choice: Choice) -> Iterator[Fields]:
    """Three or more peaks whose spacings are nearly equal: each is within `UNEVEN` of their mean.

    The period is the smallest and the largest of them, in steps. In an exact table each may also be
    one component off. Noise has peaks too: of what was learned, and has not been judged, there have
    to be four.
    """
    moment, action = choice.moment, choice.action
    found = peaks(moment, action)
    is_judged = moment.is_exact or moment.judged(action) is not None
    if len(found) < (3 if is_judged else 4):
        return
    spacings = np.diff(found)
    mean = float(spacings.mean())
    if (np.abs(spacings - mean) <= max(UNEVEN * mean, 1.0 * moment.is_exact)).all():
        ends = sorted({int(of) * choice.time_axis.width for of in (spacings.min(), spacings.max())})
        period = " to ".join(map(str, ends))
        yield _about(choice) | {"period": period, "first": found[0], "last": found[-1]}


@CHOICES.rule(
    "The {effect:text} that {action} is to bring {component:when} is spread over {steps:steps}: "
    "its time is uncertain, or it comes bit by bit."
)
def spread(choice: Choice) -> Iterator[Fields]:
    """The highest peak of what was learned is wider than a step, at half its prominence; w = 1."""
    moment, action = choice.moment, choice.action
    sizes, found = shares(moment, action), peaks(moment, action)
    if moment.is_exact or choice.time_axis.width != 1 or not found:
        return
    i = max(found, key=lambda at: sizes[at])
    first, last = _flanks(sizes, i)
    if last > first and last < len(sizes) - 1:
        fields = {"component": i, "steps": last - first + 1, "first": first, "last": last}
        yield _about(choice) | fields


def _about(choice: Choice) -> Fields:
    moment, action = choice.moment, choice.action
    most = undiscounted(moment, action)[largest(moment, action)]
    return {
        "action": action,
        "effect": "reward" if most > 0.0 else "cost",
        "last_step": explicit_end(moment, action) * choice.time_axis.width - 1,
    }


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
    sizes = shares(moment, action)
    allowed = np.maximum(SHARE, _doubt(moment, action))
    return [
        i for i in np.flatnonzero(sizes >= SHARE).tolist() if prominence(sizes, i) >= allowed[i]
    ]


def _doubt(moment: Moment, action: str) -> FloatArray:
    """Returns `[K]`: what such forecasts are off by, in the unit of `shares`; 0 if not known."""
    row = undiscounted(moment, action)
    if not row.any():
        return row
    error = off_by(moment, action)[: len(row)] / moment.time_axis.discounts[: len(row)]
    return np.asarray(error / np.abs(row).max())


def _flanks(sizes: FloatArray, at: int) -> tuple[int, int]:
    """Returns the first and last place around a peak that are above half its prominence."""
    below = sizes < sizes[at] - prominence(sizes, at) / 2.0
    before, after = np.flatnonzero(below[:at]), np.flatnonzero(below[at:])
    first = int(before[-1]) + 1 if before.size else 0
    return first, at + int(after[0]) - 1 if after.size else len(sizes) - 1
