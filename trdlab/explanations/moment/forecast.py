"""Forecast: what one action is expected to pay, and when."""

from collections.abc import Iterator

import numpy as np

from trdlab.explanations.claims import Finding, agrees, one_sign
from trdlab.explanations.moment.chances import chances, likelihood, one_or_nothing
from trdlab.explanations.moment.limits import doubtful, explicit_end
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.peaks import (
    Rhythm,
    effect_of,
    largest,
    regular,
    stands_out,
    steady,
    undiscounted,
)

_MATTERS = 0.5
"""An error is told that is at least this share of what is expected."""

_TOO_LITTLE = 0.05  # of an action's value, to tell that it lies beyond


def forecast(moment: Moment, action: str) -> tuple[Finding, ...]:
    """Returns when an action's first reward comes, its peaks, its centre and what lies beyond N.

    Nothing is said of components that are not to be trusted. Shares and centres are defined only
    where all components have one sign, and the centre only for w = 1; where they are not defined
    there is no finding.

    Args:
        moment: the decompositions of every action.
        action: the name of one.

    Raises:
        InputError: there is no such action.
    """
    row, end = moment.components(action), explicit_end(moment, action)
    if doubtful(moment, action).all():
        return ()
    if not row[:end].any():
        return (*_nothing(moment, action), *chances(moment, action))
    always = steady(moment, action)
    when = tuple(_when(moment, action)) if always is None else (always,)
    is_regular = always is not None or any(isinstance(x, Rhythm) for x in when)
    named = {x.component for x in when if isinstance(x, FirstChance)}
    return (
        *when,
        *_accuracy(moment, action),
        *_beyond(moment, action),
        *(() if is_regular else _centre(moment, action)),
        *chances(moment, action, named),
    )


def _when(moment: Moment, action: str) -> Iterator[Finding]:
    """Yields what comes first, how likely the largest reward is, and where rewards peak."""
    if not stands_out(moment, action).any():
        yield NextToNothing(action, explicit_end(moment, action))
        return
    firsts = tuple(_firsts(moment, action))
    yield from firsts
    yield from likelihood(moment, action)
    yield from regular(moment, action, {first.component for first in firsts})


def _nothing(moment: Moment, action: str) -> tuple[Finding, ...]:
    """Returns what is said where no explicit component differs from zero."""
    beyond = AllBeyond(action, moment.q_value(action), moment.time_axis.horizon)
    before = NothingBefore(action, explicit_end(moment, action))
    claims = (EarnsNothing(action), beyond, before)
    return tuple(claim for claim in claims if claim.holds(moment))[:1]


def _firsts(moment: Moment, action: str) -> Iterator["FirstReward"]:
    """Yields the first reward and the first cost, the earlier one first."""
    row, notable = undiscounted(moment, action), stands_out(moment, action)
    either = one_or_nothing(moment, action)
    places = [np.flatnonzero(notable & (sign * row > 0.0)) for sign in (1.0, -1.0)]
    for i in sorted(int(place[0]) for place in places if place.size):
        discounted = float(moment.components(action)[i])
        effect = _effect(moment, action, i)
        if i in either:
            reward, chance = either[i]
            yield FirstChance(action, effect, i, discounted, abs(reward), chance)
        elif moment.time_axis.width == 1:
            yield FirstStepReward(action, effect, i, discounted, float(row[i]))
        else:
            yield FirstReward(action, effect, i, discounted)


def _effect(moment: Moment, action: str, component: int) -> str:
    """Returns what a component is called: a notable one, if smaller ones of its kind precede it."""
    row = undiscounted(moment, action)
    is_preceded = bool((row[:component] * np.sign(row[component]) > 0.0).any())
    return "notable " * is_preceded + effect_of(row[component])


def _accuracy(moment: Moment, action: str) -> Iterator[Finding]:
    """Yields what such forecasts are off by, where that matters."""
    i = largest(moment, action)
    errors = moment.error_of(action)
    if errors is not None and not moment.is_exact:
        error = float(errors[i])
        if error >= _MATTERS * abs(moment.components(action)[i]):  # not so if it is NaN
            yield OffBy(action, i, error)


def _speaks_of_all(moment: Moment, action: str) -> bool:
    """Returns whether all components of an action can be told of: trusted, or of an exact table.

    Short episodes of such a table may not have shown what it knows of the residual.
    """
    return moment.is_exact or not doubtful(moment, action).any()


def _beyond(moment: Moment, action: str) -> Iterator[Finding]:
    row = moment.components(action)
    if one_sign(row):
        beyond = ShareBeyond(action, float(row[-1] / row.sum()), moment.time_axis.horizon)
        if beyond.share >= _TOO_LITTLE and beyond.holds(moment):
            yield beyond


