"""Scores of a blind reading, against what guessing gets."""

import json
import re
from collections import Counter
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from trdlab.errors import InputError
from trdlab.files import read_json
from trdlab.formatting import percent
from trdlab.show.text import fit
from trdlab.statistics import Estimate
from trdlab.study.candidates import LETTERS
from trdlab.study.kit import SCHEMA

CHANCE = 1 / len(LETTERS)
"""How often a guess is right."""
NO_ANSWER = "-"


@dataclass(frozen=True)
class Score:
    """How many answers are right.

    Args:
        right: how many are.
        total: of how many; one that was not given counts as wrong.
        rate: the share of right answers, with its exact interval (95 %, Clopper and Pearson).
        p_value: the probability that guessing each answer gets at least as many right.
    """

    right: int
    total: int
    rate: Estimate
    p_value: float

    @classmethod
    def of(cls, right: int, total: int) -> "Score":
        """Returns the score of so many right answers.

        >>> Score.of(10, 12).p_value < 0.001, Score.of(4, 12).p_value > 0.5
        (True, True)
        """
        from scipy.stats import binomtest

        test = binomtest(right, total, CHANCE, alternative="greater")
        interval = binomtest(right, total).proportion_ci(0.95, method="exact")
        rate = Estimate(right / total, float(interval.low), float(interval.high))
        return cls(right, total, rate, float(test.pvalue))


@dataclass(frozen=True)
class Scores:
    """What a class has answered.

    Args:
        answers: the right ones, a letter for each trial.
        readers: the score of each reader by name, in the order in which they were given.
        overall: of all answers together. Its interval takes them as independent of each other,
            though readers share the trials.
        trials: for each trial, how many readers gave each answer.
    """

    answers: str
    readers: dict[str, Score]
    overall: Score
    trials: tuple[dict[str, int], ...]


def score(answers: str, given: Mapping[str, str]) -> Scores:
    """Scores what readers answered.

    Args:
        answers: the right ones, such as `ABCCBA`.
        given: those of each reader, `-` for none.

    Raises:
        InputError: nobody answered, or somebody's answers are not one letter for each trial.
    """
    if not given:
        raise InputError("There are no answers.", "Give at least one reader's.")
    for name, letters in given.items():
        _check(name, letters, len(answers))
    right = {
        name: sum(a == b for a, b in zip(letters, answers, strict=True))
        for name, letters in given.items()
    }
    return Scores(
        answers=answers,
        readers={name: Score.of(found, len(answers)) for name, found in right.items()},
        overall=Score.of(sum(right.values()), len(answers) * len(given)),
        trials=tuple(dict(Counter(column)) for column in zip(*given.values(), strict=True)),
    )


def read_answers(path: Path) -> str:
    """Returns the right answers that the file of a kit holds.

    Raises:
        TrdlabError: it cannot be read, or is torn.
        InputError: it is no such file.
    """
    data = read_json(path)
    answers = data.get("answers") if isinstance(data, dict) else None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA or not _is_answers(answers):
        raise InputError(
            f"'{path}' does not hold the answers of a kit.",
            "Give the answers.json that `trdlab study make` wrote.",
        )
    return str(answers)


def read_given(path: Path) -> dict[str, str]:
    """Returns the answers of each reader from a file such as `{"Ada": "ABC", "Ben": "AB-"}`.

    Raises:
        TrdlabError: it cannot be read, or is torn.
        InputError: it holds something else, or two readers of one name.
    """
    data = read_json(path)
    if not isinstance(data, dict) or not all(isinstance(x, str) for x in data.values()):
        raise InputError(
            f"'{path}' does not hold what readers answered.",
            'Write one object: a name and letters for each, {"Ada": "ABCABC…", …}.',
        )
    json.loads(path.read_bytes(), object_pairs_hook=_unique)
    return {name: normal(letters) for name, letters in data.items()}


def normal(letters: str) -> str:
    """Returns answers in capitals, without the spaces and commas that people write.

    >>> normal("a b c, -")
    'ABC-'
    """
    return re.sub(r"[\s,;]", "", letters).upper()


