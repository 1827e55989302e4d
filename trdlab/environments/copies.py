"""Copies of environments in the midst of an episode: proved to be copies, with chance of their own.

A deep copy need not be one. An environment may hold what Python cannot copy, share it with its
copies, or be pickled by its arguments, as Gymnasium's `EzPickle` does it: then a copy is a new
environment at its beginning.
"""

import random
from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from types import BuiltinMethodType, FunctionType, MethodType, ModuleType
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding

from trdlab.environments.answers import layers, observation_of, outcome_of

Env = gym.Env[Any, Any]
Chance = np.random.Generator | np.random.RandomState | random.Random

LEAST, COMPARED = 8, 32
"""Steps into an episode before a copy differs from a new environment, and those compared then."""

_COPIES, _EPISODES = 16, 8  # of one beginning, and from different seeds, to see what chance does
_SEARCHED = 2_000  # objects in which generators of chance are looked for
_PLAIN = (bool, int, float, str, bytes, np.ndarray, np.generic)
_CLOSED = (*_PLAIN, type, ModuleType, FunctionType, type(None))  # no generator is looked for there


@dataclass(frozen=True)
class Past:
    """How an episode came to where it is.

    Args:
        seed: that it began with.
        actions: taken since, as the environment calls them.
    """

    seed: int
    actions: Sequence[int]


@dataclass(frozen=True)
class Proof:
    """What has been found out about the copies of an environment.

    Args:
        fault: why its deep copies are none, a sentence; empty where they are copies.
        shared_chance: whether its episodes know chance that copies do not have of their own.
    """

    fault: str
    shared_chance: bool = False


def prove(make: Callable[[], Env], past: Past, more: Sequence[int]) -> Proof:
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

    def continued(seed: int) -> list[Any]:
        begun(env, past.seed)
        copy = make() if fault else deepcopy(env)
        if fault:
            begun(copy, past.seed)
        renew_chance(copy, np.random.SeedSequence(seed), generators(env))
        with kept_luck(seed):
            went = trace(copy, more)
        if fault:
            copy.close()
        return went

    first = continued(0)
    alike = all(continued(seed) == first for seed in range(1, _COPIES))
    shared = alike and _vary(env, more)
    env.close()
    return Proof(fault, shared)


def unlike(env: Env, copy: Env) -> str:
    """Returns why a copy is none that has another plain value in an attribute; else nothing."""
    for one, other in zip(layers(env), layers(copy), strict=False):
        theirs = vars(other)
        for name, value in vars(one).items():
            if isinstance(value, _PLAIN) and not _same(value, theirs.get(name)):
                return f"Deep copies have another '{name}'."
    return ""


def generators(env: Any) -> list[Chance]:
    """Returns the generators of chance that an environment holds, wherever it holds them.

    They are looked for in attributes, lists, tuples and dictionaries, the nearest first, and behind
    methods such as `rng.random`; those of modules, closures and libraries in C are not found.
    """
    found: list[Chance] = []
    queue, seen = deque([env]), {id(env)}
    while queue and len(seen) < _SEARCHED:
        thing = queue.popleft()
        if isinstance(thing, Chance):
            found.append(thing)
            continue
        for part in _parts(thing):
            if id(part) not in seen and not isinstance(part, _CLOSED):
                seen.add(id(part))
                queue.append(part)
    return found


def renew_chance(env: Env, words: np.random.SeedSequence, shared: Iterable[Chance]) -> None:
    """Seeds the generators of an environment anew, all but those shared with another one."""
    keep: Container[int] = {id(generator) for generator in shared}
    own = [generator for generator in generators(env) if id(generator) not in keep]
    for generator, seed in zip(own, words.spawn(len(own)), strict=True):
        if isinstance(generator, np.random.Generator):
            bits = generator.bit_generator
            bits.state = type(bits)(seed).state
        elif isinstance(generator, np.random.RandomState):
            generator.set_state(np.random.RandomState(seed.generate_state(4)).get_state())
        else:
            generator.seed(seed.generate_state(1).item())


def begun(env: Env, seed: int) -> bytes:
    """Begins an episode, and returns its first observation."""
    return _told(observation_of(env, seed, _kind(env)))


def trace(env: Env, actions: Iterable[int]) -> list[tuple[bytes, bytes, bool, bool]]:
    """Returns what follows actions: observations, rewards and ends, up to the first end."""
    went = []
    for action in actions:
        observation, reward, terminated, truncated = outcome_of(env, action, _kind(env))
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


@contextmanager
def kept_luck(seed: int | None = None) -> Iterator[None]:
    """Leaves the chance that all programs share, of NumPy and Python, as it was before.

    Args:
        seed: where it begins within; by default where it is.
    """
    numpy_state, python_state = np.random.get_state(), random.getstate()  # noqa: NPY002
    if seed is not None:
        np.random.seed(seed)  # noqa: NPY002
        random.seed(seed)
    try:
        yield
    finally:
        np.random.set_state(numpy_state)  # noqa: NPY002
        random.setstate(python_state)


def _fault(env: Env, rest: Sequence[int]) -> str:
    """Returns why a deep copy of an environment is none; both are stepped."""
    try:
        copy = deepcopy(env)
    except Exception as error:  # noqa: BLE001  anything can be raised in another's code
        return f"No deep copies can be made ({type(error).__name__}: {error})."
    if fault := unlike(env, copy):
        return fault
    try:
        with kept_luck(1):
            copied = trace(copy, rest)
    except Exception as error:  # noqa: BLE001
        return f"Deep copies cannot be stepped ({type(error).__name__}: {error})."
    with kept_luck(1):
        return "" if copied == trace(env, rest) else "Deep copies go another way."


def _vary(env: Env, actions: Sequence[int]) -> bool:
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


def _parts(thing: Any) -> Iterable[Any]:
    if isinstance(thing, dict):
        return thing.values()
    if isinstance(thing, list | tuple | deque):
        return thing
    if isinstance(thing, MethodType | BuiltinMethodType):
        return (thing.__self__,)
    return getattr(thing, "__dict__", {}).values()


def _same(one: Any, other: Any) -> bool:
    """Returns whether a plain value is the same as another, NaN as NaN; if that can be told."""
    if type(one) is not type(other) or getattr(one, "dtype", None) == np.dtype(object):
        return True
    if isinstance(one, np.ndarray | np.generic):
        return bool(one.shape == other.shape and one.tobytes() == other.tobytes())
    return bool(one == other or one != one)


def _told(value: Any) -> bytes:
    return np.asarray(value).tobytes()


def _kind(env: Env) -> str:
    return type(getattr(env, "unwrapped", env)).__name__
