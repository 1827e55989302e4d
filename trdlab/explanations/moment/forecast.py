"""Forecast: what one action is expected to pay, and when."""

from collections.abc import Iterator, Sequence

import numpy as np

from trdlab.arrays import RELATIVE_ZERO, FloatArray
from trdlab.explanations.moment.chances import LASTING, VARYING, either_or, outcomes_of, put_at
from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.explanations.moment.peaks import regular, rhythm, steady
from trdlab.explanations.moment.steps import (
    doubtful,
    explicit_end,
    largest,
    least,
    speaks_of_all,
    stands_out,
    undiscounted,
)
from trdlab.explanations.rules import Claim, Fields, every, first

_MATTERS = 0.5
"""An error is told that is at least this share of what is expected."""

_TOO_LITTLE = 0.05  # of an action's value, to tell that it lies beyond


def forecast(choice: Choice) -> list[Claim]:
    """Returns when an action's first reward comes, its peaks, its centre and what lies beyond N.

    Nothing is said of components that are not to be trusted. Shares and centres are defined only
    where all components have one sign, and the centre only for w = 1; where they are not defined
    there is no claim.
    """
    end = explicit_end(choice.moment, choice.action)
    if doubtful(choice.moment, choice.action).all():
        return []
    chances = every(choice, *VARYING, *LASTING)
    if not choice.moment.components(choice.action)[:end].any():
        nothing = first(choice, earns_nothing, zero_on_average, all_beyond, nothing_before)
        return nothing + chances
    when = first(choice, steady, next_to_nothing)
    if not when:
        when = every(choice, *FIRSTS)
        named = {claim.component for claim in when}
        when += [c for c in every(choice, either_or) if c.component not in named]
        when += every(choice, put_at) + regular(choice, named)
    is_regular = bool(every(choice, steady, rhythm))
    centre = [] if is_regular else every(choice, centre_of_mass)
    return when + every(choice, off_by, share_beyond) + centre + chances


@CHOICES.rule("Nothing is expected of {action}, at any step.")
def earns_nothing(choice: Choice) -> Iterator[Fields]:
    if _expects_nothing(choice) and not _is_chancy(choice):
        yield {"action": choice.action}


@CHOICES.rule("{action} pays nothing on average at any step, but single episodes differ.")
def zero_on_average(choice: Choice) -> Iterator[Fields]:
    if _expects_nothing(choice) and _is_chancy(choice):
        yield {"action": choice.action}


@CHOICES.rule("{action} pays nothing {last_step:within}; what comes later is worth {value:number}.")
def all_beyond(choice: Choice) -> Iterator[Fields]:
    row, horizon = _row(choice), choice.time_axis.horizon
    is_told = horizon > 0 and speaks_of_all(choice.moment, choice.action)
    if is_told and not row[:-1].any() and row[-1] != 0.0:
        last_step = choice.time_axis.num_steps - 1
        yield {"action": choice.action, "last_step": last_step, "value": float(row[-1])}


@CHOICES.rule("Nothing is expected of {action} {last_step:within}.")
def nothing_before(choice: Choice) -> Iterator[Fields]:
    end = explicit_end(choice.moment, choice.action)
    if end > 0 and not _row(choice)[:end].any():
        yield {"action": choice.action, "last_step": end * choice.time_axis.width - 1}


@CHOICES.rule("Hardly anything is expected of {action} {last_step:within}.")
def next_to_nothing(choice: Choice) -> Iterator[Fields]:
    """Some components of those that a forecast speaks of differ from zero, but none stands out."""
    row = undiscounted(choice.moment, choice.action)
    if row.any() and not stands_out(choice.moment, choice.action).any():
        yield {"action": choice.action, "last_step": len(row) * choice.time_axis.width - 1}


# ---- the first reward, and the first cost ------------------------------------------------------


@CHOICES.rule(
    "With {action}, the first {effect:text} comes {component:when}: it is {worth:worth}"
    "{amount:number}."
)
def first_reward(choice: Choice) -> Iterator[Fields]:
    yield from (told for told in _firsts(choice) if told["is_sure"])


@CHOICES.rule(
    "With {action}, a {effect:text} of {amount:number} can come {component:when}{earliest:text}; "
    "the chance that it comes then is {chance:percent}."
)
def first_chance(choice: Choice) -> Iterator[Fields]:
    """That step pays, or costs, one amount or none."""
    for told in _firsts(choice):
        if not told["is_sure"] and len(told["amounts"]) == 1:
            yield told | {"amount": told["amounts"][0]}


