"""The choice: worth what was drawn, whoever faces it, and taken for the agent's own reason."""

import numpy as np
import pytest

from trdlab.study.candidates import LETTERS
from trdlab.study.crossroads import (
    LATE,
    SOON,
    TIME_AXIS,
    Event,
    Way,
    draw_ways,
    draw_worths,
    model,
    worth_of,
)
from trdlab.tabular import exact

SEEDS = range(20)


def drawn(letter: str, seed: int) -> tuple[np.ndarray, tuple[Way, ...]]:
    rng = np.random.default_rng(seed)
    worths = draw_worths(rng)
    return worths, draw_ways(letter, worths, rng)


def danger(way: Way) -> float:
    """Returns the cost that is expected of a way, discounted."""
    return -sum(worth_of({k: event}) for k, event in way.items() if event.amount < 0.0)


def test_a_way_is_walked_as_it_is_drawn():
    coin = {0: Event(2.0, 1.0), 2: Event(-4.0, 0.25)}
    table = exact(model((coin, {1: Event(1.0, 0.5)}, {0: Event(3.0, 1.0)}, coin)), TIME_AXIS)
    first, second, third, last = table.decomposition.components[0]
    assert first[:4] == pytest.approx([2.0, 0.0, -(0.95**2), 0.0])
    assert second[:3] == pytest.approx([0.0, 0.475, 0.0])
    assert third.tolist() == [3.0, *[0.0] * 16]
    assert (first == last).all()


@pytest.mark.parametrize("letter", LETTERS)
def test_ways_are_worth_what_was_drawn_before_anything_was_known_of_the_agent(letter: str):
    for seed in SEEDS:
        worths, ways = drawn(letter, seed)
        assert worths == pytest.approx(drawn("A", seed)[0])
        assert exact(model(ways), TIME_AXIS).decomposition.value[0] == pytest.approx(worths)
        assert (np.diff(worths) < 0.0).all()
        assert all(0.0 < event.chance <= 1.0 for way in ways for event in way.values())


@pytest.mark.parametrize(("letter", "times"), [("A", {*SOON}), ("B", {*LATE})])
def test_a_and_b_take_the_larger_risk_for_what_comes_soon_or_late(letter: str, times: set[int]):
    for seed in SEEDS:
        _, (taken, other, *_) = drawn(letter, seed)
        assert {k for k, event in taken.items() if event.amount > 0.0} <= times
        assert danger(taken) >= 2.0 * danger(other)


def test_c_takes_the_smaller_risk_and_would_do_otherwise_were_there_none():
    for seed in SEEDS:
        worths, (taken, other, *_) = drawn("C", seed)
        assert 6.0 * danger(taken) <= danger(other)
        assert worths[0] + danger(taken) < worths[1] + danger(other)
