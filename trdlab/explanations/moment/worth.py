"""Worth: what two actions pay in total, and what that is worth now."""

import numpy as np

from trdlab.arrays import same
from trdlab.explanations.claims import Finding, agrees
from trdlab.explanations.moment.moment import Moment


def compare_totals(moment: Moment, action: str, foil: str) -> tuple[Finding, ...]:
    """Returns what two actions pay in total, undiscounted, where that is known.

    Args:
        moment: what is known of every action.
        action: the name of one.
        foil: the name of another.
    """
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


def compare_values(moment: Moment, action: str, foil: str) -> Finding:
    """Returns which of two actions has the larger Q-value, or that neither has.

    Args:
        moment: what is known of every action.
        action: the name of one.
        foil: the name of another.
    """
    gamma, a, b = moment.time_axis.gamma, moment.q_value(action), moment.q_value(foil)
    if same(a, b):
        return EqualValues(action, foil, gamma, a)
    claim = (*moment.ordered(action, foil), gamma, max(a, b), min(a, b))
    by_discount = BetterByDiscount(*claim)
    return by_discount if by_discount.holds(moment) else Better(*claim)


class EqualTotals(Finding):
    """Both actions pay the same in total, undiscounted."""

    action: str
    foil: str
    total: float

    def holds(self, moment: Moment) -> bool:
        a, b = moment.total(self.action), moment.total(self.foil)
        return _close(a, b) and agrees(self.total, a)


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


class NoTotal(Finding):
    """An action has no undiscounted total: its rewards never end."""

    action: str

    def holds(self, moment: Moment) -> bool:
        return moment.totals is not None and bool(np.isnan(moment.total(self.action)))


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


class BetterByDiscount(Better):
    """The same where the undiscounted totals are equal: only the discount decides."""

    def holds(self, moment: Moment) -> bool:
        return _close(moment.total(self.better), moment.total(self.worse)) and super().holds(moment)


class EqualValues(Finding):
    """Both actions have the same Q-value."""

    action: str
    foil: str
    gamma: float
    value: float

    def holds(self, moment: Moment) -> bool:
        a, b = moment.q_value(self.action), moment.q_value(self.foil)
        return same(a, b) and agrees(self.value, a) and agrees(self.gamma, moment.time_axis.gamma)


def _close(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-9 * max(1.0, abs(a), abs(b))
