"""Chances: what is uncertain about what an action is expected to pay."""

from collections.abc import Collection, Iterator

import numpy as np

from trdlab.explanations.claims import Finding, agrees
from trdlab.explanations.moment.limits import explicit_end
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.peaks import NEGLIGIBLE, SHARE, largest, undiscounted


def likelihood(moment: Moment, action: str) -> Iterator[Finding]:
    """Yields the chance that a learned forecast implies, where it is one.

    Args:
        moment: the decompositions of every action.
        action: the name of one of which something is expected.
    """
    if moment.only_reward is not None and not moment.is_exact:
        i = largest(moment, action)
        chance = float(undiscounted(moment, action)[i] / moment.only_reward)
        claim = PutAt(action, i, moment.only_reward, chance)
        if claim.holds(moment):
            yield claim


def chances(moment: Moment, action: str, named: Collection[int] = ()) -> Iterator[Finding]:
    """Yields how much an action's reward varies, where one step does, and how long it lasts.

    Args:
        moment: the decompositions of every action, and how uncertain they are.
        action: the name of one.
        named: components whose chances have been told.
    """
    known, a = moment.uncertainty, moment.index(action)
    if known is None:
        return
    varies = GiveOrTake(action, moment.q_value(action), float(known.return_deviation[a]))
    if varies.holds(moment):
        yield varies
    either = [
        EitherOr(action, i, verb_of(reward), abs(reward), chance)
        for i, (reward, chance) in one_or_nothing(moment, action).items()
    ]
    if either:
        most = max(either, key=lambda x: x.amount * x.chance)
        if most.component not in named and most.holds(moment):
            yield most
    over = np.flatnonzero(known.survival[a] < 0.5)
    if over.size:
        i = int(over[0])
        chance = 1.0 - float(known.survival[a, i])
        sure = SurelyOver(action, i)
        yield sure if sure.holds(moment) else LikelyOver(action, i, chance)


def one_or_nothing(moment: Moment, action: str) -> dict[int, tuple[float, float]]:
    """Returns the steps that pay one amount, or cost one, or nothing: the reward, and its chance.

    Args:
        moment: the decompositions of every action, and how uncertain they are.
        action: the name of one.
    """
    known = moment.uncertainty
    if known is None or not known.outcomes:
        return {}
    steps = known.outcomes[moment.index(action)][: explicit_end(moment, action)]
    return {
        i: (reward, chance)
        for i, step in enumerate(steps)
        for reward, chance in step.items()
        if set(step) == {0.0, reward} and reward != 0.0
    }


def verb_of(reward: float) -> str:
    """Returns what an action does that is rewarded so."""
    return "pays" if reward > 0.0 else "costs"


class PutAt(Finding):
    """The chance that the largest component implies, where one reward or none is ever observed.

    With w = 1 component k is γ^k·c times the probability that step k pays c (errata P9, P10).
    """

    action: str
    component: int
    reward: float
    chance: float

    def holds(self, moment: Moment) -> bool:
        row, paid = undiscounted(moment, self.action), moment.only_reward
        if paid is None or moment.trust is None or moment.time_axis.width != 1 or not row.any():
            return False
        chance = float(row[largest(moment, self.action)] / paid)
        return (
            self.component == largest(moment, self.action)
            and 0.0 < chance <= 1.0
            and agrees(self.reward, paid)
            and agrees(self.chance, chance)
        )


class GiveOrTake(Finding):
    """The standard deviation of an action's whole discounted reward, if it is not `NEGLIGIBLE`."""

    action: str
    value: float
    deviation: float

    def holds(self, moment: Moment) -> bool:
        if moment.uncertainty is None:
            return False
        deviation = float(moment.uncertainty.return_deviation[moment.index(self.action)])
        value = moment.q_value(self.action)
        return (
            deviation > NEGLIGIBLE * abs(value)
            and agrees(self.value, value)
            and agrees(self.deviation, deviation)
        )


class EitherOr(Finding):
    """A step that pays one amount or nothing; of several, where most of it is expected.

    The amount matters: it is at least `SHARE` of the action's value and of the largest reward that
    is expected of it at one step, and what is expected of it at least `NEGLIGIBLE`.
    """

    action: str
    component: int
    verb: str
    amount: float
    chance: float

    def holds(self, moment: Moment) -> bool:
        either = one_or_nothing(moment, self.action)
        if self.component not in either:
            return False
        expected = {i: abs(reward) * chance for i, (reward, chance) in either.items()}
        reward, chance = either[self.component]
        row = undiscounted(moment, self.action)
        scale = max(abs(moment.q_value(self.action)), float(np.abs(row).max()))
        return (
            self.component == max(expected, key=expected.__getitem__)
            and abs(reward) >= SHARE * scale
            and expected[self.component] >= NEGLIGIBLE * scale
            and self.verb == verb_of(reward)
            and agrees(self.amount, abs(reward))
            and agrees(self.chance, chance)
        )


class LikelyOver(Finding):
    """The first component at whose beginning the episode has more likely ended than not."""

    action: str
    component: int
    chance: float

    def holds(self, moment: Moment) -> bool:
        survival = _survival_when_likely_over(moment, self.action, self.component)
        return survival is not None and survival > 0.0 and agrees(self.chance, 1.0 - survival)


class SurelyOver(Finding):
    """The same where it has ended for certain."""

    action: str
    component: int

    def holds(self, moment: Moment) -> bool:
        return _survival_when_likely_over(moment, self.action, self.component) == 0.0


def _survival_when_likely_over(moment: Moment, action: str, component: int) -> float | None:
    """Returns the survival at a component, if it is the first at which it is below one half."""
    if moment.uncertainty is None:
        return None
    survival = moment.uncertainty.survival[moment.index(action)]
    below = np.flatnonzero(survival < 0.5)
    return float(survival[component]) if below.size and below[0] == component else None
