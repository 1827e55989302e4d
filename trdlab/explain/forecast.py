"""Forecast: what one action is expected to pay, and when."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from trdlab.explain.finding import Finding, agrees, one_sign
from trdlab.explain.moment import Moment


def forecast(moment: Moment, action: str) -> tuple[Finding, ...]:
    """Returns when an action's first reward comes, its peak, its centre and what lies beyond N.

    Shares and centres are defined only where all components have one sign, and the centre only
    for w = 1; where they are not defined there is no finding.

    Args:
        moment: the decompositions of every action.
        action: the name of one.

    Raises:
        InputError: there is no such action.
    """
    return _when(moment, action) + _chances(moment, action)


def _when(moment: Moment, action: str) -> tuple[Finding, ...]:
    axis, row = moment.time_axis, moment.components(action)
    explicit, value = row[:-1], float(row.sum())
    if not row.any():
        return (EarnsNothing(action),)
    if axis.horizon == 0:
        return ()
    if not explicit.any():
        return (AllBeyond(action, value, axis.horizon),)
    first = int(np.flatnonzero(explicit)[0])
    discounted = float(explicit[first])
    findings: list[Finding] = []
    if axis.width == 1 and axis.gamma > 0.0:
        reward = discounted / axis.gamma**first
        kind = FirstStepReward if discounted > 0.0 else FirstStepCost
        findings.append(kind(action, first, discounted, reward))
    else:
        findings.append((FirstReward if discounted > 0.0 else FirstCost)(action, first, discounted))
    if np.count_nonzero(explicit) > 1:
        peak = int(explicit.argmax())
        if explicit[peak] > 0.0:
            findings.append(Peak(action, peak, float(explicit[peak])))
        if axis.width == 1 and one_sign(explicit):
            centre = explicit @ np.arange(axis.horizon) / explicit.sum()
            findings.append(CentreOfMass(action, float(centre)))
    if one_sign(row) and row[-1] != 0.0:
        findings.append(ShareBeyond(action, float(row[-1] / value), axis.horizon))
    return tuple(findings)


def _chances(moment: Moment, action: str) -> tuple[Finding, ...]:
    """Returns what is uncertain about an action: all of it, one step, and how long it lasts."""
    known, a = moment.uncertainty, moment.index(action)
    if known is None:
        return ()
    findings: list[Finding] = []
    deviation = float(known.return_deviation[a])
    if deviation > 0.0:
        findings.append(GiveOrTake(action, moment.q_value(action), deviation))
    either = [
        EitherOr(action, i, reward, chance)
        for i, step in enumerate(known.outcomes[a] if known.outcomes else ())
        for reward, chance in step.items()
        if set(step) == {0.0, reward} and reward != 0.0
    ]
    if either:
        findings.append(max(either, key=lambda x: abs(x.reward) * x.chance))
    over = np.flatnonzero(known.survival[a] < 0.5)
    if over.size:
        i = int(over[0])
        chance = 1.0 - float(known.survival[a, i])
        sure = SurelyOver(action, i)
        findings.append(sure if sure.holds(moment) else LikelyOver(action, i, chance))
    return tuple(findings)


@dataclass(eq=False, repr=False)
class EarnsNothing(Finding):
    """No component of an action differs from zero."""

    action: str

    def holds(self, moment: Moment) -> bool:
        return not moment.components(self.action).any()


@dataclass(eq=False, repr=False)
class AllBeyond(Finding):
    """All of an action's value lies in the residual."""

    action: str
    value: float
    component: int

    def holds(self, moment: Moment) -> bool:
        row = moment.components(self.action)
        at_end = self.component == moment.time_axis.horizon > 0
        return at_end and not row[:-1].any() and row[-1] != 0.0 and agrees(self.value, row[-1])


@dataclass(eq=False, repr=False)
class FirstReward(Finding):
    """The first component of an action that is not zero, where it is positive."""

    sign: ClassVar[float] = 1.0

    action: str
    component: int
    discounted: float

    def holds(self, moment: Moment) -> bool:
        row, i = moment.components(self.action), self.component
        is_first = i < moment.time_axis.horizon and not row[:i].any()
        return is_first and bool(row[i] * self.sign > 0.0) and agrees(self.discounted, row[i])


