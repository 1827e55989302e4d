"""Rewards of one's own, in games."""

import numpy as np

from trdlab.atari import AtariEnvironments
from trdlab.environments.paying import paying
from trdlab.environments.screens import screened


def test_lost_lives_can_pay_in_a_game():
    game = AtariEnvironments("Breakout", 1, seed=0)
    lost = []
    game.reset()
    for _ in range(300):
        step = game.step(np.array([0]))
        lost.append(bool(step.life_lost[0] or step.terminated[0]))
    paid = paying(AtariEnvironments("Breakout", 1, seed=0), {"life_lost": -5})
    paid.reset()
    own = [float(paid.step(np.array([0])).rewards[0]) for _ in range(300)]
    assert own == [-5.0 * it for it in lost]
    assert any(lost)


def test_where_people_look_on_they_are_paid_the_same():
    game = screened(paying(AtariEnvironments("Pong", 1, seed=0), {"step": -3.0}))
    game.reset()
    assert game.step(np.array([0])).rewards.tolist() == [-3.0]
    assert game.screens.shape == (1, 210, 160, 3)
