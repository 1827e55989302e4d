"""Random command lines and map files: exit code 0 or 2, never a traceback, and true numbers."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from trdlab.cli import main
from trdlab.gridworld import map_names

EXAMPLES = 1_000  # of each of the two kinds


def usually(good: st.SearchStrategy[str], bad: list[str], odds: int = 12) -> st.SearchStrategy[str]:
    return st.integers(0, odds).flatmap(lambda i: good if i else st.sampled_from(bad))


def numbers(low: float, high: float) -> st.SearchStrategy[str]:
    return st.floats(low, high).map(lambda x: f"{x:.3g}")


JUNK = ["", "x", "nan", "inf", "-1", "1e9", "0x1", "½", "--", "\x00", "a b", "🙂"]
OPTIONS: dict[str, st.SearchStrategy[str]] = {
    "--gamma": usually(numbers(0, 0.99), ["1", *JUNK]),
    "--N": usually(st.integers(0, 60).map(str), ["2.5", "99999999999", *JUNK]),
    "--w": usually(st.integers(1, 9).map(str), ["0", "99999999999", *JUNK]),
    "--slip": usually(numbers(0, 1), ["2", *JUNK]),
    "--treasure": usually(numbers(-10, 10), JUNK),
    "--state": usually(st.integers(0, 5).map(str), ["0,0", "9,9,9", "1,", *JUNK]),
    "--action": usually(st.sampled_from(["up", "down"]), ["jump", "UP", *JUNK]),
    "--foil": usually(st.sampled_from(["left", "right"]), ["jump", *JUNK]),
    "--ties": usually(st.sampled_from(["lowest", "mixed"]), ["random", *JUNK]),
}
FLAGS = ["--json", "--json", "--list", "--version", "--help", "--jso", "--plot", "extra"]


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    names = st.sampled_from([name for name in map_names() if name != "corridor"])  # that is slow
    words = ["gridworld", "--map", draw(usually(names, ["dron", "no.txt", ".", *JUNK]))]
    for option in draw(st.lists(st.sampled_from(sorted(OPTIONS)), max_size=4, unique=True)):
        words += [option, draw(OPTIONS[option])]
    words += ["--details"] * draw(st.booleans())
    flag = draw(st.integers(0, 3))
    return words + ([] if flag == 0 else ["--json"] if flag < 3 else [draw(st.sampled_from(FLAGS))])


@st.composite
def map_files(draw: st.DrawFn) -> bytes:
    """Mostly playable maps: open floor, one start, few items; and some that are broken."""
    rows, columns = draw(st.integers(1, 5)), draw(st.integers(1, 6))
    cells = st.sampled_from("........" * 3 + "cCtThHfE<>v^##")
    lines = [[draw(cells) for _ in range(columns)] for _ in range(rows)]
    lines[draw(st.integers(0, rows - 1))][draw(st.integers(0, columns - 1))] = "S"
    wind = f"wind: up {' '.join('0' * (columns - 1) + '1')}"
    good = ["title: Random", "slip: 0.2", "step_cost: 0.5", "c = coin 2.5", wind]
    bad = ["slip: 7", "colour: red", "S = coin", "wind: up 1", "c = coin many", "title", "---"]
    header = draw(st.lists(st.sampled_from(good), max_size=2, unique=True))
    text = "\n".join([*header, "---", *map("".join, lines)])
    fault = draw(st.integers(0, 11))
    if fault == 0:
        text = draw(st.sampled_from(bad)) + "\n" + text
    elif fault == 1:
        text = text.replace("S", draw(st.sampled_from(["", "SS", "?"])))
    elif fault == 2:
        return draw(st.binary(max_size=40))
    return text.encode()


def outcome(capsys: pytest.CaptureFixture[str], words: list[str]) -> tuple[int, str]:
    """Runs a command line; checks the exit code, the error line, and the numbers of the output."""
    with pytest.raises(SystemExit) as stop:
        main(words)
    out, err = capsys.readouterr()
    code = int(stop.value.code or 0)
    assert code in (0, 2), (words, err)
    assert "Traceback" not in out + err
    if code == 2:
        assert out == ""
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert len(err) > len("error: something\n")
        return code, "refused"
    if out.startswith("{"):
        check_numbers(json.loads(out))
        return code, "JSON"
    if "components:" in out:
        assert ("Whose future" in out) == ("--details" in words)
        assert "Components sum to Q" in " ".join(out.split())
        return code, "text"
    return code, "other"


def check_numbers(data: dict[str, Any]) -> None:
    axis, actions = data["time_axis"], data["actions"]
    for action in actions.values():
        assert len(action["components"]) == axis["horizon"] + 1 == len(axis["labels"])
        largest = max(1.0, *map(abs, action["components"]))
        assert abs(sum(action["components"]) - action["q_value"]) < 1e-9 * largest
    assert sum(action["probability"] for action in actions.values()) == pytest.approx(1.0)
    best = max(action["q_value"] for action in actions.values())
    chosen = [action["q_value"] for action in actions.values() if action["probability"] > 0]
    assert min(chosen) >= best - 1e-6 * max(1.0, abs(best))
    assert data["action"] in actions
    assert 1 <= len(data["answer"]) <= 5
    is_over = data["answer"][0]["kind"] == "episode-is-over"
    assert data["sections"][-1]["name"] == ("forecast" if is_over else "context")


def settle(kinds: Counter[str]) -> None:
    assert sum(kinds.values()) >= EXAMPLES
    assert kinds["JSON"] + kinds["text"] >= 0.3 * sum(kinds.values()), kinds
    assert kinds["refused"] > 0.1 * sum(kinds.values()), kinds


exactly = settings(
    max_examples=EXAMPLES,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


def test_random_command_lines(capsys: pytest.CaptureFixture[str]):
    kinds: Counter[str] = Counter()

    @exactly
    @given(command_lines())
    def run(words: list[str]) -> None:
        kinds[outcome(capsys, words)[1]] += 1

    run()
    settle(kinds)


def test_random_map_files(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    kinds: Counter[str] = Counter()
    path = tmp_path / "map.txt"

    @exactly
    @given(map_files(), st.sampled_from([[], ["--json"]]), st.integers(0, 9))
    def run(content: bytes, flags: list[str], horizon: int) -> None:
        path.write_bytes(content)
        words = ["gridworld", "--map", str(path), "--N", str(horizon), *flags]
        kinds[outcome(capsys, words)[1]] += 1

    run()
    settle(kinds)
