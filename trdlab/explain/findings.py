"""Findings: small true statements about a moment, each with the numbers that support it.

Each one can check itself: `holds(moment)` tests the claim by its definition, not by the search
that found it. The numbers it compares may be exact, or `Shown`: read back from printed text.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from decimal import Decimal
from typing import Any, ClassVar

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explain.moment import Moment, WhatIf, same


class Shown(float):
    """A number as it stood in a text; it equals every number that is printed the same way."""

    text: str
    reprint: Callable[[float], str]

    def __new__(cls, text: str, reprint: Callable[[float], str]) -> "Shown":
        """Reads the number; `reprint` prints another one in the same manner."""
        shown = super().__new__(cls, text)
        shown.text, shown.reprint = text, reprint
        return shown


def agrees(claimed: float, true: float) -> bool:
    """Returns whether a claimed number is the true one, at the precision it was claimed in."""
    if isinstance(claimed, Shown):
        return claimed.reprint(true) == claimed.text
    return same(claimed, true) or abs(claimed - true) <= 1e-9 * max(1.0, abs(true))


@dataclass(frozen=True)
class Finding:
    """Base class: a claim and its numbers."""

    kinds: ClassVar[dict[str, type["Finding"]]] = {}

    def __init_subclass__(cls) -> None:
        cls.kinds[cls.kind()] = cls

    @classmethod
    def kind(cls) -> str:
        """Returns the name of the claim, as JSON carries it: `first-reward`."""
        return re.sub(r"(?<!^)([A-Z])", r"-\1", cls.__name__).lower()

    def holds(self, moment: Moment) -> bool:
        """Returns whether the claim is true of a moment, tested by its definition."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Returns the kind and the numbers as plain data."""
        return {"kind": self.kind()} | {f.name: getattr(self, f.name) for f in fields(self)}


# ---- whose future ------------------------------------------------------------------------------


@dataclass(frozen=True)
class WhoseFuture(Finding):
    """Who acts after the first action."""

    policy: str

    def holds(self, moment: Moment) -> bool:
        return self.policy == moment.future.policy


@dataclass(frozen=True)
class TiedActions(Finding):
    """Several optimal actions tie here, and their futures differ."""

    actions: tuple[str, ...]

    def holds(self, moment: Moment) -> bool:
        return len(self.actions) > 1 and self.actions == moment.tied


@dataclass(frozen=True)
class TiedLater(Finding):
    """Optimal actions tie in later states, and their futures differ."""

    states: int

    def holds(self, moment: Moment) -> bool:
        return self.states > 0 and self.states == moment.tied_later


# ---- forecast of one action --------------------------------------------------------------------


@dataclass(frozen=True)
class EarnsNothing(Finding):
    """No component of an action differs from zero."""

    action: str

    def holds(self, moment: Moment) -> bool:
        return not moment.components(self.action).any()


@dataclass(frozen=True)
class AllBeyond(Finding):
    """All of an action's value lies in the residual."""

    action: str
    value: float
    component: int

    def holds(self, moment: Moment) -> bool:
        row = moment.components(self.action)
        at_end = self.component == moment.time_axis.horizon > 0
        return at_end and not row[:-1].any() and row[-1] != 0.0 and agrees(self.value, row[-1])


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class FirstCost(FirstReward):
    """The same where that component is negative."""

    sign: ClassVar[float] = -1.0


@dataclass(frozen=True)
class FirstStepReward(FirstReward):
    """The same for w = 1, where the discount can be taken out exactly."""

    reward: float

    def holds(self, moment: Moment) -> bool:
        axis = moment.time_axis
        if axis.width != 1 or axis.gamma == 0.0 or not super().holds(moment):
            return False
        true = moment.components(self.action)[self.component] / axis.gamma**self.component
        return agrees(self.reward, float(true))


@dataclass(frozen=True)
class FirstStepCost(FirstStepReward):
    """The same where that reward is negative."""

    sign: ClassVar[float] = -1.0


@dataclass(frozen=True)
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


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class CentreOfMass(Finding):
    """The mean step of an action's explicit rewards, weighted by amount; w = 1, one sign."""

    action: str
    step: float

    def holds(self, moment: Moment) -> bool:
        explicit = moment.components(self.action)[:-1]
        if moment.time_axis.width != 1 or not one_sign(explicit):
            return False
        return agrees(self.step, float(explicit @ np.arange(len(explicit)) / explicit.sum()))


# ---- contrast of an action and its foil --------------------------------------------------------


@dataclass(frozen=True)
class EqualTotals(Finding):
    """Both actions pay the same in total, undiscounted."""

    action: str
    foil: str
    total: float

    def holds(self, moment: Moment) -> bool:
        a, b = moment.total(self.action), moment.total(self.foil)
        return _close(a, b) and agrees(self.total, a)