@CHOICES.rule(
    "With {action}, a {effect:text} can come {component:when}{earliest:text}; the chance that it "
    "comes then is {chance:percent}."
)
def first_of_several(choice: Choice) -> Iterator[Fields]:
    """That step pays, or costs, different amounts."""
    yield from (told for told in _firsts(choice) if len(told["amounts"]) > 1)


@CHOICES.rule(
    "With {action}, the first {effect:text} to expect comes {component:when}: {worth:worth}"
    "{amount:number} on average."
)
def first_expected(choice: Choice) -> Iterator[Fields]:
    """It is not known what that step can pay, but for its mean."""
    for told in _firsts(choice):
        if not told["is_sure"] and not told["amounts"]:
            yield told


FIRSTS = (first_reward, first_chance, first_of_several, first_expected)


# ---- how much lies where -----------------------------------------------------------------------


@CHOICES.rule("Forecasts of what comes {component:when} are off by about {error:number}.")
def off_by(choice: Choice) -> Iterator[Fields]:
    """The root mean square of what forecasts of the largest component are off by, if it matters."""
    errors, row = choice.moment.error_of(choice.action), _row(choice)
    if errors is None or choice.moment.is_exact:
        return
    if undiscounted(choice.moment, choice.action).any():
        i = largest(choice.moment, choice.action)
        if errors[i] >= _MATTERS * abs(row[i]):  # not so if it is NaN
            yield {"action": choice.action, "component": i, "error": float(errors[i])}


@CHOICES.rule("{share:percent} of what {action} is worth comes {component:when}.")
def share_beyond(choice: Choice) -> Iterator[Fields]:
    """The share of the residual; all components have one sign."""
    row, horizon = _row(choice), choice.time_axis.horizon
    if horizon > 0 and one_sign(row) and speaks_of_all(choice.moment, choice.action):
        share = float(row[-1] / row.sum())
        if _TOO_LITTLE <= share < 1.0:
            yield {"share": share, "action": choice.action, "component": horizon}


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


def one_sign(row: FloatArray) -> bool:
    """Returns whether shares and means of components make sense: one sign, and not all zero."""
    return bool(row.any() and ((row >= 0.0).all() or (row <= 0.0).all()))


# ---- the numbers -------------------------------------------------------------------------------


def _row(choice: Choice) -> FloatArray:
    return choice.moment.components(choice.action)


def _expects_nothing(choice: Choice) -> bool:
    return not _row(choice).any() and speaks_of_all(choice.moment, choice.action)


def _is_chancy(choice: Choice) -> bool:
    return choice.moment.uncertainty is not None and not choice.moment.is_sure(choice.action)


def _firsts(choice: Choice) -> Iterator[Fields]:
    """Yields the first reward and the first cost that stand out, the earlier one first.

    Where it is known what each step can pay, that is the first step that can pay so; the mean of an
    earlier one may have another sign. One that smaller ones precede is called clear.
    """
    moment, axis, action = choice.moment, choice.time_axis, choice.action
    row, paid = undiscounted(moment, action), outcomes_of(choice)
    found = []
    for sign, effect in ((1.0, "reward"), (-1.0, "cost")):
        part = np.maximum(sign * row, 0.0)  # [K], how much of it is expected at each step
        if paid:
            part = np.array([sum(p * max(sign * r, 0.0) for r, p in step.items()) for step in paid])
        notable = np.flatnonzero((part > 0.0) & (part >= least(moment, action)))
        if notable.size:
            i = int(notable[0])
            effect = "clear " * bool(part[:i].any()) + effect
            found.append((i, effect, float(part[i]), _chances(paid, i, sign)))
    for i, effect, mean, chances in sorted(found):
        chance = min(sum(chances.values()), 1.0)
        one_for_sure = len(chances) == 1 and chance >= 1.0 - RELATIVE_ZERO
        yield {
            "action": action,
            "effect": effect,
            "component": i,
            "earliest": " at the earliest" if i else "",
            "worth": axis.width > 1,
            "amount": mean,
            "amounts": tuple(sorted(chances)),
            "chance": chance,
            "is_sure": one_for_sure if paid else moment.is_sure(action, slice(i, i + 1)),
        }


def _chances(paid: Sequence[dict[float, float]], i: int, sign: float) -> dict[float, float]:
    """Returns the amounts of one sign that a step can pay, and the chance of each."""
    step = paid[i] if paid else {}
    return {abs(r): p for r, p in step.items() if sign * r > 0.0}
