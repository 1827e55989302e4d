"""What else is read of a step than its reward."""

import gymnasium as gym
import numpy as np
import pytest

from trdlab.environments import GymEnvironments, Step
from trdlab.environments.outcomes import Outcomes, check_parts
from trdlab.errors import InputError
from trdlab.gridworld import Gridworld, load_map
from trdlab.tabular.episodes import ModelEnvironments


def step(*infos: dict, rewards: tuple[float, ...] = (1.0, 0.0)) -> Step:
    """What two environments led to."""
    no = np.zeros(2, dtype=np.bool_)
    seen = np.zeros((2, 3))
    return Step(seen, np.array(rewards), no, ~no, no, seen, info=lambda env: infos[env])


def read(given: dict, *infos: dict) -> list[list[float]]:
    return Outcomes(given).read(np.array([4, 5]), step(*infos), np.array([0, 1])).tolist()


def test_functions_see_what_a_step_led_to():
    given = {
        "paid": lambda of: of.reward > 0.0,
        "cut": lambda of: of.truncated,
        "action": lambda of: of.action,
        "told": lambda of: of.info["x"] + of.observation.sum(),
    }
    assert read(given, {"x": 2}, {"x": 3}) == [[1.0, 1.0, 4.0, 2.0], [0.0, 1.0, 5.0, 3.0]]


def test_numbers_are_found_in_info_by_name_and_by_place():
    given = {"fuel": "info.fuel", "coin": "info.parts.coin", "second": "info.vector.1"}
    first = {"fuel": 0.5, "parts": {"coin": 1.0}, "vector": np.array([7.0, 8.0])}
    assert read(given, first, {"fuel": np.float32(0.25)}) == [[0.5, 1.0, 8.0], [0.25, 0.0, 0.0]]


def test_what_no_step_has_told_is_named_with_what_was_there():
    outcomes = Outcomes({"fuel": "info.fule"})
    outcomes.read(np.array([0, 0]), step({"fuel": 1.0}, {}), np.array([0, 1]))
    with pytest.raises(InputError, match=r"no step had that\. Did you mean 'info\.fuel'\?"):
        outcomes.check_seen()
    silent = Outcomes({"fuel": "info.fuel"})
    silent.read(np.array([0, 0]), step({}, {}), np.array([0, 1]))
    with pytest.raises(InputError, match=r"Its environment told nothing else"):
        silent.check_seen()


@pytest.mark.parametrize("what", ["fuel", "info.", 3, None])
def test_what_is_no_outcome_is_refused(what: object):
    with pytest.raises(InputError, match=r"Give a function of a step, a place such as info"):
        Outcomes({"fuel": what})  # type: ignore[dict-item]


@pytest.mark.parametrize("value", [float("nan"), "much", None])
def test_what_is_no_number_is_named(value: object):
    with pytest.raises(InputError, match=r"The outcome 'fuel' is .* at a step\."):
        read({"fuel": lambda of: value}, {}, {})


def test_parts_have_to_add_up():
    parts, are_steps = np.array([[1.0, -0.1], [0.0, -0.1]]), np.array([True, True])
    check_parts(["coin", "step"], parts, np.array([0.9, -0.1]), are_steps)
    wrong = r"coin 0 \+ step -0\.1 = -0\.1, and the reward is 2 \(1 of 2 steps\)"
    with pytest.raises(InputError, match=wrong):
        check_parts(["coin", "step"], parts, np.array([0.9, 2.0]), are_steps)


def test_environments_tell_their_info_and_models_the_parts_of_their_rewards():
    environments = GymEnvironments("trdlab.envs:trdlab/DroneGridworld-v0", 2, seed=0)
    environments.reset()
    told = environments.step(np.array([1, 0]))
    assert told.info(0)["parts"] == {"coin": 0.0, "treasure": 0.0}
    assert (told.info(0)["row"], told.info(1)["row"]) == (2, 0)
    world = Gridworld(load_map("drone"))
    model = ModelEnvironments(world.mdp, 3, seed=0, parts=world.parts)
    model.reset()
    for _ in range(30):
        after = model.step(np.random.default_rng(0).integers(4, size=3))
        paid = [sum(after.info(env)["parts"].values()) for env in range(3)]
        np.testing.assert_allclose(paid, after.rewards)


class Silent(gym.Env):
    """It answers with no info at all, as some do."""

    observation_space = gym.spaces.Box(0.0, 1.0, (1,))
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action):
        return np.zeros(1, dtype=np.float32), 1.0, False, False, None


def test_an_environment_may_tell_nothing():
    environments = GymEnvironments(Silent, 1, seed=0)
    environments.reset()
    assert environments.step(np.array([0])).info(0) == {}
