"""A light installation, without PyTorch and the Atari games, is enough to teach with."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SHOWN = {
    "--help": "fit",
    "gridworld --gamma 0.95 --N 2 --w 2 --plot drone.png": "[0.95, 1.76, 0.81]",
    "tabular FrozenLake-v1 --N 10": "FrozenLake-v1",
    "explain gridworld:ledge --episodes 20 --out pictures": "better than a guess",
}
NEEDS_MORE = {
    "train gym CartPole-v1 --preset smoke": "PyTorch",
    "train atari Breakout": "PyTorch",
    "explain pretrained:Breakout": "PyTorch",
    "fit gridworld:ledge --N 4": "PyTorch",
    "games": "ale-py",
}
LESSON = "01_read_a_reward_vector.py"
PATH = os.pathsep.join([str(ROOT), str(ROOT / "tutorials")])
WITHOUT = """
import io, json, runpy, sys
from contextlib import redirect_stderr, redirect_stdout


class Without:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("torch", "ale_py"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


sys.meta_path.insert(0, Without())
from trdlab.cli import main

said = {}
for words in json.loads(sys.argv[1]):
    out, err, code = io.StringIO(), io.StringIO(), 0
    with redirect_stdout(out), redirect_stderr(err):
        try:
            runpy.run_path(words) if words.endswith(".py") else main(words.split())
        except SystemExit as stop:
            code = stop.code
    said[words] = code, out.getvalue(), err.getvalue()
print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def light(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[int, str, str]]:
    """Returns what commands do where PyTorch and ale-py cannot be imported."""
    words = [*SHOWN, *NEEDS_MORE, str(ROOT / "tutorials" / LESSON)]
    env = {**os.environ, "PYTHONPATH": PATH, "MPLBACKEND": "agg", "COLUMNS": "80"}
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, json.dumps(words)],
        cwd=tmp_path_factory.mktemp("light"),
        env=env | {"NO_COLOR": "1"},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return {Path(name).name: said for name, said in json.loads(done.stdout).items()}


def test_the_list_is_that_of_the_package_without_two() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = (ROOT / "light.txt").read_text(encoding="utf-8").splitlines()
    told = {line for line in lines if not line.startswith("#")}
    left_out = set(project["dependencies"]) - told
    assert told < set(project["dependencies"])
    assert {line.partition(">=")[0] for line in left_out} == {"torch", "ale-py"}


@pytest.mark.parametrize(("words", "told"), [*SHOWN.items(), (LESSON, "down  [0.95 1.76 0.81]")])
def test_what_a_lecture_shows_works(light: dict[str, tuple[int, str, str]], words: str, told: str):
    code, out, err = light[words]
    assert (code, "error" in err) == (0, False), err
    assert told in out


@pytest.mark.parametrize(("words", "package"), NEEDS_MORE.items())
def test_what_needs_more_says_how_to_get_it(
    light: dict[str, tuple[int, str, str]], words: str, package: str
) -> None:
    cause = f"This needs {package}, which a light installation leaves out."
    code, _, err = light[words]
    assert (code, err) == (1, f"error: {cause} Run: pip install trdlab\n")
