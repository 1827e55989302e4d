"""Contrast: how the futures of two actions differ, and what decides between them."""

from collections.abc import Iterator

import numpy as np

from trdlab.arrays import same
from trdlab.explanations.moment.leads import (
    are_costs,
    are_sure,
    better_of,
    crossings,
    is_by_discount,
    is_immediate,
    leads_of,
    off_together,
    sums,
)
from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.explanations.moment.steps import SLIGHT, doubtful
from trdlab.explanations.rules import Claim, Fields, Found, every, first

_DECIDES = 0.8  # of all that differs: what lies at one step decides
_MOST_DOUBT = 0.5  # of a difference, to tell what comes when
_MOST_REASONS = 6  # components that people still look at


def contrast(choice: Choice) -> list[Claim]:
    """Returns how an action's future differs from its foil's, what matters most first.

    Who is ahead comes first, and of a lead of the action that is worth less what makes up for it;
    then totals and values, and the few steps that are enough to prefer the better action. Where
    more than half of the difference is not to be trusted, or all of it is small beside what
    forecasts are off by, that is told in place of what comes when.
    """
    if expected := every(choice, *nothing):
        return expected
    worth = every(choice, *totals) + first(choice, *values)
    if same_all_along := every(choice, *alike):
        return same_all_along + worth
    if doubt := every(choice, *untested_difference):
        return worth[-1:] + doubt + worth[:-1]
    if close := every(choice, hardly_apart):
        return close + worth
    passing, decided = every(choice, *turns), every(choice, decided_at)
    rest = every(choice, never_behind, reasons)
    if decided and not passing:
        return decided + worth + rest
    return first(choice, *leads) + passing + worth + decided + rest


def in_brief(choice: Choice) -> list[Claim]:
    """Returns who is ahead and why, and what the discount has to do with it."""
    told = contrast(choice)
    brief = told[:1] + [c for c in told[1:] if c.kind in ("overtakes", "makes-up")]
    if any(claim.kind in _BY_DISCOUNT[1:] for claim in told):
        return brief + [c for c in told if c.kind in _BY_DISCOUNT]
    return brief + [c for c in told if c.kind in ("better", "equal-values") and c not in brief]


_BY_DISCOUNT = ("different-totals", "better-by-discount", "better-against-total")


@CHOICES.kinds(
    {
        "equal-totals": "Both bring {total:number} in total{averages:averages}{ties:ties}.",
        "different-totals": (
            "In total {more} brings {more_total:number} and {less} "
            "{less_total:number}{averages:averages}{ties:ties}."
        ),
        "no-total": "The rewards after {action} may never end, so there is no total.",
    }
)
def totals(choice: Choice) -> Iterator[Found]:
    """What is paid in total."""
    is_tied = bool(choice.moment.tied or choice.moment.tied_later)  # totals depend on it
    notes = {"averages": are_sure(choice), "ties": is_tied}
    for action, other in choice.orders:
        a, b = choice.moment.total(action), choice.moment.total(other)
        if same(a, b):
            if action == choice.action and not is_by_discount(choice):
                yield "equal-totals", {"total": a} | notes
        elif a > b:
            paid = {"more": action, "less": other, "more_total": a, "less_total": b}
            yield "different-totals", paid | notes
        if choice.moment.totals is not None and np.isnan(a):
            yield "no-total", {"action": action}


@CHOICES.kinds(
    {
        "better-by-discount": (
            "Both pay {total:number} in total{average:average}, but each step of waiting makes a "
            "reward count {loss:percent} less: {better} is worth {better_value:number}, {worse} "
            "{worse_value:number}."
        ),
        "better-against-total": (
            "But each step of waiting makes a reward count {loss:percent} less: {better} is worth "
            "{better_value:number}, {worse} {worse_value:number}."
        ),
        "better": (
            "All steps counted, {better} is worth {better_value:number} and {worse} is worth "
            "{worse_value:number} (γ = {gamma:given})."
        ),
        "equal-values": "{action} and {foil} are worth the same: {value:number}.",
    }
)
def values(choice: Choice) -> Iterator[Found]:
    """What the totals are worth now."""
    for fields in better_of(choice):
        a, b = (choice.moment.total(fields[name]) for name in ("better", "worse"))
        if is_by_discount(choice):
            total = choice.moment.total(choice.action)
            yield "better-by-discount", fields | {"total": total, "average": are_sure(choice)}
        if a < b and not same(a, b):
            yield "better-against-total", fields
        yield "better", fields
    for action, foil in choice.orders[:1]:
        a, b = choice.moment.q_value(action), choice.moment.q_value(foil)
        if same(a, b):
            yield "equal-values", {"action": action, "foil": foil, "value": a}


