"""Random actions: how often, and for how long."""

import itertools

import numpy as np
import pytest

from trdlab.deep.exploring import Exploring


def drawn(hold: int, epsilon: float, steps: int = 300) -> np.ndarray:
    """Returns `[steps, 500]`, the random actions of 500 environments; −1 where there was none."""
    exploring, rng = Exploring(500, 3, hold), np.random.default_rng(0)
    drawn = (exploring.draw(epsilon, rng) for _ in range(steps))
    return np.array([np.where(explore, actions, -1) for explore, actions in drawn])


@pytest.mark.parametrize("hold", [1, 2, 10])
@pytest.mark.parametrize("epsilon", [0.0, 0.1, 0.5])
def test_epsilon_is_the_share_of_random_steps_however_long_one_is_held(hold, epsilon):
    assert (drawn(hold, epsilon)[50:] >= 0).mean() == pytest.approx(epsilon, abs=0.01)


def test_an_action_is_held_for_one_to_so_many_steps_alike():
    held = drawn(4, 0.01) >= 0  # [steps, 500], so rarely that two seldom touch
    lengths = [
        len(list(steps))
        for env in range(500)
        for random, steps in itertools.groupby(held[:, env])
        if random
    ]
    shares = np.bincount(lengths, minlength=10)[:10] / len(lengths)
    assert shares[1:5] == pytest.approx([0.25] * 4, abs=0.05)
    assert shares[5:].sum() < 0.02


def test_where_all_steps_are_random_they_change_when_one_is_over():
    always = drawn(10, 1.0)
    assert (always >= 0).all()
    changes = (np.diff(always, axis=0) != 0).mean()
    assert changes == pytest.approx(2 / 3 / 5.5, abs=0.01)  # two of three are another action


def test_all_actions_are_drawn_alike():
    counts = np.bincount(drawn(5, 1.0).ravel(), minlength=3)
    assert counts / counts.sum() == pytest.approx([1 / 3] * 3, abs=0.02)


def test_a_single_step_draws_what_it_always_drew():
    """So that older settings are older runs."""
    exploring, rng, same = Exploring(8, 4), np.random.default_rng(3), np.random.default_rng(3)
    for _ in range(10):
        explore, actions = exploring.draw(0.3, rng)
        assert (explore == (same.random(8) < 0.3)).all()
        assert (actions == same.integers(4, size=8)).all()


def test_what_is_held_can_be_taken_up_and_dropped():
    one, rng = Exploring(4, 3, 50), np.random.default_rng(1)
    one.draw(1.0, rng)
    other = Exploring(4, 3, 50)
    other.load_state_dict(one.state_dict())
    for _ in range(5):
        assert (one.draw(0.0, rng)[0] == other.draw(0.0, rng)[0]).all()
    assert (one.actions == other.actions).all()
    one.drop(np.array([True, False, False, True]))
    assert (one.left == 0).tolist() == [True, False, False, True]