@dataclass(frozen=True)
class DifferentTotals(Finding):
    """One action pays more in total, undiscounted."""

    more: str
    less: str
    more_total: float
    less_total: float

    def holds(self, moment: Moment) -> bool:
        a, b = moment.total(self.more), moment.total(self.less)
        return (
            a > b and not _close(a, b) and agrees(self.more_total, a) and agrees(self.less_total, b)
        )


@dataclass(frozen=True)
class NoTotal(Finding):
    """An action has no undiscounted total: its rewards never end."""

    action: str

    def holds(self, moment: Moment) -> bool:
        return moment.totals is not None and bool(np.isnan(moment.total(self.action)))


@dataclass(frozen=True)
class SameComponents(Finding):
    """Both actions have the same decomposition."""

    action: str
    foil: str

    def holds(self, moment: Moment) -> bool:
        return not difference(moment, self.action, self.foil).any()


@dataclass(frozen=True)
class MoreImmediate(Finding):
    """One action's running total leads from the first difference on, furthest at `last_step`."""

    leader: str
    other: str
    leader_sum: float
    other_sum: float
    last_step: int

    def holds(self, moment: Moment) -> bool:
        return self._leads(moment) and self._leader_total(moment) > 0.0

    def _leads(self, moment: Moment) -> bool:
        axis = moment.time_axis
        count = self._count(moment)
        if self.last_step != count * axis.width - 1 or not 0 < count <= axis.horizon:
            return False
        lead = running_lead(moment, self.leader, self.other)[: axis.horizon]
        first = int((lead != 0).argmax())
        lost = int((lead[first:] <= 0).argmax()) or axis.horizon  # counted from the first lead on
        other = moment.components(self.other)[:count].sum()
        return (
            bool((lead[first:count] > 0).all())
            and int(lead[: first + lost].argmax()) == count - 1
            and agrees(self.leader_sum, self._leader_total(moment))
            and agrees(self.other_sum, float(other))
        )

    def _leader_total(self, moment: Moment) -> float:
        return float(moment.components(self.leader)[: self._count(moment)].sum())

    def _count(self, moment: Moment) -> int:
        return (self.last_step + 1) // moment.time_axis.width


@dataclass(frozen=True)
class LessCostly(MoreImmediate):
    """The same where the leader only loses less."""

    def holds(self, moment: Moment) -> bool:
        return self._leads(moment) and self._leader_total(moment) <= 0.0


@dataclass(frozen=True)
class Better(Finding):
    """One action has the larger Q-value."""

    better: str
    worse: str
    gamma: float
    better_value: float
    worse_value: float

    def holds(self, moment: Moment) -> bool:
        a, b = moment.q_value(self.better), moment.q_value(self.worse)
        return (
            a > b
            and not same(a, b)
            and agrees(self.gamma, moment.time_axis.gamma)
            and agrees(self.better_value, a)
            and agrees(self.worse_value, b)
        )


@dataclass(frozen=True)
class BetterByDiscount(Better):
    """The same where the undiscounted totals are equal: only the discount decides."""

    def holds(self, moment: Moment) -> bool:
        return _close(moment.total(self.better), moment.total(self.worse)) and super().holds(moment)


@dataclass(frozen=True)
class EqualValues(Finding):
    """Both actions have the same Q-value."""

    action: str
    foil: str
    gamma: float
    value: float

    def holds(self, moment: Moment) -> bool:
        a, b = moment.q_value(self.action), moment.q_value(self.foil)
        return same(a, b) and agrees(self.value, a) and agrees(self.gamma, moment.time_axis.gamma)


@dataclass(frozen=True)
class Overtakes(Finding):
    """The running total of one action passes the other's at a component."""

    leader: str
    other: str
    component: int
    leader_total: float
    other_total: float

    def holds(self, moment: Moment) -> bool:
        i = self.component
        lead = np.sign(running_lead(moment, self.leader, self.other))
        before = lead[:i][lead[:i] != 0]
        leader = moment.components(self.leader)[: i + 1].sum()
        other = moment.components(self.other)[: i + 1].sum()
        return (
            before.size > 0
            and before[-1] < 0 < lead[i]
            and agrees(self.leader_total, float(leader))
            and agrees(self.other_total, float(other))
        )


@dataclass(frozen=True)
class StaysAhead(Finding):
    """The running total of one action is never behind, and ahead in the end."""

    leader: str
    other: str

    def holds(self, moment: Moment) -> bool:
        lead = running_lead(moment, self.leader, self.other)
        return len(lead) > 1 and bool((lead >= 0).all()) and bool(lead[-1] > 0)


