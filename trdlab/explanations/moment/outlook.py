"""Outlook: what else was learned to be expected: what happens, and what the reward is made of.

Each is told as far as its forecasts have proved better than a guess, and no further.
"""

from collections.abc import Iterator

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.moment.contrast import untested_difference
from trdlab.explanations.moment.leads import NOISE
from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.explanations.moment.steps import LEAST_DISCOUNT, SHARE
from trdlab.explanations.rules import Claim, Fields, Found, every
from trdlab.formatting import DOUBT, said

_MOST_PARTS = 4  # that are named
_SEEN = 0.02  # of all parts: what is less cannot be seen in two digits
_MOST = 0.5  # of all that differs: a part that makes more of it decides
_PEAK = 2.0  # times the mean of all other chances: what is likelier than that has a time


def forecast(choice: Choice) -> list[Claim]:
    """Returns what else is expected of an action, and what cannot be told."""
    return every(choice, *made_of, *outcomes, untold)


def contrast(choice: Choice) -> list[Claim]:
    """Returns what else is expected otherwise of its foil, if differences are to be trusted."""
    return [] if every(choice, *untested_difference) else every(choice, decides, *differences)


def in_brief(choice: Choice) -> list[Claim]:
    """Returns the one finding that matters most, where outcomes were asked for."""
    return (contrast(choice) + forecast(choice))[:1]


@CHOICES.kinds(
    {
        "made-of": "{last_step:within} {action} brings {total:share} on average: {parts:bill}.",
        "part-alone": (
            "With {action}, {total:share} is expected from {outcome:text} {last_step:within}."
        ),
    }
)
def made_of(choice: Choice) -> Iterator[Found]:
    """What the reward is made of, as far as all parts can be told, and those that go further."""
    together = [*_told(choice, "parts", together=True)]
    common = together[0][1] if together else -1
    sums = {part: float(row.sum()) for part, _, (row, *_) in together}
    ordered = sorted(sums, key=lambda part: -abs(sums[part]))
    named, others = ordered[:_MOST_PARTS], ordered[_MOST_PARTS:]
    parts = {part: sums[part] for part in named}
    parts |= {f"{len(others)} others": sum(sums[part] for part in others)} if others else {}
    least = _SEEN * sum(map(abs, sums.values()))
    if parts := {part: total for part, total in parts.items() if abs(total) > least}:
        about = {"action": choice.action, "last_step": common, "total": sum(sums.values())}
        yield "made-of", about | {"parts": parts}
    for part, last_step, (row, *_) in _told(choice, "parts"):
        if last_step > common and row.any():
            about = {"action": choice.action, "last_step": last_step, "total": float(row.sum())}
            yield "part-alone", about | {"outcome": part}


@CHOICES.rule(
    "{last_step:within}, most of the difference is {outcome:text}: on average {total:share} with "
    "{action} and {other:share} with {foil}."
)
def decides(choice: Choice) -> Iterator[Fields]:
    """One part makes more than half of what the parts differ by, and that is no noise."""
    told = [*_told(choice, "parts", together=True)]
    for action, foil in choice.orders[:1] if told else ():
        sums = np.stack([rows.sum(axis=1) for *_, rows in told])  # [P, 2]
        apart, size = np.ptp(sums, axis=1), np.abs(sums).sum(axis=0).max()
        lead = np.abs(choice.moment.lead(action, foil)).max()
        i = int(apart.argmax())
        if apart[i] > max(_MOST * apart.sum(), SHARE * size, NOISE * lead):
            about = {"action": action, "foil": foil, "outcome": told[i][0]}
            total, other = sums[i].tolist()
            yield about | {"last_step": told[i][1], "total": total, "other": other}


