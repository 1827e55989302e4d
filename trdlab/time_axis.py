"""The time axis: which future steps each component speaks of."""

import math
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError


@dataclass(frozen=True)
class TimeAxis:
    """Which future steps each component speaks of.

    Component i < N covers the agent steps `t+i·w … t+(i+1)·w−1`; component N, the residual,
    covers all later ones. Component 0 holds the reward of the action taken now (errata P1, P8).

    Args:
        gamma: the discount factor, in [0, 1).
        horizon: N, the number of explicit components, at least 0.
        width: w, the agent steps in each explicit component, at least 1.

    Raises:
        InputError: a value is out of its range.

    Source: the paper's Eqs. trd-array and trd-binned-array.

    >>> TimeAxis(gamma=0.95, horizon=2, width=2).labels
    ('t…t+1', 't+2…t+3', 't+4…∞')
    """

    gamma: float
    horizon: int
    width: int = 1

    def __post_init__(self) -> None:
        gamma: Any = self.gamma
        if not isinstance(gamma, Real) or not 0.0 <= float(gamma) < 1.0:
            raise InputError(
                f"The discount factor gamma is {gamma}.",
                "It must be at least 0 and less than 1, for example 0.95.",
            )
        plain = {  # whatever numpy type they came in
            "gamma": float(gamma),
            "horizon": _whole("horizon N", self.horizon, 0),
            "width": _whole("width w", self.width, 1),
        }
        for name, value in plain.items():
            object.__setattr__(self, name, value)

    @property
    def num_components(self) -> int:
        """N+1: the explicit components and the residual."""
        return self.horizon + 1

    @property
    def num_steps(self) -> int:
        """N·w: the agent steps that the explicit components cover; the residual starts there."""
        return self.horizon * self.width

    def start(self, component: int) -> int:
        """Returns the first agent step, counted from t, that a component covers."""
        return self._checked(component) * self.width

    def steps(self, component: int) -> range | None:
        """Returns the agent steps that an explicit component covers, or None for the residual.

        >>> TimeAxis(0.95, horizon=2, width=2).steps(1)
        range(2, 4)
        """
        start = self.start(component)
        return None if component == self.horizon else range(start, start + self.width)

    def label(self, component: int) -> str:
        """Returns the steps of a component as text: `t+1`, `t+2…t+3`, or `t+4…∞`."""
        start, steps = self.start(component), self.steps(component)
        if steps is None:
            return f"{step_label(start)}…∞"
        return (
            step_label(start) if self.width == 1 else f"{step_label(start)}…{step_label(steps[-1])}"
        )

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of all N+1 components."""
        return tuple(self.label(i) for i in range(self.num_components))

    @property
    def discounts(self) -> FloatArray:
        """`[N+1]`: γ^(i·w), the discount of the first step of each component."""
        steps = np.arange(self.num_components) * self.width
        return np.power(float(self.gamma), steps)

    def regrouped(self, width: int) -> "TimeAxis":
        """Returns the axis of the same steps in wider groups.

        Raises:
            InputError: `width` is no multiple of the present width, or does not divide N·w.
        """
        width = _whole("width w", width, 1)
        if width % self.width:
            raise InputError(
                f"Groups of {self.width} cannot be regrouped to a width of {width}.",
                f"Choose a multiple of {self.width}.",
            )
        if self.num_steps % width:
            widths = range(self.width, self.num_steps + 1, self.width)
            fits = [w for w in widths if self.num_steps % w == 0]
            raise InputError(
                f"{self.num_steps} steps do not divide into groups of {width}: "
                f"the last group would be short.",
                f"Choose a width from {fits}, or a horizon N that is a multiple of "
                f"{width // math.gcd(width, self.width)}.",
            )
        return TimeAxis(self.gamma, self.num_steps // width, width)

    def shared(self, other: "TimeAxis") -> "TimeAxis":
        """Returns the finest axis that decompositions on either can be brought to (see `on`).

        Its width is the least common multiple of both; its residual starts where the first
        residual does, or before, if the last group would be short.

        Raises:
            InputError: the discount factors differ.

        >>> TimeAxis(0.9, horizon=10).shared(TimeAxis(0.9, horizon=4, width=3)).labels
        ('t…t+2', 't+3…t+5', 't+6…t+8', 't+9…∞')
        """
        if self.gamma != other.gamma:
            raise InputError(
                f"The discount factors differ: {self.gamma:g} and {other.gamma:g}.",
                "Rewards discounted differently cannot be compared.",
            )
        width = math.lcm(self.width, other.width)
        return TimeAxis(self.gamma, min(self.num_steps, other.num_steps) // width, width)

    def _checked(self, component: int) -> int:
        if not 0 <= component <= self.horizon:
            raise InputError(
                f"There is no component {component}.", f"Components run from 0 to {self.horizon}."
            )
        return component


def step_label(offset: int) -> str:
    """Returns an agent step as text: `t`, `t+1`."""
    return "t" if offset == 0 else f"t+{offset}"


def axis_title(axis: TimeAxis) -> str:
    """Returns the settings of an axis as a title: `γ = 0.95, N = 2, w = 2`."""
    return f"γ = {axis.gamma:g}, N = {axis.horizon}, w = {axis.width}"


def _whole(name: str, value: Any, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(
            f"The {name} is {value!r}.", f"It must be a whole number of at least {least}."
        )
    return int(value)
