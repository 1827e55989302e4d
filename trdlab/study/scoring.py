"""Scores of a study: each group against guessing, and the group that is tested against controls."""

import json
import re
from collections import Counter
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.files import read_json
from trdlab.statistics import Estimate, bootstrap
from trdlab.study.design import BLIND_READING, DESIGNS, Design

NO_ANSWER = "-"

Answers = Mapping[str, str]
"""The answers of readers by name, a letter for each trial."""


@dataclass(frozen=True)
class Key:
    """What was asked.

    Args:
        answers: the right ones, a letter for each trial.
        texts: of each trial, the sentences that readers saw.
        design: of the study.
    """

    answers: str
    texts: tuple[tuple[str, ...], ...]
    design: Design = BLIND_READING


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
    def of(cls, right: int, total: int, chance: float = BLIND_READING.chance) -> "Score":
        """Returns the score of so many right answers, each of which may be guessed by chance.

        >>> Score.of(10, 12).p_value < 0.001, Score.of(4, 12).p_value > 0.5
        (True, True)
        """
        from scipy.stats import binomtest

        test = binomtest(right, total, chance, alternative="greater")
        interval = binomtest(right, total).proportion_ci(0.95, method="exact")
        rate = Estimate(right / total, float(interval.low), float(interval.high))
        return cls(right, total, rate, float(test.pvalue))


@dataclass(frozen=True)
class GroupScores:
    """What a group of readers has answered.

    Args:
        readers: the score of each reader by name, in the order in which they were given.
        overall: of all answers together. Its interval takes them as independent of each other,
            though readers share the trials.
        trials: for each trial, how many readers gave each answer.
    """

    readers: dict[str, Score]
    overall: Score
    trials: tuple[dict[str, int], ...]

    def rates(self, answers: str) -> FloatArray:
        """Returns, of each trial, the share of readers who were right."""
        right = [of.get(letter, 0) for of, letter in zip(self.trials, answers, strict=True)]
        return np.array(right) / len(self.readers)

    def misled(self, answers: str) -> list[int]:
        """Returns the trials of which a wrong answer was given more often than the right one."""
        return [
            i
            for i, (given, right) in enumerate(zip(self.trials, answers, strict=True))
            if any(of > given.get(right, 0) for x, of in given.items() if x != NO_ANSWER)
        ]


@dataclass(frozen=True)
class Help:
    """How much oftener readers of the group that is tested are right than those of a control.

    Args:
        difference: of the shares of right answers, with the interval (95 %) that a bootstrap over
            the trials gives.
        p_value: the probability of so large a difference, or a larger one, if each trial were as
            likely to speak for one group as for the other (an exact sign-flip test).
    """

    difference: Estimate
    p_value: float


@dataclass(frozen=True)
class Scores:
    """What a class has answered.

    Args:
        key: what was asked.
        groups: those that answered.
        help: what is gained over each control, where the group that is tested and it answered.
    """

    key: Key
    groups: dict[str, GroupScores]
    help: dict[str, Help]


def score(key: Key, given: Mapping[str, Answers]) -> Scores:
    """Scores what readers answered.

    Args:
        key: what was asked.
        given: the answers of each group's readers, such as `ABCCBA`, `-` for none.

    Raises:
        InputError: nobody answered, there is no such group, or somebody's answers are not one
            letter for each trial.
    """
    known = key.design.groups
    for group in given:
        check_group(group, known)
    groups = {group: _group(key, given[group]) for group in known if given.get(group)}
    if not groups:
        raise InputError("There are no answers.", "Give at least one reader's.")
    tested = groups.get(key.design.tested)
    controls = () if tested is None else tuple(groups)[1:]
    found = {name: _help(key, groups[key.design.tested], groups[name]) for name in controls}
    return Scores(key, groups, found)


def check_group(group: str, known: Iterable[str]) -> None:
    """Checks that a study has a group of readers.

    Raises:
        InputError: it has not.
    """
    if group not in known:
        cure = f"Its groups are {', '.join(known)}."
        raise InputError(f"This study has no group '{group}'.", cure)


def _group(key: Key, given: Answers) -> GroupScores:
    total, chance = len(key.answers), key.design.chance
    for name, letters in given.items():
        _check(name, letters, key)
    right = {
        name: sum(a == b for a, b in zip(letters, key.answers, strict=True))
        for name, letters in given.items()
    }
    return GroupScores(
        readers={name: Score.of(found, total, chance) for name, found in right.items()},
        overall=Score.of(sum(right.values()), total * len(given), chance),
        trials=tuple(dict(Counter(column)) for column in zip(*given.values(), strict=True)),
    )


