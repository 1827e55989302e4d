"""The lessons run as a new user runs them, and their exercises know right from wrong."""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from trdlab.bellman import target
from trdlab.decomposition import TimeAxis
from trdlab.gridworld import Gridworld, load_map, parse_map
from trdlab.tabular import MDP, WindowBuilder, exact, learn
from trdlab.teach import check
from trdlab.teach.checking import EXERCISES

pytest.importorskip("nbclient")
ROOT = Path(__file__).parents[1]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(ROOT / "docs")
    import lesson as lessons
    import notebooks

LESSONS = notebooks.lessons()

# What a reader who understood would answer. Found by solving, not taken from the exercises.
SOLUTIONS: dict[str, Any] = {
    "1.1": 1.62 / 0.81,
    "1.2": list(TimeAxis(0.95, horizon=3, width=2).steps(1)),
    "1.3": 4.327,
    "2.1": target(np.float64(0.5), np.float64(0.5), np.array([1.0, 2.0, 4.0])),
    "2.2": TimeAxis(0.95, horizon=30).regrouped(5).num_components,
    "2.3": 0.9,
    "3.1": np.array([0, 2, 4]) / 2 + target(1.0, 0.5, np.array([2.0, 2.0, 4.0])) / 2,
    "3.2": 10,
    "3.3": np.std([4, 0, 0, 0]),
    "4.1": [2, 1, 1, 1],
    "4.2": [2, 4],
    "4.3": (1 - 0.2 + 0.2 / 4) ** 2,
    "5.1": 6 * (40 + 1),
    "5.2": 10 * 250 * 4,
    "5.3": sum((a - b) ** 2 for a, b in zip([4, 0.5, 2.5], [4, 1, 1], strict=True)),
    "6.1": next(k for k in range(9) if abs(0.9**k - 0.81) < 1e-9),
    "6.2": [4, 0.5 * 1, 0.5 * (2 + 6)],
    "6.3": 1,
    "7.1": 1 - sum([0.1, 0.2, 0.3]),
    "7.2": 0.405 / 0.9**2,
    "7.3": 0.1 * 1 / 2,
    "7.4": [0.6, 0.5, 0.3, -0.1, 0.2, 0.1].index(-0.1) - 1,
    "8.1": 1 - 25 / 100,
    "8.2": 0.368,
    "9.1": 0.9**2 * 0.6 - 0.9**2 * 0.5,
    "9.2": 0.03,
    "9.3": -0.2,
    "9.4": [3],
}


def exercises_of(lesson: Path) -> list[str]:
    return [name for name in EXERCISES if name.startswith(f"{int(lesson.name[:2])}.")]


@cache
def outputs_of(lesson: Path) -> list[list[Any]]:
    """Returns what came of each code cell, run once for all tests and for the documentation."""
    if "stable_baselines3" in lesson.read_text(encoding="utf-8"):
        pytest.importorskip("stable_baselines3", reason="needs pip install 'trdlab[interop]'")
    ran = lessons.lesson_run(lesson, ROOT / ".cache" / "docs")
    return [cell.outputs for cell in ran.cells if cell.cell_type == "code"]


def printed_by(lesson: Path) -> str:
    return "".join(map(lessons.printed, outputs_of(lesson)))


def test_lessons_are_found() -> None:
    assert [lesson.stem for lesson in LESSONS] == [
        "01_read_a_reward_vector",
        "02_derive_it",
        "03_learn_it",
        "04_why_the_sum_fails",
        "05_from_pixels",
        "06_debug_an_agent",
        "07_explain_your_own",
        "08_from_a_teacher",
        "09_which_pixels",
    ]


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_a_notebook_is_what_its_script_gives_now(lesson: Path) -> None:
    """If this fails, run `python docs/notebooks.py`."""
    committed = notebooks.NOTEBOOKS / f"{lesson.stem}.ipynb"
    assert committed.read_text(encoding="utf-8") == notebooks.written(lesson)


