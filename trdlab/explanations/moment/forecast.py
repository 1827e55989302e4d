"""Forecast: what one action is expected to pay, and when."""

from collections.abc import Iterator

import numpy as np

from trdlab.arrays import RELATIVE_ZERO, FloatArray, one_sign
from trdlab.explanations.moment.chances import either_or, give_or_take, outcomes_of, over, put_at
from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.explanations.moment.peaks import regular, rhythm, steady
from trdlab.explanations.moment.steps import (
    doubtful,
    explicit_end,
    largest,
    least,
    stands_out,
    undiscounted,
)
from trdlab.explanations.rules import Claim, Fields, Found, every, first

_MATTERS = 0.5  # of what is expected: an error is told that is at least this share
_TOO_LITTLE = 0.05  # of an action's value, to tell that it lies beyond


def forecast(choice: Choice) -> list[Claim]:
    """Returns when an action's first reward comes, its peaks, its centre and what lies beyond N.

    Nothing is said of components that are not to be trusted. Shares and centres are defined only
    where all components have one sign, and the centre only for w = 1; where they are not defined
    there is no claim.
    """
    end = explicit_end(choice.moment, choice.action)
    if doubtful(choice.moment, choice.action).all():
        return every(choice, *over)  # which has been judged by itself
    chances = every(choice, give_or_take, *over)
    if not choice.moment.components(choice.action)[:end].any():
        return first(choice, *silence) + chances
    when = first(choice, steady, next_to_nothing)
    if not when:
        when = every(choice, *firsts)
        named = {claim.component for claim in when}
        when += [c for c in every(choice, either_or) if c.component not in named]
        when += every(choice, put_at) + regular(choice, named)
    is_regular = bool(every(choice, steady, rhythm))
    centre = [] if is_regular else every(choice, centre_of_mass)
    return when + every(choice, off_by, share_beyond) + centre + chances


@CHOICES.kinds(
    {
        "earns-nothing": "Nothing is expected of {action}, at any step.",
        "zero-on-average": (
            "{action} pays nothing on average at any step, but single episodes differ."
        ),
        "all-beyond": (
            "{action} pays nothing {last_step:within}; what comes later is worth {value:number}."
        ),
        "nothing-before": "Nothing is expected of {action} {last_step:within}.",
    }
)
def silence(choice: Choice) -> Iterator[Found]:
    moment, action, axis, row = choice.moment, choice.action, choice.time_axis, _row(choice)
    is_chancy = moment.uncertainty is not None and not moment.is_sure(action)
    if not doubtful(moment, action).any() and not row[:-1].any():
        if row[-1] == 0.0:
            yield "zero-on-average" if is_chancy else "earns-nothing", {"action": action}
        elif axis.horizon > 0:
            fields = {"action": action, "last_step": axis.num_steps - 1, "value": float(row[-1])}
            yield "all-beyond", fields
    end = explicit_end(moment, action)
    if end > 0 and not row[:end].any():
        yield "nothing-before", {"action": action, "last_step": end * axis.width - 1}


@CHOICES.rule("Hardly anything is expected of {action} {last_step:within}.")
def next_to_nothing(choice: Choice) -> Iterator[Fields]:
    """Some components of those that a forecast speaks of differ from zero, but none stands out."""
    row = undiscounted(choice.moment, choice.action)
    if row.any() and not stands_out(choice.moment, choice.action).any():
        yield {"action": choice.action, "last_step": len(row) * choice.time_axis.width - 1}


