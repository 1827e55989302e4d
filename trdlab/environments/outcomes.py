"""Outcomes: what can be forecast of a step beside its reward, such as a crash."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.environments.protocol import Step
from trdlab.errors import InputError, closest

INFO = "info."
LIFE_LOST = "life_lost"
"""The place of whether a life was lost, the last one, too, with which a game ends."""


@dataclass(frozen=True, slots=True, eq=False)
class Transition:
    """What one step of one environment led to.

    Args:
        observation: what was seen after it, one frame of it.
        action: the number of the action.
        reward: as the environment pays it.
        terminated: whether the episode ended for good.
        truncated: whether it was cut off; never both.
        life_lost: whether a life was lost and the episode goes on.
        info: what else the environment tells.
    """

    observation: Any
    action: int
    reward: float
    terminated: bool
    truncated: bool
    life_lost: bool
    info: Mapping[str, Any]


Outcome = Callable[[Transition], float]
"""Returns a number for each step: an amount, or whether something happened."""


class Outcomes:
    """Named numbers of every step, read as the steps are taken.

    Args:
        given: a function for each name, or where in `info` the number stands, as `info.KEY` or
            `info.KEY.KEY`; what `info` does not name in a step is 0 there. Or `life_lost`.

    Attributes:
        names: Q names.

    Raises:
        InputError: a name is empty, or a text is no place in `info`.

    >>> found = Outcomes({"crash": lambda step: step.terminated, "fuel": "info.fuel"})
    >>> found.names
    ('crash', 'fuel')
    """

    def __init__(self, given: Mapping[str, Outcome | str] | None = None) -> None:
        self._given = dict(given or {})
        self.names = tuple(self._given)
        self._seen: set[str] = set()  # keys of `info` that were there, as `info.KEY`
        for name, what in self._given.items():
            is_place = isinstance(what, str) and what.startswith(INFO) and what != INFO
            is_place |= what == LIFE_LOST
            if not name or not (is_place or callable(what)):
                raise InputError(
                    f"The outcome '{name}' is {what!r}.",
                    f"Give a function of a step, a place such as info.KEY, or {LIFE_LOST}.",
                )

    @property
    def places(self) -> dict[str, str]:
        """Where each stands, or that it is a function."""
        return {
            name: what if isinstance(what, str) else "a function"
            for name, what in self._given.items()
        }

    def read(self, actions: IntArray, step: Step, which: IntArray) -> FloatArray:
        """Returns the numbers `[R, Q]` of the environments `which [R]` that took a step.

        Args:
            actions: `[B]`, what was done.
            step: what that led to.
            which: the numbers of those that count.

        Raises:
            InputError: something is no finite number.
        """
        found = np.zeros((len(which), len(self.names)))
        if not self.names:
            return found
        for row, env in enumerate(which.tolist()):
            transition = Transition(
                step.frames[env],
                int(actions[env]),
                float(step.rewards[env]),
                bool(step.terminated[env]),
                bool(step.truncated[env]),
                bool(step.life_lost[env]),
                step.info(env),
            )
            for column, (name, what) in enumerate(self._given.items()):
                found[row, column] = self._number(name, what, transition)
        return found

    def check_seen(self) -> None:
        """Checks that every place in `info` has been there in some step.

        Raises:
            InputError: one was not; the message says what was there.
        """
        for name, what in self._given.items():
            if isinstance(what, str) and what not in {LIFE_LOST, *self._seen}:
                known = sorted(self._seen)
                cure = closest(what, known) if known else "Its environment told nothing else."
                raise InputError(f"The outcome '{name}' is {what}, and no step had that.", cure)

    def _number(self, name: str, what: Outcome | str, transition: Transition) -> float:
        value: Any
        if what == LIFE_LOST:
            value = transition.life_lost or transition.terminated
        else:
            value = self._at(what, transition.info) if isinstance(what, str) else what(transition)
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = np.nan
        if not np.isfinite(number):
            raise InputError(
                f"The outcome '{name}' is {value!r} at a step.", "Give one finite number."
            )
        return number

    def _at(self, place: str, info: Mapping[str, Any]) -> Any:
        """Returns what stands at a place in `info`, 0 where nothing does."""
        found: Any = info
        path = INFO[:-1]
        for key in place.removeprefix(INFO).split("."):
            inside = _inside(found)
            self._seen |= {f"{path}.{name}" for name in inside}
            if key not in inside:
                return 0.0
            found, path = inside[key], f"{path}.{key}"
        return found


def _inside(found: Any) -> Mapping[str, Any]:
    """Returns what a value holds by name, or by number where it is a sequence."""
    if isinstance(found, Mapping):
        return {str(key): value for key, value in found.items()}
    if isinstance(found, Sequence | np.ndarray) and not isinstance(found, str | bytes):
        return {str(at): value for at, value in enumerate(found)}
    return {}


def check_parts(
    names: Sequence[str], parts: FloatArray, rewards: FloatArray, steps: BoolArray
) -> None:
    """Checks that the parts of a reward add up to it.

    Args:
        names: P of them.
        parts: `[M, P]`.
        rewards: `[M]`.
        steps: `[M]`, which rows are steps.

    Raises:
        InputError: they do not; the message says by how much, and where.
    """
    total = parts.sum(axis=1)
    apart = np.abs(total - rewards) > 1e-6 * np.maximum(np.abs(parts).sum(axis=1), 1e-6)
    wrong = np.flatnonzero(apart & steps)
    if wrong.size:
        at = wrong[0]
        told = " + ".join(f"{name} {value:g}" for name, value in zip(names, parts[at], strict=True))
        raise InputError(
            f"The parts do not add up to the reward: {told} = {total[at]:g}, and the reward is "
            f"{rewards[at]:g} ({len(wrong)} of {int(steps.sum())} steps).",
            "Name all of them, or call them outcomes and no parts.",
        )
