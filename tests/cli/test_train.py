"""`trdlab train`, `resume`, `evaluate` and `runs` as their users see them."""

import fcntl
import io
import json
import os
import pty
import re
import shutil
import signal
import subprocess
import sys
import termios
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from rich.console import Console

from trdlab.agents import find_agent
from trdlab.cli import main
from trdlab.cli.options import flag
from trdlab.cli.progress import EpisodeProgress, TrainingProgress, stopping
from trdlab.deep.presets import PRESETS, preset, with_teacher
from trdlab.rollouts.playing import Progress
from trdlab.runs import RunFolder, checkpoint_steps, read_arrays
from trdlab.training.fitted import Stopped
from trdlab.training.loading import load
from trdlab.verbs.fitting import fit_run

Outcome = tuple[int, str, str]
Trdlab = Callable[..., Outcome]

SMALL = [
    "--agent-steps=120", "--num-envs=1", "--capacity=100000", "--learning-starts=30",
    "--batch-size=4", "--hidden=8", "--N=2", "--log-every=40", "--evaluate-episodes=3",
]  # fmt: skip


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def trdlab(capsys, monkeypatch) -> Trdlab:
    """Returns a function that runs a command line: exit code, stdout, stderr."""
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("trdlab.training.setup._MEASURED_SECONDS", 0.05)

    def run(*words: object) -> Outcome:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main([str(word) for word in words])
        return int(end.value.code or 0), *capsys.readouterr()

    return run


@pytest.fixture(scope="module")
def trained(tmp_path_factory) -> Path:
    """Returns a run; not to be changed."""
    out = tmp_path_factory.mktemp("runs") / "pole"
    with pytest.raises(SystemExit) as end:
        main(["train", "gym", "CartPole-v1", *SMALL, "--out", str(out)])
    assert not end.value.code
    return out


def in_shell(*words: object, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "trdlab", *map(str, words)]
    return subprocess.run(command, capture_output=True, env=os.environ | environment, check=False)


# ---- help ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["gym", "atari"])
def test_the_help_has_every_setting_under_its_heading(trdlab, kind):
    code, out, err = trdlab("train", kind, "--help")
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 80
    panels = re.split(r"╭─ (.+?) ─+╮", out)
    shown = dict(zip(panels[1::2], panels[2::2], strict=True))
    assert list(shown) == [
        "Arguments", "Options", "Run", "Time axis", "Acting", "Learning", "Learning from a teacher",
        "Reward and ending", "Evaluation", "Running",
    ]  # fmt: skip
    taught = preset(kind, "X").changed({"teacher": "ppo.zip"}).to_config()
    keys = [*taught, "learning_rate_end", "max_grad_norm", "weights"]
    for key in keys[2:]:
        assert re.search(rf"{flag(key)}\b", out), key
    assert "--w " in shown["Time axis"]
    assert "--weights" in shown["Learning"]
    assert "--no-clip-rewards" in shown["Reward and ending"]
    told = " ".join(out.replace("│", " ").split())
    for name, (about, lines) in PRESETS[kind].items():
        assert f"{name}: {about}" in told
        assert all(key in keys for key in lines)
    steps = with_teacher(kind, preset(kind, "X"))["teacher_steps"]
    assert f"of all environments. [default: ({steps})]" in told
    horizon = preset(kind, "X").horizon
    about = rf"Number of explicit components; 0 is DQN\. \[default: \({horizon}\)\]"
    assert re.search(rf"--N (<int>|INTEGER) {about}", told)  # which of them, Typer decides


@pytest.mark.parametrize("command", ["resume", "evaluate", "runs"])
def test_the_help_of_the_others(trdlab, command):
    code, out, err = trdlab(command, "--help")
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 80
    assert f"Usage: trdlab {command}" in out


def test_train_alone_shows_what_can_be_trained_on(trdlab):
    code, out, err = trdlab("train")
    assert (code, err) == (2, "")
    assert "Train on a Gymnasium environment." in out
    assert "Train on an Atari game" in out


# ---- settings ------------------------------------------------------------------------------------


def planned(outcome: Outcome) -> dict[str, Any]:
    """Returns the configuration that a dry run shows."""
    code, out, err = outcome
    assert (code, err) == (0, "")
    return tomllib.loads(out.partition("\n\n")[0])