@CHOICES.kinds(
    {
        "nothing-at-all": "Nothing is expected of any action here.",
        "nothing-on-average": (
            "On average no action pays anything here, but single episodes differ."
        ),
    }
)
def nothing(choice: Choice) -> Iterator[Found]:
    if not choice.moment.decomposition.components.any():
        known = choice.moment.uncertainty
        is_chancy = known is not None and known.return_deviation.any()
        yield "nothing-on-average" if is_chancy else "nothing-at-all", {}


@CHOICES.kinds(
    {
        "same-rewards": (
            "{action} and {foil} lead to the same rewards at the same times{averages:averages}."
        ),
        "same-components": "Nothing in these numbers tells {action} and {foil} apart.",
    }
)
def alike(choice: Choice) -> Iterator[Found]:
    """Rewards are the same where all that comes is told step by step."""
    for action, foil in choice.orders[:1]:
        if not choice.moment.difference(action, foil).any():
            residual = choice.moment.components(action)[-1]
            is_all_told = choice.time_axis.width == 1 and residual == 0.0
            fields = {"action": action, "foil": foil, "averages": are_sure(choice)}
            yield "same-rewards" if is_all_told else "same-components", fields


@CHOICES.kinds(
    {
        "untested-difference": (
            "{share:percent} of the difference between {action} and {foil} comes "
            "{components:whens}, and that {state:text}."
        ),
        "untested-whole": "What tells {action} and {foil} apart {state:text}, all of it.",
    }
)
def untested_difference(choice: Choice) -> Iterator[Found]:
    for action, foil in choice.orders[:1]:
        size = np.abs(choice.moment.difference(action, foil))
        doubt = doubtful(choice.moment, action) | doubtful(choice.moment, foil)
        share = float(size[doubt].sum() / size.sum()) if size.any() else 0.0
        if share > _MOST_DOUBT:
            components = tuple(np.flatnonzero(doubt & (size > 0.0)).tolist())
            known = (choice.moment.judged(name) for name in (action, foil))
            states = {of.status[i] for of in known if of is not None for i in components}
            state = "was not tested" if states <= {"good", "not tested"} else "is not to be trusted"
            about = {"action": action, "foil": foil, "state": state}
            if share == 1.0:
                yield "untested-whole", about
            else:
                yield "untested-difference", about | {"share": share, "components": components}


@CHOICES.rule(
    "{action} and {foil} hardly differ: by {most:number} at most, added up to any step, where such "
    "forecasts are off by about {error:number}."
)
def hardly_apart(choice: Choice) -> Iterator[Fields]:
    """No lead of what was learned is more than `SLIGHT` of what forecasts of both are off by."""
    for action, foil in choice.orders[:1]:
        size = np.abs(choice.moment.lead(action, foil))
        error = off_together(choice.moment, action, foil)
        if size.any() and (size <= SLIGHT * error).all():
            i = int(size.argmax())
            about = {"action": action, "foil": foil}
            yield about | {"most": float(size[i]), "error": float(error[i])}


