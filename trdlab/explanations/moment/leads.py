"""Leads: which of two actions is ahead, as rewards come in, and when that changes."""

from collections.abc import Iterator
from itertools import groupby, pairwise

import numpy as np

from trdlab.arrays import FloatArray, same
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.explanations.moment.steps import (
    NEGLIGIBLE,
    SHARE,
    SLIGHT,
    least,
    off_by,
    stands_out,
)
from trdlab.explanations.rules import Fields

NOISE = 0.1  # of the largest lead: up to this one of what was learned may be noise
_SEEN = 1e-3  # of a sum: a cost that changes it as it is printed
_SOON = 4, 0.2  # immediate are so many steps, or such a share of the explicit ones
_MOST_CROSSINGS = 2  # of more only the last is told


def better_of(choice: Choice) -> Iterator[Fields]:
    """Yields which action has the larger Q-value, if one has."""
    gamma = choice.time_axis.gamma
    for better, worse in choice.orders:
        a, b = choice.moment.q_value(better), choice.moment.q_value(worse)
        if a > b and not same(a, b):
            names = {"better": better, "worse": worse, "better_value": a, "worse_value": b}
            yield names | {"gamma": gamma, "loss": 1.0 - gamma}


def is_by_discount(choice: Choice) -> bool:
    """Returns whether both pay the same in total, but are not worth the same."""
    totals = [choice.moment.total(name) for name, _ in choice.orders]
    return len(totals) == 2 and same(*totals) and totals[0] != 0.0 and any(better_of(choice))


def are_sure(choice: Choice, components: slice = slice(None)) -> bool:
    """Returns whether chance has no part in what both actions pay, as far as known."""
    names = (name for name, _ in choice.orders)
    return all(choice.moment.is_sure(name, components) for name in names)


def sums(choice: Choice, leader: str, other: str, count: int) -> Fields:
    """Returns what two actions pay up to a component, as the fields of a claim."""
    rows = choice.moment.components(leader), choice.moment.components(other)
    return {
        "leader": leader,
        "other": other,
        "leader_sum": float(rows[0][:count].sum()),
        "other_sum": float(rows[1][:count].sum()),
        "averages": are_sure(choice, slice(0, count)),
    }


def leads_of(choice: Choice) -> Iterator[Fields]:
    """Yields which action is the first to lead clearly, and where it is furthest ahead.

    A lead that begins soon is told as it stands soon.
    """
    axis, soon = choice.time_axis, _soon(choice)
    for leader, other in choice.orders:
        lead, in_the_end = np.split(choice.moment.lead(leader, other), [-1])  # [N], [1]
        lead[np.abs(lead) < _least_lead(choice.moment, leader, other)[:-1]] = 0.0
        places = np.flatnonzero(lead)
        if not places.size or lead[places[0]] < 0:
            continue
        begins = int(places[0])
        lost = np.flatnonzero(lead[begins:] <= 0)
        until = begins + int(lost[0]) if lost.size else axis.horizon
        if soon > begins and lead[:soon].max() >= SHARE * lead[:until].max():
            until = min(until, soon)
        count = int(lead[:until].argmax()) + 1
        if count > soon and until == axis.horizon and in_the_end < 0.0:
            count = until  # it is told as it stands before what decides otherwise
        yield sums(choice, leader, other, count) | {"last_step": count * axis.width - 1}


def _soon(choice: Choice) -> int:
    """Returns how many explicit components lie in the immediate future."""
    axis, (steps, share) = choice.time_axis, _SOON
    return min(axis.horizon, int(max(steps, share * axis.num_steps)) // axis.width)


def _count(choice: Choice, lead: Fields) -> int:
    return int(lead["last_step"] + 1) // choice.time_axis.width


def is_immediate(choice: Choice, lead: Fields) -> bool:
    """Returns whether a lead is one of rewards that come soon, with no cost among them."""
    count, names = _count(choice, lead), (lead["leader"], lead["other"])
    rows = np.stack([choice.moment.components(name)[:count] for name in names])
    # costs count that change the sums as they are printed
    is_seen = choice.moment.is_exact and (rows < -_SEEN * abs(lead["leader_sum"])).any()
    has_costs = is_seen or (_notable(choice, lead) < 0.0).any()
    return bool(count <= _soon(choice) and lead["other_sum"] >= 0.0 and not has_costs)


def are_costs(choice: Choice, lead: Fields) -> bool:
    """Returns whether nothing but costs stands out up to a lead."""
    return bool(lead["leader_sum"] <= 0.0 and not (_notable(choice, lead) > 0.0).any())


def _notable(choice: Choice, lead: Fields) -> FloatArray:
    """Returns `[2 K]`: what stands out of either action up to a lead, and 0 for all else."""
    moment, count = choice.moment, _count(choice, lead)
    rows = []
    for name in (lead["leader"], lead["other"]):
        notable = stands_out(moment, name)[:count]
        rows.append(np.where(notable, moment.components(name)[: len(notable)], 0.0))
    return np.concatenate(rows)


def off_together(moment: Moment, action: str, foil: str) -> FloatArray:
    """Returns `[N+1]`: what a lead is off by, as forecasts of both usually are up to there."""
    squares = off_by(moment, action) ** 2 + off_by(moment, foil) ** 2
    return np.asarray(np.sqrt(squares.cumsum()))


def _least_lead(moment: Moment, action: str, foil: str) -> FloatArray:
    """Returns `[N+1]`: the least lead that is told.

    What was learned may be noise up to `NOISE` of the largest explicit lead, and up to `SLIGHT` of
    what it is off by. Of an exact table `NEGLIGIBLE` of the largest lead is left out, and what does
    not stand out at a step of either.
    """
    size = np.abs(moment.lead(action, foil))  # [N+1]
    if not moment.is_exact:
        noise = NOISE * float(size[:-1].max(initial=0.0))
        return np.asarray(np.maximum(noise, SLIGHT * off_together(moment, action, foil)))
    steps = [least(moment, name).max(initial=0.0) for name in (action, foil)]
    return np.full(len(size), max(NEGLIGIBLE * float(size.max()), *steps))


def crossings(choice: Choice) -> Iterator[tuple[str, str, int]]:
    """Yields who passes whom, and at which component: a clear lead follows one of the other.

    The last lead decides which action is worth more, and counts however small it is. Of more than
    two crossings only the last is told.
    """
    if choice.foil is None:
        return
    moment, action, foil = choice.moment, choice.action, choice.foil
    lead, least_lead = moment.lead(action, foil), _least_lead(moment, action, foil)
    runs = [list(run) for _, run in groupby(np.flatnonzero(lead), key=lambda i: lead[i] > 0)]
    clear = [run for run in runs if (np.abs(lead[run]) >= least_lead[run]).any()]
    if runs and runs[-1] not in clear and not same(moment.q_value(action), moment.q_value(foil)):
        clear.append(runs[-1])
    found = []
    for before, now in pairwise(clear):
        is_ahead = bool(lead[now[0]] > 0)
        if is_ahead != (lead[before[0]] > 0):
            found.append((action, foil, int(now[0])) if is_ahead else (foil, action, int(now[0])))
    yield from found if len(found) <= _MOST_CROSSINGS else found[-1:]
