"""The contract of everything that acts, and of what it remembers."""

from typing import Any, Protocol, runtime_checkable

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray, map_leaves
from trdlab.errors import InputError

_OFF = 1e-4  # that probabilities in float32 may sum to more or less than 1


@runtime_checkable
class Policy(Protocol):
    """Chooses actions, by what it sees and what it remembers.

    Who plays asks once at each step of an episode, in order, about every episode that goes on: B of
    them. A policy keeps nothing in itself. What it wants to remember it returns as `state`, and is
    given back at the next step, so that states of an environment can be copied with the memory of
    who acts in them.

    Where the environment forbids actions, the chances of these become 0, and those of the others
    grow alike. A policy that would rather know has a method `act_within`, which is asked in place
    of `act` there and takes one argument more: `allowed [B, A]`.

    `state` is None, an array `[B, ...]`, or a dict, list or tuple of those. The rows of episodes
    that have ended are taken out of it, and those of copies are repeated (see `rows`).
    """

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns how likely each action is `[B, A]`, and what to remember.

        Args:
            observations: `[B, ...]`.
            state: what was returned at the step before; None where every episode begins.
            begins: `[B]`, where an episode begins, of which nothing can be remembered yet.
        """


def rows(state: Any, which: IntArray | BoolArray | int) -> Any:
    """Returns some rows of what a policy remembers, or one of them.

    Args:
        state: of B episodes.
        which: `[B′]`, their numbers, as often as they are wanted; or `[B]`, whether they are.

    >>> rows((np.array([[1.0], [2.0]]), None), np.array([1, 1]))
    (array([[2.],
           [2.]]), None)
    """
    return map_leaves(lambda leaf: leaf[which], state)


def ask(
    policy: Policy,
    observations: Any,
    state: Any = None,
    begins: BoolArray | None = None,
    allowed: BoolArray | None = None,
) -> tuple[FloatArray, Any]:
    """Returns how likely a policy takes each action `[B, A]`, checked, and what it remembers.

    Args:
        policy: who is asked.
        observations: `[B, ...]`.
        state: see `Policy`.
        begins: `[B]`; by default episodes begin everywhere.
        allowed: `[B, A]`, which actions can be taken; by default all.

    Raises:
        InputError: the answer is no distribution over actions for each observation, or leaves none
            that can be taken.
    """
    count = len(observations)
    begins = np.ones(count, dtype=np.bool_) if begins is None else begins
    within = getattr(policy, "act_within", None)
    if allowed is not None and within is not None:
        told, state = within(observations, state, begins, allowed)
    else:
        told, state = policy.act(observations, state, begins)
    probabilities = np.asarray(told)
    if probabilities.ndim != 2 or len(probabilities) != count:
        raise InputError(
            f"The policy answered {count} observations with shape {probabilities.shape}.",
            "It must return the probability of each action, [B, A].",
        )
    fine = (probabilities >= 0.0).all(axis=1) & (np.abs(probabilities.sum(axis=1) - 1.0) <= _OFF)
    if not fine.all():
        row = int(np.argmin(fine))
        raise InputError(
            f"The policy's answer to observation {row} of {count} is no distribution over actions: "
            f"{probabilities[row].tolist()}.",
            "It must be probabilities that sum to 1.",
        )
    return (probabilities if allowed is None else _within(probabilities, allowed)), state


def _within(probabilities: FloatArray, allowed: BoolArray) -> FloatArray:
    """Returns `[B, A]`: 0 for what cannot be taken, and the rest grown to sum to 1."""
    if probabilities.shape != allowed.shape:
        return probabilities  # whoever knows the actions says what is wrong
    left = np.where(allowed, probabilities, 0.0)
    total = left.sum(axis=1, keepdims=True)  # [B, 1]
    if not total.all():
        row = int(np.argmin(total))
        raise InputError(
            f"The policy's answer to observation {row} of {len(left)} leaves no action that the "
            f"environment allows: it gives {probabilities[row].tolist()}, allowed are the actions "
            f"{np.flatnonzero(allowed[row]).tolist()}.",
            "Give it a method act_within, which is told what is allowed.",
        )
    return np.where(allowed.all(axis=1, keepdims=True), probabilities, left / total)
