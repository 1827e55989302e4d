"""Maps of where a component is decided: grouped, held against each other, and enlarged."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.explanations.saliency.groups import Group
from trdlab.time_axis import TimeAxis


@dataclass(frozen=True, eq=False)
class SaliencyMap:
    """Where something is decided.

    Args:
        signed: `[h, w]`, above 0 where what is seen there raises it, below where it lowers it.
        label: what it is of, such as `t…t+9`.
    """

    signed: FloatArray
    label: str

    @property
    def rectified(self) -> FloatArray:
        """`[h, w]`: only what raises it, as GradCAM is mostly shown."""
        return np.maximum(self.signed, 0.0)

    @property
    def strength(self) -> FloatArray:
        """`[h, w]`: how much it matters, either way."""
        return np.abs(self.signed)

    @cached_property
    def scaled(self) -> FloatArray:
        """`[h, w]`: signed, as a share of the largest strength."""
        return shares_of_largest(self.signed)

    def at(self, height: int, width: int) -> "SaliencyMap":
        """Returns the map enlarged to a screen `[height, width]`."""
        return SaliencyMap(enlarged(self.signed, height, width), self.label)


@dataclass(frozen=True, eq=False)
class SaliencyMaps:
    """The maps of all components of an action, or of how it differs from another one.

    Being sums of gradients, signed maps add up: that of a group is the sum of its maps, and that of
    a difference is the difference.

    Args:
        signed: `[N+1, h, w]`, of the discounted components.
        time_axis: what those mean.
    """

    signed: FloatArray
    time_axis: TimeAxis

    def __post_init__(self) -> None:
        if self.signed.ndim != 3 or len(self.signed) != self.time_axis.num_components:
            raise InputError(
                f"The maps have shape {self.signed.shape}.",
                f"Give one for each component: [{self.time_axis.num_components}, h, w].",
            )

    def of(self, group: Group) -> SaliencyMap:
        """Returns the map of some components together."""
        return SaliencyMap(
            self.signed[group.components].sum(axis=0, dtype=np.float64),
            group.label(self.time_axis),
        )

    def difference(self, near: Group, far: Group) -> SaliencyMap:
        """Returns the map of how much more is expected far than near, in discounted reward."""
        one, other = self.of(near), self.of(far)
        return SaliencyMap(other.signed - one.signed, f"{other.label} − {one.label}")

    def paper_difference(self, near: Group, far: Group) -> SaliencyMap:
        """Returns the paper's difference: rectified maps, each a share of its largest, subtracted.

        It tells where the attention goes, whatever the two are worth; it is the map of nothing that
        the network tells.

        Source: the paper's section 6.2.
        """
        one, other = self.of(near), self.of(far)
        shares = shares_of_largest(other.rectified) - shares_of_largest(one.rectified)
        return SaliencyMap(shares, f"{other.label} − {one.label}, as in the paper")

    def minus(self, other: "SaliencyMaps") -> "SaliencyMaps":
        """Returns the maps of how two actions differ."""
        return SaliencyMaps(self.signed - other.signed, self.time_axis)


def shares_of_largest(values: FloatArray) -> FloatArray:
    """Returns numbers as shares of the largest by its absolute value; of only zeros, zeros."""
    largest = np.abs(values).max(initial=0.0)
    return values / largest if largest > 0.0 else np.zeros_like(values, dtype=np.float64)


def overlap(one: FloatArray, other: FloatArray) -> float:
    """Returns by what share two signed maps lie on the same places, with the same sign.

    Each is taken as shares of all that it holds. It is 1 for a map and any multiple of it above 0,
    and 0 where none of one's places is one of the other's; NaN if one holds nothing.

    >>> overlap(np.array([1.0, 3.0, 0.0]), np.array([0.0, 2.0, 2.0]))
    0.5
    """
    totals = [np.abs(of).sum() for of in (one, other)]
    if 0.0 in totals:
        return float("nan")
    p, q = one / totals[0], other / totals[1]
    both = np.where(p * q > 0.0, np.minimum(np.abs(p), np.abs(q)), 0.0)
    return float(both.sum())


def area_of(strength: FloatArray, share: float = 0.5) -> float:
    """Returns on how few of the places a share of all strength lies; NaN if there is none.

    >>> area_of(np.array([6.0, 2.0, 1.0, 1.0]))
    0.25
    """
    ordered = np.sort(strength.ravel())[::-1].cumsum()
    if not len(ordered) or ordered[-1] == 0.0:
        return float("nan")
    return float((np.searchsorted(ordered, share * ordered[-1] * (1.0 - 1e-12)) + 1) / len(ordered))


def enlarged(values: FloatArray, height: int, width: int) -> FloatArray:
    """Returns a map `[h, w]` as `[height, width]`, on straight lines between middles of cells.

    That is what `torch.nn.functional.interpolate` calls bilinear, with `align_corners=False`.

    >>> enlarged(np.array([[0.0, 4.0]]), 1, 4)
    array([[0., 1., 3., 4.]])
    """
    rows, columns = (_weights(of, to) for of, to in zip(values.shape, (height, width), strict=True))
    return np.asarray(rows @ values @ columns.T)


def _weights(size: int, new: int) -> FloatArray:
    """Returns `[new, size]`: how much each old cell counts in each new one."""
    middle = np.clip((np.arange(new) + 0.5) * size / new - 0.5, 0.0, size - 1.0)
    distance = np.abs(middle[:, None] - np.arange(size))  # [new, size]
    return np.maximum(0.0, 1.0 - distance)
