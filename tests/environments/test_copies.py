"""Copies of environments: what is one, and what only looks like one."""

import ctypes
import itertools
import random

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils import EzPickle

from trdlab.environments import GymEnvironments, NotCopyable
from trdlab.errors import TrdlabError


class Clock(gym.Env):
    """Ten steps that are seen; in the last two of them action 1 pays 1."""

    observation_space = gym.spaces.Box(0, 10, (1,), np.float32)
    action_space = gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return self.seen(), {}

    def step(self, action):
        paid = self.paid(action)
        self.t += 1
        return self.seen(), paid, self.t >= 10, False, {}

    def seen(self):
        return np.array([self.t], np.float32)

    def paid(self, action):
        return float(self.t >= 8 and action == 1)


class Pickled(Clock, EzPickle):
    """Its copies are new environments, at the beginning, as Gymnasium's recipe has it."""

    def __init__(self):
        EzPickle.__init__(self)
        self.t = 0


class Blind(Pickled):
    """The same, and nothing of it is seen."""

    def seen(self):
        return np.zeros(1, np.float32)


class Handle(Clock):
    """Holds a pointer of C, which cannot be copied."""

    def __init__(self):
        self.handle = ctypes.pointer(ctypes.c_int(0))


class Entwined(Clock):
    """Its copies move along with it."""

    def __deepcopy__(self, memo):
        twin = Entwined()
        twin.__dict__ = self.__dict__
        return twin


class Forgetful(Handle):
    """Cannot be copied, and has a day of its own at each reset."""

    def reset(self, *, seed=None, options=None):
        self.day = random.SystemRandom().random()
        return super().reset(seed=seed)

    def paid(self, action):
        return self.day


class Coin(Clock):
    """Pays 0 or 1 at each step."""

    def paid(self, action):
        return float(self.toss() < 0.5)


class OwnCoin(Coin):
    def reset(self, *, seed=None, options=None):
        self.rng = np.random.default_rng(seed)
        return super().reset(seed=seed)

    def toss(self):
        return self.rng.random()


class Scattered(Coin):
    """Has three generators in three places, and needs them all."""

    def reset(self, *, seed=None, options=None):
        self.lots = {"a": [np.random.RandomState(seed % 2**32)], "b": Clock()}
        self.lots["b"].coin = random.Random(seed)
        return super().reset(seed=seed)

    def toss(self):
        here = self.np_random.random() + self.lots["a"][0].rand() + self.lots["b"].coin.random()
        return here % 1.0


class Bound(Coin):
    """Keeps the method of a generator only, which deep copies share."""

    def reset(self, *, seed=None, options=None):
        self.toss = np.random.default_rng(seed).random
        return super().reset(seed=seed)


class OfAll(Coin):
    """Uses the generators that all programs share."""

    def toss(self):
        return (np.random.rand() + random.random()) % 1.0  # noqa: NPY002


class Hidden(Coin):
    """Its generator is out of reach."""

    def reset(self, *, seed=None, options=None):
        rng = np.random.default_rng(seed)
        self.tosses = (rng.random() for _ in itertools.count())
        return super().reset(seed=seed)

    def toss(self):
        return next(self.tosses)


class Secret(Clock):
    """Its beginning decides what it pays, and shows nothing of it: no chance after that."""

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.pays = self.np_random.random(10)
        return super().reset()

    def paid(self, action):
        return self.pays[self.t]


def at(env, step: int, num_envs: int = 1) -> GymEnvironments:
    """Returns environments after some steps, in which action 1 and 0 took turns."""
    environments = GymEnvironments(env, num_envs, seed=0)
    environments.reset()
    for t in range(step):
        environments.step(np.full(num_envs, 1 - t % 2))
    return environments


def paid(environments: GymEnvironments, steps: int) -> np.ndarray:
    """Returns `[steps, B]`: what action 1 is paid."""
    ones = np.ones(environments.num_envs, dtype=np.int64)
    return np.array([environments.step(ones).rewards for _ in range(steps)])


@pytest.mark.parametrize("step", [0, 7])
@pytest.mark.parametrize("kind", [Clock, Pickled, Blind, Handle, Entwined])
def test_copies_go_on_from_where_the_environment_is(kind, step):
    environments = at(kind, step)
    copies = environments.branch(np.array([0, 0, 0]), seed=1)
    assert not copies.shared_chance
    expected = [float(step + i in (8, 9)) for i in range(10 - step)]
    assert paid(copies, 10 - step).T.tolist() == [expected] * 3
    assert paid(environments, 10 - step).T.tolist() == [expected]  # which has not moved


