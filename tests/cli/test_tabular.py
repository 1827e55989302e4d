"""`trdlab tabular` as its users see it."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest

from trdlab.cli import main
from trdlab.tabular.toytext import toy_text_ids

CLIFF, TAXI = (
    next(name for name in toy_text_ids() if name.startswith(start)) for start in ("Cliff", "Taxi")
)


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(["tabular", *words])
    out, err = capsys.readouterr()
    return int(stop.value.code or 0), out, err


def in_shell(*words: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "trdlab", "tabular", *words]
    return subprocess.run(command, capture_output=True, env=os.environ | environment, check=False)


def loaded(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    code, out, err = run(capsys, *words, "--json")
    assert (code, err) == (0, "")
    return json.loads(out)


def expected_components(env: gym.Env, state: int, gamma: float, horizon: int) -> list[list[float]]:
    """Returns the optimal decomposition of one state: plain value iteration, and the recursion."""
    table: Any = env.unwrapped.P  # type: ignore[attr-defined]

    def back_up(values: list[list[float]], s: int, a: int, reward: bool) -> float:
        total = 0.0
        for probability, following, paid, ended in table[s][a]:
            total += probability * paid * reward
            if not ended:
                total += gamma * probability * values[following][best[following]]
        return total

    states, actions = range(len(table)), range(len(table[0]))
    best = [0 for _ in states]
    q = [[0.0 for _ in actions] for _ in states]
    for _ in range(800):
        q = [[back_up(q, s, a, True) for a in actions] for s in states]
        best = [max(actions, key=lambda a, s=s: round(q[s][a], 9)) for s in states]
    components, residual = [], q
    step = [[sum(p * r for p, _, r, _ in table[s][a]) for a in actions] for s in states]
    for _ in range(horizon):
        components.append(step[state])
        step = [[back_up(step, s, a, False) for a in actions] for s in states]
        residual = [[back_up(residual, s, a, False) for a in actions] for s in states]
    return [[part[a] for part in (*components, residual[state])] for a in actions]


@pytest.mark.parametrize(
    ("words", "state", "coordinates"),
    [
        (("FrozenLake-v1",), 0, {"row": 0, "column": 0}),
        (("FrozenLake-v1", "--state", "2,1"), 9, {"row": 2, "column": 1}),
        ((CLIFF, "--state", "3,0"), 36, {"row": 3, "column": 0}),
    ],
)
def test_json_has_the_numbers_of_value_iteration(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], state: int, coordinates: Any
):
    data = loaded(capsys, *words, "--gamma", "0.9", "--N", "5")
    assert data["schema"] == "trdlab.tabular/2"
    assert data["environment"]["id"] == words[0]
    assert data["time_axis"]["labels"][-1] == "t+5…∞"
    assert data["state"]["index"] == state
    assert data["state"]["coordinates"] == coordinates
    assert data["state"]["visited"]
    expected = expected_components(gym.make(words[0]), state, 0.9, 5)
    for action, components in zip(data["actions"].values(), expected, strict=True):
        assert action["components"] == pytest.approx(components, abs=1e-9)
        assert action["q_value"] == pytest.approx(sum(components), abs=1e-9)
    findings = [finding for section in data["sections"] for finding in section["findings"]]
    assert findings
    assert all(finding["sentence"].endswith(".") for finding in findings)


def test_taxi(capsys: pytest.CaptureFixture[str]):
    data = loaded(capsys, TAXI, "--state", "0,4,taxi,G", "--N", "2")
    assert data["state"]["coordinates"] == {
        "row": 0,
        "column": 4,
        "passenger": 4,
        "destination": 1,
    }
    assert data["action"] == "dropoff"
    assert data["actions"]["dropoff"]["components"] == [20.0, 0.0, 0.0]
    away = data["actions"]["south"]["components"]  # there, back, and the delivery
    assert away == pytest.approx([-1.0, -0.95, 0.95**2 * 20], abs=1e-12)
    _, out, _ = run(capsys, TAXI, "--state", "97")
    assert f"{TAXI} · 500 states, 6 actions" in out
    assert "state 97 (row 0, column 4, passenger in the taxi, destination at G)" in " ".join(
        out.split()
    )
    assert "|R: | : :@|" in out


def test_the_page(capsys: pytest.CaptureFixture[str]):
    code, out, err = run(capsys, "FrozenLake-v1", "--env-arg", "is_slippery=false", "--N", "6")
    assert (code, err) == (0, "")
    text = " ".join(out.split())
    assert out.startswith("FrozenLake-v1 · 16 states, 4 actions\n")
    assert "  @FFF    @ the agent" in out
    assert "G goal 1 (ends)" in out
    assert "is_slippery=false" in out
    assert "cuts episodes off after 100 steps; the model does not." in out
    assert "[0, 0, 0, 0, 0, 0.77, 0]" in out
    assert "Components sum to Q" in out
    assert "Down and right lead to the same rewards at the same times." in text


def test_the_advice_can_be_followed(capsys: pytest.CaptureFixture[str]):
    for words in (
        ("FrozenLake-v1",),
        ("FrozenLake-v1", "--env-arg", "is_slippery=false"),
        (CLIFF, "--N", "3", "--w", "2"),
        ("trdlab.envs:trdlab/DroneGridworld-v0", "--gamma", "0.8"),
    ):
        _, out, _ = run(capsys, *words)
        advice = " ".join(out.split()).partition("Try: trdlab tabular ")[2].partition(" (")[0]
        assert run(capsys, *advice.split())[0] == 0
        assert advice.split()[0] == words[0]


def test_arguments_change_the_environment(capsys: pytest.CaptureFixture[str]):
    sure = loaded(capsys, "FrozenLake-v1", "--env-arg", "is_slippery=False", "--gamma", "0.9")
    assert sure["actions"]["down"]["q_value"] == pytest.approx(0.9**5, abs=1e-12)
    assert sure["environment"]["arguments"]["is_slippery"] is False
    large = loaded(
        capsys, "FrozenLake-v1", "--env-arg", "map_name=8x8", "--env-arg", "success_rate=0.8"
    )
    assert large["environment"]["num_states"] == 64
    assert large["environment"]["arguments"]["success_rate"] == 0.8
    assert large["environment"]["time_limit"] == 100
    own = loaded(capsys, "FrozenLake-v1", "--env-arg", 'desc=["SFG", "FHF"]')
    assert own["environment"]["num_states"] == 6
    assert "map_name" not in own["environment"]["arguments"]  # it is another map


def test_what_flips_the_preference_does(capsys: pytest.CaptureFixture[str]):
    words = (TAXI, "--state", "0,0,R,G", "--action", "pickup", "--foil", "north")
    never = "Whatever γ was, within the values tried, pickup is better than north."
    assert never in run(capsys, *words, "--details")[1]
    data = loaded(capsys, "FrozenLake-v1", "--foil", "down")
    findings = [finding for section in data["sections"] for finding in section["findings"]]
    (flip,) = next(f for f in findings if f["kind"] == "flips")["bounds"]
    for gamma, better in ((flip - 1e-3, "down"), (flip + 1e-3, "left")):
        data = loaded(capsys, "FrozenLake-v1", "--gamma", str(gamma))
        q_values = {name: data["actions"][name]["q_value"] for name in ("left", "down")}
        assert max(q_values, key=lambda name: q_values[name]) == better


def test_to_fall_off_the_cliff_is_an_alternative_and_when_it_costs_is_told_first(
    capsys: pytest.CaptureFixture[str],
):
    _, out, _ = run(capsys, CLIFF, "--N", "14")
    assert "What comes at once decides: up loses 1 and right loses 100." in out
    right = next(line for line in out.splitlines() if line.startswith("right"))
    assert "stays" not in right


def test_states_in_which_episodes_are_over_are_said(capsys: pytest.CaptureFixture[str]):
    over = "The episode is over here: no action pays anything any more."
    never = "Episodes are over in this state, or never come to it."
    for words, note in (
        (("FrozenLake-v1", "--state", "5"), over),
        ((CLIFF, "--state", "3,11"), never),  # its table goes on from the goal
    ):
        assert note in run(capsys, *words)[1]
        assert not loaded(capsys, *words)["state"]["visited"]
    assert over not in run(capsys, "FrozenLake-v1")[1]
    assert "Try:" not in run(capsys, "FrozenLake-v1", "--state", "5")[1]  # nothing comes later


def test_ties(capsys: pytest.CaptureFixture[str]):
    words = ("FrozenLake-v1", "--env-arg", "is_slippery=false", "--ties", "mixed")
    _, out, _ = run(capsys, *words)
    assert "chosen 50 %" in out
    _, out, _ = run(capsys, *words, "--details")
    assert "mixes tied actions evenly" in " ".join(out.split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["Frozenlake-v1"], "no environment 'Frozenlake-v1'. Did you mean 'FrozenLake-v1'?"),
        (["FrozenLake-v0"], "no environment 'FrozenLake-v0'. Did you mean 'FrozenLake-v1'?"),
        (["FrozenLake"], "no environment 'FrozenLake'. Did you mean 'FrozenLake-v1'?"),
        (["xyz"], "There is no environment 'xyz'. Known: CliffWalking"),
        ([""], "There is no environment ''."),
        ([":"], "There is no environment ':'."),
        (["nope:Foo-v1"], "nope:Foo-v1 cannot be imported: No module named 'nope'. Install"),
        (["CartPole-v1"], "CartPole-v1 has no transition table 'P', so there is no exact model"),
        (["Blackjack-v1"], "trdlab.tabular.from_arrays"),
        (["FrozenLake-v1", "--env-arg", "is_slipery=1"], "Did you mean 'is_slippery'?"),
        (["FrozenLake-v1", "--env-arg", "map_name=9x9"], "cannot be made with map_name=9x9"),
        (["FrozenLake-v1", "--env-arg", "is_slippery=no"], "is 'no'. It must be true or false."),
        (["FrozenLake-v1", "--env-arg", "reward_schedule=3"], "'int' object is not iterable). "),
        (["FrozenLake-v1", "--env-arg", "is_slippery"], "'is_slippery' is not KEY=VALUE."),
        (["FrozenLake-v1", *["--env-arg", "is_slippery=true"] * 2], "is given twice."),
        (["FrozenLake-v1", "--env-arg", "success_rate=2"], "State 0, action 0 has a negative"),
        ([TAXI, "--env-arg", "fickle_passenger=true"], "leaves out that the passenger is fickle"),
        (["FrozenLake-v1", "--state", "16"], "There is no state 16. States run from 0 to 15."),
        (["FrozenLake-v1", "--state", "4,0"], "There is no row '4'. It runs from 0 to 3."),
        (["FrozenLake-v1", "--state", "1,1,1"], "The state is '1,1,1'. Give its number, or row,"),
        ([TAXI, "--state", "0,0,X,0"], "There is no passenger 'X'. Known: 0 (at R), 1 (at G)"),
        (["FrozenLake-v1", "--action", "lfet"], "There is no action 'lfet'. Did you mean 'left'?"),
        (["FrozenLake-v1", "--gamma", "1"], "The discount factor gamma is 1.0."),
        (["FrozenLake-v1", "--plot", "x.pgn"], "'.pgn' is no known ending."),
        ([], "Missing argument 'ENV_ID'."),
    ],
)
def test_bad_input_is_one_line_with_its_cure(
    capsys: pytest.CaptureFixture[str], words: list[str], message: str
):
    code, out, err = run(capsys, *words)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert message in err


def test_pictures(capsys: pytest.CaptureFixture[str], tmp_path: Path):
    drone = "trdlab.envs:trdlab/DroneGridworld-v0"  # which has no map here
    for env_id, name in (("FrozenLake-v1", "a.png"), (TAXI, "b.svg"), (drone, "c.pdf")):
        code, _, err = run(capsys, env_id, "--plot", str(tmp_path / name))
        assert (code, err) == (0, f"Picture: {tmp_path / name}\n")
    code, out, err = run(capsys, TAXI, "--plot", str(tmp_path / "b.svg"))
    assert (code, out) == (2, "")
    assert "exists" in err


@pytest.mark.parametrize("columns", ["40", "80"])
def test_no_overflow_in_pipes(columns: str):
    shown = in_shell("FrozenLake-v1", "--N", "10", COLUMNS=columns)
    assert shown.returncode == 0
    assert max(map(len, shown.stdout.decode().splitlines())) <= int(columns)


def test_a_terminal_without_utf8():
    shown = in_shell("FrozenLake-v1", PYTHONIOENCODING="ascii")
    assert (shown.returncode, shown.stderr) == (0, b"")
    assert "gamma = 0.95" in shown.stdout.decode("ascii")
    assert in_shell("--help", PYTHONIOENCODING="ascii").returncode == 0


def test_nothing_heavy_is_imported():
    code = (
        "import sys, trdlab.cli\n"
        "try: trdlab.cli.main(['tabular', 'FrozenLake-v1'])\n"
        "except SystemExit: pass\n"
        "heavy = {'torch', 'pygame', 'matplotlib'} & set(sys.modules)\n"
        "assert 'gymnasium' in sys.modules and not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
