"""Contrast: how two actions' futures differ."""

from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explain.finding import Finding, agrees
from trdlab.explain.limits import doubtful
from trdlab.explain.moment import Moment, same
from trdlab.explain.rhythm import NEGLIGIBLE
from trdlab.explain.worth import compare_totals, compare_values

NOISE = 0.1
"""A lead of what was learned may be noise up to this share of the largest one."""

_MOST_DOUBT = 0.5  # of a difference, to tell what comes when
_MOST_REASONS = 6  # components that people still look at
_MOST_CROSSINGS = 2  # of more only the last is told


def contrast(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    """Returns how an action's future differs from its foil's.

    In order: the undiscounted totals, which pays sooner, which is worth more, where the running
    totals cross, and the few components that justify the better one. Where more than half of the
    difference is not to be trusted, that is said instead of what comes when.

    Args:
        moment: the decompositions of every action.
        action: the name of one.
        foil: the name of another.

    Raises:
        InputError: there is no such action, or they are the same.
    """
    moment.index(action), moment.index(foil)
    worth = compare_values(moment, action, foil)
    if not difference(moment, action, foil).any():
        return (*compare_totals(moment, action, foil), SameComponents(action, foil), worth)
    doubt = DoubtfulDifference(action, foil, doubtful_share(moment, action, foil))
    if doubt.holds(moment):
        return (*compare_totals(moment, action, foil), worth, doubt)
    return (
        *compare_totals(moment, action, foil),
        *_sooner(moment, action, foil),
        worth,
        *_crossings(moment, action, foil),
        *_reasons(moment, action, foil),
    )


def _sooner(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
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
    sums = [float(moment.components(name)[:count].sum()) for name in (leader, other)]
    kind = MoreImmediate if sums[0] > 0.0 else LessCostly
    return (kind(leader, other, sums[0], sums[1], count * width - 1),)


def _crossings(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    lead = running_lead(moment, action, foil)
    runs = [list(run) for _, run in groupby(np.flatnonzero(lead), key=lambda i: lead[i] > 0)]
    least = _least(moment, lead)
    clear = [run for run in runs if np.abs(lead[run]).max() >= least]
    found: list[Finding] = []
    for before, now in pairwise(clear):
        i, is_ahead = int(now[0]), bool(lead[now[0]] > 0)
        if is_ahead != (lead[before[0]] > 0):
            leader, other = (action, foil) if is_ahead else (foil, action)
            sums = [float(moment.components(name)[: i + 1].sum()) for name in (leader, other)]
            found.append(Overtakes(leader, other, i, sums[0], sums[1]))
    never = [StaysAhead(action, foil), StaysAhead(foil, action)]
    told = found if len(found) <= _MOST_CROSSINGS else found[-1:]
    return tuple(told) or tuple(finding for finding in never if finding.holds(moment))


def _reasons(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    if same(moment.q_value(action), moment.q_value(foil)):
        return ()
    better, worse = moment.ordered(action, foil)
    delta = difference(moment, better, worse)
    if len(delta) == 1:
        return ()
    against = float(-delta[delta < 0].sum())
    if against == 0.0:
        return (Dominates(better, worse),)
    chosen: list[int] = []
    for i in np.argsort(-delta, kind="stable"):
        chosen.append(int(i))
        advantage = float(delta[chosen].sum())
        if advantage > against:
            break
    if len(chosen) > _MOST_REASONS:
        return ()
    return (Reasons(better, worse, tuple(sorted(chosen)), advantage, against),)


@dataclass(eq=False, repr=False)
class SameComponents(Finding):
    """Both actions have the same decomposition."""

    action: str
    foil: str

    def holds(self, moment: Moment) -> bool:
        return not difference(moment, self.action, self.foil).any()


@dataclass(eq=False, repr=False)
class DoubtfulDifference(Finding):
    """More than half of the difference, Σ|action − foil|, lies in components not to be trusted."""

    action: str
    foil: str
    share: float

    def holds(self, moment: Moment) -> bool:
        share = doubtful_share(moment, self.action, self.foil)
        return share > _MOST_DOUBT and agrees(self.share, share)


@dataclass(eq=False, repr=False)
class MoreImmediate(Finding):
    """One running total is the first to lead clearly, and furthest ahead at `last_step`."""

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
        lead = clear_lead(moment, self.leader, self.other)
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


@dataclass(eq=False, repr=False)
class LessCostly(MoreImmediate):
    """The same where the leader only loses less."""

    def holds(self, moment: Moment) -> bool:
        return self._leads(moment) and self._leader_total(moment) <= 0.0


@dataclass(eq=False, repr=False)
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


@dataclass(eq=False, repr=False)
class StaysAhead(Finding):
    """The running total of one action is never behind, and ahead in the end."""

    leader: str
    other: str

    def holds(self, moment: Moment) -> bool:
        lead = running_lead(moment, self.leader, self.other)
        return len(lead) > 1 and bool((lead >= 0).all()) and bool(lead[-1] > 0)


@dataclass(eq=False, repr=False)
class Dominates(Finding):
    """One action is at least as good in every component, and better in some."""

    better: str
    worse: str

    def holds(self, moment: Moment) -> bool:
        delta = difference(moment, self.better, self.worse)
        return len(delta) > 1 and bool((delta >= 0).all()) and bool((delta > 0).any())


@dataclass(eq=False, repr=False)
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


def difference(moment: Moment, action: str, foil: str) -> FloatArray:
    """Returns `[N+1]`: action minus foil, with exact zeros where they only differ by rounding."""
    a, b = moment.components(action), moment.components(foil)
    equal = np.abs(a - b) <= 1e-12 * np.maximum(np.abs(a), np.abs(b))
    return np.where(equal, 0.0, a - b)


def doubtful_share(moment: Moment, action: str, foil: str) -> float:
    """Returns the share of Σ|action − foil| in components not to be trusted; 0 of no difference."""
    size = np.abs(difference(moment, action, foil))
    doubt = doubtful(moment, action) | doubtful(moment, foil)
    return float(size[doubt].sum() / size.sum()) if size.any() else 0.0


def running_lead(moment: Moment, action: str, foil: str) -> FloatArray:
    """Returns `[N+1]`: how far the action's running total is ahead, 0 where only by rounding."""
    a, b = (np.cumsum(moment.components(name)) for name in (action, foil))
    lead = np.cumsum(difference(moment, action, foil))
    equal = np.abs(a - b) <= 1e-12 * np.maximum(np.abs(a), np.abs(b))
    return np.where(equal, 0.0, lead)


def clear_lead(moment: Moment, action: str, foil: str) -> FloatArray:
    """Returns `[N]`: the running lead, 0 where it is next to nothing (see `_least`)."""
    lead = running_lead(moment, action, foil)
    return np.where(np.abs(lead) >= _least(moment, lead), lead, 0.0)[:-1]


def _least(moment: Moment, lead: FloatArray) -> float:
    """Returns the least lead that is told, as a share of the largest of `lead [N+1]`.

    What was learned may be noise up to `NOISE` of the largest explicit one; of an exact table
    `NEGLIGIBLE` of the largest is left out.
    """
    size = np.abs(lead)
    if moment.is_exact:
        return NEGLIGIBLE * float(size.max())
    return NOISE * float(size[:-1].max(initial=0.0))