def test_a_dry_run_shows_what_is_resolved_and_writes_nothing(trdlab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = trdlab("train", "gym", "CartPole-v1", "--preset", "smoke", "--dry-run", "--w", 2)
    config = planned(outcome)
    wanted = preset("gym", "CartPole-v1", "smoke").changed({"w": 2}).to_config()
    resolved = {"device", "threads"}
    assert {key: config[key] for key in wanted if key not in resolved} == {
        key: wanted[key] for key in wanted if key not in resolved
    }
    assert config["device"] != "auto"
    assert config["threads"] == 1
    assert re.search(r"Replay memory: up to \d\.\d\d MB", outcome[1])
    assert re.search(r"Time: about \S+ \w+, at [\d,]+ agent steps a second", outcome[1])
    assert outcome[1].endswith("Nothing was written: leave out --dry-run to train.\n")
    assert list(tmp_path.iterdir()) == []


def test_options_of_every_type_and_which_of_preset_file_and_option_wins(trdlab, tmp_path):
    file = tmp_path / "run.toml"
    file.write_text("log_every = 9\nagent_steps = 2e3\ndouble = true\nhidden = [5]\n")
    words = [
        "--preset",
        "smoke",
        "--config",
        file,
        "--dry-run",
        "--no-double",
        "--hidden",
        "64, 64",
    ]
    words += ["--learning-rate-end", "0", "--reduction", "mean", "--clip-rewards", "--N", 0]
    words += ["--env-arg", "is_slippery=false", "--env-arg", "map_name=8x8", "--seed", 7]
    config = planned(trdlab("train", "gym", "FrozenLake-v1", *words))
    assert config["evaluate_episodes"] == 10  # of the preset
    assert (config["log_every"], config["agent_steps"]) == (9, 2000)  # of the file
    assert (config["double"], config["hidden"]) == (False, [64, 64])  # of the command
    assert (config["learning_rate_end"], config["reduction"]) == (0.0, "mean")
    assert (config["clip_rewards"], config["N"], config["seed"]) == (True, 0, 7)
    assert config["env_arg"] == ["is_slippery=false", "map_name=8x8"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["gym"], "Missing argument 'ENV_ID'. See: trdlab train gym --help"),
        (["atary", "Pong"], "No such command 'atary'. Did you mean 'atari'?"),
        (["gym", "CartPole-v2"], "no environment 'CartPole-v2'. Did you mean 'CartPole-v1'?"),
        (["gym", "cartpole-v1"], "Did you mean 'CartPole-v1'?"),
        (["gym", "nowhere:X-v0"], "nowhere:X-v0 cannot be imported: No module named 'nowhere'."),
        (["gym", "Pendulum-v1"], "Name a few actions to choose from: gymnasium."),
        (["gym", "ALE/Breakout-v5"], "is an Atari game. Use: trdlab train atari ALE/Breakout-v5"),
        (["atari", "Brekout"], "no Atari game 'Brekout'. Did you mean 'Breakout'?"),
        (
            ["atari", "Pong", "--env-arg", "stiky=0.1"],
            "Atari games take no argument 'stiky'. Did you mean 'sticky'?",
        ),
        (["gym", "CartPole-v1", "--env-arg", "gravity"], "'gravity' is not KEY=VALUE."),
        (["gym", "CartPole-v1", "--preset", "clasic"], "Did you mean 'classic'?"),
        (
            ["gym", "CartPole-v1", "--preset", "paper"],
            "no preset 'paper' for gym. Known: acrobot, classic",
        ),
        (["gym", "CartPole-v1", "--config", "none.toml"], "'none.toml' cannot be read"),
        (["gym", "CartPole-v1", "--learning-rat", "1"], "No such option"),
        (["gym", "CartPole-v1", "--N", "2.5"], "Invalid value for '--N'"),
        (["gym", "CartPole-v1", "--N", "-1"], "--N is -1. It must be from 0 to 10,000."),
        (["gym", "CartPole-v1", "--gamma", "1"], "gamma is 1.0. It must be at least 0"),
        (["gym", "CartPole-v1", "--hidden", "64,x"], "--hidden is '64,x': give sizes, such as"),
        (["gym", "CartPole-v1", "--hidden", "0"], "--hidden is 0. It must be from 1 to"),
        (
            ["gym", "CartPole-v1", "--epsilon-end", "2"],
            "--epsilon-end is 2.0. It must be from 0",
        ),
        (["gym", "CartPole-v1", "--seed", str(2**64)], "It must be less than 2**63."),
        (
            ["gym", "CartPole-v1", "--num-envs", "1", "--learning-starts", "3", "--w", "4"],
            "Choose 4 or more.",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(trdlab, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    for more in ([], ["--dry-run"]):
        code, out, err = trdlab("train", *words, *more)
        assert (code, out) == (2, "")
        assert err.startswith("error: ")
        assert message in err
        assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--N", 10**24], 2, "--N is 1000000000000000000000000. It must be from 0 to"),
        (["--N", 10**6], 2, "--N is 1000000."),
        (["--batch-size", 10**22], 2, "--batch-size is 1"),
        (["--batch-size", 10**8], 2, "A batch of 100000000 windows is larger than a replay memory"),
        (["--batch-size", 10**8, "--capacity", 10**8], 1, "Learning with this network and batch"),
        (
            ["--hidden", "1000000,1000000"],
            1,
            "Learning with this network and batch takes about 200",
        ),
        (["--hidden", 10**13], 2, "--hidden is 10000000000000."),
        (["--threads", 10**5], 2, "--threads is 100000, and the machine has"),
        (["--threads", 10**30], 2, "It must be less than 2**63."),
        (["--num-envs", 10**9], 2, "--num-envs is 1000000000."),
        (["--capacity", 10**17], 1, "A replay memory of 100000000000000000 transitions takes"),
        (["--w", 10**15, "--learning-starts", 10**15], 2, "Choose 8000000000000000 or more."),
        (["--agent-steps", 10**30], 2, "It must be less than 2**63."),
        (["--agent-steps", -5], 2, "--agent-steps is -5."),
        (["--evaluate-episodes", 10**12], 2, "It must be from 0 to 100,000."),
        (["--gamma", "nan"], 2, "gamma is nan."),
        (["--gamma", "-inf"], 2, "gamma is -inf."),
        (
            ["--epsilon-start", "nan"],
            2,
            "--epsilon-start is nan. It must be from 0 to 1.",
        ),
        (["--epsilon-end", "-0.1"], 2, "--epsilon-end is -0.1."),
        (["--evaluate-epsilon", "inf"], 2, "--evaluate-epsilon is inf."),
        (["--learning-rate", "nan"], 2, "The learning rate is nan."),
        (["--learning-rate", "inf"], 2, "The learning rate is inf."),
        (["--learning-rate-end", "nan"], 2, "--learning-rate-end is nan."),
        (["--device", "cpu:x"], 2, "PyTorch finds no device 'cpu:x' here."),
        (["--config", "/dev/zero"], 2, "'/dev/zero' is a device. Name a text file."),
    ],
)
def test_what_cannot_fit_or_be_meant_is_refused_before_work_begins(
    trdlab, tmp_path, monkeypatch, words, code, message
):
    monkeypatch.chdir(tmp_path)
    for more in ([], ["--dry-run"]):
        refused, out, err = trdlab("train", "gym", "CartPole-v1", *words, *more)
        assert (refused, out, err.count("\n")) == (code, "", 1)
        assert err.startswith("error: ")
        assert message in err
    assert list(tmp_path.iterdir()) == []


def test_settings_of_a_file_and_of_the_command_are_checked_together(trdlab, tmp_path):
    file = tmp_path / "run.toml"
    file.write_text("w = 20\nlearning_starts = 30")  # too few for the environments of the preset
    words = ("--config", file, "--num-envs", 1, "--dry-run")
    assert planned(trdlab("train", "gym", "CartPole-v1", *words))["learning_starts"] == 30


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("learning_rat = 1", "'run.toml' has an unknown key 'learning_rat'. Did you mean"),
        ("agent_steps = 'many'", "'run.toml' has agent_steps = 'many'. It must be a whole number."),
        ("hidden = ['many']", "'run.toml' has hidden = ['many']. It must be a list of whole"),
        ("[learning]\nN = 1", "'run.toml' has an unknown key 'learning'."),
        ("kind = 'atari'", "'run.toml' is for another kind. Here it is 'gym'."),
        ("N = ", "'run.toml' is not valid TOML"),
    ],
)
def test_a_file_that_cannot_be_used(trdlab, tmp_path, monkeypatch, lines, message):
    monkeypatch.chdir(tmp_path)
    Path("run.toml").write_text(lines)
    code, _, err = trdlab("train", "gym", "CartPole-v1", "--config", "run.toml")
    assert code == 2
    assert err.startswith(f"error: {message}")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "run.toml"]


