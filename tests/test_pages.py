"""Every command and block of code on the pages runs, and what is shown is what is printed."""

import json
import re
import shlex
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest

from archives import cartpole_ppo
from commands import refusal
from pages import (
    PAGES,
    ROOT,
    Shown,
    blocks,
    built,
    commands,
    in_prose,
    matches,
    sources,
    words_of,
)
from trdlab.cli import main

TRAIN = ROOT / "docs" / "train.md"
RUN, GAME, FIT = "CartPole-v1-N10-w1-seed1", "Breakout-N40-w1-seed1", "ppo-N40-w1"
LITTLE = (
    "--agent-steps 40 --learning-starts 20 --capacity 100 --num-envs 2 --threads 1 --log-every 9"
)
CHEAP = {
    r"^trdlab train gym (?!.*--teacher)": f"{LITTLE} --evaluate-episodes 5",
    r"^trdlab train .*--teacher": f"{LITTLE} --teacher-steps 100 --offline-updates 50",
    r"^trdlab resume .*--agent-steps": "--agent-steps 60",
    r"^trdlab evaluate ": "--episodes 2 --max-steps 40",
    r"^trdlab agent ": "--episodes 2 --max-steps 40",
    r"^trdlab explain (?!gridworld|tabular)": "--episodes 0 --max-steps 5",
    r"^trdlab explain fits": "--what forecast",
    r"^trdlab video ": "--max-steps 5",
    r" --step \d": "--step 2",
}
"""What makes a command that takes long a cheap one; of some options the last one counts."""
ONLY_PARSED = {
    r"^trdlab train atari ": "plays games for minutes; tests/training has it",
    r"^trdlab report pretrained": "takes a quarter of a minute; tests/cli has short ones",
    r"^trdlab fit ": "is run once, for all pages (`made`)",
    r"--kind goals": "tests/study has it",
    r"acktr|young|runs/received|@\d+|LunarLander": "a file that everybody has another one of",
    r"\.\.\.|[A-Z]{3,}|\bDIR\b|FILE": "stands for another word",
    r"study score": "tests/study has it",
    r"trdlab playground": "serves until it is stopped; tests/playground has it",
    r"--weights": "of a checkpoint that takes minutes to reach",
    r"--preset gpu|--device cuda$": "needs a card",
}
"""Commands of which only the options are checked, and why."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_command_on_a_page_is_one(page: Path, here: Path) -> None:
    write_files(page, here)
    whole = [of.command for of in commands(page)] + built(page)
    in_part = [command for command in in_prose(page) if command not in whole]
    refused = {
        command: why
        for command in whole + in_part
        if command.startswith("trdlab ") and (why := refusal(command)) is not None
    }
    for command in in_part:  # a sentence may leave out what a command needs
        if re.search(r"^$|issing|requires", refused.get(command, "-")):
            del refused[command]
    assert refused == {}


def test_every_other_command_names_what_there_is() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    for page in PAGES:
        for command in (of.command for of in commands(page)):
            words = shlex.split(command)
            if words[0] == "make":
                assert words[1] in targets, command
            for path in re.findall(r"((?<= -[rc] )\w+\.txt|(?:\w+/)+\w+\.py)", command):
                assert (ROOT / path).exists(), command
            for extras in re.findall(r"(?:trdlab|\.)\[([\w,]+)\]", command):
                assert set(extras.split(",")) <= set(project["optional-dependencies"]), command


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns a folder with what the pages speak of: runs, a file and a fit, hardly trained."""
    from trdlab.deep.presets import preset
    from trdlab.training.run import begin, carry_on

    folder = tmp_path_factory.mktemp("pages")
    little = {
        "agent_steps": 40,
        "learning_starts": 20,
        "capacity": 100,
        "threads": 1,
        "log_every": 9,
    }
    for kind, env, name in (("gym", "CartPole-v1", RUN), ("atari", "Breakout", GAME)):
        settings = preset(kind, env).changed({**little, "num_envs": 2})
        with begin(settings, folder / "runs" / name) as run:
            assert carry_on(run)
            held = {path.name for path in run.folder.path.iterdir()}
    assert {".lock", ".holder.json"} <= held
    cartpole_ppo(folder / "ppo.zip")
    fit = f"fit {folder}/ppo.zip --env CartPole-v1 --N 3 --steps 300 --time 1s"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NO_COLOR", "1")
        run_command(f"trdlab {fit} --out {folder}/fits/{FIT}", fails=False)
    shutil.copy(ROOT / "docs" / "assets" / "garden.txt", folder)
    return folder


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Returns the folder that a page's commands run in: empty, but for a map."""
    monkeypatch.chdir(tmp_path)
    for name, value in (("COLUMNS", "80"), ("NO_COLOR", "1"), ("MPLBACKEND", "agg")):
        monkeypatch.setenv(name, value)
    return tmp_path


def write_files(page: Path, here: Path) -> None:
    """Writes the files that a page tells its reader to save."""
    for block in blocks(page):
        if name := re.search(r'title="([\w.]+)"', block.kind):
            (here / name[1]).write_text(block.text + "\n", encoding="utf-8")