@CHOICES.kinds(
    {
        "chance-of": (
            "With {action}, there is {chance:likely} of {outcome:text} {last_step:within}."
        ),
        "likeliest": (
            "Within {count:first} of {action}, {outcome:text} is likeliest {component:when}: "
            "{chance:likely}."
        ),
        "comes-in": (
            "With {action}, {outcome:text} comes in {total:rough} of {count:groups}, on average."
        ),
        "comes-in-less": (
            "With {action}, {outcome:text} comes in less than one of {count:groups}: {total:rough} "
            "on average."
        ),
        "adds-up": (
            "With {action}, {outcome:text} adds up to {total:rough}{unit:text} {last_step:within}, "
            "on average."
        ),
    }
)
def outcomes(choice: Choice) -> Iterator[Found]:
    """When an event is likeliest, or in how many steps it comes; how much an amount adds up to.

    The chance that an event comes at all is that of the only component that can be told, or at most
    all chances together, if that is little; it is exactly these where the event ends the episode.
    Of other events a group of steps counts once.
    """
    for about, row, _ in _sums(choice):
        peak, total = int(row.argmax()), about["total"]
        if "unit" in about:
            yield "adds-up", about
        elif len(row) == 1 or _ends(choice, about["outcome"]) or total <= DOUBT:
            yield "chance-of", about | {"chance": total}
        elif row[peak] >= _PEAK * np.delete(row, peak).mean():
            steps = {"component": peak, "chance": float(row[peak]), "count": about["last_step"] + 1}
            yield "likeliest", about | steps
        else:
            yield "comes-in" if float(said(total, 2)) >= 1.0 else "comes-in-less", about


@CHOICES.kinds(
    {
        "chances-differ": (
            "{last_step:within}, there is {total:likely} of {outcome:text} with {action}, and "
            "{other:likely} with {foil}."
        ),
        "comes-otherwise": (
            "Of {count:groups}, {outcome:text} comes in {total:rough} with {action} and in "
            "{other:rough} with {foil}, on average."
        ),
        "adds-up-otherwise": (
            "{last_step:within}, {outcome:text} adds up to {total:rough}{unit:text} with {action} "
            "and {other:rough}{unit:text} with {foil}, on average."
        ),
    }
)
def differences(choice: Choice) -> Iterator[Found]:
    """What comes otherwise with the foil, and by so much that it is no noise."""
    for about, row, others in _sums(choice):
        is_once = len(row) == 1 or _ends(choice, about["outcome"])
        kind = "chances-differ" if is_once else "comes-otherwise"
        kind, least = ("adds-up-otherwise", 0.0) if "unit" in about else (kind, DOUBT)
        for other in others:
            size = max(abs(about["total"]), abs(other))
            if abs(about["total"] - other) > max(least, SHARE * size):
                yield kind, about | {"foil": choice.foil, "other": other}


def _ends(choice: Choice, outcome: str) -> bool:
    """Whether it ends the episode, so that its chances add up to the chance that it comes."""
    known = choice.moment.outlook
    return known is not None and outcome in known.endings


def _sums(choice: Choice) -> Iterator[tuple[Fields, FloatArray, list[float]]]:
    """Yields what can be told of each event and amount, its components, and the foil's sum if any.

    Amounts have a unit: they are discounted, but with w = 1 not.
    """
    axis, is_full = choice.time_axis, choice.time_axis.width == 1
    full = np.maximum(axis.discounts, LEAST_DISCOUNT) if is_full else np.ones(axis.num_components)
    unit: Fields = {"unit": "" if is_full else " (discounted)"}
    for kind, weights in (("events", np.ones_like(full)), ("amounts", 1.0 / full)):
        for outcome, last_step, rows in _told(choice, kind):
            about: Fields = {"count": rows.shape[1]} if kind == "events" else unit
            sums = (rows * weights[: rows.shape[1]]).sum(axis=1)  # [1 or 2]
            total, *others = np.minimum(sums, 1.0 if _ends(choice, outcome) else np.inf).tolist()
            about = {"action": choice.action, "outcome": outcome, "total": total} | about
            yield about | {"last_step": last_step}, rows[0], others


@CHOICES.rule(
    "{outcome:text} cannot be told yet: such forecasts have not proved better than a guess."
)
def untold(choice: Choice) -> Iterator[Fields]:
    """What was asked for."""
    known = choice.moment.outlook
    yield from ({"outcome": name} for name in (() if known is None else known.untold))


def _told(
    choice: Choice, kind: str, *, together: bool = False
) -> Iterator[tuple[str, int, FloatArray]]:
    """Yields what can be told, up to which step, and `[1 or 2, K]` of the action and its foil."""
    moment, known = choice.moment, choice.moment.outlook
    at = [moment.index(name) for name in (choice.action, choice.foil) if name is not None]
    for name, rows in {} if known is None else known.told(kind, together=together).items():
        yield name, rows.shape[-1] * moment.time_axis.width - 1, rows[at]
