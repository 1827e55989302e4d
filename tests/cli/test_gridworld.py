"""`trdlab gridworld` as its users see it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from trdlab import __version__
from trdlab.cli import main


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(words)
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, err


def in_shell(*words: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "trdlab", *words]
    return subprocess.run(command, capture_output=True, env=os.environ | environment, check=False)


def test_the_papers_numbers(capsys: pytest.CaptureFixture[str]):
    code, out, err = run(capsys, "gridworld", "--gamma", "0.95", "--N", "2", "--w", "2")
    rows = {line.split()[0]: line for line in reversed(out.splitlines()) if line.strip()}
    assert (code, err) == (0, "")
    assert "[0, 0, 3.26]" in rows["up"]
    assert "[0.95, 1.76, 0.81]" in rows["down"]
    assert "3.52" in rows["down"]
    headline = (
        "Down gives more immediate rewards: 2.71 in the first 4 steps, while up gives nothing."
    )
    assert headline in " ".join(out.split())
    assert len(out.splitlines()) <= 24
    assert max(map(len, out.splitlines())) <= 80
    _, details, _ = run(capsys, "gridworld", "--N", "2", "--w", "2", "--details")
    assert "What would change that" in details
    assert "What would change that" not in out


def test_the_papers_numbers_step_by_step(capsys: pytest.CaptureFixture[str]):
    _, out, _ = run(capsys, "gridworld", "--gamma", "0.95", "--N", "4", "--w", "1")
    assert "[0, 0.95, 0.90, 0.86, 0.81]" in out
    assert "[0, 0, 0, 0, 3.26]" in out


def test_json_has_full_precision_and_nothing_else_is_on_stdout(capsys: pytest.CaptureFixture[str]):
    code, out, _ = run(capsys, "gridworld", "--N", "4", "--json")
    data = json.loads(out)
    actions = data["actions"]
    assert code == 0
    assert data["schema"] == "trdlab.gridworld/2"
    assert actions["up"]["components"][-1] == pytest.approx(4 * 0.95**4, abs=1e-12)
    for action in actions.values():
        assert sum(action["components"]) == pytest.approx(action["q_value"], abs=1e-12)
    assert actions["down"]["deviation"] == [0.0] * 5
    assert actions["down"]["survival"] == [1.0] * 5
    findings = [finding for section in data["sections"] for finding in section["findings"]]
    kinds = {finding["kind"] for finding in findings}
    assert {"better-by-discount", "more-immediate", "never-flips", "decided-by"} <= kinds
    assert all(finding["sentence"].endswith(".") for finding in findings)
    assert {finding["kind"] for finding in data["answer"]} <= kinds


def test_json_has_null_where_no_total_exists(capsys: pytest.CaptureFixture[str]):
    _, out, _ = run(capsys, "gridworld", "--map", "loop", "--json")
    assert json.loads(out)["actions"]["right"]["undiscounted_total"] is None


def test_options_change_the_world(capsys: pytest.CaptureFixture[str]):
    _, out, _ = run(capsys, "gridworld", "--treasure", "5", "--action", "up", "--foil", "left")
    assert "up − left" in out
    _, out, _ = run(capsys, "gridworld", "--treasure", "5", "--details")
    assert "Down would be better if γ were below 0.869 instead of 0.95." in out
    _, slippery, _ = run(capsys, "gridworld", "--slip", "0.2", "--json")
    assert json.loads(slippery)["map"]["slip"] == 0.2


def test_states_are_named_by_number_or_place(capsys: pytest.CaptureFixture[str]):
    _, by_number, _ = run(capsys, "gridworld", "--state", "1", "--json")
    _, by_place, _ = run(capsys, "gridworld", "--state", "0,0", "--json")
    assert by_number == by_place
    _, over, _ = run(capsys, "gridworld", "--state", "0,4")  # where the treasure was
    assert "The episode is over here: no action pays anything any more." in over
    assert "Try:" not in over


def test_ties_are_said_and_can_be_mixed(capsys: pytest.CaptureFixture[str]):
    _, out, _ = run(capsys, "gridworld", "--map", "tie")
    assert "Left and right are equally good here, but pay other amounts" in out
    assert "the agent takes left." in " ".join(out.split())
    _, out, _ = run(capsys, "gridworld", "--map", "tie", "--ties", "mixed")
    assert "the agent takes each equally often." in " ".join(out.split())
    assert "chosen 50 %" in out


def test_a_map_file(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    path = tmp_path / "mine.txt"
    path.write_text("title: Mine\n---\n>C\nS#\n>C", encoding="utf-8")
    code, out, _ = run(capsys, "gridworld", "--map", str(path))
    assert code == 0
    assert out.startswith("mine · Mine")
    assert "Up and down lead to the same rewards at the same times." in out
    assert f"Try: trdlab gridworld --map {path}" in " ".join(out.split())


@pytest.mark.parametrize(
    ("coin", "treasure", "totals", "flip", "richer"),
    [
        ("1e-12", "4e-12", ("1.00e-12", "4.00e-12", "3.00e-12"), "1.05e-12", "5e-12"),
        ("1e+12", "1.001e+12", ("1.000e+12", "1.001e+12", "1.000e+09"), None, "1.25125e+12"),
    ],
)
def test_amounts_of_any_size_are_told_apart(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    coin: str,
    treasure: str,
    totals: tuple[str, str, str],
    flip: str | None,
    richer: str,
):
    path = tmp_path / "mine.txt"
    rules = f"X = coin {coin} terminal\nY = treasure {treasure} terminal\n"
    steps = 2 if flip else 1  # to the treasure: 1e-12 / 0.95 = 1.05e-12
    path.write_text(f"{rules}---\nXS{'.' * (steps - 1)}Y", encoding="utf-8")
    _, out, _ = run(capsys, "gridworld", "--map", str(path))
    assert f"X coin {coin} (ends)" in out
    assert f"Y treasure {treasure} (ends)" in out
    rows = {line.split("[")[0].strip(): line.split() for line in out.splitlines() if "[" in line}
    assert rows["left"][-1] == totals[0]
    assert totals[1] in rows["right"]
    assert rows["right − left"][-1] == totals[2]
    told = f"if the treasure paid less than {flip or coin} instead of {treasure}."
    assert told in " ".join(out.split())
    assert f"--treasure {richer} --N 4" in " ".join(out.split())


def test_a_gamma_too_close_to_1_is_not_called_exact(capsys: pytest.CaptureFixture[str]):
    _, out, _ = run(capsys, "gridworld", "--map", "loop", "--gamma", "0.999999999")
    assert "γ is so close to 1 that Q is only known to" in " ".join(out.split())
    assert "exact" not in out


def test_the_next_step_keeps_what_was_given(capsys: pytest.CaptureFixture[str]):
    _, out, _ = run(capsys, "gridworld", "--slip", "0.3", "--treasure", "5", "--w", "2")
    advice = " ".join(out.split()).partition("Try: ")[2]
    assert "--slip 0.3 --treasure 5" in advice
    assert advice.count("--treasure") == 1


def test_a_full_disk_is_one_line():
    command = f"{sys.executable} -m trdlab gridworld > /dev/full"
    shown = subprocess.run(command, shell=True, capture_output=True, check=False)
    assert shown.returncode == 1
    assert b"No space left on device" in shown.stderr
    assert b"Traceback" not in shown.stderr


def test_list_shows_every_map(capsys: pytest.CaptureFixture[str]):
    _, out, _ = run(capsys, "gridworld", "--list")
    _, as_json, _ = run(capsys, "gridworld", "--list", "--json")
    assert json.loads(as_json)[0]["name"] == "drone"
    for name in ("drone", "patience", "bridge", "tie", "corridor", "loop", "windy"):
        assert any(line.startswith(name) for line in out.splitlines())


def test_version(capsys: pytest.CaptureFixture[str]):
    assert run(capsys, "--version") == (0, f"trdlab {__version__}\n", "")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--gamma", "1"], "The discount factor gamma is 1.0. It must be at least 0 and less than"),
        (["--gamma", "nan"], "The discount factor gamma is nan."),
        (["--gamma", "high"], "Invalid value for '--gamma': "),
        (["--N", "-1"], "The horizon N is -1. It must be a whole number of at least 0."),
        (["--w", "0"], "The width w is 0. It must be a whole number of at least 1."),
        (["--map", "dron"], "There is no map 'dron'. Did you mean 'drone'?"),
        (["--map", "no/such.txt"], "The map file 'no/such.txt' cannot be read: No such file"),
        (["--map", "."], "The map file '.' cannot be read: Is a directory."),
        (["--state", "99"], "There is no state 99. States run from 0 to 13."),
        (["--state", "1,3"], "The drone can never be at row 1, column 3."),
        (["--action", "dwon"], "There is no action 'dwon'. Did you mean 'down'?"),
        (["--action", "up", "--foil", "up"], "Action and foil are both 'up'."),
        (["--slip", "2"], "The slip probability is 2.0. It must lie between 0 and 1."),
        (["--treasure", "inf"], "The value of treasure is 'inf'. It must be a finite number."),
        (["--map", "loop", "--treasure", "3"], "The map 'loop' has no treasure."),
        (["--plot", "no/such/folder.png"], "The folder 'no/such' does not exist. Create it first."),
        (["--plot", "x.pgn"], "'.pgn' is no known ending. Did you mean '.png'?"),
        (["--N", "100000000"], "N = 100000000 takes"),
        (["--gama", "0.9"], "No such option"),
        (["extra"], "unexpected extra argument"),
    ],
)
def test_bad_input_is_one_line_with_its_cure(
    capsys: pytest.CaptureFixture[str], words: list[str], message: str
):
    code, out, err = run(capsys, "gridworld", *words)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert message in err


def test_verbose_shows_the_traceback():
    shown = in_shell("gridworld", "--gamma", "2", "-v")
    assert b"Traceback" in shown.stderr
    assert shown.returncode != 0
    assert b"Traceback" not in in_shell("gridworld", "--gamma", "2").stderr


def test_pictures_are_written_once(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    for suffix, start in ((".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")):
        path = tmp_path / f"drone{suffix}"
        code, _, err = run(capsys, "gridworld", "--plot", str(path))
        assert (code, err) == (0, f"Picture: {path}\n")
        assert path.read_bytes().startswith(start)
    before = path.read_bytes()
    code, out, err = run(capsys, "gridworld", "--plot", str(path))
    assert (code, out) == (2, "")
    assert "exists" in err
    assert path.read_bytes() == before
    assert run(capsys, "gridworld", "--plot", str(path), "--overwrite")[0] == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["drone.pdf", "drone.png", "drone.svg"]


@pytest.mark.parametrize("columns", ["24", "40", "80", "120"])
def test_no_colour_no_overflow_and_no_padding_in_pipes(columns: str):
    shown = in_shell("gridworld", "--N", "2", "--w", "2", COLUMNS=columns)
    text = shown.stdout.decode()
    assert "\x1b" not in text
    assert max(map(len, text.splitlines())) <= int(columns)
    assert "3.26" in text  # no number is cut
    assert not any(line.endswith(" ") for line in text.splitlines())


def test_a_terminal_of_no_width_is_one_of_80():
    shown = in_shell("gridworld", COLUMNS="0").stdout.decode()
    assert max(map(len, shown.splitlines())) <= 80
    assert "Down gives more immediate rewards" in shown


def test_colour_can_be_refused():
    assert (
        b"\x1b[32m"
        in in_shell("gridworld", FORCE_COLOR="1", NO_COLOR="", TERM="xterm-256color").stdout
    )
    refused = in_shell("gridworld", FORCE_COLOR="1", NO_COLOR="1", TERM="xterm-256color")
    assert b"\x1b[32m" not in refused.stdout


def test_a_terminal_without_utf8():
    shown = in_shell("gridworld", "--N", "2", "--w", "2", PYTHONIOENCODING="ascii")
    text = shown.stdout.decode("ascii")
    assert shown.returncode == 0
    assert "t..t+1, t+2..t+3, t+4..inf" in text
    assert "gamma = 0.95" in text
    assert in_shell("gridworld", "--list", PYTHONIOENCODING="ascii").returncode == 0
    assert in_shell("gridworld", "--help", PYTHONIOENCODING="ascii").returncode == 0
    wrong = in_shell("gridworld", "--map", "dröne", PYTHONIOENCODING="ascii")
    assert wrong.returncode == 2
    assert b"Traceback" not in wrong.stderr


def test_nothing_heavy_is_imported():
    code = (
        "import sys, trdlab, trdlab.cli; assert 'torch' not in sys.modules\n"
        "try: trdlab.cli.main(['gridworld'])\n"
        "except SystemExit: pass\n"
        "heavy = {'torch', 'pygame', 'gymnasium', 'matplotlib', 'scipy'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_a_reader_that_stops_early_is_no_failure():
    command = f"{sys.executable} -m trdlab gridworld --N 400 | head -n 1"
    shown = subprocess.run(command, shell=True, capture_output=True, check=True)
    assert shown.stdout.startswith(b"drone")
    assert shown.stderr == b""
