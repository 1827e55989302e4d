"""The trials of a blind reading tell the truth, and nothing that gives the map away."""

import re

import numpy as np
import pytest

from trdlab.errors import InputError
from trdlab.study import candidates
from trdlab.study.candidates import CANDIDATES, LETTERS, TIME_AXIS, solved, visited, worth_by_source
from trdlab.study.trials import Trial, draw_trials
from trdlab.tabular import exact

NAMING = re.compile(
    r"coin|treasure|hazard|wall|\bmap\b|\brow\b|column|\bup\b|\bdown\b|\bleft\b|\bright\b", re.I
)


def words(trial: Trial) -> str:
    return " ".join(told for heading, texts in trial.parts for told in (heading, *texts))


@pytest.mark.parametrize("seed", range(3))
def test_texts_name_neither_the_map_nor_the_actions(seed: int):
    for trial in draw_trials(seed):
        assert not NAMING.search(words(trial))
        assert set(re.findall(r"[Aa]ction (\w+)", words(trial))) <= set("PQRS")
        assert trial.promise
        assert trial.against


@pytest.mark.parametrize("count", [3, 12, 30])
def test_each_agent_comes_up_as_often_and_each_state_once(count: int):
    trials = draw_trials(5, count)
    letters = [trial.letter for trial in trials]
    assert {letter: letters.count(letter) for letter in LETTERS} == dict.fromkeys("ABC", count // 3)
    assert len({trial.reason for trial in trials}) == count


def test_a_seed_gives_the_same_trials_and_another_one_others():
    assert draw_trials(1) == draw_trials(1)
    assert draw_trials(1) != draw_trials(2)
    drawn = [draw_trials(seed, 6) for seed in range(4)]
    assert len({"".join(trial.letter for trial in trials) for trials in drawn}) > 2
    assert len({trial.action for trials in drawn for trial in trials}) > 2


@pytest.mark.parametrize("count", [0, 4, 33, -3])
def test_counts_that_do_not_divide_are_refused(count: int):
    with pytest.raises(InputError, match=rf"There cannot be {count} trials. Give a multiple of 3"):
        draw_trials(0, count)


def test_the_three_agents_behave_as_they_are_described():
    def visits(letter: str, symbol: str) -> float:
        """Returns how often an episode passes a kind of cell."""
        world, _ = solved(letter)
        passed = [
            world.grid.rows[world.states[state].row][world.states[state].column]
            for seed in range(30)
            for state in visited(letter, seed)
        ]
        return passed.count(symbol) / 30

    assert visits("A", "c") > 3.5 > 0.5 > visits("B", "c")
    lengths = {x: np.mean([len(visited(x, seed)) for seed in range(30)]) for x in LETTERS}
    assert lengths["B"] < lengths["C"] < lengths["A"]  # the short way, round hazards, for coins
    assert visits("C", "h") < visits("B", "h")


@pytest.mark.parametrize("letter", LETTERS)
def test_what_sources_add_is_all_there_is(letter: str):
    _, table = solved(letter)
    parts = worth_by_source(letter, 0, 1)
    assert set(parts) == {"coin", "treasure", "hazard"}
    assert sum(parts.values()) == pytest.approx(table.decomposition.value[0, 1], abs=1e-12)


def test_one_source_alone_is_worth_what_it_is_said_to_add():
    world, table = solved("C")
    alone = candidates.Gridworld(
        world.grid.with_value("coin", 0.0).with_value("treasure", 0.0)
    )  # hazards only
    value = exact(alone.mdp, TIME_AXIS, policy=table.solution.policy).decomposition.value
    assert worth_by_source("C", 0, 1)["hazard"] == pytest.approx(value[0, 1], abs=1e-12)


def test_a_single_loss_costs_more_than_there_is_to_earn():
    last = CANDIDATES[-1].rewards
    assert -last["hazard"] > 4 * last["coin"] + last["treasure"]


def test_there_is_no_fourth_agent():
    with pytest.raises(InputError, match=r"There is no agent 'D'. Known: A, B, C."):
        candidates.candidate_of("D")
