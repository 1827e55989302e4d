"""Leads: which of two actions is ahead, counted as rewards come in, and when that changes."""

from itertools import groupby, pairwise
from typing import ClassVar

import numpy as np

from trdlab.arrays import FloatArray, same
from trdlab.explanations.claims import Finding, agrees
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.peaks import NEGLIGIBLE, SHARE, least, stands_out, undiscounted

NOISE = 0.1
"""A lead of what was learned may be noise up to this share of the largest one."""

_SEEN = 1e-3  # of a sum: a cost that changes it as it is printed
_SOON = 0.2  # of the explicit steps: what comes within them is immediate
_MOST_CROSSINGS = 2  # of more only the last is told


def sooner(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    """Returns which action is the first to be clearly ahead, if one is before the residual.

    Args:
        moment: the decompositions of every action.
        action: the name of one.
        foil: the name of another.
    """
    horizon, width = moment.time_axis.horizon, moment.time_axis.width
    lead = clear_lead(moment, action, foil)
    if not lead.any():
        return ()
    first = int(np.flatnonzero(lead)[0])
    leader, other = (action, foil) if lead[first] > 0 else (foil, action)
    lead = clear_lead(moment, leader, other)
    lost = np.flatnonzero(lead[first:] <= 0)
    until = first + int(lost[0]) if lost.size else horizon
    count = int(lead[:until].argmax()) + 1  # where the leader is furthest ahead
    kind = _called(moment, leader, other, count)
    sums = [kind.sign * _sum(moment, name, count) for name in (leader, other)]
    return (kind(leader, other, sums[0], sums[1], count * width - 1),)


def crossings(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    """Returns where the running totals cross, or that they never do.

    Args:
        moment: the decompositions of every action.
        action: the name of one.
        foil: the name of another.
    """
    lead = running_lead(moment, action, foil)
    runs = [list(run) for _, run in groupby(np.flatnonzero(lead), key=lambda i: lead[i] > 0)]
    least_lead = _least(moment, action, foil)
    differ = not same(moment.q_value(action), moment.q_value(foil))
    clear = [  # the last one decides which action is worth more
        run for run in runs if np.abs(lead[run]).max() >= least_lead or (differ and run is runs[-1])
    ]
    found: list[Finding] = []
    for before, now in pairwise(clear):
        i, is_ahead = int(now[0]), bool(lead[now[0]] > 0)
        if is_ahead != (lead[before[0]] > 0):
            leader, other = (action, foil) if is_ahead else (foil, action)
            found.append(_crossing(moment, leader, other, i))
    never = [StaysAhead(action, foil), StaysAhead(foil, action)]
    told = found if len(found) <= _MOST_CROSSINGS else found[-1:]
    return tuple(told) or tuple(finding for finding in never if finding.holds(moment))


def _crossing(moment: Moment, leader: str, other: str, component: int) -> Finding:
    if component == moment.time_axis.horizon:
        more = float(difference(moment, leader, other)[component])
        return MakesUp(leader, other, component, more)
    sums = [_sum(moment, name, component + 1) for name in (leader, other)]
    return Overtakes(leader, other, component, sums[0], sums[1])


class _Lead(Finding):
    """One running total is the first to lead clearly, and furthest ahead at `last_step`.

    Each kind says it in other words (see `_called`); sums are those up to that step, times `sign`.
    """

    sign: ClassVar[float] = 1.0

    leader: str
    other: str
    leader_sum: float
    other_sum: float
    last_step: int

    def holds(self, moment: Moment) -> bool:
        axis = moment.time_axis
        count = (self.last_step + 1) // axis.width
        if self.last_step != count * axis.width - 1 or not 0 < count <= axis.horizon:
            return False
        lead = clear_lead(moment, self.leader, self.other)
        first = int((lead != 0).argmax())
        lost = int((lead[first:] <= 0).argmax()) or axis.horizon  # counted from the first lead on
        return (
            bool((lead[first:count] > 0).all())
            and int(lead[: first + lost].argmax()) == count - 1
            and type(self) is _called(moment, self.leader, self.other, count)
            and agrees(self.leader_sum, self.sign * _sum(moment, self.leader, count))
            and agrees(self.other_sum, self.sign * _sum(moment, self.other, count))
        )


class MoreImmediate(_Lead):
    """The same where rewards come soon, and no cost comes with them."""


class PaysMore(_Lead):
    """The same where rewards do not come soon."""


class PaysMoreNet(_Lead):
    """The same where there are costs too."""


class CostsLess(_Lead):
    """The same where there are nothing but costs; the sums are what it costs."""

    sign: ClassVar[float] = -1.0


LEADS = (MoreImmediate, PaysMore, PaysMoreNet, CostsLess)


class Overtakes(Finding):
    """The running total of one action passes the other's at an explicit component."""

    leader: str
    other: str
    component: int
    leader_total: float
    other_total: float

    def holds(self, moment: Moment) -> bool:
        count = self.component + 1
        return (
            self.component < moment.time_axis.horizon
            and _passes(moment, self.leader, self.other, self.component)
            and agrees(self.leader_total, _sum(moment, self.leader, count))
            and agrees(self.other_total, _sum(moment, self.other, count))
        )


class MakesUp(Finding):
    """The running total of one action passes the other's at the residual."""

    leader: str
    other: str
    component: int
    more: float

    def holds(self, moment: Moment) -> bool:
        return (
            self.component == moment.time_axis.horizon
            and _passes(moment, self.leader, self.other, self.component)
            and agrees(self.more, float(difference(moment, self.leader, self.other)[-1]))
        )


class StaysAhead(Finding):
    """The running total of one action is never behind, and ahead in the end."""

    leader: str
    other: str

    def holds(self, moment: Moment) -> bool:
        lead = running_lead(moment, self.leader, self.other)
        return len(lead) > 1 and bool((lead >= 0).all()) and bool(lead[-1] > 0)


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


def clear_lead(moment: Moment, action: str, foil: str) -> FloatArray:
    """Returns `[N]`: the running lead, 0 where it is next to nothing (see `_least`)."""
    lead = running_lead(moment, action, foil)
    return np.where(np.abs(lead) >= _least(moment, action, foil), lead, 0.0)[:-1]


def _least(moment: Moment, action: str, foil: str) -> float:
    """Returns the least lead that is told.

    What was learned may be noise up to `NOISE` of the largest explicit lead. Of an exact table
    `NEGLIGIBLE` of the largest lead is left out, and what does not stand out at a step of either
    action.
    """
    size = np.abs(running_lead(moment, action, foil))  # [N+1]
    if moment.is_exact:
        return max(NEGLIGIBLE * float(size.max()), least(moment, action), least(moment, foil))
    return NOISE * float(size[:-1].max(initial=0.0))


def _called(moment: Moment, leader: str, other: str, count: int) -> type[_Lead]:
    """Returns in which words a lead is told that is furthest after so many components.

    Rewards are called immediate if at least `SHARE` of the lead is there at the next step, or
    within `_SOON` of the explicit ones. Neither they nor costs are called so where some of the
    other kind stand out.
    """
    effects = np.concatenate([_notable(moment, name)[:count] for name in (leader, other)])
    ahead, behind = _sum(moment, leader, count), _sum(moment, other, count)
    if ahead <= 0.0 and not (effects > 0.0).any():
        return CostsLess
    if ahead <= 0.0 or behind < 0.0 or (effects < 0.0).any():
        return PaysMoreNet
    lead = running_lead(moment, leader, other)[:count]
    axis, begins = moment.time_axis, int((lead >= SHARE * lead[-1]).argmax())
    if axis.start(begins) <= max(1.0, _SOON * axis.num_steps):
        return MoreImmediate
    rows = np.stack([moment.components(name)[:count] for name in (leader, other)])
    is_net = moment.is_exact and bool((rows < -_SEEN * ahead).any())  # else it may be noise
    return PaysMoreNet if is_net else PaysMore


def _notable(moment: Moment, action: str) -> FloatArray:
    """Returns `[K]`: what is expected at each step, 0 where it does not stand out."""
    return np.where(stands_out(moment, action), undiscounted(moment, action), 0.0)


def _sum(moment: Moment, action: str, count: int) -> float:
    """Returns what the first components of an action add up to."""
    return float(moment.components(action)[:count].sum())


def _passes(moment: Moment, leader: str, other: str, component: int) -> bool:
    """Returns whether one running total is ahead at a component, and the other was before it."""
    lead = np.sign(running_lead(moment, leader, other))
    before = lead[:component][lead[:component] != 0]
    return before.size > 0 and bool(before[-1] < 0 < lead[component])
