"""Claims about two agents at the same states: who expects more, when, and how surely."""

from typing import ClassVar

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.claims import Claim, agrees
from trdlab.explanations.comparison.report import SIDES, Comparison
from trdlab.statistics import Estimate

MOST = 0.5
"""More than this share of a difference is most of it."""
_ROUNDING = 1e-9


class ComparisonFinding(Claim):
    """A claim about a comparison; the two agents are A and B."""

    def holds(self, comparison: Comparison) -> bool:
        """Returns whether the claim is true of a comparison, tested by its definition."""
        raise NotImplementedError


# ---- how much -----------------------------------------------------------------------------------


class NothingDiffers(ComparisonFinding):
    """Every component of every action is the same at every state."""

    def holds(self, comparison: Comparison) -> bool:
        return not comparison.visits.of_any_action.any()


class ExpectsMore(ComparisonFinding):
    """One expects more in all, and other episodes would hardly turn that round."""

    more: str
    less: str
    more_value: float
    less_value: float

    def holds(self, comparison: Comparison) -> bool:
        told = {self.more: self.more_value, self.less: self.less_value}
        is_larger = is_larger_by(comparison.gap, self.more, self.less)
        return is_larger and _tells(told, values(comparison))


class NeitherSurelyMore(ComparisonFinding):
    """What they expect in all differs, but the other way round in some samples of the episodes."""

    first_value: float
    second_value: float

    def holds(self, comparison: Comparison) -> bool:
        gap = comparison.gap
        told = dict(zip(SIDES, (self.first_value, self.second_value), strict=True))
        return gap.value != 0.0 and gap.low <= 0.0 <= gap.high and _tells(told, values(comparison))


class SameInAll(ComparisonFinding):
    """They expect the same in all, though not the same everywhere."""

    value: float

    def holds(self, comparison: Comparison) -> bool:
        is_same = comparison.gap.value == 0.0 and bool(comparison.visits.of_any_action.any())
        return is_same and agrees(self.value, float(values(comparison)[0]))


class OfAnyAction(ComparisonFinding):
    """How far apart they are on average of one and the same action, over all components."""

    distance: float

    def holds(self, comparison: Comparison) -> bool:
        apart = np.abs(comparison.visits.of_any_action).sum(axis=-1)
        return bool(apart.any()) and agrees(self.distance, float(apart.mean()))


class Agreement(ComparisonFinding):
    """The share of states at which they would most likely do the same."""

    share: float

    def holds(self, comparison: Comparison) -> bool:
        one, other = comparison.visits.probabilities.argmax(axis=-1)
        return agrees(self.share, float((one == other).mean()))


# ---- where in time ------------------------------------------------------------------------------


class LargestAt(ComparisonFinding):
    """Where the means are furthest apart, if other episodes would not turn that round."""

    component: int
    more: str
    less: str
    by: float

    def holds(self, comparison: Comparison) -> bool:
        size, c = np.abs(comparison.visits.difference.mean(axis=0)), self.component
        if comparison.time_axis.horizon == 0 or not 0 <= c < len(size):
            return False
        is_larger = is_larger_by(comparison.difference[c], self.more, self.less)
        return is_larger and is_first_largest(size, c) and agrees(self.by, float(size[c]))


class _Most(ComparisonFinding):
    """The fewest components in a row that hold most of the difference; of equals the fullest."""

    def _is_it(self, comparison: Comparison, begin: int, end: int, share: float) -> bool:
        size = np.abs(comparison.visits.difference).mean(axis=0)
        count = end - begin
        if not (0 <= begin < end <= len(size) and count < len(size) and size.any()):
            return False
        shares = in_a_row(size / size.sum(), count)
        fewer = in_a_row(size / size.sum(), count - 1)
        is_most = is_first_largest(shares, begin) and shares[begin] > MOST
        return bool(is_most and (fewer <= MOST).all()) and agrees(share, float(shares[begin]))


class MostAt(_Most):
    """It is one component."""

    component: int
    share: float

    def holds(self, comparison: Comparison) -> bool:
        return self._is_it(comparison, self.component, self.component + 1, self.share)


class MostBetween(_Most):
    """They are some explicit ones."""

    begin: int
    last_step: int
    share: float

    def holds(self, comparison: Comparison) -> bool:
        end, rest = divmod(self.last_step + 1, comparison.time_axis.width)
        in_range = not rest and self.begin + 1 < end <= comparison.time_axis.horizon
        return in_range and self._is_it(comparison, self.begin, end, self.share)


class MostFrom(_Most):
    """They are the last ones, the residual among them."""

    begin: int
    share: float

    def holds(self, comparison: Comparison) -> bool:
        end = comparison.time_axis.num_components
        return self.begin + 1 < end and self._is_it(comparison, self.begin, end, self.share)


