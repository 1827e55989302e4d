"""The nouns: the time axis, and the reward decomposition that lives on it."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.formatting import decimals_for, number
from trdlab.time_axis import TimeAxis as TimeAxis
from trdlab.time_axis import axis_title
from trdlab.undiscounting import bounds

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "trdlab.RewardDecomposition/1"
_MOST_ROWS = 50  # as a table; what is longer is shown by its shape


def _is_frozen(array: Any) -> bool:
    """Returns whether nobody can write to an array, so that it need not be copied."""
    if not isinstance(array, np.ndarray) or array.flags.writeable:
        return False
    return array.base is None or _is_frozen(array.base)


@dataclass(frozen=True, eq=False)
class RewardDecomposition:
    """Expected discounted rewards, split over future time.

    The last axis of `components` is the time axis: N explicit components and the residual. The
    leading axes say what is decomposed: `[A, N+1]` a moment, `[B, A, N+1]` a batch,
    `[T, A, N+1]` an episode, `[S, A, N+1]` a table; without A, state values.

    Args:
        components: `[..., N+1]`, in units of discounted reward. Read-only after; copied, unless
            nobody could write to it before.
        time_axis: what the last axis means.

    Raises:
        InputError: the last axis does not have N+1 entries.

    Source: the paper's Eqs. trd-array, trd-equiv and trd-binned-array.

    >>> down = RewardDecomposition([0.95, 1.76, 0.81], TimeAxis(0.95, horizon=2, width=2))
    >>> round(float(down.value), 2), float(down.residual)
    (3.52, 0.81)
    """

    components: FloatArray
    time_axis: TimeAxis

    def __post_init__(self) -> None:
        components = np.array(self.components, copy=not _is_frozen(self.components) or None)
        if components.dtype.kind != "f":
            components = components.astype(np.float64)
        expected = self.time_axis.num_components
        if components.ndim == 0 or components.shape[-1] != expected:
            raise InputError(
                f"The components have shape {components.shape}, but N = "
                f"{self.time_axis.horizon} needs a last axis of {expected}.",
                "Give [..., N+1], the residual last.",
            )
        components.setflags(write=False)
        object.__setattr__(self, "components", components)

    @property
    def value(self) -> FloatArray:
        """`[...]`: the Q-value or state value, Σ components (the paper's Eq. trd-equiv)."""
        return np.asarray(self.components.sum(axis=-1))

    @property
    def residual(self) -> FloatArray:
        """`[...]`: the discounted reward of all steps from t+N·w on."""
        return np.asarray(self.components[..., -1])

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape without the component axis."""
        return self.components.shape[:-1]

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError("a single vector of components has no length; see time_axis")
        return self.shape[0]

    def __iter__(self) -> Iterator["RewardDecomposition"]:
        return (self[i] for i in range(len(self)))  # so that a single vector refuses

    def __getitem__(self, index: Any) -> "RewardDecomposition":
        """Selects states, actions or moments; the component axis stays whole."""
        parts = index if isinstance(index, tuple) else (index,)
        whole = any(part is Ellipsis for part in parts)  # not `in`: a part may be an array
        try:
            selected = self.components[(*parts, *(() if whole else (...,)), slice(None))]
        except IndexError as error:
            raise IndexError(
                f"{index} does not select from shape {self.shape} (the component axis is not "
                f"indexed: use .components)"
            ) from error
        return RewardDecomposition(selected, self.time_axis)

    def __sub__(self, other: "RewardDecomposition") -> "RewardDecomposition":
        """Returns the contrast, component by component, of two decompositions on one axis."""
        if not isinstance(other, RewardDecomposition):
            return NotImplemented
        if other.time_axis != self.time_axis:
            raise InputError(
                f"The time axes differ: {self.time_axis} and {other.time_axis}.",
                "Regroup one of them, or decompose both on the same axis.",
            )
        return RewardDecomposition(self.components - other.components, self.time_axis)

    def under(self, probabilities: FloatArray) -> "RewardDecomposition":
        """Returns what is expected before the action is chosen: `[..., N+1]`, v^TRD of a policy.

        Of the components `[..., A, N+1]` that is Σ_a π(a|s)·q^TRD(s, a).

        Args:
            probabilities: π, `[..., A]`.

        Source: Towers et al. (2024), appendix A.

        >>> actions = RewardDecomposition([[1.0, 0.0], [0.0, 2.0]], TimeAxis(0.9, 1))
        >>> print(actions.under(np.array([0.75, 0.25])).components)
        [0.75 0.5 ]
        """
        mean = (probabilities[..., None, :] @ self.components)[..., 0, :]
        return RewardDecomposition(mean, self.time_axis)

    def regroup(self, width: int) -> "RewardDecomposition":
        """Returns the same rewards in wider groups; the residual stays as it is.

        Raises:
            InputError: the last group would be short; the message says which widths fit.

        >>> fine = RewardDecomposition([0, 0.95, 0.9, 0.86, 0.81], TimeAxis(0.95, horizon=4))
        >>> fine.regroup(2).components.round(2).tolist()
        [0.95, 1.76, 0.81]
        """
        axis = self.time_axis.regrouped(width)
        split = (*self.shape, axis.horizon, width // self.time_axis.width)
        groups = self.components[..., :-1].reshape(split).sum(axis=-1)
        return RewardDecomposition(
            np.concatenate([groups, self.components[..., -1:]], axis=-1), axis
        )

    def on(self, axis: TimeAxis) -> "RewardDecomposition":
        """Returns the same rewards on a coarser axis: late components fold into the residual.

        Args:
            axis: with a width that is a multiple of the present one, and no more steps before the
                residual (see `TimeAxis.shared`).

        Raises:
            InputError: it is another discount factor, or a finer axis.

        >>> fine = RewardDecomposition([0, 0.95, 0.9, 0.86, 0.81], TimeAxis(0.95, horizon=4))
        >>> fine.on(TimeAxis(0.95, horizon=1, width=3)).components.round(2).tolist()
        [1.85, 1.67]
        """
        own = self.time_axis
        if own.shared(axis) != axis:
            raise InputError(
                f"{own} cannot be brought to {axis}.",
                f"The nearest that it can is {own.shared(axis)}.",
            )
        kept = axis.num_steps // own.width
        beyond = self.components[..., kept:].sum(axis=-1, keepdims=True)  # [..., 1]
        folded = np.concatenate([self.components[..., :kept], beyond], axis=-1)
        groups = TimeAxis(own.gamma, kept, own.width)
        return RewardDecomposition(folded, groups).regroup(axis.width)

    def undiscounted(self) -> FloatArray:
        """Returns `[..., N]`: the expected reward of each explicit step, c_i / γ^i (w = 1 only).

        The residual has no entry: what lies in it cannot be undiscounted (errata P9). An
        undiscounted total must be solved for separately, and may not exist.

        Raises:
            InputError: w > 1 (see `undiscounted_bounds`), or γ = 0.
        """
        if self.time_axis.width > 1:
            raise InputError(
                f"A group of {self.time_axis.width} steps cannot be undiscounted: "
                "the steps inside it carry different discounts.",
                "Decompose with w = 1, or ask for undiscounted_bounds.",
            )
        self._refuse_vanishing_discounts()
        return np.asarray(self.components[..., :-1] / self.time_axis.discounts[:-1])

    def undiscounted_bounds(
        self, lowest: float = 0.0, highest: float = math.inf
    ) -> tuple[FloatArray, FloatArray]:
        """Returns `[..., N+1]` twice: the least and the most undiscounted reward per component.

        They follow from the range of a single reward alone: the sum of a group is least when it
        is paid as early as possible, and most when as late. The residual has a finite bound only
        where rewards have one sign (`0, inf` or `-inf, 0`, or within).

        Args:
            lowest: the least reward that a single step can pay. After the end of an episode
                steps pay 0: where an end is possible, the range must include 0.
            highest: the most that it can pay.

        Raises:
            InputError: the range bounds nothing (both ends infinite) or is empty, it contradicts
                the components, or γ = 0.

        >>> group = RewardDecomposition([0.95, 0.81], TimeAxis(0.95, horizon=1, width=2))
        >>> [bound.round(2).tolist() for bound in group.undiscounted_bounds()]
        [[0.95, 0.9], [1.0, inf]]
        """
        self._refuse_vanishing_discounts()
        if not lowest <= highest or lowest == math.inf or highest == -math.inf:
            raise InputError(
                f"There is no reward from {lowest} to {highest}.", "Give the lower end first."
            )
        if math.isinf(lowest) and math.isinf(highest):
            raise InputError(
                "Rewards of both signs without a limit bound nothing.",
                "Give the least or the most that one step can pay.",
            )
        if math.isinf(lowest):  # mirror, so that below the low end is always finite
            mirrored = RewardDecomposition(-self.components, self.time_axis)
            low, high = mirrored.undiscounted_bounds(-highest, math.inf)
            return -high, -low
        return bounds(self.components, self.time_axis, lowest, highest)

    def to_dict(self) -> dict[str, Any]:
        """Returns plain Python data at full precision, with the version of its schema."""
        axis = self.time_axis
        return {
            "schema": SCHEMA,
            "gamma": axis.gamma,
            "N": axis.horizon,
            "w": axis.width,
            "components": self.components.tolist(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Returns the decomposition that `to_dict` wrote.

        Raises:
            InputError: another schema, or a field is missing or holds something else.
        """
        if data.get("schema") != SCHEMA:
            raise InputError(
                f"The schema is {data.get('schema')!r}.", f"This version reads {SCHEMA!r}."
            )
        try:
            axis = TimeAxis(data["gamma"], data["N"], data["w"])
            return cls(np.asarray(data["components"], dtype=np.float64), axis)
        except KeyError as error:
            raise InputError(f"The field {error} is missing.", "Write it with to_dict.") from error
        except (TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"The components are no array of numbers: {error}.", "Write them with to_dict."
            ) from error

    def __rich__(self) -> "Table | str":
        from rich.table import Table

        if not self._is_readable():
            return repr(self)
        table = Table(*self.time_axis.labels, "value", title=axis_title(self.time_axis))
        for column in table.columns:
            column.justify = "right"
        for row in self._text_rows():
            table.add_row(*row)
        return table

    def _repr_html_(self) -> str:
        if not self._is_readable():
            return f"<code>{repr(self).replace('<', '&lt;')}</code>"
        head = "".join(f"<th>{label}</th>" for label in (*self.time_axis.labels, "value"))
        body = "".join(
            "<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>"
            for row in self._text_rows()
        )
        caption = f"<caption>{axis_title(self.time_axis)}</caption>"
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def __repr__(self) -> str:
        if not self._is_readable() or self.time_axis.horizon > 12:
            return f"RewardDecomposition(shape={self.components.shape}, {self.time_axis})"
        return f"RewardDecomposition({self.components.tolist()}, {self.time_axis})"

    def _is_readable(self) -> bool:
        return len(self.shape) < 2 and math.prod(self.shape) <= _MOST_ROWS

    def _text_rows(self) -> list[list[str]]:
        rows = np.atleast_2d(np.concatenate([self.components, self.value[..., None]], axis=-1))
        decimals = decimals_for(rows.ravel())
        return [[number(v, decimals) for v in row] for row in rows]

    def _refuse_vanishing_discounts(self) -> None:
        axis = self.time_axis
        if axis.gamma == 0.0:
            raise InputError(
                "With gamma = 0 later rewards are worth nothing and cannot be read back.",
                "Decompose with gamma above 0.",
            )
        if axis.gamma**axis.num_steps < np.finfo(np.float64).tiny:
            raise InputError(
                f"{axis.gamma:g} to the power of {axis.num_steps} vanishes in double precision: "
                "later rewards cannot be read back.",
                "Choose a smaller horizon N.",
            )
