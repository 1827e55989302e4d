"""The lessons run as a new user runs them, and their exercises know right from wrong."""

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from trdlab.decomposition import TimeAxis
from trdlab.gridworld import Gridworld, load_map, parse_map
from trdlab.tabular import exact

TUTORIALS = Path(__file__).parents[1] / "tutorials"
LESSONS = sorted(TUTORIALS.glob("[0-9]*.py"))

# What a reader who understood would write. Found by solving, not taken from the exercises.
SOLUTIONS = {
    "1.1": "1.62 / 0.81",
    "1.2": "list(TimeAxis(0.95, horizon=3, width=2).steps(1))",
    "1.3": "4.327",
    "2.1": "target(np.float64(0.5), np.float64(0.5), np.array([1.0, 2.0, 4.0]))",
    "2.2": "TimeAxis(0.95, horizon=30).regrouped(5).num_components",
    "2.3": "0.9",
}


def _load_exercise() -> ModuleType:
    spec = importlib.util.spec_from_file_location("trdlab_exercise", TUTORIALS / "exercise.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


exercise = _load_exercise()


def run(script: Path, cwd: Path) -> str:
    """Returns what a script prints, warnings being errors."""
    command = [sys.executable, "-W", "error", str(script)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def number(lesson: Path) -> str:
    return str(int(lesson.name[:2]))


def exercises_of(lesson: Path) -> list[str]:
    return [name for name in exercise.EXERCISES if name.startswith(f"{number(lesson)}.")]


def test_lessons_are_found() -> None:
    assert [lesson.stem for lesson in LESSONS] == ["01_read_a_reward_vector", "02_derive_it"]


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_lesson_runs_unanswered(lesson: Path, tmp_path: Path) -> None:
    printed = run(lesson, tmp_path)
    unanswered = re.findall(r"Exercise (\S+): not answered yet", printed)
    assert unanswered == exercises_of(lesson)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_lesson_accepts_the_solutions(lesson: Path, tmp_path: Path) -> None:
    source = lesson.read_text(encoding="utf-8")
    for name in exercises_of(lesson):
        answered = f"answer_{name[-1]} = {SOLUTIONS[name]}  # filled in"
        source, count = re.subn(rf"answer_{name[-1]} = None +# replace .*", answered, source)
        assert count == 1
    shutil.copy(TUTORIALS / "exercise.py", tmp_path)
    (tmp_path / lesson.name).write_text(source, encoding="utf-8")
    printed = run(tmp_path / lesson.name, tmp_path)
    assert re.findall(r"Exercise (\S+): right\.", printed) == exercises_of(lesson)


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_lesson_prints_the_same_each_time(lesson: Path, tmp_path: Path) -> None:
    assert run(lesson, tmp_path) == run(lesson, tmp_path)


def test_first_lesson_shows_the_numbers_of_the_paper(tmp_path: Path) -> None:
    printed = run(LESSONS[0], tmp_path)
    for line in (
        "Q(up)   = 3.26",
        "Q(down) = 3.52",
        "up   [0.   0.   0.   0.   3.26]",
        "down [0.   0.95 0.9  0.86 0.81]",
        "up    [0.   0.   3.26]",
        "down  [0.95 1.76 0.81]",
    ):
        assert f"\n{line}\n" in printed


def test_second_lesson_finds_no_deviation(tmp_path: Path) -> None:
    assert "False" not in run(LESSONS[1], tmp_path)


@pytest.mark.parametrize("name", exercise.EXERCISES)
def test_check_explains_each_known_mistake(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    for wrong, said in exercise.EXERCISES[name].mistakes:
        exercise.check(name, wrong)
        assert capsys.readouterr().out == f"Exercise {name}: {wrong} is not right. {said}\n"


@pytest.mark.parametrize("answer", [1e6, -3, [1, 2, 3, 4, 5, 6], "many", [[1], [1, 2]], object])
def test_check_gives_a_hint_on_any_other_answer(
    answer: object, capsys: pytest.CaptureFixture[str]
) -> None:
    exercise.check("1.3", answer)
    printed = capsys.readouterr().out
    assert printed.endswith(f"is not right. Hint: {exercise.EXERCISES['1.3'].hint}\n")


def test_check_compares_to_two_decimals(capsys: pytest.CaptureFixture[str]) -> None:
    exercise.check("1.3", 4.33)
    assert "right." in capsys.readouterr().out
    exercise.check("1.3", 4.34)
    assert "not right" in capsys.readouterr().out


def test_solution_of_the_treasure_makes_both_routes_equal() -> None:
    grid = load_map("drone").with_value("treasure", exercise.EXERCISES["1.3"].right)
    up, down = exact(Gridworld(grid).mdp, TimeAxis(0.95, 4)).decomposition.value[0, :2]
    assert np.isclose(up, down)


def test_solution_of_the_corridor_ties_both_sides() -> None:
    text = "X = coin 18 terminal\nY = treasure 20 terminal\n---\nX.S..Y"
    gamma = exercise.EXERCISES["2.3"].right
    table = exact(Gridworld(parse_map(text)).mdp, TimeAxis(gamma, 4))
    assert table.solution.tied[0].tolist() == [False, False, True, True]
