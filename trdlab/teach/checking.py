"""Checks the answers to the exercises of the lessons, and shows how to find them."""

from textwrap import fill

from trdlab.errors import InputError, closest
from trdlab.teach import (
    lesson_01,
    lesson_02,
    lesson_03,
    lesson_04,
    lesson_05,
    lesson_06,
    lesson_07,
    lesson_08,
    lesson_09,
)
from trdlab.teach.exercise import Exercise

EXERCISES: dict[str, Exercise] = {
    **lesson_01.EXERCISES,
    **lesson_02.EXERCISES,
    **lesson_03.EXERCISES,
    **lesson_04.EXERCISES,
    **lesson_05.EXERCISES,
    **lesson_06.EXERCISES,
    **lesson_07.EXERCISES,
    **lesson_08.EXERCISES,
    **lesson_09.EXERCISES,
}


def check(name: str, answer: object) -> None:
    """Prints whether the answer to an exercise is right; if not, why, as far as can be guessed.

    >>> check("1.1", 1.62)
    Exercise 1.1: 1.62 is not right. That is what the reward is worth from here. Undo the discount.
    >>> check("1.1", 2)
    Exercise 1.1: right.

    Args:
        name: lesson and number, such as "1.1".
        answer: a number, or a sequence of numbers; they are compared to two decimals. None says
            that there is no answer yet.

    Raises:
        InputError: there is no exercise of this name.
    """
    exercise = _named(name)
    if answer is None:
        said = "not answered yet. Replace None, then run this cell again."
    else:
        said = exercise.verdict(answer)
    print(f"Exercise {name}: {said}")


def solution(name: str) -> None:
    """Prints how to find the answer to an exercise.

    >>> solution("2.2")
    The explicit components must reach N · w = 30 steps. With w = 5 that is N = 6.
    The residual is one more, so there are N + 1 = 7 outputs for each action.

    Raises:
        InputError: there is no exercise of this name.
    """
    print(fill(_named(name).solution, 80))


def _named(name: str) -> Exercise:
    if name not in EXERCISES:
        raise InputError(f"There is no exercise {name!r}.", closest(name, EXERCISES))
    return EXERCISES[name]
