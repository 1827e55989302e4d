"""Contrast: how two actions' futures differ."""

from collections.abc import Iterable

import numpy as np

from trdlab.arrays import same
from trdlab.explanations.claims import Finding, agrees
from trdlab.explanations.moment.leads import (
    LEADS,
    MakesUp,
    Overtakes,
    crossings,
    difference,
    sooner,
)
from trdlab.explanations.moment.limits import doubtful
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.worth import Better, EqualValues, compare_totals, compare_values

_MOST_DOUBT = 0.5  # of a difference, to tell what comes when
_MOST_REASONS = 6  # components that people still look at


def contrast(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    """Returns how an action's future differs from its foil's.

    In order: the undiscounted totals, which is worth more, which pays sooner, where the running
    totals cross, and the few components that justify the better one. A lead of the action that is
    worth less is always followed by what makes up for it. Where more than half of the difference is
    not to be trusted, that is said instead of what comes when.

    Args:
        moment: the decompositions of every action.
        action: the name of one.
        foil: the name of another.

    Raises:
        InputError: there is no such action, or they are the same.
    """
    moment.index(action), moment.index(foil)
    worth = (*compare_totals(moment, action, foil), compare_values(moment, action, foil))
    if not difference(moment, action, foil).any():
        return (*worth, SameComponents(action, foil))
    doubt = DoubtfulDifference(action, foil, doubtful_share(moment, action, foil))
    if doubt.holds(moment):
        return (*worth, doubt)
    return (
        *worth,
        *sooner(moment, action, foil),
        *crossings(moment, action, foil),
        *_reasons(moment, action, foil),
    )


def in_short(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Returns which action is worth more, and the first that is said of why.

    Where that is a lead of the other action, what makes up for it is the last word.

    Args:
        findings: a contrast, in its order.
    """
    essential = [x for x in findings if isinstance(x, _ESSENTIAL)]
    worth, why = essential[:1], essential[1:]
    is_of_worse = any(
        isinstance(x, Better) and isinstance(y, LEADS) and y.leader == x.worse
        for x, y in zip(worth, why, strict=False)
    )
    return (*worth, *why[: 2 if is_of_worse else 1])


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


class SameComponents(Finding):
    """Both actions have the same decomposition."""

    action: str
    foil: str

    def holds(self, moment: Moment) -> bool:
        return not difference(moment, self.action, self.foil).any()


class DoubtfulDifference(Finding):
    """More than half of the difference, Σ|action − foil|, lies in components not to be trusted."""

    action: str
    foil: str
    share: float

    def holds(self, moment: Moment) -> bool:
        share = doubtful_share(moment, self.action, self.foil)
        return share > _MOST_DOUBT and agrees(self.share, share)


class Dominates(Finding):
    """One action is at least as good in every component, and better in some."""

    better: str
    worse: str

    def holds(self, moment: Moment) -> bool:
        delta = difference(moment, self.better, self.worse)
        return len(delta) > 1 and bool((delta >= 0).all()) and bool((delta > 0).any())


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


def doubtful_share(moment: Moment, action: str, foil: str) -> float:
    """Returns the share of Σ|action − foil| in components not to be trusted; 0 of no difference."""
    size = np.abs(difference(moment, action, foil))
    doubt = doubtful(moment, action) | doubtful(moment, foil)
    return float(size[doubt].sum() / size.sum()) if size.any() else 0.0


_ESSENTIAL = (
    Better,
    EqualValues,
    SameComponents,
    DoubtfulDifference,
    *LEADS,
    Overtakes,
    MakesUp,
    Dominates,
)
