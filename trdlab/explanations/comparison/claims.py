"""What there is to say of two agents at the same states: who expects more, when, and how surely."""

from collections.abc import Iterator

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration.claims import in_brief as in_brief_of_report
from trdlab.explanations.comparison.comparison import COMPARISONS, SIDES, Comparison
from trdlab.explanations.rules import Claim, Fields, Found, every, first
from trdlab.explanations.sections import Section, at_first

NOTABLE = 0.05  # of all that is expected: the least lead to call one agent later
FURTHEST = 3  # of the largest disagreements are told


def in_brief(comparison: Comparison) -> list[Claim]:
    """Returns who expects more, when, whether they would do the same, and whom to trust."""
    told = [*first(comparison, nothing_differs, *how_much), *_when(comparison)[:1]]
    told += every(comparison, agreement)
    for side in SIDES:
        verdicts = [of for of in every(comparison, trusted) if of.side == side][1:]
        tested = [of for of in verdicts if of.about not in ("unseen", "silent")]
        told += (tested or verdicts)[-1:]  # what is wrong, if anything is
    return list(at_first(told))


def sections(comparison: Comparison) -> tuple[Section, ...]:
    """Returns all there is to say of a comparison, by the question that it answers."""
    differences = first(comparison, nothing_differs, *how_much) + _when(comparison)
    apart = every(comparison, agreement, of_any_action, furthest_apart)
    grounds = every(comparison, each_tells, one_tells, compared_at, some_cut_off, all_alike)
    parts = (
        Section("differences", "Who expects more, and when", tuple(differences)),
        Section("states", "Where they are furthest apart", tuple(apart)),
        Section("trust", "How far to trust each where A acts", tuple(every(comparison, trusted))),
        Section("grounds", "What this rests on", tuple(grounds)),
    )
    return tuple(part for part in parts if part)


def _when(comparison: Comparison) -> list[Claim]:
    when = every(comparison, largest_at)
    return when + first(comparison, *later, come_by)


@COMPARISONS.rule("They expect the same of every action, at every state they were compared at.")
def nothing_differs(comparison: Comparison) -> Iterator[Fields]:
    if not comparison.visits.of_any_action.any():
        yield {}


@COMPARISONS.kinds(
    {
        "same-in-all": (
            "Both expect {value:number} on average, though not the same of every action at every "
            "state."
        ),
        "expects-more": (
            "{more:text} expects more than {less:text}: {more_value:number} against "
            "{less_value:number} on average."
        ),
        "neither-surely-more": (
            "A expects {first_value:number} on average and B {second_value:number}; with other "
            "episodes it could be the other way round."
        ),
    }
)
def how_much(comparison: Comparison) -> Iterator[Found]:
    """Who expects more in all, if other episodes would hardly turn that round."""
    gap, worth = comparison.gap, comparison.visits.expected.mean(axis=1).sum(axis=1)  # [2]
    if gap.value == 0.0:
        if comparison.visits.of_any_action.any():
            yield "same-in-all", {"value": float(worth[0])}
    elif gap.low <= 0.0 <= gap.high:
        values = {"first_value": float(worth[0]), "second_value": float(worth[1])}
        yield "neither-surely-more", values
    else:
        sides, more = _sides(gap.value)
        values = {"more_value": float(worth[more]), "less_value": float(worth[1 - more])}
        yield "expects-more", sides | values


@COMPARISONS.rule(
    "Over all actions that can be taken in these states, what they expect differs by "
    "{distance:number} on average."
)
def of_any_action(comparison: Comparison) -> Iterator[Fields]:
    """The sum of |differences| over all components."""
    apart = comparison.visits.of_any_action.sum(axis=-1)
    if apart.any():
        yield {"distance": float(apart.mean())}


@COMPARISONS.rule("They would take the same action in {share:percent} of the states.")
def agreement(comparison: Comparison) -> Iterator[Fields]:
    """Of two who expect the same everywhere that is said only where they act otherwise."""
    one, other = comparison.visits.actions
    share = float((one == other).mean())
    if share < 1.0 or comparison.visits.of_any_action.any():
        yield {"share": share}


@COMPARISONS.rule(
    "They differ most in what comes {component:when}: there {more:text} expects {by:number} more "
    "than {less:text}, on average."
)
def largest_at(comparison: Comparison) -> Iterator[Fields]:
    """Where the means are furthest apart, if other episodes would not turn that round."""
    mean = comparison.visits.difference.mean(axis=0)
    c = int(np.abs(mean).argmax())
    of = comparison.difference[c]
    if comparison.time_axis.horizon and mean[c] != 0.0 and not of.low <= 0.0 <= of.high:
        sides, _ = _sides(mean[c])
        yield {"component": c, **sides, "by": abs(float(mean[c]))}


_LATER = (
    "{later:text} expects its %s later: {later_share:percent} of its own come {last_step:within}, "
    "but {sooner_share:percent} of {sooner:text}'s."
)


