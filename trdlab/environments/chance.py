"""The generators of chance that an environment holds, and those that all programs share."""

import random
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from types import BuiltinMethodType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

Chance = np.random.Generator | np.random.RandomState | random.Random

_SEARCHED = 2_000  # objects of an environment
_CLOSED = (  # in these no generators are looked for
    *(bool, int, float, str, bytes, np.ndarray, np.generic, type(None)),
    *(type, ModuleType, FunctionType),
)


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


def own_chance(env: Any, others: Sequence[Chance]) -> list[Chance]:
    """Returns the generators of an environment, without those that it shares with others."""
    known = {id(generator) for generator in others}
    return [generator for generator in generators(env) if id(generator) not in known]


def renew(chance: Sequence[Chance], words: np.random.SeedSequence) -> None:
    """Seeds generators anew, each by words of its own."""
    for generator, seed in zip(chance, words.spawn(len(chance)), strict=True):
        if isinstance(generator, np.random.Generator):
            bits = generator.bit_generator
            bits.state = type(bits)(seed).state
        elif isinstance(generator, np.random.RandomState):
            generator.set_state(np.random.RandomState(seed.generate_state(4)).get_state())
        else:
            generator.seed(seed.generate_state(1).item())


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


def _parts(thing: Any) -> Iterable[Any]:
    if isinstance(thing, dict):
        return thing.values()
    if isinstance(thing, list | tuple | deque):
        return thing
    if isinstance(thing, MethodType | BuiltinMethodType):
        return (thing.__self__,)
    return getattr(thing, "__dict__", {}).values()
