"""Runs on a terminal: what is shown is what is known, in 80 columns, with or without UTF-8."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.text import Text

from trdlab.deep.settings import TrainSettings
from trdlab.rollouts.evaluation import Evaluation
from trdlab.runs import RunSummary
from trdlab.show.text import plain_ascii
from trdlab.show.training import (
    best_line,
    chance_line,
    duration,
    evaluation_page,
    longer_line,
    memory_line,
    plan_page,
    runs_page,
)
from trdlab.training.setup import Plan

CART = TrainSettings("gym", "CartPole-v1", horizon=40)


def words(page: Text, width: int = 80) -> str:
    assert max(map(len, page.plain.splitlines())) <= width
    return " ".join(page.plain.split())


def test_a_plan_shows_a_configuration_that_can_be_used_and_what_it_takes():
    settings = CART.changed({"weights": "/a" * 60, "hidden": [7] * 40})
    plan = Plan(settings, 2_100_000_000, 24_000_000_000, 20_000, 123.4)
    shown = plan_page(plan).plain
    lines, _, rest = shown.partition("\n\n")
    assert tomllib.loads(lines) == settings.to_config()
    assert "Replay memory: up to 2.10 GB, of 24.00 GB that are free." in rest
    assert "Time: about 5.6 hours, at 123 agent steps a second" in rest
    assert "Nothing was written" in rest


def test_a_plan_says_where_its_settings_are_from():
    page = plan_page(Plan(CART, 1, None, 1, 1), "Settings: the preset smoke.")
    lines, _, rest = page.plain.partition("\n\n")
    assert tomllib.loads(lines) == CART.to_config()
    assert rest.startswith("Settings: the preset smoke.\n")


@pytest.mark.parametrize(
    ("returns", "said"),
    [
        ([-200.0] * 20, "Nothing shows that it plays better than chance: random actions reach "),
        ([-200.0] * 19 + [-199.0], "Nothing shows that it plays better than chance: "),
        ([-150.0] * 20, ""),
        ([-190.0, -180.0] * 10, ""),
        ([-150.0, -250.0] * 10, "Nothing shows that it plays better than chance: "),
        ([-210.0] * 20, "It plays worse than chance: random actions reach -200.0 in as many "),
    ],
)
def test_an_agent_that_is_no_better_than_chance_is_told_of(returns, said):
    line = chance_line(evaluation(returns), evaluation([-200.0] * 20, 1.0), "Train longer.")
    assert line.startswith(said)
    assert bool(line) == bool(said) == line.endswith("in as many episodes. Train longer.")


def test_episodes_that_begin_alike_are_compared_with_each_other():
    chance = [float(10 * at) for at in range(20)]  # which differ far more than what was gained
    better = chance_line(evaluation([of + 1.0 for of in chance]), evaluation(chance), "")
    worse = chance_line(evaluation([of - 1.0 for of in chance]), evaluation(chance), "")
    assert (better, worse.split(":")[0]) == ("", "It plays worse than chance")


def test_how_a_longer_run_goes_on():
    assert longer_line(CART, 50) == "It takes 100,000 agent steps now."
    kept = best_line(Path("my runs/a"), 9000, 8000)
    assert kept == (
        "Its score was better at 8,000 agent steps: that checkpoint is kept as 'my runs/a'@best."
    )
    assert best_line(Path("a"), 9000, None) == ""


def test_memory_where_nobody_knows_what_is_free():
    assert memory_line(54_260_000, None) == "Replay memory: up to 54.26 MB."


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.0, "1 second"),
        (1.4, "1 second"),
        (1.6, "2 seconds"),
        (89.4, "89 seconds"),
        (90, "1.5 minutes"),
        (5400, "1.5 hours"),
        (36 * 3600, "1.5 days"),
    ],
)
def test_a_time_as_people_say_it(seconds, said):
    assert duration(seconds) == said


def evaluation(returns: list[float], epsilon: float = 0.0, cut: int = 0) -> Evaluation:
    count = len(returns)
    lengths = np.full(count, 1200)
    return Evaluation(np.array(returns), lengths, np.arange(count) < cut, epsilon, 7)


def test_an_evaluation_in_numbers():
    result = evaluation([480.0, 500.0, 500.0, 500.0], cut=3)
    shown = words(evaluation_page(result))
    assert "4 episodes, greedy, seed 7; raw rewards, undiscounted" in shown
    assert f"mean return 495.0 95 % interval {result.mean.low:.1f} … 500.0" in shown
    assert "interquartile mean 500.0 95 % interval" in shown
    assert "least and most 480.0 … 500.0" in shown
    assert "mean length 1,200.0 agent steps 3 of 4 were cut off" in shown
    at_limit = words(evaluation_page(replace(result, max_steps=1200)))
    assert "3 of 4 were cut off at step 1,200" in at_limit
    elsewhere = words(evaluation_page(replace(result, max_steps=1300)))
    assert "cut off at" not in elsewhere + shown
    assert "cut off" not in words(evaluation_page(evaluation([1.0])))
    assert "greedy, 5.0% random actions," in words(evaluation_page(evaluation([1.0], 0.05)))


def test_episodes_that_are_all_alike_have_no_interval():
    alike = words(evaluation_page(evaluation([10.0, 10.0])))
    assert "mean return 10.0 interquartile mean 10.0 least and most 10.0 … 10.0" in alike
    assert "1 episode, greedy" in words(evaluation_page(evaluation([1.0])))


@pytest.mark.parametrize(
    ("returns", "mean"),
    [
        ([0.0, 1.0, 1.0, 1.0], "0.75"),
        ([-21.0, -20.0], "-20.5"),
        ([0.0, 0.0], "0.00"),
        ([0.002, 0.004], "0.00300"),
        ([2e6, 4e6], "3.000e+06"),
        ([1500.0, 2500.25], "2,000.1"),
    ],
)
def test_scores_large_and_small(returns, mean):
    assert f"mean return {mean} " in words(evaluation_page(evaluation(returns)))


def summary(name: str = "run", **known: Any) -> RunSummary:
    return RunSummary(Path("runs") / name, **{"config": CART.to_config()} | known)


@pytest.mark.parametrize(
    ("known", "row"),
    [
        ({}, "run CartPole-v1 40 1 0 no checkpoint yet"),
        ({"step": 100_000}, "run CartPole-v1 40 1 100,000 done"),
        (
            {"step": 20_000, "metrics": {"agent_steps": 21_000, "score": 0.25}},
            "run CartPole-v1 40 1 21,000 0.25 stopped at 20,000 of 100,000",
        ),
        (
            {"step": 20_000, "pid": 77, "metrics": {"agent_steps": 1, "score": 195.04}},
            "run CartPole-v1 40 1 20,000 195.0 training (process 77)",
        ),
        ({"pid": 0}, "run CartPole-v1 40 1 0 training"),
        ({"config": {}, "fault": "'x' is torn."}, "run cannot be read run: 'x' is torn."),
        ({"config": {"kind": "gym"}}, "run: Its config.toml does not say 'env'. Add it."),
        (
            {"config": CART.to_config() | {"agent_steps": "many"}},
            "run: Its config.toml has agent_steps = 'many'. It must be a whole number.",
        ),
        ({"metrics": {"score": None, "agent_steps": 5}}, "run CartPole-v1 40 1 5 no checkpoint"),
    ],
)
def test_how_a_run_stands(known, row):
    assert row in words(runs_page([summary(**known)], width=80))


def test_names_are_not_markup_and_any_terminal_can_show_them():
    shown = words(runs_page([summary("[red]…γ"), summary("b", fault="[/]")], width=80))
    assert "[red]…γ" in shown
    assert "[/]" in shown
    for page in (
        runs_page([summary("[red]…γ"), summary("ü")]),
        evaluation_page(evaluation([1.0, 2.0])),
        plan_page(Plan(CART.changed({"env_arg": ["map=ü…"]}), 1, None, 1, 1)),
    ):
        assert plain_ascii(page).plain.isascii()


def test_on_a_narrow_terminal_no_number_is_cut():
    runs = [summary(step=100_000, metrics={"agent_steps": 1, "score": 195.04})]
    shown = words(runs_page(runs, width=24), width=24)
    assert "environment CartPole-v1 N 40 w 1 steps 100,000 score 195.0 status done" in shown
    shown = words(evaluation_page(evaluation([1500.0, 2500.25]), width=24), width=24)
    assert "mean return 2,000.1 95 % interval" in shown