def test_no_notebook_is_without_a_lesson() -> None:
    assert {path.stem for path in notebooks.NOTEBOOKS.iterdir()} == {of.stem for of in LESSONS}


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_a_lesson_has_a_goal_a_time_a_formula_and_an_open_question(lesson: Path) -> None:
    source = lesson.read_text(encoding="utf-8")
    first = next(notebooks.split_cells(source)).text
    assert re.findall(r"\*\*(Goal|Before it|Time):\*\*", first) == ["Goal", "Before it", "Time"]
    assert "on two cores." in " ".join(first.split())
    titles = re.findall(r"^# > \*\*(.+?)\.\*\*", source, re.MULTILINE)
    assert titles == ["The formula", "An open question"]


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_lesson_runs_unanswered(lesson: Path) -> None:
    unanswered = re.findall(r"Exercise (\S+): not answered yet", printed_by(lesson))
    assert unanswered == exercises_of(lesson)


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_a_notebook_shows_each_figure_once_and_nothing_else_beside_it(lesson: Path) -> None:
    drawn = [lessons.figures(outputs) for outputs in outputs_of(lesson)]
    everything = [figure for figures in drawn for figure in figures]
    assert len(set(everything)) == len(everything)
    for outputs, figures in zip(outputs_of(lesson), drawn, strict=True):
        values = [of.data for of in outputs if of.output_type == "execute_result"]
        assert not figures or all("image/svg+xml" in value for value in values)


