"""What an exercise is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Answer = float | Sequence[float]

_TOLERANCE = 0.005
"""Numbers are compared to two decimals."""


@dataclass(frozen=True)
class Exercise:
    """What is right, how to find it, and what wrong answers usually mean.

    Args:
        right: the right answer.
        solution: how to find it, worked out for a student.
        hint: for a wrong answer that is no known mistake.
        mistakes: wrong answers that show what was misunderstood, each with what to say.
    """

    right: Answer
    solution: str
    hint: str
    mistakes: tuple[tuple[Answer, str], ...]

    def verdict(self, answer: object) -> str:
        """Returns "right.", or that the answer is not, and why, as far as can be guessed."""
        if _same(answer, self.right):
            return "right."
        known = (said for wrong, said in self.mistakes if _same(answer, wrong))
        return f"{answer} is not right. {next(known, f'Hint: {self.hint}')}"


def _same(a: object, b: object) -> bool:
    try:
        left, right = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    except (TypeError, ValueError):
        return False
    return left.shape == right.shape and bool(np.all(np.abs(left - right) <= _TOLERANCE))