def _centre(moment: Moment, action: str) -> Iterator[Finding]:
    end = explicit_end(moment, action)
    explicit = moment.components(action)[:end]
    if one_sign(explicit):
        step = float(explicit @ np.arange(end) / explicit.sum())
        centre = CentreOfMass(action, end, effect_of(explicit.sum()), step)
        if centre.holds(moment):
            yield centre


class EarnsNothing(Finding):
    """No component of an action differs from zero (see `_speaks_of_all`)."""

    action: str

    def holds(self, moment: Moment) -> bool:
        return not moment.components(self.action).any() and _speaks_of_all(moment, self.action)


class AllBeyond(Finding):
    """All of an action's value lies in the residual (see `_speaks_of_all`)."""

    action: str
    value: float
    component: int

    def holds(self, moment: Moment) -> bool:
        row = moment.components(self.action)
        at_end = self.component == moment.time_axis.horizon > 0 and _speaks_of_all(
            moment, self.action
        )
        return at_end and not row[:-1].any() and row[-1] != 0.0 and agrees(self.value, row[-1])


class NothingBefore(Finding):
    """No component of an action differs from zero, of those that a forecast speaks of."""

    action: str
    end: int

    def holds(self, moment: Moment) -> bool:
        is_nothing = not moment.components(self.action)[: self.end].any()
        return is_nothing and self.end == explicit_end(moment, self.action) > 0


class NextToNothing(Finding):
    """Some components of those that a forecast speaks of differ from zero, but none stands out."""

    action: str
    end: int

    def holds(self, moment: Moment) -> bool:
        row = undiscounted(moment, self.action)
        little = bool(row.any()) and not stands_out(moment, self.action).any()
        return little and self.end == explicit_end(moment, self.action)


class FirstReward(Finding):
    """The first component of its sign that stands out; it is notable if smaller ones precede it."""

    action: str
    effect: str
    component: int
    discounted: float

    def holds(self, moment: Moment) -> bool:
        row, notable = undiscounted(moment, self.action), stands_out(moment, self.action)
        i = self.component
        if i >= len(row) or not notable[i]:
            return False
        before = notable[:i] & (np.sign(row[:i]) == np.sign(row[i]))
        return (
            not before.any()
            and self.effect == _effect(moment, self.action, i)
            and agrees(self.discounted, float(moment.components(self.action)[i]))
        )


class FirstStepReward(FirstReward):
    """The same for w = 1, where the discount can be taken out exactly."""

    reward: float

    def holds(self, moment: Moment) -> bool:
        return (
            moment.time_axis.width == 1
            and super().holds(moment)
            and agrees(self.reward, float(undiscounted(moment, self.action)[self.component]))
        )


class FirstChance(FirstReward):
    """The same where that step pays, or costs, one amount or nothing."""

    amount: float
    chance: float

    def holds(self, moment: Moment) -> bool:
        reward, chance = one_or_nothing(moment, self.action).get(self.component, (0.0, 0.0))
        return (
            chance > 0.0
            and super().holds(moment)
            and agrees(self.amount, abs(reward))
            and agrees(self.chance, chance)
        )


class OffBy(Finding):
    """What forecasts of an action's largest component are off by: the root mean square."""

    action: str
    component: int
    error: float

    def holds(self, moment: Moment) -> bool:
        errors = moment.error_of(self.action)
        if errors is None or not undiscounted(moment, self.action).any():
            return False
        i = largest(moment, self.action)
        return self.component == i and agrees(self.error, float(errors[i]))


class CentreOfMass(Finding):
    """The mean step of an action's rewards before `end`, weighted by what they are worth now.

    There are several that stand out, w = 1, and all have one sign.
    """

    action: str
    end: int
    effect: str
    step: float

    def holds(self, moment: Moment) -> bool:
        explicit = moment.components(self.action)[: self.end]
        if self.end != explicit_end(moment, self.action) or not one_sign(explicit):
            return False
        return (
            moment.time_axis.width == 1
            and int(np.count_nonzero(stands_out(moment, self.action))) > 1
            and self.effect == effect_of(explicit.sum())
            and agrees(self.step, float(explicit @ np.arange(self.end) / explicit.sum()))
        )


class ShareBeyond(Finding):
    """The share of an action's value that lies in the residual; components of one sign only.

    For what has to be trusted, see `_speaks_of_all`.
    """

    action: str
    share: float
    component: int

    def holds(self, moment: Moment) -> bool:
        row = moment.components(self.action)
        return (
            self.component == moment.time_axis.horizon > 0
            and one_sign(row)
            and row[-1] != 0.0
            and _speaks_of_all(moment, self.action)
            and agrees(self.share, float(row[-1] / row.sum()))
        )
