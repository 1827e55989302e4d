"""The trials: their sentences are true and suffice, their Q-values tell nothing."""

import re
from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np
import pytest

from trdlab.errors import InputError
from trdlab.study.candidates import LETTERS
from trdlab.study.trials import Trial, draw, draw_trials

NAMING = re.compile(r"coin|treasure|hazard|\bmap\b|agent|state|\bway\b", re.I)
COST = re.compile(r"cost of ([\d.,]+) can come \d+ steps? later at [^.]* then is ([\d.]+) %")
REWARD = re.compile(r"reward (?:of [\d.,]+ can come|comes) (\d+) steps? later")


def words(trial: Trial) -> str:
    return " ".join(told for heading, texts in trial.parts for told in (heading, *texts))


def by_the_text(trial: Trial) -> str:
    """Answers as the page says: C risks less than with the next best, A is paid soon, B late."""
    risk, other = (_danger(texts) for texts in (trial.promise, trial.instead))
    if risk < other:
        return "C"
    found = REWARD.search(" ".join(trial.promise))
    assert found is not None
    return "A" if int(found[1]) <= 7 else "B"


def _danger(texts: Sequence[str]) -> float:
    found = COST.search(" ".join(texts))
    return 0.0 if found is None else float(found[1].replace(",", "")) * float(found[2])


def by_neighbours(known: np.ndarray, was: np.ndarray, asked: np.ndarray, count: int) -> np.ndarray:
    """Answers as most of the nearest known trials were, by all that Q tells."""
    apart = np.abs(known[None] - asked[:, None]).sum(axis=2)
    nearest = was[apart.argsort(axis=1)[:, :count]]
    return np.array([np.bincount(of, minlength=3).argmax() for of in nearest])


def by_threshold(known: np.ndarray, was: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Answers by the two thresholds on one number of Q that were best for known trials."""
    rules = [
        (column, low, high, names)
        for column in range(known.shape[1])
        for low, high in combinations(np.quantile(known[:, column], np.linspace(0, 1, 12)), 2)
        for names in permutations(range(3))
    ]

    def answers(worths: np.ndarray, rule: tuple[int, float, float, tuple[int, ...]]) -> np.ndarray:
        column, low, high, names = rule
        return np.take(names, np.digitize(worths[:, column], [low, high]))

    return answers(asked, max(rules, key=lambda rule: np.mean(answers(known, rule) == was)))


def all_that_q_tells(letter: str, rng: np.random.Generator) -> np.ndarray:
    """Returns the unit, and the worths of the other actions beside the best one, in order."""
    worths = np.sort(draw(letter, rng)[0].q_values)[::-1]
    return np.append(worths[1:] / worths[0], np.log10(worths[0]))


@pytest.fixture(scope="module")
def many() -> list[Trial]:
    return [trial for seed in range(100, 106) for trial in draw_trials(seed, 30)]


def test_q_alone_does_not_tell_the_agent():
    """Classifiers that learned from 400 other trials stay near a third, five times over."""
    rng = np.random.default_rng(7)
    letters = rng.integers(3, size=500)
    worths = np.stack([all_that_q_tells(LETTERS[i], rng) for i in letters])
    right: dict[str, list[bool]] = {}
    for asked in np.array_split(np.arange(500), 5):
        known = np.delete(np.arange(500), asked)
        seen = worths[known], letters[known], worths[asked]
        found = {f"{k} neighbours": by_neighbours(*seen, k) for k in (1, 5, 25)}
        for name, answers in (found | {"thresholds": by_threshold(*seen)}).items():
            right.setdefault(name, []).extend(answers == letters[asked])
    scores = {name: float(np.mean(of)) for name, of in right.items()}
    print(f"right by Q alone: {scores}")
    assert max(scores.values()) < 0.42


def test_the_text_tells_the_agent_to_who_reads_as_the_page_says(many: list[Trial]):
    right = np.mean([by_the_text(trial) == trial.letter for trial in many])
    print(f"right by the text: {right}")
    assert right > 0.97


def test_the_kind_of_sentence_alone_is_not_enough(many: list[Trial]):
    """A reader who is blind to numbers and names gets too few right to pass (10 of 12)."""
    kinds = [_kinds(trial) for trial in many]
    vocabulary = sorted(set().union(*kinds))
    seen = np.array([[kind in of for kind in vocabulary] for of in kinds], dtype=float)
    letters = np.array([LETTERS.index(trial.letter) for trial in many])
    right = []
    for asked in np.array_split(np.arange(len(many)), 4):
        known = np.delete(np.arange(len(many)), asked)
        parts = [seen[known][letters[known] == i] for i in range(3)]
        share = np.array([(of.sum(axis=0) + 1.0) / (len(of) + 2.0) for of in parts])
        likely = seen[asked] @ np.log(share).T + (1.0 - seen[asked]) @ np.log(1.0 - share).T
        right.extend(likely.argmax(axis=1) == letters[asked])  # naive Bayes
    print(f"right by kinds of sentences alone: {np.mean(right)}")
    assert np.mean(right) < 0.7


def _kinds(trial: Trial) -> set[str]:
    parts = enumerate(texts for _, texts in trial.parts)
    blind = re.compile(r"[Aa]ction [PQRS]|\d[\d.,]*(e[-+]?\d+)?")
    return {f"{i} {blind.sub('…', told)}" for i, texts in parts for told in texts}


def test_texts_name_nothing_that_gives_the_agent_away(many: list[Trial]):
    for trial in many:
        assert not NAMING.search(words(trial))
        assert set(re.findall(r"[Aa]ction (\w+)", words(trial))) <= set("PQRS")
        assert all(texts for _, texts in trial.parts)


@pytest.mark.parametrize("count", [3, 12, 30])
def test_each_agent_comes_up_as_often_and_each_choice_once(count: int):
    trials = draw_trials(5, count)
    letters = [trial.letter for trial in trials]
    assert {letter: letters.count(letter) for letter in LETTERS} == dict.fromkeys("ABC", count // 3)
    assert len({trial.reason for trial in trials}) == count


def test_a_seed_gives_the_same_trials_and_another_one_others():
    assert draw_trials(1) == draw_trials(1)
    assert draw_trials(1) != draw_trials(2)
    drawn = [draw_trials(seed, 6) for seed in range(4)]
    assert len({"".join(trial.letter for trial in trials) for trials in drawn}) > 2
    assert len({trial.action for trials in drawn for trial in trials}) > 2


def test_what_is_told_after_the_answer_is_what_lay_ahead():
    trial = draw_trials(1)[0]
    assert trial.reason.startswith("Action R pays 14.6 (2 steps later), ")
    assert "It costs 178 (8 steps later) with a chance of 1 %. Action S pays 42.4 (" in trial.reason


@pytest.mark.parametrize("count", [0, 4, 33, -3])
def test_counts_that_do_not_divide_are_refused(count: int):
    with pytest.raises(InputError, match=rf"There cannot be {count} trials. Give a multiple of 3"):
        draw_trials(0, count)
