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
from trdlab.study.report import page, to_dict
from trdlab.study.scoring import Key, Score, Scores, read_given, read_key, score, sign_flip
from trdlab.study.trials import draw_trials


def key_of(answers: str) -> Key:
    return Key(answers, tuple((f"Trial {i} says this.",) for i in range(1, len(answers) + 1)))


def printed(scores: Scores) -> str:
    console = Console(width=100, record=True, file=StringIO())
    console.print(page(scores, width=100))
    return console.export_text()


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
    scores = score(key_of("ABCABC"), {"text": {"Ada": "ABCABC", "Ben": "AAAAA-"}})
    found = scores.groups["text"]
    assert (found.readers["Ada"].right, found.readers["Ben"].right) == (6, 2)
    assert (found.overall.right, found.overall.total) == (8, 12)
    assert found.overall.rate.value == pytest.approx(8 / 12)
    assert found.trials[1] == {"B": 1, "A": 1}
    assert found.trials[5] == {"C": 1, "-": 1}
    assert (scores.groups.keys(), scores.help) == ({"text"}, {})


def test_the_text_is_held_against_q_alone_trial_by_trial():
    text, q = {"Ada": "ABCABC"}, {"Cleo": "ABACCC", "Dan": "BBACCC"}
    found = score(key_of("ABCABC"), {"text": text, "q": q}).help["q"]
    # right are 1 1 1 1 1 1 of the text and ½ 1 0 0 0 1 of Q: the differences are ½ 0 1 1 1 0
    assert found.difference.value == pytest.approx(3.5 / 6)
    assert 0.0 <= found.difference.low < 3.5 / 6 < found.difference.high <= 1.0
    assert found.p_value == 1 / 16  # all four signs that matter have to be the same


@pytest.mark.parametrize(
    ("differences", "chance"), [([2, 1], 0.25), ([2, -1], 0.5), ([-1, -1], 1.0), ([0], 1.0)]
)
def test_the_sign_flip_test_counts_all_signs(differences: list[int], chance: float):
    assert sign_flip(differences) == chance


def test_the_page_says_what_each_group_gets_and_whether_the_text_helps():
    text, q = {"Ada": "ABCABCABCAAA"}, {"Cleo": "BCABCABCAABC", "Dan": "-" * 12}
    told = " ".join(printed(score(key_of("ABC" * 4), {"text": text, "q": q})).split())
    assert "Readers of the text: 10 of 12 answers are right, 83 % (52 to 98 %)." in told
    assert "Readers of Q alone: 3 of 24 answers are right, 12 % (3 to 32 %)." in told
    assert "The text helps: its readers are right more often than those of Q alone, by 71 " in told
    found = printed(score(key_of("ABC" * 4), {"text": {**text, "Ben": "-" * 12}}))
    rows = {line.split()[0]: line.split() for line in found.splitlines() if line.strip()}
    assert rows["Ada"][1:4] == ["10/12", "83", "%"]
    assert rows["Ben"][1] == "0/12"
    assert rows["12"] == ["12", "C", "1", "0", "0", "1"]
    assert "helps" not in found


def test_a_difference_that_chance_makes_is_not_told_as_one():
    told = printed(score(key_of("ABC"), {"text": {"Ada": "ABC"}, "q": {"Ben": "ABA"}}))
    assert "These answers do not tell whether the text helps" in " ".join(told.split())
    told = printed(score(key_of("ABC" * 3), {"text": {"Ada": "C" * 9}, "q": {"Ben": "ABC" * 3}}))
    assert "The text misleads: its readers are right less often" in " ".join(told.split())


def test_texts_that_mislead_are_shown():
    readers = {"Ada": "AAC", "Ben": "AAC", "Cleo": "ABA"}
    told = printed(score(key_of("ABC"), {"text": readers}))
    assert "Trial 2 misleads: 2 took it for A, 1 for B, which is right. It says:" in told
    assert "  Trial 2 says this." in told
    assert "Trial 1 says" not in told
    assert "Trial 3 says" not in told


