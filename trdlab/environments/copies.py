"""Copies of environments in the midst of an episode: proved to be copies, with chance of their own.

A deep copy need not be one. An environment may hold what Python cannot copy, share it with its
copies, or be pickled by its arguments, as Gymnasium's `EzPickle` does it: then a copy is a new
environment at its beginning.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding

from trdlab.environments.actions import possible
from trdlab.environments.answers import beginning_of, layers, outcome_of
from trdlab.environments.chance import Chance, generators, kept_luck, own_chance, renew

Env = gym.Env[Any, Any]

LEAST, COMPARED = 8, 32
"""Steps into an episode before a copy differs from a new environment, and those compared then."""

_COPIES, _EPISODES = 8, 8  # of one beginning, and from different seeds, to see what chance does
_PLAIN = (bool, int, float, str, bytes, np.ndarray, np.generic)


class NoDeepCopy(Exception):  # noqa: N818  it says what a copy is, not what failed
    """A deep copy that is no copy; the text says why."""


@dataclass(frozen=True)
class Past:
    """How an episode came to where it is.

    Args:
        seed: that it began with.
        actions: taken since, as the environment calls them.
    """

    seed: int
    actions: Sequence[Any]


@dataclass(frozen=True)
class Proof:
    """What has been found out about the copies of an environment.

    Args:
        fault: why its deep copies are none, a sentence; empty where they are copies.
        shared_chance: whether its episodes know chance that copies do not have of their own.
    """

    fault: str
    shared_chance: bool = False


def prove(make: Callable[[], Env], past: Past, more: Sequence[Any]) -> Proof:
    """Finds out how an environment can be copied, by trying it out on another one of its kind.

    That one is played as far as `past`, or `LEAST` steps if they are more. Its deep copy is stepped
    first, and then itself, in the same way: if the copy is one, they do the same, and so they do
    not if it has moved along with its copy.

    Chance is shared where fresh generators make no difference to copies, while other seeds make
    one to episodes that begin alike. (Where lots are drawn for the beginning, something hidden in
    it can make the difference, and no claim is made.)

    Args:
        make: makes an environment of this kind, to be closed afterwards.
        past: of the environment that is to be copied.
        more: `LEAST + COMPARED` actions to go on with, as the environment calls them.
    """
    env, actions = make(), [*past.actions, *more]
    with kept_luck(0):
        begun(env, past.seed)
        length = len(trace(env, actions))
    far = max(0, min(max(len(past.actions), LEAST), length - 1))

    def played() -> int:
        """Plays to the middle of an episode: as far as may be, should it end sooner this time."""
        middle = far
        while not goes_on(env, Past(past.seed, actions[:middle])):
            middle //= 2
        return middle

    fault = _fault(env, actions[played() :][:COMPARED])
    new = make if fault else None
    shared = _same_every_time(env, past.seed, more, new) and _vary(env, more)
    env.close()
    return Proof(fault, shared)


def copied(env: Env, held: Sequence[Chance]) -> tuple[Env, list[Chance]]:
    """Returns a deep copy, and the generators of chance that it has for its own.

    Args:
        env: what to copy.
        held: the generators of the environment.

    Raises:
        NoDeepCopy: none can be made, or it is seen to be none.
    """
    memo: dict[int, Any] = {}  # what has been copied, by the id of the original
    try:
        copy = deepcopy(env, memo)
    except Exception as error:  # anything can be raised in another's code
        raise NoDeepCopy(f"No deep copies can be made ({_say(error)}).") from error
    if fault := _unlike(env, copy):
        raise NoDeepCopy(fault)
    twins = [memo[id(generator)] for generator in held if id(generator) in memo]
    return copy, twins if len(twins) == len(held) else own_chance(copy, held)


def begun(env: Env, seed: int) -> bytes:
    """Begins an episode, and returns its first observation."""
    return _told(beginning_of(env, seed, _kind(env))[0])


def trace(env: Env, actions: Iterable[Any]) -> list[tuple[bytes, bytes, bool, bool]]:
    """Returns what follows actions: observations, rewards and ends, up to the first end.

    In place of an action that the environment forbids another is taken.
    """
    went = []
    for wanted in actions:
        action = possible(env, wanted)
        observation, reward, terminated, truncated, _ = outcome_of(env, action, _kind(env))
        went.append((_told(observation), _told(reward), terminated, truncated))
        if terminated or truncated:
            break
    return went


def goes_on(env: Env, past: Past) -> bool:
    """Plays an episode up to where it has come to, and returns whether it goes on from there."""
    with kept_luck(0):
        begun(env, past.seed)
        went = trace(env, past.actions)
    return not (went and any(went[-1][2:]))


def _fault(env: Env, rest: Sequence[Any]) -> str:
    """Returns why a deep copy of an environment is none; both are stepped."""
    try:
        copy, _ = copied(env, generators(env))
        with kept_luck(1):
            went = trace(copy, rest)
            copy.close()  # which must not close the original, either
    except NoDeepCopy as error:
        return str(error)
    except Exception as error:  # noqa: BLE001  anything can be raised in another's code
        return f"Deep copies cannot be stepped ({_say(error)})."
    with kept_luck(1):
        return "" if went == trace(env, rest) else "Deep copies go another way."


def _unlike(env: Env, copy: Env) -> str:
    """Returns why a copy is none, where it has another plain value in an attribute; or nothing."""
    for one, other in zip(layers(env), layers(copy), strict=False):
        theirs = vars(other)
        for name, value in vars(one).items():
            if isinstance(value, _PLAIN) and not _same(value, theirs.get(name)):
                return f"Deep copies have another '{name}'."
    return ""


def _same_every_time(
    env: Env, seed: int, actions: Sequence[Any], new: Callable[[], Env] | None
) -> bool:
    """Returns whether copies with fresh chance do the same from the beginning of an episode on.

    Args:
        env: what they are copies of.
        seed: that the episode begins with.
        actions: taken in each.
        new: makes environments in place of deep copies.
    """
    begun(env, seed)

    def went(number: int) -> list[Any]:
        copy = deepcopy(env) if new is None else new()
        if new is not None:
            begun(copy, seed)
        renew(own_chance(copy, generators(env)), np.random.SeedSequence(number))
        with kept_luck(number):
            told = trace(copy, actions)
        copy.close()
        return told

    first = went(0)
    return all(went(number) == first for number in range(1, _COPIES))


def _vary(env: Env, actions: Sequence[Any]) -> bool:
    """Returns whether episodes begin alike and differ, though no generator drew their beginning."""
    went: dict[bytes, list[Any]] = {}
    for seed in range(_EPISODES):
        with kept_luck(seed):
            first = begun(env, seed)
            fresh = seeding.np_random(seed)[0].bit_generator.state
            for found in generators(env):
                if not isinstance(found, np.random.Generator) or (
                    found.bit_generator.state != fresh
                ):
                    return False
            later = trace(env, actions)
        if went.setdefault(first, later) != later:
            return True
    return False


def _same(one: Any, other: Any) -> bool:
    """Returns whether a plain value is the same as another, NaN as NaN; if that can be told."""
    if type(one) is not type(other) or getattr(one, "dtype", None) == np.dtype(object):
        return True
    if isinstance(one, np.ndarray | np.generic):
        return bool(one.shape == other.shape and one.tobytes() == other.tobytes())
    return bool(one == other or one != one)


def _told(value: Any) -> bytes:
    """Returns an observation or a reward in bytes, whatever parts it has."""
    if isinstance(value, Mapping):
        return b"".join(map(_told, value.values()))
    return b"".join(map(_told, value)) if isinstance(value, tuple) else np.asarray(value).tobytes()


def _kind(env: Env) -> str:
    return type(getattr(env, "unwrapped", env)).__name__


def _say(error: Exception) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