# ---- runs ----------------------------------------------------------------------------------------


def test_a_run_from_start_to_score(trdlab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = trdlab("train", "gym", "CartPole-v1", *SMALL)
    assert code == 0
    run, origin, memory, first, *_, trained, kept, chance = err.splitlines()
    assert run == "Run: runs/CartPole-v1-N2-w1-seed1"
    assert origin == "Settings: the preset classic, made for CartPole-v1."
    assert re.fullmatch(r"Replay memory: up to \d\.\d\d MB(, of .* GB that are free)?\.", memory)
    assert first == "1 of 120 steps, score –, loss –"
    assert re.fullmatch(r"Trained 120 agent steps in \d+ seconds?\.", trained)
    name = "step-120-episodes-3-epsilon-0-seed-1000.json"
    assert kept == f"Kept: runs/CartPole-v1-N2-w1-seed1/evaluations/{name}"
    assert re.fullmatch(
        r"(Nothing shows that it plays better|It plays worse) than chance: random actions reach "
        r"[\d.]+ in as many episodes\. Train longer: trdlab resume runs/CartPole-v1-N2-w1-seed1 "
        r"--agent-steps 240; or try other settings, such as --epsilon-hold 10\.",
        chance,
    )
    assert out.startswith("3 episodes, greedy, seed 1000; raw rewards, undiscounted\n")
    assert "mean return" in out
    assert "error" not in err
    code, _, err = trdlab("train", "gym", "CartPole-v1", *SMALL, "--evaluate-episodes", 0)
    assert (code, err.splitlines()[0]) == (0, "Run: runs/CartPole-v1-N2-w1-seed1-2")
    assert list(Path("runs/CartPole-v1-N2-w1-seed1-2/evaluations").iterdir()) == []


def test_actions_are_called_as_people_say(trdlab, tmp_path):
    words = ("train", "gym", "CartPole-v1", *SMALL, "--evaluate-episodes", 0, "--out")
    assert trdlab(*words, tmp_path / "run", "--action-names", "push left, push right")[0] == 0
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["environment"]["action_names"] == ["push left", "push right"]
    assert find_agent(str(tmp_path / "run")).action_names == ("push left", "push right")
    assert trdlab("resume", tmp_path / "run")[0] == 0
    for names, message in (
        ("left,right,up", "There are 3 names for 2 actions: left, right, up. Give one for each"),
        ("left,left", "The action names are 'left', 'left'. Each has a name of its own."),
    ):
        for more in ([], ["--dry-run"]):
            code, _, err = trdlab(*words, tmp_path / "no", "--action-names", names, *more)
            assert (code, err.count("\n")) == (2, 1)
            assert message in err
    assert not (tmp_path / "no").exists()


def test_an_evaluation_as_json(trdlab, trained):
    code, out, err = trdlab("evaluate", trained, "--episodes", 2, "--seed", 3, "--json")
    assert code == 0
    data = json.loads(out)
    assert data["schema"] == "trdlab.evaluation/1"
    assert (data["episodes"], data["seed"], len(data["returns"])) == (2, 3, 2)
    kept = Path(err.removeprefix("Kept: ").strip())
    assert json.loads(kept.read_text()) == {"agent_steps": 120, **data}
    _, again, _ = trdlab("evaluate", trained, "--episodes", 2, "--seed", 3, "--json")
    assert again == out
    _, page, _ = trdlab("evaluate", trained, "--episodes", 2, "--epsilon", 0.5)
    assert "2 episodes, greedy, 50.0% random actions, seed 1000" in page
    code, _, err = trdlab("evaluate", trained, "--epsilon", 2)
    assert code == 2
    assert "Invalid value for '--epsilon'" in err
    code, _, err = trdlab("evaluate", trained, "--epsilon", "nan")
    message = "error: --epsilon is nan. It lies from 0 to 1.\n"
    assert (code, err) == (2, message)


def test_an_evaluation_that_would_never_return_is_cut_off(trdlab, tmp_path):
    cliff = max(name for name in gymnasium.registry if name.startswith("CliffWalking-v"))
    words = ("train", "gym", cliff, *SMALL, "--out", tmp_path / "run")
    code, out, _ = trdlab(*words)
    assert code == 0
    assert "3 of 3 were cut off at step 1,000" in " ".join(out.split())
    code, out, err = trdlab("evaluate", tmp_path / "run", "--max-steps", 7, "--json")
    data = json.loads(out)
    assert (code, data["lengths"], data["max_steps"]) == (0, [7, 7, 7], 7)
    assert err.endswith("seed-1000-max-steps-7.json\n")
    evaluations = list((tmp_path / "run" / "evaluations").iterdir())
    assert {path.name.partition("episodes-3-")[2] for path in evaluations} == {
        "epsilon-0-seed-1000.json",
        "epsilon-1-seed-1000.json",  # of random actions, to compare with
        "epsilon-0-seed-1000-max-steps-7.json",
    }


def test_the_environments_own_limit_is_enough(trdlab, trained):
    _, out, _ = trdlab("evaluate", trained, "--json")
    assert json.loads(out)["max_steps"] is None


def test_the_list_of_runs(trdlab, trained, tmp_path):
    shutil.copytree(trained, tmp_path / "pole")
    torn = Path(shutil.copytree(trained, tmp_path / "torn"))
    (torn / "manifest.json").write_text("{")
    edited = Path(shutil.copytree(trained, tmp_path / "edited"))
    (edited / "config.toml").write_text("kind = 'gym'\nenv = 'X'\nagent_steps = 'many'")
    (tmp_path / "no run").mkdir()
    code, out, err = trdlab("runs", tmp_path)
    assert (code, err) == (0, "")
    header, *rows = [" ".join(line.split()) for line in out.splitlines()]
    assert header == "run environment N w steps score status"
    assert any(re.fullmatch(r"pole CartPole-v1 2 1 120 [\d.]+ done", row) for row in rows)
    assert any(row.startswith("torn ") for row in rows)
    assert any(row.startswith("edited ") for row in rows)
    assert "env = 'X', and the run began with" in " ".join(rows)
    assert "no run" not in out
    code, out, _ = trdlab("runs", tmp_path / "nowhere")
    assert (code, out) == (0, f"There are no runs in '{tmp_path / 'nowhere'}'.\n")


@pytest.fixture
def received(trained, tmp_path, monkeypatch) -> Iterator[Path]:
    """Returns a run whose environment needs a module, which leaves a mark when it is executed."""
    run = Path(shutil.copytree(trained, tmp_path / "received"))
    for name in ("config.toml", "manifest.json"):
        text = (run / name).read_text().replace('"CartPole-v1"', '"their_world:CartPole-v1"')
        (run / name).write_text(text)
    (tmp_path / "their_world.py").write_text("import pathlib\npathlib.Path('executed').touch()")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [path for path in sys.path if path not in ("", ".")])
    yield run
    sys.modules.pop("their_world", None)


