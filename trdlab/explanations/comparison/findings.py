"""All that is to be said of a comparison, what matters most first."""

import numpy as np

from trdlab.explanations.comparison import background, differences
from trdlab.explanations.comparison.differences import ComparisonFinding
from trdlab.explanations.comparison.report import SIDES, Comparison

NOTABLE = 0.05
"""The least lead, as a share of all that is expected, that makes one agent later worth telling."""

Findings = tuple[ComparisonFinding, ...]


def comparison_findings(comparison: Comparison) -> Findings:
    """Returns what is to be said of a comparison, what matters most first.

    Args:
        comparison: of two agents.
    """
    if not comparison.visits.of_any_action.any():
        return (differences.NothingDiffers(), *_trust(comparison), *_background(comparison))
    return (
        *_in_all(comparison),
        *_in_time(comparison),
        *_actions(comparison),
        *_trust(comparison),
        *_background(comparison),
    )


def _in_all(comparison: Comparison) -> Findings:
    gap, (first, second) = comparison.gap, map(float, differences.values(comparison))
    if gap.value == 0.0:
        return (differences.SameInAll(first),)
    if gap.low <= 0.0 <= gap.high:
        return (differences.NeitherSurelyMore(first, second),)
    if gap.value > 0.0:
        return (differences.ExpectsMore("B", "A", second, first),)
    return (differences.ExpectsMore("A", "B", first, second),)


def _in_time(comparison: Comparison) -> Findings:
    """Returns at which steps they differ; with no explicit component there are none."""
    if comparison.time_axis.horizon == 0 or not comparison.visits.difference.any():
        return ()
    mean = comparison.visits.difference.mean(axis=0)
    c = int(np.abs(mean).argmax())
    sides = ("B", "A") if mean[c] > 0.0 else ("A", "B")
    largest = differences.LargestAt(c, *sides, abs(float(mean[c])))
    found = [largest, *_most(comparison), *_later(comparison)]
    return tuple(claim for claim in found if claim.holds(comparison))


def _most(comparison: Comparison) -> Findings:
    axis = comparison.time_axis
    size = np.abs(comparison.visits.difference).mean(axis=0)
    for count in range(1, axis.num_components):
        shares = differences.in_a_row(size / size.sum(), count)
        begin = int(shares.argmax())
        if shares[begin] <= differences.MOST:
            continue
        end, share = begin + count, float(shares[begin])
        if count == 1:
            return (differences.MostAt(begin, share),)
        if end == axis.num_components:
            return (differences.MostFrom(begin, share),)
        return (differences.MostBetween(begin, end * axis.width - 1, share),)
    return ()


def _later(comparison: Comparison) -> Findings:
    """Returns who expects it later, or at least how much has come by when."""
    for kind in (differences.LaterRewards, differences.LaterCosts):
        shares = differences.come(comparison, kind.sign)
        lead = np.zeros(1) if shares is None else shares[0] - shares[1]  # [N], of the first one
        c = int(np.abs(lead).argmax())
        if shares is None or abs(lead[c]) < NOTABLE:
            continue
        last, (first, second) = (c + 1) * comparison.time_axis.width - 1, map(float, shares[:, c])
        later = kind("B", "A", last, first, second)
        if lead[c] < 0.0:
            later = kind("A", "B", last, second, first)
        is_later = later.holds(comparison)
        return (later if is_later else differences.ComeBy(last, first, second),)
    return ()


def _actions(comparison: Comparison) -> Findings:
    visits = comparison.visits
    share = float((visits.actions[0] == visits.actions[1]).mean())
    of_any = float(np.abs(visits.of_any_action).sum(axis=-1).mean())
    found: list[ComparisonFinding] = [differences.Agreement(share)]
    if visits.apart.any():
        found.append(furthest(comparison, int(visits.apart.argmax())))
    return (*found, differences.OfAnyAction(of_any))


def furthest(comparison: Comparison, m: int) -> differences.FurthestApart:
    """Returns the claim that they are furthest apart at a state.

    Args:
        comparison: of two agents.
        m: the number of the state.
    """
    visits, actions = comparison.visits, comparison.visits.actions[:, m]
    first, second = (float(worth) for worth in visits.components[(0, 1), m, actions].sum(axis=-1))
    names = [comparison.action_names[a] for a in actions]
    return differences.FurthestApart(
        distance=float(visits.apart[m]),
        step=int(visits.step[m]),
        side=SIDES[visits.player[m]],
        seed=int(visits.seed[m]),
        first_value=first,
        first_action=names[0],
        second_value=second,
        second_action=names[1],
    )


def _trust(comparison: Comparison) -> Findings:
    found: list[ComparisonFinding] = []
    for side, report in zip(SIDES, comparison.reports, strict=True):
        if report is None:
            continue
        step = report.trust.last_step or 0
        claims = (
            background.TrustedUpTo(side, step),
            background.TrustedAllAlong(side, step),
            background.TrustedNowhere(side),
            background.TooFewToJudge(side, int(report.calibration.num_episodes[0])),
            background.NeverTested(side),
        )
        found += [claim for claim in claims if claim.holds(comparison)]
    return tuple(found)


def _background(comparison: Comparison) -> Findings:
    first, second = comparison.futures
    at = background.ComparedAt(len(comparison.visits), comparison.episodes)
    alike = background.AllAlike(comparison.visits.different)
    futures: Findings = (background.EachTells(first.policy, first.reward, first.ending),)
    if first != second:
        futures = tuple(
            background.OneTells(side, future.policy, future.reward, future.ending)
            for side, future in zip(SIDES, comparison.futures, strict=True)
        )
    cut = background.SomeCutOff(comparison.visits.cut, comparison.max_steps or 0)
    return (*futures, at, *(claim for claim in (cut, alike) if claim.holds(comparison)))
