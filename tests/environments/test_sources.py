"""Environments from an id, an instance, or a function; and those that answer as none should."""

import sys
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils import EzPickle

from trdlab.environments import (
    GymEnvironments,
    NotCopyable,
    NotParallel,
    in_batches,
    make_environment,
)
from trdlab.errors import InputError


class Ten(gym.Env):
    """Ten steps; action 1 pays `pays`, and the first observation is drawn."""

    observation_space = gym.spaces.Box(-9, 99, (2,), np.float32)
    action_space = gym.spaces.Discrete(2)
    pays, closed = 1.0, False

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t, self.start = 0, self.np_random.random()
        return self.seen(), {}

    def step(self, action):
        self.t += 1
        return self.seen(), self.pays * float(action), self.t >= 10, False, {}

    def seen(self):
        return np.array([self.t, self.start], np.float32)

    def close(self):
        self.closed = True


def rewards(environments: GymEnvironments) -> list[float]:
    environments.reset()
    return environments.step(np.ones(environments.num_envs, dtype=np.int64)).rewards.tolist()


def test_ids_specifications_functions_and_instances_give_the_same_environments():
    given = ["CartPole-v1", gym.spec("CartPole-v1"), partial(gym.make, "CartPole-v1")]
    given += [gym.make("CartPole-v1"), gym.make("CartPole-v1", disable_env_checker=True)]
    every = [GymEnvironments(env, 2, seed=3) for env in given]
    firsts = [environments.reset() for environments in every]
    seconds = [environments.step(np.array([0, 1])).frames for environments in every]
    for frames in (firsts, seconds):
        assert all(np.array_equal(some, frames[0]) for some in frames)
    assert {environments.time_limit for environments in every} == {500}
    assert {environments.name for environments in every} == {"CartPole-v1"}


def test_an_instance_is_copied_with_what_was_set_in_it_and_left_open():
    class Ours(Ten):
        pass

    env = Ours()
    env.pays = 3.0
    environments = GymEnvironments(env, 3, seed=0)
    assert environments.name == "Ours"
    assert rewards(environments) == [3.0, 3.0, 3.0]
    environments.close()
    assert not env.closed
    assert rewards(GymEnvironments(env, 1, seed=0)) == [3.0]


def test_where_a_copy_forgets_what_was_set_the_instance_itself_is_played():
    class Forgets(Ten, EzPickle):
        def __init__(self):
            EzPickle.__init__(self)

    env = Forgets()
    assert rewards(GymEnvironments(env, 2, seed=0)) == [1.0, 1.0]  # nothing was set
    env.pays = 3.0
    one = GymEnvironments(env, 1, seed=0)
    assert rewards(one) == [3.0]
    with pytest.raises(NotCopyable, match=r"Forgets cannot be copied.*at a time"):
        one.branch(np.array([0]), seed=0)
    with pytest.raises(NotParallel, match=r"There can be 1 of Forgets at a time.*it is in use"):
        GymEnvironments(env, 2, seed=0)
    batches = in_batches(lambda count, seed: GymEnvironments(env, count, seed=seed), 2, seed=0)
    assert [rewards(environments) for environments in batches] == [[3.0], [3.0]]
    assert not env.closed


class Port(Ten):
    """One at a time."""

    held = False

    def __init__(self):
        if Port.held:
            raise RuntimeError("the port is in use")
        Port.held = True

    def close(self):
        Port.held = False


def test_one_at_a_time_plays_one_after_another():
    def make(count: int, seed: int) -> GymEnvironments:
        return GymEnvironments(Port, count, seed=seed)

    with pytest.raises(NotParallel) as refusal:
        make(3, 0)
    assert str(refusal.value) == (
        "There can be 1 of Port at a time: Port makes no environment (RuntimeError: the port is in "
        "use). Ask for no more."
    )
    assert not Port.held  # the first one was closed again
    starts = [batch.reset()[:, 1].tolist() for batch in in_batches(make, 3, seed=0)]
    assert [len(batch) for batch in starts] == [1, 1, 1]
    assert len({start for (start,) in starts}) == 3
    assert not Port.held
    (together,) = in_batches(lambda count, seed: GymEnvironments(Ten, count, seed=seed), 3, seed=0)
    assert together.num_envs == 3
    one = make(1, 0)
    one.reset()
    with pytest.raises(NotCopyable, match="the port is in use"):
        one.branch(np.array([0]), seed=0)
    with pytest.raises(InputError, match="the port is in use") as refused:
        make(1, 0)
    assert not isinstance(refused.value, NotParallel)  # there is nothing to play one after another
    one.close()


def broken():
    raise ZeroDivisionError("division by zero")