@pytest.mark.parametrize("name", EXERCISES)
def test_an_exercise_accepts_the_solution(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    check(name, SOLUTIONS[name])
    assert capsys.readouterr().out == f"Exercise {name}: right.\n"


@pytest.mark.parametrize("lesson", LESSONS[:2], ids=lambda lesson: lesson.stem)
def test_a_script_prints_what_its_notebook_prints(lesson: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(lesson)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == printed_by(lesson)


def test_first_lesson_shows_the_numbers_of_the_paper() -> None:
    for line in (
        "Q(up)   = 3.26",
        "Q(down) = 3.52",
        "up   [0.   0.   0.   0.   3.26]",
        "down [0.   0.95 0.9  0.86 0.81]",
        "up    [0.   0.   3.26]",
        "down  [0.95 1.76 0.81]",
    ):
        assert f"\n{line}\n" in printed_by(LESSONS[0])


def test_second_lesson_finds_no_deviation() -> None:
    assert "False" not in printed_by(LESSONS[1])


def test_third_lesson_learns_what_is_exact() -> None:
    for line in (
        "after flight 5: [0.   0.95 0.9  0.86 0.81]",
        "up   [0.    0.    0.    0.    3.258]",
        "largest error anywhere: 0.0",
    ):
        assert f"\n{line}\n" in f"\n{printed_by(LESSONS[2])}"


def test_fourth_lesson_says_what_its_numbers_show() -> None:
    printed = printed_by(LESSONS[3])
    assert printed.count("sum 3.52\n") == 4  # the exact vector and three wrong ones
    for line in (
        "1 step(s) later [0.95  1.76  3.022] sum 5.732",
        "w = 2, ε = 0: no bias.",
        "greedy tails    [0.95  1.76  0.815]",
        "left out: 7.5% of all windows",
    ):
        assert f"\n{line}\n" in printed


def test_fifth_lesson_learns_from_pixels_what_is_exact() -> None:
    """The lesson itself asserts that no component of any state and action is off by 0.05."""
    rows = re.findall(r"^ *\d+ +(\d+)((?: +[\d.]+){5})$", printed_by(LESSONS[4]), re.MULTILINE)
    errors = np.array([row.split() for _, row in rows], dtype=float)
    optimal = [flight == "4" for flight, _ in rows]
    assert optimal[-1]
    assert errors[-1].max() < 0.05
    assert any(best and row.max() > 1.0 for best, row in zip(optimal, errors, strict=True))


def test_sixth_lesson_names_each_planted_fault_and_no_other() -> None:
    """From five logs: the done-when of the lesson. Dora is the healthy one."""
    printed = printed_by(LESSONS[5])
    row = r"^ +\d +mistimed +discount-off +end-ignored +none$"
    assert len(re.findall(row, printed, re.MULTILINE)) == 5
    for name in ("Ada", "Ben", "Cleo"):
        assert f"{name}, repaired: none" in printed


def test_sixth_lesson_reads_to_a_student_what_is_wrong() -> None:
    reports = {
        name: " ".join(text.split())
        for name, text in re.findall(
            r"^(\w+)'s report says:\n((?:  .*\n)+)", printed_by(LESSONS[5]), re.MULTILINE
        )
    }
    assert "The agent expects rewards 1 step too early." in reports["Ada"]
    assert "counts 0.947 times as much; it should be 0.90" in reports["Ben"]
    assert "The agent ignores where episodes end" in reports["Cleo"]
    complaints = ("too early", "too late", "it should be", "ignores", "times what comes")
    named = {name: [x for x in complaints if x in text] for name, text in reports.items()}
    assert named["Emil"] == ["times what comes"]
    assert not named["Dora"]
    assert (
        "For everything that comes, the agent's forecasts are better than a guess."
        in reports["Dora"]
    )


def test_seventh_lesson_says_what_its_numbers_show() -> None:
    printed = printed_by(LESSONS[6])

    def numbers(pattern: str) -> list[float]:
        found = re.search(pattern, printed, re.MULTILINE)
        assert found is not None
        return [float(number) for number in found.groups()]

    assert numbers(r"draws: +\d+ \(\d+ to (\d+)\)") < numbers(r"likeliest: +\d+ \((\d+) to \d+\)")
    assert "For what comes 1 to 29 steps later (0.02 to 0.58 s), the agent's forecasts" in printed
    assert "Its own critic is wrong" in printed
    steps, worst, before, after = numbers(
        r"The game has (\d+) steps\.\nStep (\d+): (\d+) before the draw, (\d+) after it\."
    )
    assert steps - 15 < worst < steps
    assert after < 0.7 * before
    lost, well = re.findall(r"^Tried out\n((?:  .*\n)+)", printed, re.MULTILINE)
    assert re.search(r"When tried, .*the forecast, \S+, fits\.", " ".join(lost.split()))
    assert "too few to tell whether" in " ".join(well.split())

    fall, lasted = numbers(r"^Tested for (\d+) steps\. The game was over after (\d+)\.$")
    (running,) = numbers(r"^Tested for (\d+) steps\.$")
    assert lasted == steps - worst <= fall < running
    for name in ("left", "right"):
        fallen, over = numbers(rf"{name}: fallen in .* steps (\S+), no longer running (\S+)$")
        assert abs(fallen - over) < 0.15

    row = r" +(\d+)" + r" +(-?\d\.\d\d)" * 3 + r" +t\+(\d+)$"
    hasty, fitted = numbers("^ hasty" + row), numbers("^fitted" + row)
    assert hasty[0] == fitted[0]
    assert all(good > bad for good, bad in zip(fitted[1:-1], hasty[1:-1], strict=True))
    assert (hasty[-1], fitted[-1]) == (0.0, 29.0)
    copies, stumbling = (
        re.findall(r"\d+", games) for games in re.findall(r": games of (.+) steps", printed)
    )
    assert len(set(copies)) == 1
    assert len(set(stumbling)) > 5


def test_eighth_lesson_learns_the_policy_and_then_what_comes_of_it() -> None:
    printed = printed_by(LESSONS[7])
    teacher, student = re.findall(r"^The (?:teacher|student): (-\d+) ", printed, re.MULTILINE)
    assert abs(int(teacher) - int(student)) < 20
    row = r"^ +{} +(\d\.\d\d) +(\d\.\d\d) +t\+9$"
    [joint] = re.findall(row.format("with the policy"), printed, re.MULTILINE)
    [fitted] = re.findall(row.format("afterwards"), printed, re.MULTILINE)
    assert all(float(late) > float(early) for late, early in zip(fitted, joint, strict=True))


def test_ninth_lesson_says_what_its_numbers_show() -> None:
    printed = printed_by(LESSONS[8])

    def column(table: int, entry: str) -> tuple[float, ...]:
        row = rf"^ *{entry} +(-?\d\.\d{{3}}) +(-?\d\.\d{{3}})$"
        near_and_far = re.findall(row, printed, re.MULTILINE)[table]
        return tuple(map(float, near_and_far))

    hiding, pushing, walking, of_network, added = range(5)
    assert column(pushing, "belt 1") == (0.0, 0.0)
    assert column(pushing, "belt 5") == (0.0, 0.590)
    assert column(walking, "belt 1") == (0.225, 0.0)
    assert column(walking, "belt 5") == (0.0, -0.118)
    others = [f"belt {k}" for k in (0, 2, 3, 4, 6, 7)] + ["noise 0", "noise 1"]
    for table, most in ((hiding, 0.0), (of_network, 0.06), (added, 0.06)):
        assert column(table, "belt 1")[0] > 0.15
        assert column(table, "belt 5")[1] < -0.08
        assert all(abs(of) <= most for entry in others for of in column(table, entry))

    sums = re.findall(r" = (\S+)\n +all entries add (\S+)$", printed, re.MULTILINE)
    assert len(sums) == 4
    for difference, total in sums:
        assert abs(float(difference) - float(total)) < 0.002

    found = re.findall(r"(near|far): new weights (\w+) \(.*\), hiding (\w+) \((.*)\)", printed)
    gradcam, hirescam = found[:2], found[2:]
    assert [of[1:3] for of in gradcam] == [("good", "bad")] * 2
    assert all(float(of[3]) < 0.0 for of in gradcam)
    assert [of[1:3] for of in hirescam] == [("good", "good")] * 2
    of_the_belt = printed[: printed.index("near: new weights")]
    assert "Do not believe" in of_the_belt  # a false alarm: the lesson says why


def test_solution_of_the_treasure_makes_both_routes_equal() -> None:
    grid = load_map("drone").with_value("treasure", EXERCISES["1.3"].right)
    up, down = exact(Gridworld(grid).mdp, TimeAxis(0.95, 4)).decomposition.value[0, :2]
    assert np.isclose(up, down)


def test_solution_of_the_corridor_ties_both_sides() -> None:
    text = "X = coin 18 terminal\nY = treasure 20 terminal\n---\nX.S..Y"
    gamma = EXERCISES["2.3"].right
    table = exact(Gridworld(parse_map(text)).mdp, TimeAxis(gamma, 4))
    assert table.solution.tied[0].tolist() == [False, False, True, True]


def test_solution_of_the_corridor_counts_the_flights_of_the_news() -> None:
    vectors, flights = np.zeros((11, 5)), 0
    while not vectors[0].any():
        flights += 1
        for step in range(10):
            following = vectors[step + 1].copy()
            vectors[step] = target(float(step == 9), 0.9 * (step < 9), following)
    assert flights == EXERCISES["3.2"].right


def test_solution_of_the_sum_is_where_such_a_learner_ends() -> None:
    five = MDP.from_transitions([[[(1.0, 0, 5.0, True)]]])
    begin = np.array([[[1.0, 0.0, 0.0, 0.0]]])
    learned = learn(five, TimeAxis(0.9, 3), loss="sum", initial=begin, agent_steps=500_000)
    ends = learned.decomposition.components[0, 0]
    np.testing.assert_allclose(ends, EXERCISES["4.1"].right, atol=1e-3)


def test_solution_of_the_windows_is_what_the_builder_finds() -> None:
    found = []
    for ending in ("truncated", "terminated"):
        builder, count = WindowBuilder(3, 0.9, 1), 0
        for step in range(4):
            ends = [[step == 3 and ending == kind] for kind in ("terminated", "truncated")]
            count += len(builder.add([step], [0], [1.0], *ends, [step + 1]))
        found.append(count)
    assert found == EXERCISES["4.2"].right