def unnamed(given: Iterable[str], named: Container[str]) -> dict[str, str]:
    """Returns the answers of readers without a name, who are called by a number that is free.

    >>> unnamed(["abc", "a-c"], ["reader 1"])
    {'reader 2': 'ABC', 'reader 3': 'A-C'}
    """
    free = (name for i in count(1) if (name := f"reader {i}") not in named)
    return {name: normal(letters) for letters, name in zip(given, free, strict=False)}


def page(scores: Scores, *, ascii_only: bool = False) -> RenderableType:
    """Returns the scores as text: of all, of each reader, and of each trial.

    Args:
        scores: of a class.
        ascii_only: for terminals without UTF-8.
    """
    overall = scores.overall
    lines: list[RenderableType] = [
        Text(
            f"{overall.right} of {overall.total} answers are right "
            f"({percent(overall.rate.value)} %); guessing gets {percent(CHANCE)} % on average.",
            style="bold",
        ),
        Text(f"{_chance(overall)}\n"),
        _readers(scores, ascii_only=ascii_only),
        Text(""),
        _trials(scores),
    ]
    return Group(*lines)


def to_dict(scores: Scores) -> dict[str, Any]:
    """Returns the scores as plain data; the schema is `trdlab.study-scores/1`."""
    return {
        "schema": "trdlab.study-scores/1",
        "chance": CHANCE,
        "overall": _score_to_dict(scores.overall),
        "readers": {name: _score_to_dict(of) for name, of in scores.readers.items()},
        "trials": [
            {"answer": answer, "given": given}
            for answer, given in zip(scores.answers, scores.trials, strict=True)
        ],
    }


def _score_to_dict(of: Score) -> dict[str, Any]:
    return {
        "right": of.right,
        "total": of.total,
        "rate": of.rate.value,
        "interval": [of.rate.low, of.rate.high],
        "p_value": of.p_value,
    }


def _chance(of: Score) -> str:
    return f"The chance to get at least {of.right} right by guessing is {_small(of.p_value)}."


def _readers(scores: Scores, *, ascii_only: bool) -> Table:
    table = _table("reader", "right", "share", "95 % interval", "by guessing")
    for name, of in scores.readers.items():
        low, high = percent(of.rate.low), percent(of.rate.high)
        share = f"{percent(of.rate.value)} %"
        cells = (name, f"{of.right}/{of.total}", share, f"{low}…{high} %", _small(of.p_value))
        table.add_row(*(Text(fit(cell, ascii_only=ascii_only)) for cell in cells))
    return table


def _trials(scores: Scores) -> Table:
    table = _table("trial", "answer", *LETTERS, "none")
    for number, (answer, given) in enumerate(zip(scores.answers, scores.trials, strict=True), 1):
        counts = (str(given.get(letter, 0)) for letter in (*LETTERS, NO_ANSWER))
        table.add_row(str(number), answer, *counts)
    return table


def _table(*columns: str) -> Table:
    table = Table(box=None, padding=(0, 3, 0, 0), header_style="bold", pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left", no_wrap=bool(i))
    return table


def _small(p_value: float) -> str:
    return "below 0.0001" if p_value < 1e-4 else f"{p_value:.2g}"


def _unique(pairs: list[tuple[str, Any]]) -> None:
    """Checks that no two readers have the same name: a dict would keep one of them only."""
    for name, times in Counter(name for name, _ in pairs).items():
        if times > 1:
            raise InputError(f"{times} readers are called '{name}'.", "Give each its own name.")


def _is_answers(answers: object) -> bool:
    return isinstance(answers, str) and bool(answers) and set(answers) <= set(LETTERS)


def _check(name: str, letters: str, trials: int) -> None:
    if wrong := [letter for letter in letters if letter not in (*LETTERS, NO_ANSWER)]:
        raise InputError(
            f"'{wrong[0]}' in the answers of {name} names no agent.",
            f"Write {', '.join(LETTERS)}, or {NO_ANSWER} for none.",
        )
    if len(letters) != trials:
        raise InputError(
            f"{name} gave {len(letters)} answers, and there are {trials} trials.",
            f"Write {NO_ANSWER} where an answer is missing.",
        )