@dataclass(frozen=True)
class Dominates(Finding):
    """One action is at least as good in every component, and better in some."""

    better: str
    worse: str

    def holds(self, moment: Moment) -> bool:
        delta = difference(moment, self.better, self.worse)
        return len(delta) > 1 and bool((delta >= 0).all()) and bool((delta > 0).any())


@dataclass(frozen=True)
class Reasons(Finding):
    """The fewest components whose advantage outweighs all that speaks for the worse action.

    This is the minimal sufficient explanation of Juozapaitis et al. (2019), over time.
    """

    better: str
    worse: str
    components: tuple[int, ...]
    advantage: float
    disadvantage: float

    def holds(self, moment: Moment) -> bool:
        delta = difference(moment, self.better, self.worse)
        if not self.components or max(self.components) >= len(delta):
            return False
        chosen, against = delta[list(self.components)], -delta[delta < 0].sum()
        largest = np.argsort(-delta, kind="stable")[: len(chosen)]  # of equals the earlier
        return (
            self.components == tuple(sorted(largest))
            and bool(chosen.sum() > against > 0)
            and not delta[largest[:-1]].sum() > against
            and agrees(self.advantage, float(chosen.sum()))
            and agrees(self.disadvantage, float(against))
        )


# ---- what would change the preference ----------------------------------------------------------


@dataclass(frozen=True)
class Flips(Finding):
    """The values of one quantity at which the preference between two actions flips."""

    action: str
    foil: str
    quantity: str
    current: float
    low: float
    high: float
    at: tuple[float, ...]

    def holds(self, moment: Moment) -> bool:
        what_if = _what_if(moment, self.quantity)
        if what_if is None or not agrees(self.current, what_if.current):
            return False
        if not (agrees(self.low, what_if.low) and agrees(self.high, what_if.high)):
            return False
        if sorted(self.at) != list(self.at) or not self.at:
            return False
        i, j = moment.index(self.action), moment.index(self.foil)
        signs = [np.sign(what_if.gap(i, j, x)) for x in _around(self, what_if)]
        return all(a * b < 0 for a, b in zip(signs[::2], signs[1::2], strict=True)) and all(
            a == b for a, b in zip(signs[1:-1:2], signs[2::2], strict=True)
        )


@dataclass(frozen=True)
class NeverFlips(Finding):
    """The preference stays the same over all values of one quantity."""

    better: str
    worse: str
    quantity: str
    low: float
    high: float

    def holds(self, moment: Moment) -> bool:
        what_if = _what_if(moment, self.quantity)
        if what_if is None:
            return False
        if not (agrees(self.low, what_if.low) and agrees(self.high, what_if.high)):
            return False
        i, j = moment.index(self.better), moment.index(self.worse)
        gaps = [what_if.gap(i, j, x) for x in np.linspace(what_if.low, what_if.high, 23)]
        return min(gaps) >= 0.0 and max(gaps) > 0.0


# ---- what several claims are made of ------------------------------------------------------------


def difference(moment: Moment, action: str, foil: str) -> FloatArray:
    """Returns `[N+1]`: action minus foil, with exact zeros where they only differ by rounding."""
    a, b = moment.components(action), moment.components(foil)
    equal = np.abs(a - b) <= 1e-12 * np.maximum(np.abs(a), np.abs(b))
    return np.where(equal, 0.0, a - b)


def running_lead(moment: Moment, action: str, foil: str) -> FloatArray:
    """Returns `[N+1]`: how far the action's running total is ahead, 0 where only by rounding."""
    a, b = (np.cumsum(moment.components(name)) for name in (action, foil))
    lead = np.cumsum(difference(moment, action, foil))
    equal = np.abs(a - b) <= 1e-12 * np.maximum(np.abs(a), np.abs(b))
    return np.where(equal, 0.0, lead)


def one_sign(row: FloatArray) -> bool:
    """Returns whether shares and means of components make sense: one sign, and not all zero."""
    return bool(row.any() and ((row >= 0.0).all() or (row <= 0.0).all()))


def _close(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-9 * max(1.0, abs(a), abs(b))


def _what_if(moment: Moment, name: str) -> WhatIf | None:
    return next((what_if for what_if in moment.what_ifs if what_if.name == name), None)


def _around(flips: Flips, what_if: WhatIf) -> list[float]:
    """Returns a value just below and just above each flip, half a unit of its last digit away."""
    around = []
    for root in flips.at:
        half = 1e-7 * max(1.0, abs(root))
        if isinstance(root, Shown):
            half = 0.5000001 * 10.0 ** int(Decimal(root.text).as_tuple().exponent)
        around += [max(root - half, what_if.low), min(root + half, what_if.high)]
    return around
