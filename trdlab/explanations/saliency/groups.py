"""Groups of components that are asked about together: near rewards, far rewards, or any steps."""

import re
from typing import NamedTuple

from trdlab.errors import InputError
from trdlab.explanations.calibration.calibration import Trust
from trdlab.time_axis import TimeAxis, step_label

EVERY, LATER = "all", "later"
"""What names each component by itself, and the residual."""

_PART = 4  # near is the first of so many parts of the explicit components, far the last one


class Group(NamedTuple):
    """Components in a row that are asked about together.

    Args:
        first: the first of them.
        last: the last one, which belongs to them.
    """

    first: int
    last: int

    def label(self, axis: TimeAxis) -> str:
        """Returns the steps that it covers, as axes show them.

        >>> axis = TimeAxis(0.9, horizon=40)
        >>> [Group(*of).label(axis) for of in ((3, 3), (0, 9), (40, 40), (30, 40))]
        ['t+3', 't…t+9', 'later', 't+30…∞']
        """
        if self == (axis.horizon, axis.horizon):
            return LATER
        first, steps = axis.start(self.first), axis.steps(self.last)
        if steps is not None and steps[-1] == first:
            return step_label(first)
        return f"{step_label(first)}…{'∞' if steps is None else step_label(steps[-1])}"

    @property
    def components(self) -> slice:
        """Where its components stand among all."""
        return slice(self.first, self.last + 1)


def usual_groups(axis: TimeAxis, trust: Trust | None = None) -> tuple[Group, ...]:
    """Returns near and far: the first quarter of the steps, and the last one that can be trusted.

    If hardly any can be, or nobody knows, it is the last quarter of all. Without explicit
    components there is only one group.

    >>> [group.label(TimeAxis(0.9, horizon=40)) for group in usual_groups(TimeAxis(0.9, 40))]
    ['t…t+9', 't+30…t+39']
    """
    if axis.horizon == 0:
        return (Group(0, 0),)
    if axis.horizon == 1:
        return Group(0, 0), Group(1, 1)
    size = max(1, axis.horizon // _PART)
    trusted = 0 if trust is None else trust.components
    end = trusted if trusted >= 2 * size else axis.horizon
    return Group(0, size - 1), Group(end - size, end - 1)


def every_component(axis: TimeAxis) -> tuple[Group, ...]:
    """Returns each component as a group of its own."""
    return tuple(Group(k, k) for k in range(axis.num_components))


def parse_groups(text: str, axis: TimeAxis) -> tuple[Group, ...]:
    """Returns the groups that a user names, with commas between them.

    Args:
        text: numbers of components, such as `3` or `0-9`, `later` for the residual, or `all` for
            each one by itself. Two are held against each other, the first one as the near one.
        axis: γ, N and w.

    Raises:
        InputError: that names no components.

    >>> parse_groups("0-9,later", TimeAxis(0.9, horizon=40))
    (Group(first=0, last=9), Group(first=40, last=40))
    """
    if text.strip() == EVERY:
        return every_component(axis)
    groups = tuple(_parse(part.strip(), axis) for part in text.split(","))
    if len(groups) > 2:
        raise InputError(
            f"'{text}' names {len(groups)} groups of components.",
            f"Name one, two that are held against each other, or '{EVERY}'.",
        )
    return groups


def _parse(text: str, axis: TimeAxis) -> Group:
    if text == LATER:
        return Group(axis.horizon, axis.horizon)
    found = re.fullmatch(r"([0-9]{1,9})(?:-([0-9]{1,9}))?", text)
    if found is None:
        raise InputError(
            f"There is no component '{text}'.",
            f"Give a number from 0 to {axis.horizon}, a range such as 0-9, or '{LATER}'.",
        )
    group = Group(int(found[1]), int(found[2] or found[1]))
    if not group.first <= group.last <= axis.horizon:
        raise InputError(
            f"There are no components '{text}'.", f"They run from 0 to {axis.horizon}."
        )
    return group