def test_scores_as_data():
    given = {"text": {"Ada": "ABA"}, "q": {"Ben": "CBC"}}
    data: dict[str, Any] = to_dict(score(key_of("ABC"), given))
    assert data["schema"] == "trdlab.study-scores/3"
    assert data["groups"]["text"]["overall"] == data["groups"]["text"]["readers"]["Ada"]
    assert data["groups"]["q"]["overall"]["right"] == 2
    assert data["help"]["q"]["difference"] == 0.0
    assert data["trials"][2] == {
        "answer": "C",
        "given": {"text": {"A": 1}, "q": {"C": 1}},
        "misled": ["text"],
    }


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
        score(key_of("ABC"), {"text": given})


def test_files_are_read_back(tmp_path: Path):
    trials = draw_trials(2, 3)
    *_, answers = write_kit(tmp_path, trials, 2)
    key = read_key(answers)
    assert key.answers == "".join(trial.letter for trial in trials)
    assert key.texts[0] == trials[0].why + trials[0].promise + trials[0].instead
    given = tmp_path / "given.json"
    given.write_text('{"Ada": "a b, c", "Ben": "A-C"}')
    assert read_given(given) == {"text": {"Ada": "ABC", "Ben": "A-C"}}
    assert read_given(given, "q") == {"q": {"Ada": "ABC", "Ben": "A-C"}}


def test_a_file_may_hold_both_groups(tmp_path: Path):
    given = tmp_path / "given.json"
    given.write_text('{"text": {"Ada": "abc"}, "q": {"Ben": "a-c"}}')
    assert read_given(given) == {"text": {"Ada": "ABC"}, "q": {"Ben": "A-C"}}
    assert read_given(given, "q") == {"q": {"Ben": "A-C"}}


@pytest.mark.parametrize(
    "content",
    [
        "[]",
        "{}",
        '{"answers": "ABC"}',
        '{"schema": "trdlab.study/1", "answers": "ABC", "trials": []}',
        '{"schema": "trdlab.study/2", "answers": "ABX"}',
        '{"schema": "trdlab.study/2", "answers": "A"}',
        '{"schema": "trdlab.study/2", "answers": "A", "trials": [{"why": []}]}',
    ],
)
def test_a_file_that_holds_no_answers_is_refused(content: str, tmp_path: Path):
    path = tmp_path / "answers.json"
    path.write_text(content)
    with pytest.raises(InputError, match="does not hold the answers of a kit"):
        read_key(path)


@pytest.mark.parametrize("content", ["[]", '{"Ada": ["A"]}', '"ABC"', '{"text": {"Ada": 1}}'])
def test_a_file_that_holds_no_readers_is_refused(content: str, tmp_path: Path):
    path = tmp_path / "given.json"
    path.write_text(content)
    with pytest.raises(InputError, match="does not hold what readers answered"):
        read_given(path)


def test_two_readers_of_one_name_are_not_taken_for_one(tmp_path: Path):
    path = tmp_path / "given.json"
    path.write_text('{"text": {"Ada": "ABC", "Ben": "ABC", "Ada": "CCC"}}')
    with pytest.raises(InputError, match=r"2 readers are called 'Ada'. Give each its own name."):
        read_given(path)


def test_a_torn_or_missing_file_is_told(tmp_path: Path):
    (tmp_path / "torn.json").write_text('{"schema": ')
    for name, message in (("torn.json", "is torn"), ("none.json", "cannot be read")):
        with pytest.raises(TrdlabError, match=message):
            read_key(tmp_path / name)


def test_answers_in_a_file_are_plain_data(tmp_path: Path):
    *_, answers = write_kit(tmp_path, draw_trials(2, 3), 2)
    data = json.loads(answers.read_text())
    assert [agent["letter"] for agent in data["agents"]] == ["A", "B", "C"]
    assert len(data["trials"]) == 3
