"""Rewards of one's own."""

import numpy as np
import pytest

from trdlab.agents.naming import find_agent
from trdlab.environments import GymEnvironments
from trdlab.environments.paying import paying
from trdlab.environments.screens import screened
from trdlab.errors import InputError
from trdlab.gridworld.env import GridworldEnv
from trdlab.verbs.making import train


def rewards(environments, steps: int) -> np.ndarray:
    """What random actions are paid `[T, B]`, always the same ones."""
    rng, count = np.random.default_rng(0), environments.num_envs
    environments.reset()
    return np.array(
        [
            environments.step(rng.integers(0, environments.num_actions, count)).rewards
            for _ in range(steps)
        ]
    )


def drones(pays=None, count: int = 2):
    return paying(GymEnvironments(lambda: GridworldEnv("drone"), count, seed=3), pays)


def test_what_is_paid_is_the_weighted_sum():
    as_it_is = rewards(drones(), 60)
    assert as_it_is.any()
    np.testing.assert_array_equal(rewards(drones({"reward": 1}), 60), as_it_is)
    turned = rewards(drones({"reward": -2, "step": 0.5}), 60)
    np.testing.assert_allclose(turned, 0.5 - 2 * as_it_is)


def test_what_the_environment_tells_can_pay():
    paid = rewards(drones({"info.parts.coin": 3.0}), 60)
    as_it_is = rewards(drones(), 60)
    assert set(np.unique(paid)) <= {0.0, 3.0}
    assert (paid > 0).sum() == (as_it_is == 1.0).sum() > 0


def test_copies_pay_the_same_and_idle_ones_nothing():
    environments = drones({"step": -1.0}, 3)
    environments.reset()
    copies = environments.branch(np.array([1, 1]), seed=0)
    assert copies.step(np.array([0, 1])).rewards.tolist() == [-1.0, -1.0]
    idle = environments.step(np.zeros(3, int), np.array([True, False, True])).rewards
    assert idle.tolist() == [-1.0, 0.0, -1.0]


def test_where_people_look_on_they_are_paid_the_same():
    drawn = screened(paying(GymEnvironments("trdlab/DroneGridworld-v0", 1, seed=0), {"step": -3.0}))
    drawn.reset()
    step = drawn.step(np.array([0]))
    assert step.rewards.tolist() == [-3.0]
    assert step.screens is not None


@pytest.mark.parametrize(
    ("pays", "message"),
    [
        ({}, r"What pays is {}. For example: pays={\"reward\":1"),
        (3, "What pays is 3."),
        ({"rewards": 1}, "Nothing called 'rewards' can pay. Did you mean 'reward'?"),
        ({"step": "much"}, "'step' pays 'much'. Give a number."),
        ({"step": float("nan")}, "'step' pays nan. Give a number."),
    ],
)
def test_what_cannot_pay_is_refused(pays, message):
    with pytest.raises(InputError) as refused:
        drones(pays)
    assert message.replace("\\", "") in str(refused.value)


def test_what_is_never_told_is_refused_after_some_episodes():
    with pytest.raises(InputError, match=r"'info.parts.coins' .* no step had that. Did you mean"):
        rewards(drones({"info.parts.coins": 1.0}), 2_000)


def test_a_run_and_its_agent_go_by_what_pays(tmp_path):
    """CartPole pays 1 for each step; here it costs 2."""
    agent = train(
        "CartPole-v1",
        preset="smoke",
        agent_steps=1_200,
        env_arg=['pays={"step":-2}'],
        evaluate_episodes=0,
        out=tmp_path / "run",
    )
    (episode,) = agent.play(1, seed=0)
    assert set(episode.rewards.tolist()) == {-2.0}
    assert agent.evaluate(2).returns.max() < 0.0
    other = find_agent(str(tmp_path / "run"), env="CartPole-v1")
    assert other.evaluate(2).returns.min() > 0.0