@CHOICES.kinds(
    {
        "first-reward": (
            "With {action}, the first {effect:text} comes {component:when}: it is "
            "{worth:worth}{amount:number}."
        ),
        "first-chance": (
            "With {action}, a {effect:text} of {amount:number} can come "
            "{component:when}{earliest:text}; the chance that it comes then is {chance:percent}."
        ),
        "first-of-several": (
            "With {action}, a {effect:text} can come {component:when}{earliest:text}; the chance "
            "that it comes then is {chance:percent}."
        ),
        "first-expected": (
            "With {action}, the first {effect:text} to expect comes {component:when}: "
            "{worth:worth}{amount:number} on average."
        ),
    }
)
def firsts(choice: Choice) -> Iterator[Found]:
    """Yields the first reward and the first cost that stand out, the earlier one first.

    Where it is known what each step can pay, that is the first step that can pay so; the mean of an
    earlier one may have another sign. One that smaller ones precede is called clear.
    """
    moment, axis, action = choice.moment, choice.time_axis, choice.action
    row, paid = undiscounted(moment, action), outcomes_of(choice)
    scale = axis.discounts if axis.width > 1 else np.ones(axis.num_components)
    found = []
    for sign, effect in ((1.0, "reward"), (-1.0, "cost")):
        part = np.maximum(sign * row, 0.0)  # [K], how much of it is expected at each step
        if paid:
            part = np.array([sum(p * max(sign * r, 0.0) for r, p in step.items()) for step in paid])
        notable = np.flatnonzero((part > 0.0) & (part >= least(moment, action)))
        if notable.size:
            i = int(notable[0])
            effect = "clear " * bool(part[:i].any()) + effect
            step = paid[i] if paid else {}
            chances = {abs(r): p for r, p in step.items() if sign * r > 0.0}
            found.append((i, effect, float(part[i]), chances))
    for i, effect, mean, chances in sorted(found):
        chance = min(sum(chances.values()), 1.0)
        amounts, is_one = tuple(sorted(chances)), len(chances) == 1
        one_for_sure = is_one and chance >= 1.0 - RELATIVE_ZERO
        is_sure = one_for_sure if paid else moment.is_sure(action, slice(i, i + 1))
        several = "first-of-several" if amounts else "first-expected"
        kind = "first-reward" if is_sure else "first-chance" if is_one else several
        fields = {
            "action": action,
            "effect": effect,
            "component": i,
            "earliest": " at the earliest" if i else "",
            "worth": axis.width > 1,
            "amount": amounts[0] if kind == "first-chance" else mean * scale[i],
            "amounts": amounts,
            "chance": chance,
            "is_sure": is_sure,
        }
        yield kind, fields


@CHOICES.rule("Forecasts of what comes {component:when} are off by about {error:number}.")
def off_by(choice: Choice) -> Iterator[Fields]:
    """The root mean square of what forecasts of the largest component are off by, if it matters."""
    judged = choice.moment.judged(choice.action)
    nothing = not undiscounted(choice.moment, choice.action).any()
    if nothing or judged is None or choice.moment.is_exact:
        return
    i = largest(choice.moment, choice.action)
    error = float(judged.off_by[i])
    if error >= _MATTERS * abs(_row(choice)[i]):  # not so if it is NaN
        yield {"action": choice.action, "component": i, "error": error}


@CHOICES.rule("{share:percent} of what {action} {pays:text} comes {component:when}.")
def share_beyond(choice: Choice) -> Iterator[Fields]:
    """The share of the residual; all components have one sign."""
    row, horizon = _row(choice), choice.time_axis.horizon
    is_doubtful = doubtful(choice.moment, choice.action).any()
    if horizon > 0 and one_sign(row) and not is_doubtful:
        share = float(row[-1] / row.sum())
        if _TOO_LITTLE <= share < 1.0:
            pays = "is worth" if row.sum() > 0.0 else "costs"
            fields = {"share": share, "action": choice.action, "pays": pays}
            yield fields | {"component": horizon}


@CHOICES.rule(
    "What {action} {pays:text} {last_step:within} comes {step:tenths} steps later on average."
)
def centre_of_mass(choice: Choice) -> Iterator[Fields]:
    """The mean step of several rewards of one sign, weighted by what they are worth now; w = 1."""
    end, axis = explicit_end(choice.moment, choice.action), choice.time_axis
    explicit = _row(choice)[:end]
    several = np.count_nonzero(stands_out(choice.moment, choice.action)) > 1
    if several and axis.width == 1 and one_sign(explicit):
        yield {
            "action": choice.action,
            "pays": "pays" if explicit.sum() > 0.0 else "costs",
            "last_step": end - 1,
            "step": float(explicit @ np.arange(end) / explicit.sum()),
        }


def _row(choice: Choice) -> FloatArray:
    return choice.moment.components(choice.action)
