"""`trdlab study` as a lecturer uses it."""

import json
from pathlib import Path

import pytest

from trdlab.cli import main


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(("study", *words))
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, err


@pytest.fixture
def kit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    code, out, err = run(
        capsys, "make", "--out", str(tmp_path / "kit"), "--trials", "6", "--seed", "4"
    )
    assert (code, out) == (0, "")
    assert err.count("Written: ") == 5
    return tmp_path / "kit"


def test_a_class_is_scored(kit: Path, capsys: pytest.CaptureFixture[str]):
    right = json.loads((kit / "answers.json").read_text())["answers"]
    given = kit / "given.json"
    given.write_text(json.dumps({"Ada": right, "reader 1": "AAAAAA"}))
    words = ("score", str(kit / "answers.json"), str(given), "--answers", right.lower())
    code, out, err = run(capsys, *words, "--json")
    assert (code, err) == (0, "")
    data = json.loads(out)
    group = data["groups"]["text"]
    counts = {name: of["right"] for name, of in group["readers"].items()}
    assert counts == {"Ada": 6, "reader 1": 2, "reader 2": 6}
    assert group["overall"]["right"] == 14
    assert data["help"] == {}
    code, out, _ = run(capsys, *words)
    assert code == 0
    assert "Readers of the text: 14 of 18 answers are right, 78 %" in out


def test_both_groups_are_scored_and_one_is_picked(kit: Path, capsys: pytest.CaptureFixture[str]):
    right = json.loads((kit / "answers.json").read_text())["answers"]
    words = ("score", str(kit / "answers.json"), "--answers", right, "--q-answers", "AAAAAA")
    _, out, _ = run(capsys, *words)
    told = " ".join(out.split())
    assert "The text helps: its readers are right more often" not in told  # 4 of 6 is p = 1/16
    assert "Readers of the text: 6 of 6" in told
    assert "Readers of Q alone: 2 of 6" in told
    _, out, _ = run(capsys, *words, "--group", "text", "--json")
    assert json.loads(out)["groups"].keys() == {"text"}
    _, out, _ = run(capsys, *words[:2], "--answers", "AAAAAA", "--group", "q", "--json")
    data = json.loads(out)
    assert {name: of["overall"]["right"] for name, of in data["groups"].items()} == {"q": 2}


def test_a_goal_study_is_made_and_scored(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "goals"
    code, printed, err = run(capsys, "make", "--kind", "goals", "--out", str(out), "--seed", "2")
    assert (code, printed, err.count("Written: ")) == (0, "", 9)
    right = json.loads((out / "answers.json").read_text())["answers"]
    assert sorted(right) == [*"ABCD"]
    given = out / "given.json"
    given.write_text(json.dumps({"report": {"Ada": right}, "clips": {"Ben": right[:2] + "--"}}))
    words = ("score", str(out / "answers.json"))
    code, printed, _ = run(capsys, *words, str(given))
    told = " ".join(printed.split())
    assert code == 0
    assert "Readers of the report: 4 of 4 answers are right, 100 %" in told
    assert "Readers of clips alone: 2 of 4 answers are right, 50 %" in told
    assert "do not tell whether the report helps" in told  # 2 of 4 trials are too few
    assert "Guessing gets 25 % on average" in told
    _, printed, _ = run(capsys, *words, "--group", "bars", "--answers", "abcd", "--json")
    assert json.loads(printed)["groups"].keys() == {"bars"}
    code, _, err = run(capsys, *words, "--group", "q", "--answers", "abcd")
    assert (code, err) == (
        2,
        "error: This study has no group 'q'. Its groups are report, bars, saliency, clips.\n",
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("make", "--out", "{kit}"), "study.html' exists. Choose another --out."),
        (("make", "--out", "{kit}/new", "--trials", "7"), "There cannot be 7 trials."),
        (
            ("make", "--out", "{kit}/new", "--agents", "a=gridworld:drone"),
            "The readers of a text get no agents of yours. Add --kind goals.",
        ),
        (
            ("make", "--kind", "goals", "--out", "{kit}/new", "--trials", "6"),
            "There cannot be 6 trials. Give a multiple of 4, from 4 to 16.",
        ),
        (
            ("make", "--kind", "goals", "--out", "{kit}/new", "--agents", "a=gridworld:drone"),
            "There is 1 goal. Give 4 different ones, each with its agent.",
        ),
        (("score", "{kit}/answers.json"), "There are no answers. Give at least one reader's."),
        (("score", "{kit}/answers.json", "--answers", "ABC"), "reader 1 gave 3 answers"),
        (("score", "{kit}/study.html", "--answers", "ABC"), "is torn"),
    ],
)
def test_bad_input_is_one_clear_line(
    words: tuple[str, ...], message: str, kit: Path, capsys: pytest.CaptureFixture[str]
):
    code, out, err = run(capsys, *(word.format(kit=kit) for word in words))
    assert code in (1, 2)
    assert out == ""
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1
    assert not (kit / "new").exists()