def test_a_module_is_not_imported_because_a_run_says_so(trdlab, received):
    for words in (["resume"], ["evaluate"], ["explain"], ["compare", received]):
        code, out, err = trdlab(*words, received)
        assert (code, out) == (2, "")
        assert err == (
            "error: The environment 'their_world:CartPole-v1' needs code that the run does not "
            "hold: the module 'their_world'. If you trust it, add: --import their_world\n"
        )
    assert trdlab("runs", received.parent)[0] == 0
    assert len(load(received).decompose([[0.0] * 4])) == 1  # which needs no environment
    assert not Path("executed").exists()
    assert "their_world" not in sys.modules


@pytest.mark.parametrize("kind", ["tabular:their_world", "gridworld"])
def test_the_name_of_a_model_is_no_way_around(trdlab, received, kind):
    for name in ("config.toml", "manifest.json"):
        text = (received / name).read_text().replace("their_world", kind)
        (received / name).write_text(text)
    code, _, err = trdlab("explain", received)
    assert (code, f"the module '{kind}'. If you trust it" in err) == (2, True)
    assert not Path("executed").exists()


@pytest.mark.parametrize("command", ["evaluate", "explain"])
def test_a_module_that_is_named_is_imported_from_the_present_folder(trdlab, received, command):
    words = (command, received, "--json", "--episodes", 2, "--import")
    code, out, err = trdlab(*words, "their_world")
    assert code == 0, err
    assert json.loads(out)
    assert Path("executed").exists()
    code, _, err = trdlab(*words, "nobodys_world")
    assert (code, err) == (2, "error: 'nobodys_world' cannot be imported: No module named "
                           "'nobodys_world'. Check its name, or correct it.\n")  # fmt: skip


