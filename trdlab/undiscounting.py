"""What undiscounted rewards can be behind discounted sums, where a single reward has a range."""

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.time_axis import TimeAxis


def bounds(
    components: FloatArray, axis: TimeAxis, lowest: float, highest: float
) -> tuple[FloatArray, FloatArray]:
    """Returns `[..., N+1]` twice, see `RewardDecomposition.undiscounted_bounds`.

    Args:
        components: `[..., N+1]`, discounted.
        axis: γ > 0, N and w.
        lowest: the least reward that a single step can pay; finite.
        highest: the most.

    Raises:
        InputError: rewards in this range cannot add up to the components.
    """
    gamma, width = axis.gamma, axis.width
    weights = gamma ** np.arange(width)  # [w]
    own_start = components / axis.discounts  # [..., N+1], from each own start
    totals = np.full(axis.num_components, weights.sum())
    totals[-1] = 1.0 / (1.0 - gamma)  # of the endless weights of the residual
    _check_range(own_start, lowest * totals, highest * totals)
    excess = own_start[..., :-1] - lowest * totals[:-1]  # [..., N], above the least there is
    low = lowest * width + _filled(excess, weights, highest - lowest)
    high = lowest * width + _filled(excess, weights[::-1], highest - lowest)
    tail = own_start[..., -1:]
    low_tail, high_tail = np.full_like(tail, -np.inf), np.full_like(tail, np.inf)
    if lowest >= 0.0:
        low_tail, high_tail = tail, np.where(tail == 0.0, 0.0, np.inf)
    elif highest <= 0.0:
        low_tail, high_tail = np.where(tail == 0.0, 0.0, -np.inf), tail
    return (
        np.concatenate([low, low_tail], axis=-1),
        np.concatenate([high, high_tail], axis=-1),
    )


def _check_range(sums: FloatArray, least: FloatArray, most: FloatArray) -> None:
    """Refuses sums outside their range by more than rounding (that of their own precision)."""
    ends = [np.where(np.isfinite(end), np.abs(end), 0.0) for end in (least, most)]
    scale = np.maximum(np.maximum(*ends), np.abs(sums))
    slack = max(1e-9, 32 * float(np.finfo(sums.dtype).eps)) * np.maximum(1.0, scale)
    if np.any(sums < least - slack) or np.any(sums > most + slack):
        raise InputError(
            "Rewards in this range cannot add up to these components.",
            "Widen the range of a single reward.",
        )


def _filled(excess: FloatArray, weights: FloatArray, room: float) -> FloatArray:
    """Returns the undiscounted sum if `excess` is paid into the steps in the order of `weights`."""
    paid = np.zeros_like(excess)
    left = np.maximum(excess, 0.0)
    for weight in weights:
        here = np.minimum(left / weight, room)
        paid = paid + here
        left = np.maximum(left - here * weight, 0.0)
    return paid
