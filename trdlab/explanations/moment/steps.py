"""Steps: what one action is expected to pay at each step, and what of that counts."""

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.explanations.moment.moment import Moment

SHARE = 0.2  # of the largest that is expected at any one step: what stands out is at least that
SLIGHT = 0.1  # of what forecasts are off by: so little is lost in what chance does
NEGLIGIBLE = 0.01  # what an exact table expects below this share is not worth a sentence
LEAST_DISCOUNT = float(np.finfo(np.float64).tiny) ** 0.25  # what is smaller cannot be taken out
_ROUNDING = 9  # decimals, of a share of the largest


def doubtful(moment: Moment, action: str) -> BoolArray:
    """Returns `[N+1]`: what is not to be trusted of an action.

    That is nothing where it has not been judged, nor of an exact table, which needs no tests.
    """
    judged = moment.judged(action)
    if judged is None or moment.is_exact:
        return np.zeros(moment.time_axis.num_components, dtype=np.bool_)
    return judged.trust.doubtful


def off_by(moment: Moment, action: str) -> FloatArray:
    """Returns `[N+1]`: what forecasts of such an action are off by; 0 where it is not known."""
    judged = moment.judged(action)
    if judged is None or moment.is_exact:
        return np.zeros(moment.time_axis.num_components)
    return np.asarray(np.nan_to_num(judged.off_by))


def explicit_end(moment: Moment, action: str) -> int:
    """Returns the first component that a forecast is silent of: the residual, or one before it.

    It is one that is not to be trusted, or so far away that its discount cannot be taken out.
    """
    silent = doubtful(moment, action) | (moment.time_axis.discounts < LEAST_DISCOUNT)
    silent[-1] = True
    return int(silent.argmax())


def undiscounted(moment: Moment, action: str) -> FloatArray:
    """Returns `[K]`: the components that can be told apart and trusted, without their discount.

    With w = 1 these are expected rewards; a group is discounted to its own first step (errata P9).
    """
    end = explicit_end(moment, action)
    return moment.components(action)[:end] / moment.time_axis.discounts[:end]


def stands_out(moment: Moment, action: str) -> BoolArray:
    """Returns `[K]`: which of the trusted explicit components are more than noise (see `least`)."""
    size = np.abs(undiscounted(moment, action))
    return np.asarray((size > 0.0) & (size >= least(moment, action)))


def least(moment: Moment, action: str) -> FloatArray:
    """Returns `[K]`: the least that stands out at each step, without its discount.

    Of what was learned that is `SHARE` of the largest that is expected, and `SLIGHT` of what such
    forecasts are off by. Of an exact table, which has no noise, it is `NEGLIGIBLE` of the largest,
    or of the reward that would be worth the residual if every later step paid it.
    """
    axis, row = moment.time_axis, np.abs(undiscounted(moment, action))
    largest = float(row.max(initial=0.0))
    if not moment.is_exact:
        noise = off_by(moment, action)[: len(row)] / axis.discounts[: len(row)]
        return np.maximum(SHARE * largest, SLIGHT * noise)
    later = abs(float(moment.components(action)[-1])) * (1.0 - axis.gamma**axis.width)
    begins = float(axis.discounts[-1])
    rate = later / begins if begins >= LEAST_DISCOUNT else 0.0
    return np.full(len(row), NEGLIGIBLE * max(largest, rate))


def largest(moment: Moment, action: str) -> int:
    """Returns the component with the largest size, of equals the first."""
    return int(np.abs(shares(moment, action)).argmax())


def shares(moment: Moment, action: str) -> FloatArray:
    """Returns `[K]`: what is expected, as a share of the largest, be that a reward or a cost.

    Shares that differ only by rounding are equal.
    """
    row = undiscounted(moment, action)
    if not row.any():
        return row
    return np.asarray(np.round(row / row[np.abs(row).argmax()], _ROUNDING))