def test_an_environment_in_the_present_folder(trdlab, received):
    words = ("train", "gym", "their_world:CartPole-v1", *SMALL, "--out", "mine")
    assert trdlab(*words)[0] == 0  # also its evaluation
    assert sys.path[0] != str(Path.cwd())  # nothing there hides what is installed
    sys.modules.pop("their_world")
    for step in Path("mine/checkpoints").iterdir():
        shutil.rmtree(step)
    code, _, err = trdlab("evaluate", "mine", "--import", "their_world")
    assert code == 2
    assert err.endswith("Train on: trdlab resume mine --import their_world.\n")
    assert trdlab("resume", "mine", "--import", "their_world")[0] == 0


def test_pipes_get_plain_text(trained, tmp_path):
    words = ("train", "gym", "FrozenLake-v1", *SMALL, "--out", tmp_path / "run")
    done = in_shell(*words, COLUMNS="80", PYTHONIOENCODING="ascii:strict")
    assert done.returncode == 0, done.stderr.decode()
    assert b"\x1b" not in done.stdout + done.stderr
    assert done.stdout.isascii()
    assert done.stdout.startswith(b"3 episodes, greedy")
    assert b"1 of 120 steps" in done.stderr
    assert b"1 of 120 steps" not in done.stdout


@pytest.mark.parametrize("words", [["runs", ".", "--plot"], ["gridworld", "--plot"]])
def test_pictures_need_no_backend_of_a_notebook(tmp_path, trained, words, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(trained, tmp_path / "pole")
    done = in_shell(*words, "picture.png", MPLBACKEND="module://matplotlib_inline.backend_inline")
    assert done.returncode == 0, done.stderr.decode()
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")


# ---- progress and signals ------------------------------------------------------------------------


def steps(count: int, total: int = 100_000, what: str = "steps", clock: int = 0) -> Any:
    return SimpleNamespace(standing=(count, total, what), clock=clock or count)


def metrics(score: float | None, loss: float | None) -> Any:
    return SimpleNamespace(score=score, loss=loss)


def test_without_a_terminal_there_is_a_line_now_and_then(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    console = Console(file=io.StringIO(), width=80)
    with TrainingProgress(console, total=100_000, done=40_000) as progress:
        for step in range(1, 60):
            now[0] += 0.5
            if step == 30:
                progress.on_metrics(metrics(195.044, 0.01234))
            progress.on_step(steps(40_000 + 100 * step))
    assert console.file.getvalue().splitlines() == [  # type: ignore[attr-defined]
        "40,100 of 100,000 steps, score –, loss –",
        "42,100 of 100,000 steps, 200/s, score –, loss –",
        "44,100 of 100,000 steps, 200/s, score 195, loss 0.0123",
    ]


def test_each_phase_counts_what_it_does_and_has_its_own_speed(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    console = Console(file=io.StringIO(), width=80)
    with TrainingProgress(console, total=1_600) as progress:
        for done, what, clock in ((100, "offline updates", 600), (300, "offline updates", 800)):
            now[0] += 20.0
            progress.on_step(steps(done, 400, what, clock))
        now[0] += 20.0
        progress.on_step(steps(100, 700, "steps", 1_000))
    assert console.file.getvalue().splitlines() == [  # type: ignore[attr-defined]
        "100 of 400 offline updates, score –, loss –",
        "300 of 400 offline updates, 10/s, score –, loss –",
        "100 of 700 steps, score –, loss –",
    ]


def test_episodes_are_told_of_in_a_pipe_too(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    console = Console(file=io.StringIO(), width=80)
    with EpisodeProgress(console) as progress:
        for step in range(1, 45):
            now[0] += 0.5
            progress.on_progress(Progress("episodes to score", step // 10, 30, 100 * step))
    assert console.file.getvalue().splitlines() == [  # type: ignore[attr-defined]
        "Playing episodes to score: step 2,000, 2 of 30 are over",
        "Playing episodes to score: step 4,000, 4 of 30 are over",
    ]


def test_on_a_terminal_there_is_a_bar():
    console = Console(file=io.StringIO(), width=80, force_terminal=True, color_system=None)
    with TrainingProgress(console, total=1000) as progress:
        progress.on_metrics(metrics(-20.5, None))
        progress.on_step(steps(500, 1000))
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert "500 of 1,000 steps" in shown
    assert "score -20.5, loss –" in shown
    assert "━" in shown


SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture
def hangs_up():
    """A closed terminal is heard of, even if the tests were started by `nohup`."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("hangs_up")
@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_asks_and_the_next_one_is_not_held_up(number):
    before = {each: signal.getsignal(each) for each in SIGNALS}
    with stopping() as stop:
        assert not stop()
        signal.raise_signal(number)
        assert stop()
        assert stop.code == 128 + number
        assert {each: signal.getsignal(each) for each in before} == before
    with stopping():
        assert signal.getsignal(number) is not before[number]
    assert {each: signal.getsignal(each) for each in before} == before


def test_what_nohup_ignores_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stopping() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert not stop()
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.usefixtures("hangs_up")
def test_a_terminal_that_is_closed_stops_and_saves(tmp_path):
    out, (ours, theirs) = tmp_path / "run", pty.openpty()
    words = ["train", "gym", "CartPole-v1", *SMALL, "--agent-steps=1000000", "--out", str(out)]
    with subprocess.Popen(
        [sys.executable, "-m", "trdlab", *words],
        stdin=theirs, stdout=theirs, stderr=theirs,
        preexec_fn=lambda: (os.setsid(), fcntl.ioctl(0, termios.TIOCSCTTY, 0)),
    ) as process:  # fmt: skip
        os.close(theirs)
        seen = b""
        while b"of 1,000,000 steps" not in seen:
            seen += os.read(ours, 1000)
        os.close(ours)
        assert process.wait(60) == 129
    assert len(checkpoint_steps(RunFolder.open(out))) == 1


def test_a_run_that_will_learn_nothing_says_so(trdlab, tmp_path):
    words = ("train", "gym", "CartPole-v1", *SMALL, "--learning-starts", 120)
    line = (
        "Nothing will be learned: updates begin after 120 agent steps, and the run ends after 120."
    )
    code, _, err = trdlab(*words, "--out", tmp_path / "run")
    assert (code, line in err.splitlines()) == (0, True)
    assert line in trdlab(*words, "--dry-run")[1].splitlines()


def test_a_run_that_fits_ends_with_how_far_that_can_be_trusted(trdlab, tmp_path):
    out = tmp_path / "run"
    words = ["train", "gym", "CartPole-v1", *SMALL, "--fit", "--fit-steps=600", "--out", out]
    code, said, err = trdlab(*words)
    assert code == 0, err
    fit = out / "fits" / "000000120"
    assert f"Kept: {fit}" in err
    assert "Over 50 episodes the agent scored" in said
    assert f"Try: trdlab explain {out}" in " ".join(said.split())
    before = {path: path.read_bytes() for path in fit.rglob("*") if path.is_file()}
    code, said, err = trdlab("resume", out)  # there is nothing left to do
    assert (code, "Kept: " + str(fit) in err) == (0, False)
    assert {path: path.read_bytes() for path in fit.rglob("*") if path.is_file()} == before


def test_a_fit_that_was_stopped_goes_on_with_its_run(trdlab, tmp_path):
    out = tmp_path / "run"
    few = [*SMALL, "--fit-steps=600", "--evaluate-episodes=0", "--out", out]
    assert trdlab("train", "gym", "CartPole-v1", *few, "--fit")[0] == 0
    fit, whole = out / "fits" / "000000120", tmp_path / "whole"
    shutil.move(fit, whole)
    rounds = iter([False, False, True])
    with pytest.raises(Stopped, match=r"Stopped at [\d,]+ updates"):
        fit_run(out, should_stop=lambda: fit.exists() and next(rounds))
    code, _, err = trdlab("resume", fit)
    assert code == 0, err
    for name in ("q_network", "possible"):
        one, other = (read_arrays(RunFolder.open(of), name)[1] for of in (fit, whole))
        assert all(np.array_equal(one[key], other[key]) for key in one | other)
