"""Scores against hand-computed chances, and answers that cannot be scored."""

import json
from io import StringIO
from math import comb
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from trdlab.errors import InputError, TrdlabError
from trdlab.study.kit import write_kit
from trdlab.study.scoring import Score, page, read_answers, read_given, score, to_dict
from trdlab.study.trials import draw_trials


@pytest.mark.parametrize("right", [0, 4, 10, 12])
def test_the_chance_of_guessing_by_the_definition(right: int):
    chance = sum(comb(12, k) * 2 ** (12 - k) for k in range(right, 13)) / 3**12
    assert Score.of(right, 12).p_value == pytest.approx(chance)


def test_the_interval_is_that_of_clopper_and_pearson():
    # of 0 of n successes the upper end is 1 − (α/2)^(1/n), and of n of n the lower end (α/2)^(1/n)
    assert Score.of(0, 12).rate.low == 0.0
    assert Score.of(0, 12).rate.high == pytest.approx(1 - 0.025 ** (1 / 12))
    assert Score.of(12, 12).rate.low == pytest.approx(0.025 ** (1 / 12))


def test_readers_are_scored_each_and_together():
    found = score("ABCABC", {"Ada": "ABCABC", "Ben": "AAAAA-"})
    assert (found.readers["Ada"].right, found.readers["Ben"].right) == (6, 2)
    assert (found.overall.right, found.overall.total) == (8, 12)
    assert found.overall.rate.value == pytest.approx(8 / 12)
    assert found.trials[1] == {"B": 1, "A": 1}
    assert found.trials[5] == {"C": 1, "-": 1}


def test_the_page_says_what_guessing_gets():
    console = Console(width=100, record=True, file=StringIO())
    console.print(page(score("ABCABCABCABC", {"Ada": "ABCABCABCAAA", "Ben": "-" * 12})))
    printed = console.export_text()
    assert "10 of 24 answers are right (42 %); guessing gets 33 % on average." in printed
    assert "The chance to get at least 10 right by guessing is" in printed
    rows = {line.split()[0]: line.split() for line in printed.splitlines() if line.strip()}
    assert rows["Ada"][1:4] == ["10/12", "83", "%"]
    assert rows["Ben"][1] == "0/12"
    assert rows["12"] == ["12", "C", "1", "0", "0", "1"]


def test_scores_as_data():
    data: dict[str, Any] = to_dict(score("ABC", {"Ada": "ABA"}))
    assert data["schema"] == "trdlab.study-scores/1"
    assert data["overall"] == data["readers"]["Ada"]
    assert data["overall"]["right"] == 2
    assert data["trials"][2] == {"answer": "C", "given": {"A": 1}}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "There are no answers."),
        ({"Ada": "AB"}, "Ada gave 2 answers, and there are 3 trials. Write - where"),
        ({"Ada": "ABCA"}, "Ada gave 4 answers"),
        ({"Ada": "ABD"}, "'D' in the answers of Ada names no agent. Write A, B, C, or - for none."),
    ],
)
def test_answers_that_cannot_be_scored_are_refused(given: dict[str, str], message: str):
    with pytest.raises(InputError, match=message):
        score("ABC", given)


def test_files_are_read_back(tmp_path: Path):
    trials = draw_trials(2, 3)
    *_, answers = write_kit(tmp_path, trials, 2)
    assert read_answers(answers) == "".join(trial.letter for trial in trials)
    given = tmp_path / "given.json"
    given.write_text('{"Ada": "a b, c", "Ben": "A-C"}')
    assert read_given(given) == {"Ada": "ABC", "Ben": "A-C"}


@pytest.mark.parametrize(
    "content", ["[]", "{}", '{"schema": "trdlab.study/1", "answers": "ABX"}', '{"answers": "ABC"}']
)
def test_a_file_that_holds_no_answers_is_refused(content: str, tmp_path: Path):
    path = tmp_path / "answers.json"
    path.write_text(content)
    with pytest.raises(InputError, match="does not hold the answers of a kit"):
        read_answers(path)


@pytest.mark.parametrize("content", ["[]", '{"Ada": ["A"]}', '"ABC"'])
def test_a_file_that_holds_no_readers_is_refused(content: str, tmp_path: Path):
    path = tmp_path / "given.json"
    path.write_text(content)
    with pytest.raises(InputError, match="does not hold what readers answered"):
        read_given(path)


def test_two_readers_of_one_name_are_not_taken_for_one(tmp_path: Path):
    path = tmp_path / "given.json"
    path.write_text('{"Ada": "ABC", "Ben": "ABC", "Ada": "CCC"}')
    with pytest.raises(InputError, match=r"2 readers are called 'Ada'. Give each its own name."):
        read_given(path)


def test_a_torn_or_missing_file_is_told(tmp_path: Path):
    (tmp_path / "torn.json").write_text('{"schema": ')
    for name, message in (("torn.json", "is torn"), ("none.json", "cannot be read")):
        with pytest.raises(TrdlabError, match=message):
            read_answers(tmp_path / name)


def test_answers_in_a_file_are_plain_data(tmp_path: Path):
    *_, answers = write_kit(tmp_path, draw_trials(2, 3), 2)
    data = json.loads(answers.read_text())
    assert [agent["letter"] for agent in data["agents"]] == ["A", "B", "C"]
    assert len(data["trials"]) == 3