def test_each_copy_is_of_the_environment_that_is_asked_for():
    environments = GymEnvironments(Pickled, 2, seed=0)
    environments.reset()
    for _ in range(3):
        environments.step(np.array([0, 0]), active=np.array([False, True]))
    copies = environments.branch(np.array([1, 0, 1]), seed=1)
    assert copies.step(np.array([0, 0, 0])).frames.ravel().tolist() == [4.0, 1.0, 4.0]


class Plugged(Clock):
    """Its deep copies are told from it only when they are closed: they hang on the same plug."""

    def __init__(self):
        self.plug = [True]

    def step(self, action):
        assert self.plug
        return super().step(action)

    def close(self):
        self.plug.clear()

    def __deepcopy__(self, memo):
        twin = Plugged()
        twin.__dict__.update(self.__dict__)
        return twin


def test_copies_can_be_closed():
    environments = at(Plugged, 7)
    environments.branch(np.array([0, 0]), seed=1).close()
    assert paid(environments, 3).ravel().tolist() == [0.0, 1.0, 1.0]


def test_a_copy_that_was_proved_in_the_beginning_is_looked_at_again_later():
    class Late(Clock):
        """Its copies begin again from step 20 on."""

        def step(self, action):
            return *super().step(action)[:2], self.t >= 30, False, {}

        def __deepcopy__(self, memo):
            twin = Late()
            twin.__dict__ = {**self.__dict__, "t": self.t if self.t < 20 else 0}
            return twin

    environments = at(Late, 3)
    for expected in (3, 25):
        while expected > (now := environments.step(np.array([0])).frames[0, 0]):
            pass
        assert environments.branch(np.array([0]), 1).step(np.array([0])).frames[0, 0] == now + 1


@pytest.mark.parametrize("kind", [OwnCoin, Scattered, Bound, OfAll])
def test_copies_have_chance_of_their_own(kind):
    environments, still = at(kind, 2), at(kind, 2)
    copies = environments.branch(np.zeros(200, dtype=np.int64), seed=1)
    assert not copies.shared_chance
    tossed = paid(copies, 8)  # [8, 200]
    assert np.abs(tossed.mean(axis=1) - 0.5).max() < 0.15
    assert len({tuple(row) for row in tossed.T}) > 100  # of 256
    if kind is not OfAll:  # where the copies have taken from what is everybody's
        np.testing.assert_array_equal(paid(environments, 8), paid(still, 8))
        again = at(kind, 2).branch(np.zeros(200, dtype=np.int64), seed=1)
        np.testing.assert_array_equal(paid(again, 8), tossed)


def test_copying_leaves_the_chance_of_all_programs_as_it_was():
    environments = at(OfAll, 2)
    np.random.seed(3)  # noqa: NPY002
    random.seed(3)
    expected = np.random.rand(), random.random()  # noqa: NPY002
    np.random.seed(3)  # noqa: NPY002
    random.seed(3)
    environments.branch(np.array([0]), seed=1)
    assert (np.random.rand(), random.random()) == expected  # noqa: NPY002


def test_copies_that_share_their_chance_say_so():
    environments = at(Hidden, 2)
    copies = environments.branch(np.zeros(5, dtype=np.int64), seed=1)
    assert copies.shared_chance
    assert not environments.shared_chance
    assert not np.ptp(paid(copies, 8), axis=1).any()
    secret = at(Secret, 2).branch(np.zeros(5, dtype=np.int64), seed=1)
    assert not secret.shared_chance  # there is none to share
    for known in ("CartPole-v1", "FrozenLake-v1"):
        assert not at(known, 2).branch(np.array([0]), seed=1).shared_chance


def test_what_has_no_copies_says_why():
    with pytest.raises(NotCopyable) as refusal:
        at(Forgetful, 2).branch(np.array([0]), seed=1)
    assert str(refusal.value) == (
        "Forgetful cannot be copied: No deep copies can be made (ValueError: ctypes objects "
        "containing pointers cannot be pickled). Played again, it did something else. "
        "Judge it without copies of its states."
    )
    with pytest.raises(TrdlabError, match=r"have not begun\. Call reset"):
        GymEnvironments(Handle, seed=0).branch(np.array([0]), seed=1)


def test_box2d_environments_are_copied():
    pytest.importorskip("Box2D")
    lander = GymEnvironments("LunarLander-v3", seed=0)
    lander.reset()
    for _ in range(30):
        lander.step(np.array([2]))
    first, second = lander.branch(np.array([0, 0]), seed=1).step(np.array([0, 0])).frames
    assert first.tolist() == second.tolist() == lander.step(np.array([0])).frames[0].tolist()