@COMPARISONS.kinds({"later-rewards": _LATER % "rewards", "later-costs": _LATER % "costs"})
def later(comparison: Comparison) -> Iterator[Found]:
    """At no step has a larger share of the later one's come; all that is expected has one sign."""
    shift = comparison.shift
    for sign, shares, c in _apart(comparison):
        late = int(shares[0, c] > shares[1, c])
        lead = shares[1 - late] - shares[late]
        is_sure = shift.value != 0.0 and not shift.low <= 0.0 <= shift.high
        if is_sure and (shift.value > 0.0) == bool(late) and (lead >= -1e-9).all():
            fields = {
                "later": SIDES[late],
                "sooner": SIDES[1 - late],
                "last_step": (c + 1) * comparison.time_axis.width - 1,
                "later_share": float(shares[late, c]),
                "sooner_share": float(shares[1 - late, c]),
            }
            yield "later-rewards" if sign > 0.0 else "later-costs", fields


@COMPARISONS.rule(
    "{last_step:within}, {first_share:percent} of what A expects has come, and "
    "{second_share:percent} of what B expects."
)
def come_by(comparison: Comparison) -> Iterator[Fields]:
    """By the step at which these shares differ most."""
    for _, shares, c in _apart(comparison):
        last, (one, other) = (c + 1) * comparison.time_axis.width - 1, map(float, shares[:, c])
        yield {"last_step": last, "first_share": one, "second_share": other}


def _apart(comparison: Comparison) -> Iterator[tuple[float, FloatArray, int]]:
    """Yields a sign; `[2, N]`, the share of what each expects that has come; and where they differ.

    All means must have that sign; where they do not, or hardly differ, there is none.
    """
    for sign in (1.0, -1.0):
        means = sign * comparison.visits.expected.mean(axis=1)  # [2, N+1]
        totals = means.sum(axis=1, keepdims=True)
        if (means < 0.0).any() or not totals.all() or not comparison.time_axis.horizon:
            continue
        shares = np.asarray(means.cumsum(axis=1) / totals)[:, :-1]
        gap = np.abs(shares[0] - shares[1])
        if gap.max() >= NOTABLE:
            yield sign, shares, int(gap.argmax())


@COMPARISONS.rule(
    "At {step:step} of {side:text}'s episode with seed {seed:text}: A would do {first_action} "
    "(expecting {first_value:number}), B {second_action} (expecting {second_value:number})."
)
def furthest_apart(comparison: Comparison) -> Iterator[Fields]:
    """The states at which what each expects of its own action is furthest apart."""
    visits = comparison.visits
    for m in visits.furthest(FURTHEST):
        actions = visits.actions[:, m]
        worth = visits.components[(0, 1), m, actions].sum(axis=-1)
        names = [comparison.agents[0].action_names[a] for a in actions]
        yield {
            "distance": float(visits.apart[m]),
            "step": int(visits.step[m]),
            "side": SIDES[visits.player[m]],
            "seed": int(visits.seed[m]),
            "first_value": float(worth[0]),
            "first_action": names[0],
            "second_value": float(worth[1]),
            "second_action": names[1],
        }


@COMPARISONS.rule("{side:text}: {said:text}")
def trusted(comparison: Comparison) -> Iterator[Fields]:
    """What matters most of the calibration of each."""
    for side, report in zip(SIDES, comparison.reports, strict=True):
        for claim in [] if report is None else in_brief_of_report(report):
            said = claim.sentence[0].lower() + claim.sentence[1:]
            yield {"side": side, "said": said, "about": claim.kind}


@COMPARISONS.rule(
    "They were compared at {states:states}: half from {episodes:episodes} of A, half from "
    "{episodes:count} of B."
)
def compared_at(comparison: Comparison) -> Iterator[Fields]:
    yield {"states": len(comparison.visits), "episodes": comparison.episodes}


@COMPARISONS.rule("{episodes:episodes} had to be cut off, after {steps:steps} each.")
def some_cut_off(comparison: Comparison) -> Iterator[Fields]:
    """Episodes that would have gone on, but were not played for longer."""
    if comparison.visits.cut:
        yield {"episodes": comparison.visits.cut, "steps": comparison.max_steps}


@COMPARISONS.rule("Only {different:episodes} {are:text} distinct: too few to tell about others.")
def all_alike(comparison: Comparison) -> Iterator[Fields]:
    if np.isnan(comparison.gap.low):
        different = comparison.visits.different
        yield {"different": different, "are": "is" if different == 1 else "are"}


@COMPARISONS.rule(
    "Each expects what would follow in its own world if {policy:text} acted: {reward:text}, up to "
    "{ending:text}."
)
def each_tells(comparison: Comparison) -> Iterator[Fields]:
    one, other = (agent.estimator.future for agent in comparison.agents)
    if one == other:
        yield {"policy": one.policy, "reward": one.reward, "ending": one.ending}


@COMPARISONS.rule(
    "{side:text} tells of the future of {policy:text}: {reward:text}, up to {ending:text}."
)
def one_tells(comparison: Comparison) -> Iterator[Fields]:
    """What each tells of, where these are different kinds of future."""
    futures = [agent.estimator.future for agent in comparison.agents]
    if futures[0] != futures[1]:
        for side, of in zip(SIDES, futures, strict=True):
            yield {"side": side, "policy": of.policy, "reward": of.reward, "ending": of.ending}


def _sides(difference: float) -> tuple[Fields, int]:
    """Returns who expects more and who less, and the number of the one who expects more."""
    more = int(difference > 0.0)
    return {"more": SIDES[more], "less": SIDES[1 - more]}, more