class _Later(ComparisonFinding):
    """At no step has a larger share of the one's come; the step at which it is smaller by most."""

    later: str
    sooner: str
    last_step: int
    sooner_share: float
    later_share: float
    sign: ClassVar[float]

    def holds(self, comparison: Comparison) -> bool:
        end, rest = divmod(self.last_step + 1, comparison.time_axis.width)
        shares = come(comparison, self.sign)
        if shares is None or rest or not 0 < end <= shares.shape[1]:
            return False
        if not is_larger_by(comparison.shift, self.later, self.sooner):
            return False
        told = {self.sooner: self.sooner_share, self.later: self.later_share}
        lead = shares[side_of(self.sooner)] - shares[side_of(self.later)]
        is_behind = is_first_largest(lead, end - 1) and bool((lead >= -_ROUNDING).all())
        return is_behind and lead[end - 1] > 0.0 and _tells(told, shares[:, end - 1])


class LaterRewards(_Later):
    """All they expect on average are rewards."""

    sign = 1.0


class LaterCosts(_Later):
    """All they expect on average are costs."""

    sign = -1.0


class ComeBy(ComparisonFinding):
    """How much of what each expects has come by the step at which these shares differ most."""

    last_step: int
    first_share: float
    second_share: float

    def holds(self, comparison: Comparison) -> bool:
        end, rest = divmod(self.last_step + 1, comparison.time_axis.width)
        for sign in (1.0, -1.0):
            shares = come(comparison, sign)
            if shares is None or rest or not 0 < end <= shares.shape[1]:
                continue
            lead = np.abs(shares[0] - shares[1])
            told = dict(zip(SIDES, (self.first_share, self.second_share), strict=True))
            return is_first_largest(lead, end - 1) and _tells(told, shares[:, end - 1])
        return False


# ---- at which state -----------------------------------------------------------------------------


class FurthestApart(ComparisonFinding):
    """The state at which what each expects of its own action is furthest apart."""

    distance: float
    step: int
    side: str
    seed: int
    first_value: float
    first_action: str
    second_value: float
    second_action: str

    def holds(self, comparison: Comparison) -> bool:
        visits = comparison.visits
        apart = np.abs(visits.difference).sum(axis=-1)
        m = int(apart.argmax())
        at = (SIDES[visits.player[m]], visits.seed[m], visits.step[m])
        names = tuple(comparison.action_names[a] for a in visits.actions[:, m])
        worth = visits.components[(0, 1), m, visits.actions[:, m]].sum(axis=-1)
        told = dict(zip(SIDES, (self.first_value, self.second_value), strict=True))
        is_there = apart[m] > 0.0 and at == (self.side, self.seed, self.step)
        is_told = names == (self.first_action, self.second_action) and _tells(told, worth)
        return bool(is_there) and is_told and agrees(self.distance, float(apart[m]))


def come(comparison: Comparison, sign: float) -> FloatArray | None:
    """Returns `[2, N]`: the share of what each expects on average that has come by each component.

    Args:
        comparison: of two agents.
        sign: what all means must have, 1 or −1; otherwise, and where all are zero, there is none.
    """
    means = sign * comparison.visits.expected.mean(axis=1)  # [2, N+1]
    totals = means.sum(axis=1, keepdims=True)
    if (means < 0.0).any() or not totals.all():
        return None
    return np.asarray(means.cumsum(axis=1) / totals)[:, :-1]


def side_of(name: str) -> int:
    """Returns the number of one of the two."""
    return SIDES.index(name)


def values(comparison: Comparison) -> FloatArray:
    """Returns `[2]`: what each expects in all on average."""
    return np.asarray(comparison.visits.expected.mean(axis=1).sum(axis=1))


def _tells(told: dict[str, float], true: FloatArray) -> bool:
    """Returns whether each side is given its number."""
    return set(told) == set(SIDES) and all(
        agrees(value, float(true[side_of(side)])) for side, value in told.items()
    )


def is_larger_by(second_minus_first: Estimate, larger: str, smaller: str) -> bool:
    """Returns whether a difference favours one; its interval too, where there is one."""
    sign = 1.0 if (smaller, larger) == SIDES else -1.0
    if {larger, smaller} != set(SIDES) or not sign * second_minus_first.value > 0.0:
        return False
    return not second_minus_first.low <= 0.0 <= second_minus_first.high


def is_first_largest(sizes: FloatArray, index: int) -> bool:
    """Returns whether an entry is the largest, of equals the first."""
    return int(sizes.argmax()) == index


def in_a_row(shares: FloatArray, count: int) -> FloatArray:
    """Returns the sums of each `count` entries in a row."""
    return np.convolve(shares, np.ones(count), "valid") if count else np.zeros(1)