@dataclass(eq=False, repr=False)
class FirstCost(FirstReward):
    """The same where that component is negative."""

    sign: ClassVar[float] = -1.0


@dataclass(eq=False, repr=False)
class FirstStepReward(FirstReward):
    """The same for w = 1, where the discount can be taken out exactly."""

    reward: float

    def holds(self, moment: Moment) -> bool:
        axis = moment.time_axis
        if axis.width != 1 or axis.gamma == 0.0 or not super().holds(moment):
            return False
        true = moment.components(self.action)[self.component] / axis.gamma**self.component
        return agrees(self.reward, float(true))


@dataclass(eq=False, repr=False)
class FirstStepCost(FirstStepReward):
    """The same where that reward is negative."""

    sign: ClassVar[float] = -1.0


@dataclass(eq=False, repr=False)
class Peak(Finding):
    """The largest explicit component (of equals the first), where several are not zero."""

    action: str
    component: int
    discounted: float

    def holds(self, moment: Moment) -> bool:
        row, i = moment.components(self.action), self.component
        explicit = row[:-1]
        return (
            i < moment.time_axis.horizon
            and bool(explicit[i] > 0.0 and (explicit[i] >= explicit).all())
            and not (explicit[:i] == explicit[i]).any()
            and int(np.count_nonzero(explicit)) > 1
            and agrees(self.discounted, row[i])
        )


@dataclass(eq=False, repr=False)
class ShareBeyond(Finding):
    """The share of an action's value that lies in the residual; components of one sign only."""

    action: str
    share: float
    component: int

    def holds(self, moment: Moment) -> bool:
        row = moment.components(self.action)
        return (
            self.component == moment.time_axis.horizon > 0
            and one_sign(row)
            and row[-1] != 0.0
            and agrees(self.share, float(row[-1] / row.sum()))
        )


@dataclass(eq=False, repr=False)
class CentreOfMass(Finding):
    """The mean step of an action's explicit rewards, weighted by amount; w = 1, one sign."""

    action: str
    step: float

    def holds(self, moment: Moment) -> bool:
        explicit = moment.components(self.action)[:-1]
        if moment.time_axis.width != 1 or not one_sign(explicit):
            return False
        return agrees(self.step, float(explicit @ np.arange(len(explicit)) / explicit.sum()))


@dataclass(eq=False, repr=False)
class GiveOrTake(Finding):
    """The standard deviation of an action's whole discounted reward."""

    action: str
    value: float
    deviation: float

    def holds(self, moment: Moment) -> bool:
        if moment.uncertainty is None:
            return False
        deviation = float(moment.uncertainty.return_deviation[moment.index(self.action)])
        value = moment.q_value(self.action)
        return deviation > 0.0 and agrees(self.value, value) and agrees(self.deviation, deviation)


@dataclass(eq=False, repr=False)
class EitherOr(Finding):
    """A step that pays one amount or nothing; of several, where most of it is expected."""

    action: str
    component: int
    reward: float
    chance: float

    def holds(self, moment: Moment) -> bool:
        known, a = moment.uncertainty, moment.index(self.action)
        if known is None or not known.outcomes or self.component >= len(known.outcomes[a]):
            return False
        expected = [
            sum(abs(r) * p for r, p in step.items()) if len(step) == 2 and 0.0 in step else -1.0
            for step in known.outcomes[a]
        ]
        step = known.outcomes[a][self.component]
        (reward, chance), *_ = [*((r, p) for r, p in step.items() if r != 0.0), (0.0, 0.0)]
        return (
            expected.index(max(expected)) == self.component
            and expected[self.component] > 0.0
            and agrees(self.reward, reward)
            and agrees(self.chance, chance)
        )


@dataclass(eq=False, repr=False)
class LikelyOver(Finding):
    """The first component at whose beginning the episode has more likely ended than not."""

    action: str
    component: int
    chance: float

    def holds(self, moment: Moment) -> bool:
        survival = _survival_when_likely_over(moment, self.action, self.component)
        return survival is not None and survival > 0.0 and agrees(self.chance, 1.0 - survival)


@dataclass(eq=False, repr=False)
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