def _help(key: Key, tested: GroupScores, control: GroupScores) -> Help:
    ahead = tested.rates(key.answers) - control.rates(key.answers)
    difference = bootstrap(ahead, rng=np.random.default_rng(0))
    whole = np.rint(ahead * len(tested.readers) * len(control.readers)).astype(int)
    return Help(difference, sign_flip(whole.tolist()))


def sign_flip(differences: Iterable[int]) -> float:
    """Returns how likely a sum is at least as large, if each difference had either sign.

    >>> sign_flip([1, 1, 1]), sign_flip([1, -1]), sign_flip([0, 0])
    (0.125, 0.75, 1.0)
    """
    told = list(differences)
    sums = {0: 1.0}
    for size in told:
        flipped = dict.fromkeys([at + x for at in sums for x in (size, -size)], 0.0)
        for at, p in sums.items():
            for x in (size, -size):
                flipped[at + x] += p / 2.0
        sums = flipped
    return sum(p for at, p in sums.items() if at >= sum(told))


def read_key(path: Path) -> Key:
    """Returns what the answers file of a kit holds.

    Raises:
        TrdlabError: it cannot be read, or is torn.
        InputError: it is no such file.
    """
    data = read_json(path)
    schema = data.get("schema") if isinstance(data, dict) else None
    design = next((of for of in DESIGNS if of.schema == schema), None)
    if design is None or not _are_answers(data, design):
        raise InputError(
            f"'{path}' does not hold the answers of a kit.",
            "Give the answers.json that `trdlab study make` wrote.",
        )
    texts = (tuple(told for part in design.sentences for told in of[part]) for of in data["trials"])
    return Key(data["answers"], tuple(texts), design)


def read_given(
    path: Path, group: str | None = None, design: Design = BLIND_READING
) -> dict[str, Answers]:
    """Returns the answers of each group's readers from a file.

    It holds `{"text": {"Ada": "ABC"}, "q": {"Ben": "AB-"}}`, or the readers of one group.

    Args:
        path: of a JSON file.
        group: whose answers are asked for; that of the readers where the file does not say, by
            default that which is tested.
        design: of the study.

    Raises:
        TrdlabError: it cannot be read, or is torn.
        InputError: it holds something else, or two readers of one name.
    """
    data = read_json(path)
    grouped = isinstance(data, dict) and bool(data) and data.keys() <= design.groups.keys()
    given = data if grouped and _holds(data, dict) else {group or design.tested: data}
    if not all(isinstance(of, dict) and _holds(of, str) for of in given.values()):
        raise InputError(
            f"'{path}' does not hold what readers answered.",
            'Write one object: a name and letters for each, {"Ada": "ABCABC…", …}.',
        )
    json.loads(path.read_bytes(), object_pairs_hook=_unique)
    return {
        name: {reader: normal(letters) for reader, letters in readers.items()}
        for name, readers in given.items()
        if group in (None, name)
    }


def _holds(data: Mapping[str, Any], kind: type) -> bool:
    return all(isinstance(of, kind) for of in data.values())


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


def _unique(pairs: list[tuple[str, Any]]) -> None:
    """Checks that no two readers have the same name: a dict would keep one of them only."""
    for name, times in Counter(name for name, _ in pairs).items():
        if times > 1:
            raise InputError(f"{times} readers are called '{name}'.", "Give each its own name.")


def _are_answers(data: Mapping[str, Any], design: Design) -> bool:
    answers, trials = data.get("answers"), data.get("trials")
    return (
        isinstance(answers, str)
        and bool(answers)
        and set(answers) <= set(design.letters)
        and isinstance(trials, list)
        and len(trials) == len(answers)
        and all(isinstance(of, dict) and of.keys() >= {*design.sentences} for of in trials)
    )


def _check(name: str, letters: str, key: Key) -> None:
    known, trials = key.design.letters, len(key.answers)
    if wrong := [letter for letter in letters if letter not in (*known, NO_ANSWER)]:
        raise InputError(
            f"'{wrong[0]}' in the answers of {name} names no agent.",
            f"Write {', '.join(known)}, or {NO_ANSWER} for none.",
        )
    if len(letters) != trials:
        raise InputError(
            f"{name} gave {len(letters)} answers, and there are {trials} trials.",
            f"Write {NO_ANSWER} where an answer is missing.",
        )
