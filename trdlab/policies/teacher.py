"""Whom another agent learns from: what it does, and what it would have others do."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.policies.adapted import softmax
from trdlab.policies.protocol import Policy, ask
from trdlab.policies.ready import greedy


class Lesson(NamedTuple):
    """What a teacher says at one step of B episodes.

    Args:
        likely: `[B, A]`, how likely it takes each action.
        taught: `[B, A]`, the probabilities that a student should come near to.
    """

    likely: FloatArray
    taught: FloatArray


@dataclass(frozen=True, eq=False)
class Teacher:
    """An agent that others learn from.

    Args:
        policy: who acts.
        values: from observations `[B, ...]` to the value of each action `[B, A]`, where it acts by
            the largest of them; None where it acts by anything else.
        temperature: above 1, what it teaches is evened out.
        by_values: whether it teaches its values: their softmax, in place of what it does.

    >>> from trdlab.policies import Memoryless
    >>> values = lambda seen: np.log([[1.0, 3.0]])
    >>> teacher = Teacher(Memoryless(lambda seen: greedy(values(seen))), values, by_values=True)
    >>> told, _ = teacher.ask(np.zeros((1, 4)), None, np.array([True]))
    >>> told.likely.tolist(), told.taught.tolist()
    ([[0.0, 1.0]], [[0.25, 0.75]])
    """

    policy: Policy
    values: Callable[[Any], FloatArray] | None = None
    temperature: float = 1.0
    by_values: bool = False

    def ask(
        self,
        observations: Any,
        state: Any,
        begins: BoolArray,
        allowed: BoolArray | None = None,
    ) -> tuple[Lesson, Any]:
        """Returns what it says, and what it remembers; see `Policy.act` for the arguments.

        Raises:
            InputError: its answer is no distribution over actions.
        """
        if self.by_values and self.values is not None:
            values = self.values(observations)  # [B, A]
            return Lesson(greedy(values, allowed), softmax(values / self.temperature)), None
        likely, state = ask(self.policy, observations, state, begins, allowed)
        return Lesson(likely, evened(likely, self.temperature)), state


def evened(probabilities: FloatArray, temperature: float) -> FloatArray:
    """Returns probabilities `[B, A]` as if their logits had been divided by a temperature.

    >>> evened(np.array([[0.2, 0.8, 0.0]]), 2.0).round(3).tolist()
    [[0.333, 0.667, 0.0]]
    """
    if temperature == 1.0:
        return probabilities
    powers = probabilities ** (1.0 / temperature)
    return np.asarray(powers / powers.sum(axis=1, keepdims=True))
