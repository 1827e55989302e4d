"""Lesson 10 leaves out nothing of the paper, and what it names is there."""

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

from commands import refusal
from trdlab.runs.pretrained import pretrained_names

ROOT = Path(__file__).parents[1]
LESSON = ROOT / "tutorials" / "10_the_paper_reproduced.py"

# The paper is not a part of this repository. These are its sections, equations, figures and tables
# in their order, by their labels, and by names of ours where it has none.
LABELS = re.findall(
    r"\S+",
    """
abstract
sec:introduction fig:gridworld
sec:related-work
sec:preliminary eq:q-value eq:state-value eq:dqn-loss eq:dqn-target eq:qdagger
sec:temporally-decomposed-q-value eq:trd-array eq:trd-equiv
theorem:sum-expected-reward eq:expanded-sum-expectation proof:sum-expected-reward
eq:trd-binned-array eq:grouped-trd-equiv eq:trd-loss
fig:dqn-sweep-episodic-return fig:dqn-sweep-error eq:index-notation
sec:training-performance
sec:explainability fig:spaceinvaders-expected-reward fig:breakout-expected-reward
fig:breakout-feature-importance fig:action-expected-reward-diff
subsec:extracting-reward-prob subsec:vis-temporal-decision-making subsec:contrast-exp
sec:conclusion
app:state-value theorem:state-value-sum-expected-reward eq:state-value-trd-array
app:training listing:trd-training
eq:state-value-trd-binned-array eq:grouped-state-value-equiv eq:state-value-trd-loss
tab:hyperparameters
app:rewards fig:mspacman-expected-reward fig:breakout-expected-reward-app
fig:seaquest-expected-reward
app:features fig:breakout-feature-importance-middle fig:breakout-feature-importance-late
app:contrasts fig:riverraid-contrastive fig:mspacman-contrastive
""",
)
NUMBERED = {"Eq": 28, "Figure": 15, "Theorem": 2, "Table": 1, "Section": 7}
ERRATA = [f"p{i}" for i in range(1, 14)] + [f"c{i}" for i in range(1, 8)]


def text_of(node: ast.expr) -> str:
    """Returns the text of a string, and of an f-string what is not filled in."""
    return "".join(
        part.value
        for part in ast.walk(node)
        if isinstance(part, ast.Constant) and isinstance(part.value, str)
    )


@cache
def rows() -> list[list[str]]:
    """Returns the fields of each row: labels, where, says, status, check, got, differs."""
    tree = ast.parse(LESSON.read_text(encoding="utf-8"))
    calls = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Row"
    ]
    calls.sort(key=lambda call: call.lineno)
    return [[text_of(argument) for argument in call.args] for call in calls]


def named(pattern: str) -> list[str]:
    return sorted({found for row in rows() for of in row for found in re.findall(pattern, of)})


def test_each_part_of_the_paper_has_its_row():
    labels = Counter(label for row in rows() for label in row[0].split())
    assert set(labels.values()) == {1}
    told = {label for label in labels if not label.startswith("claim:")}
    assert told == {*LABELS}
    assert len(labels) - len(told) >= 40  # claims of the text


@pytest.mark.parametrize("kind", NUMBERED)
def test_each_number_has_its_row(kind: str):
    seen: set[int] = set()
    for row in rows():
        for found in re.findall(rf"{kind}s?\.? ([\d, to]+)", row[1]):
            ends = [int(number) for number in re.findall(r"\d+", found)]
            seen |= set(range(ends[0], ends[-1] + 1)) if " to " in found else {*ends}
    assert seen == set(range(1, NUMBERED[kind] + 1))


def test_what_was_not_reproduced_says_why():
    for labels, _, _, status, check, got, *differs in rows():
        assert got, labels
        assert check or status in ("not", "nothing"), labels
        assert differs or status in ("reproduced", "nothing"), labels


@pytest.mark.parametrize("name", named(r"tests/[\w/]+\.py(?:::\w+)?"))
def test_each_test_is_there(name: str):
    file, _, function = name.partition("::")
    source = (ROOT / file).read_text(encoding="utf-8")
    assert not function or f"\ndef {function}(" in source


@pytest.mark.parametrize("name", named(r"benchmarks/\w+\.py"))
def test_each_benchmark_is_there(name: str):
    assert (ROOT / name).is_file()


def in_prose() -> list[str]:
    source = LESSON.read_text(encoding="utf-8").replace("\\\n#", "")
    return re.findall(r"^# \$ (trdlab .+)$", source, re.MULTILINE)


@pytest.mark.parametrize("command", [*named(r"`(trdlab [^`]+)`"), *in_prose()])
def test_each_command_is_one(command: str):
    assert refusal(command) is None


def test_each_row_of_the_errata_that_changes_a_result_is_named():
    assert {*named(r"errata\.md#(\w+)")} >= {*ERRATA}


def test_the_games_that_it_has_no_agents_of_are_still_these():
    """If this fails, write down what has been reproduced of them."""
    assert not {"SpaceInvaders", "MsPacman"} & {*pretrained_names()}
