"""Contrast: how two actions' futures differ, and what would make the other one better."""

from itertools import pairwise

import numpy as np

from trdlab.explain.findings import (
    Better,
    BetterByDiscount,
    DifferentTotals,
    Dominates,
    EqualTotals,
    EqualValues,
    Finding,
    Flips,
    LessCostly,
    MoreImmediate,
    NeverFlips,
    NoTotal,
    Overtakes,
    Reasons,
    SameComponents,
    StaysAhead,
    difference,
    running_lead,
)
from trdlab.explain.flips import find_flips
from trdlab.explain.moment import Moment, same


def contrast(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    """Returns how an action's future differs from its foil's.

    In order: the undiscounted totals, which pays sooner, which is worth more, where the running
    totals cross, and the fewest components that justify the better one.

    Args:
        moment: the decompositions of every action.
        action: the name of one.
        foil: the name of another.

    Raises:
        InputError: there is no such action, or they are the same.
    """
    moment.index(action), moment.index(foil)
    worth = _worth(moment, action, foil)
    if not difference(moment, action, foil).any():
        return (*_totals(moment, action, foil), SameComponents(action, foil), worth)
    return (
        *_totals(moment, action, foil),
        *_sooner(moment, action, foil),
        worth,
        *_crossings(moment, action, foil),
        *_reasons(moment, action, foil),
    )


def what_would_flip(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    """Returns where the preference flips as each quantity varies, or that it never does.

    The policy is re-optimised at every value. A preference that stays the same but for ties counts
    as never flipping.

    Raises:
        InputError: there is no such action.
    """
    i, j = moment.index(action), moment.index(foil)
    found: list[Finding] = []
    for what_if in moment.what_ifs:
        name, low, high = what_if.name, what_if.low, what_if.high
        at = find_flips(lambda x, w=what_if: w.gap(i, j, x), low, high)  # type: ignore[misc]
        if at:
            found.append(Flips(action, foil, name, what_if.current, low, high, at))
        elif not same(moment.q_value(action), moment.q_value(foil)):
            better, worse = _ordered(moment, action, foil)
            found.append(NeverFlips(better, worse, name, low, high))
    return tuple(found)


def _totals(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    if moment.totals is None:
        return ()
    a, b = moment.total(action), moment.total(foil)
    endless = tuple(NoTotal(name) for name, x in ((action, a), (foil, b)) if np.isnan(x))
    if endless:
        return endless
    if EqualTotals(action, foil, a).holds(moment):
        return (EqualTotals(action, foil, a),)
    if a > b:
        return (DifferentTotals(action, foil, a, b),)
    return (DifferentTotals(foil, action, b, a),)


def _sooner(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    horizon, width = moment.time_axis.horizon, moment.time_axis.width
    lead = running_lead(moment, action, foil)[:horizon]
    if not lead.any():
        return ()
    first = int(np.flatnonzero(lead)[0])
    leader, other = (action, foil) if lead[first] > 0 else (foil, action)
    lead = running_lead(moment, leader, other)[:horizon]
    lost = np.flatnonzero(lead[first:] <= 0)
    until = first + int(lost[0]) if lost.size else horizon
    count = int(lead[:until].argmax()) + 1  # where the leader is furthest ahead
    sums = [float(moment.components(name)[:count].sum()) for name in (leader, other)]
    kind = MoreImmediate if sums[0] > 0.0 else LessCostly
    return (kind(leader, other, sums[0], sums[1], count * width - 1),)


def _worth(moment: Moment, action: str, foil: str) -> Finding:
    gamma, a, b = moment.time_axis.gamma, moment.q_value(action), moment.q_value(foil)
    if same(a, b):
        return EqualValues(action, foil, gamma, a)
    claim = (*_ordered(moment, action, foil), gamma, max(a, b), min(a, b))
    by_discount = BetterByDiscount(*claim)
    return by_discount if by_discount.holds(moment) else Better(*claim)


def _ordered(moment: Moment, action: str, foil: str) -> tuple[str, str]:
    """Returns the better of two actions, then the other."""
    better_first = moment.q_value(action) > moment.q_value(foil)
    return (action, foil) if better_first else (foil, action)


def _crossings(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    lead = running_lead(moment, action, foil)
    ahead = [(i, lead[i] > 0) for i in np.flatnonzero(lead)]
    found: list[Finding] = []
    for (_, before), (i, now) in pairwise(ahead):
        if before != now:
            leader, other = (action, foil) if now else (foil, action)
            sums = [float(moment.components(name)[: i + 1].sum()) for name in (leader, other)]
            found.append(Overtakes(leader, other, int(i), sums[0], sums[1]))
    never = [StaysAhead(action, foil), StaysAhead(foil, action)]
    return tuple(found) or tuple(finding for finding in never if finding.holds(moment))


def _reasons(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    if same(moment.q_value(action), moment.q_value(foil)):
        return ()
    better, worse = _ordered(moment, action, foil)
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
    return (Reasons(better, worse, tuple(sorted(chosen)), advantage, against),)