@CHOICES.rule(
    "What comes {component:when} decides: {better} {better_sum:gains} and {worse} "
    "{worse_sum:gains}{averages:averages}."
)
def decided_at(choice: Choice) -> Iterator[Fields]:
    """Most of all that differs lies at one component, and speaks for the better action."""
    for fields in better_of(choice):
        a, b = fields["better"], fields["worse"]
        delta = choice.moment.difference(a, b)
        i = int(delta.argmax())
        if choice.time_axis.horizon and delta[i] >= _DECIDES * np.abs(delta).sum():
            rows = (choice.moment.components(a), choice.moment.components(b))
            yield {
                "component": i,
                "better": a,
                "worse": b,
                "better_sum": float(rows[0][i]),
                "worse_sum": float(rows[1][i]),
                "averages": are_sure(choice, slice(i, i + 1)),
            }


@CHOICES.kinds(
    {
        "more-immediate": (
            "{leader} gives more immediate rewards: {leader_sum:number} {last_step:within}, while "
            "{other} {other_sum:gives}{averages:averages}."
        ),
        "costs-less": (
            "{leader} costs less: {leader_cost:size} {last_step:within}, while {other} costs "
            "{other_cost:number}{averages:averages}."
        ),
        "pays-more": (
            "{last_step:within} {leader} {leader_sum:gains} and {other} "
            "{other_sum:gains}{averages:averages}."
        ),
    }
)
def leads(choice: Choice) -> Iterator[Found]:
    """Who leads, be it by rewards that come soon, by nothing but lower costs, or otherwise."""
    for lead in leads_of(choice):
        if are_costs(choice, lead):
            costs = {"leader_cost": abs(lead["leader_sum"]), "other_cost": -lead["other_sum"]}
            yield "costs-less", lead | costs
        else:
            yield "more-immediate" if is_immediate(choice, lead) else "pays-more", lead


@CHOICES.kinds(
    {
        "overtakes": (
            "After {count:first} {leader} has overtaken {other}: added up, {leader} "
            "{leader_sum:gains} and {other} {other_sum:gains}{averages:averages}."
        ),
        "makes-up": (
            "But what comes {component:when} decides: with {leader}, that part is worth "
            "{more:number} more{averages:averages}."
        ),
    }
)
def turns(choice: Choice) -> Iterator[Found]:
    """Where the running total of one action passes the other's, at a step or at the residual."""
    for leader, other, i in crossings(choice):
        if i < choice.time_axis.horizon:
            count = (i + 1) * choice.time_axis.width
            fields = sums(choice, leader, other, i + 1) | {"component": i, "count": count}
            yield "overtakes", fields
        else:
            more = float(choice.moment.difference(leader, other)[i])
            fields = {"component": i, "leader": leader, "other": other, "more": more}
            yield "makes-up", fields | {"averages": are_sure(choice, slice(i, i + 1))}


@CHOICES.rule(
    "Added up step by step, {leader} is never behind {other} in {count:first}, nor in the end."
)
def never_behind(choice: Choice) -> Iterator[Fields]:
    """Step by step its running total is no smaller, and larger in the end; w = 1."""
    axis = choice.time_axis
    for leader, other in choice.orders:
        lead = choice.moment.lead(leader, other)
        is_ahead = bool((lead >= 0).all()) and (lead[:-1] > 0).any() and lead[-1] > 0
        if axis.width == 1 and is_ahead:
            yield {"leader": leader, "other": other, "count": axis.horizon}


@CHOICES.rule(
    "What comes {components:whens} is enough to make {better} better: it is {advantage:number} "
    "ahead then, and {disadvantage:number} behind otherwise."
)
def reasons(choice: Choice) -> Iterator[Fields]:
    """The fewest components whose advantage outweighs all that speaks for the worse action.

    This is the minimal sufficient explanation of Juozapaitis et al. (2019), over time.
    """
    for fields in better_of(choice):
        better, worse = fields["better"], fields["worse"]
        delta = choice.moment.difference(better, worse)
        against = float(-delta[delta < 0].sum())
        chosen: list[int] = []
        for i in np.argsort(-delta, kind="stable").tolist():
            chosen.append(i)
            if delta[chosen].sum() > against:
                break
        if against > 0.0 and len(chosen) <= _MOST_REASONS:
            yield {
                "components": tuple(sorted(chosen)),
                "better": better,
                "worse": worse,
                "advantage": float(delta[chosen].sum()),
                "disadvantage": against,
            }