@pytest.mark.parametrize(
    ("env", "message"),
    [
        (7, "This int is no environment: it has no reset and no step and no close and no"),
        (gym.spaces.Discrete(2), "This Discrete is no environment: it has no reset and no step"),
        (lambda: "Ten", "This str is no environment: it has no reset"),
        (broken, "broken makes no environment (ZeroDivisionError: division by zero)"),
        (lambda size: Ten(), "missing 1 required positional argument: 'size')"),
        (
            partial(gym.make_vec, "CartPole-v1", 3),
            "This CartPoleVectorEnv is 3 environments",
        ),
        (partial(gym.make, "Pendulum-v1"), "The action space of Pendulum-v1 is Box(-2.0, 2.0"),
        (gym.make("Pendulum-v1"), "The action space of Pendulum-v1 is Box(-2.0, 2.0"),
    ],
)
def test_what_is_no_environment_is_refused_by_what_is_missing(env, message):
    with pytest.raises(InputError) as refusal:
        GymEnvironments(env, seed=0)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_function_must_make_a_new_one():
    env = Ten()
    with pytest.raises(NotParallel, match="returns the same environment again"):
        GymEnvironments(lambda: env, 2, seed=0)
    with pytest.raises(InputError, match="The arguments size are for an environment made by its"):
        GymEnvironments(Ten, seed=0, env_arguments={"size": 3})


def test_whatever_a_constructor_raises_is_told(monkeypatch):
    spec = gym.envs.registration.EnvSpec("Broken-v0", broken)
    monkeypatch.setitem(gym.registry, "Broken-v0", spec)
    with pytest.raises(InputError, match=r"Broken-v0 cannot be made \(ZeroDivisionError: division"):
        make_environment("Broken-v0")


class OldStep(Ten):
    def step(self, action):
        seen, paid, over, _, info = super().step(action)
        return seen, paid, over, info


class OldReset(Ten):
    def reset(self):
        super().reset()
        return self.seen()


class OldAnswer(Ten):
    """Its two numbers could be taken for an observation and `info`."""

    def reset(self, *, seed=None, options=None):
        return super().reset(seed=seed)[0]


class ArrayReward(Ten):
    def step(self, action):
        seen, paid, *rest = super().step(action)
        return seen, np.array([paid]), *rest


class NoReward(ArrayReward):
    pays = None

    def step(self, action):
        return self.seen(), None, False, False, {}


class Buggy(Ten):
    def step(self, action):
        first, second = (1, 2, 3)
        raise AssertionError(first, second)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (OldStep, "does not return five values (not enough values to unpack (expected 5, got 4))."),
        (OldReset, "OldReset.reset() of OldReset takes no seed. Write reset(self, *, seed=None"),
        (OldAnswer, "OldAnswer.reset() returns one ndarray. Return observation, info"),
        (ArrayReward, "The reward of ArrayReward is no number: array([1.]). Return one number"),
        (NoReward, "The reward of NoReward is no number: None."),
    ],
)
@pytest.mark.parametrize("wrapped", [False, True])
def test_old_ways_of_answering_are_refused_in_one_line_with_the_cure(kind, message, wrapped):
    make = (lambda: gym.wrappers.TimeLimit(kind(), 5)) if wrapped else kind
    with pytest.raises(InputError) as refusal:
        rewards(GymEnvironments(make, seed=0))
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_what_goes_wrong_in_an_environment_is_not_taken_for_an_old_way():
    with pytest.raises(ValueError, match="too many values to unpack") as failure:
        rewards(GymEnvironments(Buggy, seed=0))
    assert not isinstance(failure.value, InputError)


class Chatty(Ten):
    def __init__(self):
        print("made")

    def reset(self, *, seed=None, options=None):
        print("new episode")
        return super().reset(seed=seed)

    def step(self, action):
        sys.stdout.write("step\n")
        return super().step(action)

    def close(self):
        print("closed")


def test_what_environments_print_goes_to_stderr(capsys):
    environments = GymEnvironments(Chatty, 2, seed=0)
    environments.reset()
    environments.step(np.array([0, 0]))
    environments.load_state_dict(environments.state_dict())
    environments.branch(np.array([0]), seed=0).close()
    environments.close()
    GymEnvironments(Chatty(), seed=0)
    said = capsys.readouterr()
    assert said.out == "made\n"  # by the test itself
    assert {"made", "new episode", "step", "closed"} == set(said.err.split("\n")) - {""}


def test_those_that_are_not_active_are_left_alone():
    environments, alone = (GymEnvironments(Ten, 3, seed=0) for _ in range(2))
    environments.reset()
    alone.reset()
    active = np.array([True, False, True])
    for step in range(12):
        told = environments.step(np.ones(3, dtype=np.int64), active)
        expected = alone.step(np.ones(3, dtype=np.int64))
        assert told.rewards.tolist() == [1.0, 0.0, 1.0]
        assert told.terminated.tolist() == [step == 9, False, step == 9]
        for name in ("frames", "following"):
            of, by = getattr(told, name), getattr(expected, name)
            np.testing.assert_array_equal(of[active], by[active])
    assert environments.state_dict()["lengths"].tolist() == [2, 0, 2]