def provide(text: str, made: Path, here: Path) -> None:
    """Puts there what is named, if it has not been made there."""
    for name in (f"runs/{RUN}", f"runs/{GAME}", f"fits/{FIT}", "ppo.zip", "garden.txt"):
        if name in text and not (here / name).exists():
            copy = shutil.copytree if (made / name).is_dir() else shutil.copy
            (here / name).parent.mkdir(exist_ok=True)
            copy(made / name, here / name)


def run_command(command: str, *, fails: bool) -> None:
    with pytest.raises(SystemExit) as stop:
        main(words_of(command)[1:])
    assert bool(stop.value.code) == fails, f"{command}: exit code {stop.value.code}"


def cheap(shown: Shown) -> str:
    """Returns a command that does the same in less time; what is shown exactly, as it is."""
    if shown.output and not shown.kind:
        return shown.command
    more = [options for start, options in CHEAP.items() if re.search(start, shown.command)]
    return " ".join([shown.command, *more])


def is_run(command: str) -> bool:
    is_one = command.startswith("trdlab ") and command != "trdlab --version"
    return is_one and not any(re.search(pattern, command) for pattern in ONLY_PARSED)


WITH_COMMANDS = [page for page in PAGES if any(is_run(of.command) for of in commands(page))]


@pytest.mark.parametrize("page", WITH_COMMANDS, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_commands_of_a_page_run_and_print_what_it_shows(
    page: Path, made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """If this fails for what is shown, paste what is printed now."""
    write_files(page, here)
    for shown in commands(page):
        if not is_run(shown.command):
            continue
        provide(shown.command, made, here)
        run_command(cheap(shown), fails=shown.output.startswith("error:"))
        printed = capsys.readouterr()
        assert matches(shown, printed.err + printed.out), f"{shown.command} prints:\n{printed.out}"


CODE = {
    "trdlab.fit(agent": "trdlab.fit(agent, steps=300, most_updates=5",
    "horizon=40": "horizon=3",
    "trdlab.calibrate(agent": "trdlab.calibrate(agent, episodes=2",
    "seed=3, step=5)": "seed=3, step=5, episodes=2)",
    "range(200)": "range(5)",
}
"""What makes code that takes long cheap."""
WITH_PYTHON = [page for page in PAGES if sources(page, "python")]


@pytest.mark.parametrize("page", WITH_PYTHON, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_python_of_a_page_runs(page: Path, made: Path, here: Path) -> None:
    namespace: dict[str, Any] = {}
    for block in sources(page, "python"):
        provide(block, made, here)
        for long, short in CODE.items():
            block = block.replace(long, short)
        exec(block, namespace)


@pytest.mark.parametrize(
    "word",
    ["Component", "Residual", "Q", "Total", "Chosen", "Stays here", "Mostly stays", "Tie", "Worth",
     "In total", "The other action** (`--foil`)", "Skill", "trusted to t+3", "Not tested"],
)  # fmt: skip
def test_the_words_of_the_output_are_explained_on_one_page(word: str) -> None:
    assert f"**{word}" in (ROOT / "docs" / "output.md").read_text(encoding="utf-8")


def test_the_files_of_a_run_are_those_of_the_table(made: Path) -> None:
    run = made / "runs" / RUN
    section = TRAIN.read_text(encoding="utf-8").split("## What lies")[1].split("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith(("| `", "| …"))]
    told = {name for row in rows for name in re.findall(r"`([\w./]+)`", row.split(" | ")[0])}
    top = {path.name + "/" * path.is_dir() for path in run.iterdir()} | {".holder.json"}
    top |= {"tensorboard/"}  # if asked for
    [checkpoint] = (run / "checkpoints").iterdir()
    held = {path.name for path in checkpoint.iterdir()}
    assert told == (top - {"checkpoints/"}) | held | {"checkpoints/000100000/"}
    metrics = json.loads((run / "metrics.jsonl").read_text().splitlines()[-1])
    row = next(row for row in rows if "metrics.jsonl" in row)
    assert re.findall(r"`(\w+)`", row.split(" | ")[1])[1:] == list(metrics)


def test_the_settings_are_those_that_the_numbers_on_the_page_were_made_with() -> None:
    """If this fails, run the commands of docs/train.md again, and write down what they print."""
    from trdlab.deep.presets import preset

    config = preset("gym", "CartPole-v1").to_config()
    names = ("N", "w", "gamma", "agent_steps", "num_envs", "learning_starts", "update_every")
    assert [config[name] for name in names] == [10, 1, 0.99, 100_000, 8, 1_000, 2]
    names = ("epsilon_end", "epsilon_steps", "batch_size", "learning_rate", "learning_rate_end")
    assert [config[name] for name in names] == [0.04, 20_000, 64, 1e-3, 0.0]
    assert (config["target_sync_updates"], config["hidden"]) == (128, [256, 256])
