"""`trdlab compare` as its users see it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

TABLES = ("gridworld:ledge", "gridworld:ledge,slip=0.3")


def test_two_tables_are_compared_and_a_picture_is_drawn(trdlab, tmp_path):
    code, out, err = trdlab("compare", *TABLES, "--episodes", 20)
    assert code == 0
    assert out.startswith("A: ledge · B: ledge,slip=0.3")
    assert "both act in gridworld:ledge" in out
    assert "A expects more than B: 0." in out
    assert "They were compared at" not in out
    folder = Path("explanations") / "ledge-against-ledge,slip=0.3"
    assert err == f"Picture: {folder / 'comparison.png'}\n"
    assert (folder / "comparison.png").read_bytes().startswith(b"\x89PNG")
    _, out, _ = trdlab("compare", *TABLES, "--episodes", 2, "--details")
    assert "They were compared at" in out
    assert Path(f"{folder}-2").is_dir()


def further(out: str) -> list[str]:
    """Returns the words of the command that is suggested last, behind `trdlab`."""
    suggested = out.splitlines()[-1]
    assert suggested.startswith("Try: trdlab explain ")
    return suggested.split()[2:]


def test_the_command_that_is_printed_runs(trdlab):
    _, out, _ = trdlab("compare", *TABLES, "--episodes", 5, "--gamma", 0.9, "--N", 3, "--out", "x")
    code, shown, _ = trdlab(*further(out), "--what", "forecast", "--episodes", 0)
    assert code == 0
    assert "γ = 0.9 · N = 3 · w = 1" in shown
    _, out, _ = trdlab("compare", *[TABLES[0]] * 2, "--episodes", 2, "--out", "y")
    assert "Try:" not in out


def test_checkpoints_of_a_run(trdlab, trained):
    code, out, _ = trdlab("compare", f"{trained}@500", trained, "--episodes", 10, "--json")
    data = json.loads(out)
    assert code == 0
    assert [data["agents"][side]["name"] for side in "AB"] == ["drone@500", "drone"]
    assert data["place"] == ["--env", "trdlab/DroneGridworld-v0", "--env-arg", "slip=0.2"]
    assert max(data["apart"]["value"]) > 0.0
    assert not Path("explanations").exists()
    _, again, _ = trdlab("compare", f"{trained}@500", trained, "--episodes", 10, "--json")
    assert again == out
    _, out, _ = trdlab("compare", f"{trained}@1000", trained, "--episodes", 10, "--json")
    assert json.loads(out)["answer"][0]["kind"] == "nothing-differs"


def test_a_run_beside_the_exact_table_that_takes_its_axis(trdlab, trained):
    table = "gridworld:drone,slip=0.2"
    code, out, _ = trdlab("compare", table, trained, "--episodes", 10, "--out", "x", "--details")
    assert code == 0
    assert "γ = 0.9 · N = 6 · w = 1 · both act in gridworld:drone,slip=0.2" in out
    assert "B tells of the future of the greedy policy of the network" in out
    assert trdlab(*further(out), "--what", "forecast", "--episodes", 0)[0] == 0


def test_elsewhere(trdlab, trained):
    same = ("--env", "trdlab/DroneGridworld-v0", "--env-arg", "slip=0.9")
    code, out, _ = trdlab("compare", f"{trained}@500", trained, *same, "--episodes", 3, "--json")
    assert code == 0
    assert json.loads(out)["place"] == list(same)
    code, out, _ = trdlab(
        "compare", *TABLES, "--env", "gridworld:ledge,slip=0.6", "--episodes", 3, "--out", "x"
    )
    assert code == 0
    assert "both act in gridworld:ledge,slip=0.6" in out
    assert "--env gridworld:ledge,slip=0.6 --seed" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["gridworld:ledge", "gridworld:ledg"], "There is no map 'ledg'. Did you mean 'ledge'?"),
        (["gridworld:ledge", "gridworld:drone"], "they have 8 states and 14 states"),
        (["gridworld:ledge", "runs/none"], "There is no 'runs/none'"),
        (["gridworld:ledge"], "Missing argument 'B'"),
        ([*TABLES, "--env", "gridworld:drone"], "'gridworld:drone' does not fit the agent"),
        ([*TABLES, "--env-arg", "slip=1"], "Write gridworld:ledge,slip=1"),
        ([*TABLES, "--episodes", "0"], "0 is not in the range"),
        ([*TABLES, "--gamma", "1.5"], "The discount factor gamma is 1.5"),
        ([*TABLES, "--out", "taken"], "The picture 'taken/comparison.png' exists."),
        ([*TABLES, "--out", "taken/comparison.png"], "is a file"),
    ],
)
def test_refusals_are_one_clear_line(trdlab, words, message):
    Path("taken").mkdir()
    Path("taken/comparison.png").write_text("mine", encoding="utf-8")
    code, out, err = trdlab("compare", *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert Path("taken/comparison.png").read_text(encoding="utf-8") == "mine"
    assert not Path("explanations").exists()


def test_runs_have_their_own_axis_and_observations(trdlab, trained):
    code, _, err = trdlab("compare", trained, trained, "--gamma", 0.9)
    assert (
        code,
        "Each of the two is a run with its own γ, N and w. Leave out --gamma, --N and --w." in err,
    ) == (2, True)
    code, _, err = trdlab("compare", trained, "gridworld:ledge")
    assert (code, err.count("\n")) == (2, 1)
    assert "drone and ledge cannot be compared: they have 14 states and 8 states" in err
    code, _, err = trdlab("compare", trained, "gridworld:drone", "--gamma", 0.5)
    assert (code, "The discount factors differ: 0.9 and 0.5." in err) == (2, True)


def test_tables_are_compared_without_pytorch(tmp_path):
    code = (
        "import sys; from trdlab.cli import main\n"
        f"try: main(['compare', *{TABLES}, '--episodes', '5'])\n"
        "except SystemExit as end: assert not end.code\n"
        "assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path, capture_output=True)
