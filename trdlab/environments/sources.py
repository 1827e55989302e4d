"""Where environments of one kind come from: an id, an instance, or a function that makes them."""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from functools import partial
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from trdlab.environments.actions import Actions
from trdlab.environments.answers import check_reset
from trdlab.environments.aside import aside
from trdlab.environments.chance import kept_luck
from trdlab.environments.copies import Env, begun, trace
from trdlab.environments.making import make_environment
from trdlab.environments.protocol import NotParallel
from trdlab.errors import InputError

EnvSource = str | EnvSpec | Env | Callable[[], Env]
"""A Gymnasium id, a specification, an environment, or a function that makes one."""

_NEEDED = ("reset", "step", "close", "observation_space", "action_space")
_STEPS = 16  # for which an instance and one made after it are compared


class Source:
    """Environments of one kind, as many as are asked for.

    Args:
        env: what they are made of. An instance is reset, stepped a little, and never closed: the
            environments are deep copies of it, or made by its `spec`, whichever do as it does.
            Where neither do, it is played itself, in one place at a time.
        arguments: what to make those of an id with.

    Attributes:
        name: what they are called.

    Raises:
        InputError: this is no environment, and makes none.
    """

    def __init__(self, env: EnvSource, arguments: Mapping[str, Any] | None = None) -> None:
        if arguments and not isinstance(env, str):
            raise InputError(
                f"The arguments {', '.join(arguments)} are for an environment made by its id.",
                "Make it with them before it is given.",
            )
        self._make: Callable[[], Env]
        self._instance: Env | None = None
        self._lent, self._nameless = False, False
        if isinstance(env, str):
            self.name = env
            self._make = lambda: checked(make_environment(env, arguments))
        elif isinstance(env, EnvSpec):
            self.name, self._make = env.id, partial(_called, partial(gym.make, env), env.id)
        elif isinstance(env, gym.Env) or not callable(env):
            self._instance = checked(env)
            self.name, self._make = name_of(env), _way_of_copying(env)
        else:
            self.name = getattr(env, "__name__", type(env).__name__)
            self._make, self._nameless = partial(_called, env, self.name), True

    def make(self, count: int = 1, beside: Sequence[Env] = ()) -> list[Env]:
        """Makes environments, to be given back with `close`.

        Args:
            count: how many.
            beside: those that there are already.

        Raises:
            InputError: none can be made.
            NotParallel: one can, and not so many beside each other.
        """
        envs: list[Env] = []
        try:
            for _ in range(count):
                envs.append(self._another([*beside, *envs]))
        except InputError as error:
            for env in envs:
                self.close(env)
            if not envs and not beside:
                raise
            raise NotParallel(
                f"There can be {len(beside) + len(envs)} of {self.name} at a time: {error.cause}",
                "Ask for no more.",
            ) from error
        return envs

    def close(self, env: Env) -> None:
        """Takes back an environment; the instance that was given is not closed."""
        if env is self._instance:
            self._lent = False
        else:
            with aside():
                env.close()

    def _another(self, others: Sequence[Env]) -> Env:
        with aside():
            env = self._make()
        if any(env is other for other in others) or (env is self._instance and self._lent):
            raise InputError(
                f"{self.name} cannot be copied, and it is in use."
                if env is self._instance
                else f"{self.name} returns the same environment again.",
                "Give a function that makes a new one.",
            )
        self._lent |= env is self._instance
        if self._nameless:  # a function's environments are not called by its name
            self.name, self._nameless = name_of(env), False
        return env


def checked(env: Any) -> Env:
    """Returns an environment.

    Raises:
        InputError: it is none.
    """
    kind = type(env).__name__
    if hasattr(env, "num_envs"):
        raise InputError(
            f"This {kind} is {env.num_envs} environments in one.",
            "Give one that is not vectorised, or a function that makes one.",
        )
    missing = [name for name in _NEEDED if not hasattr(env, name)]
    if missing:
        raise InputError(
            f"This {kind} is no environment: it has no {' and no '.join(missing)}.",
            "Give a Gymnasium id, an environment, or a function that makes one.",
        )
    check_reset(env, name_of(env))
    if str(getattr(getattr(env, "spec", None), "entry_point", "")).startswith("ale_py"):
        raise InputError(
            f"{name_of(env)} is an Atari game.",
            f"Use: trdlab train atari {name_of(env).rpartition(':')[2]}",
        )
    found: Env = env
    return found


def name_of(env: Any) -> str:
    """Returns the id that an environment was made by, or else the name of its class."""
    spec = getattr(env, "spec", None)
    return str(spec.id) if spec is not None else type(getattr(env, "unwrapped", env)).__name__


def _called(function: Callable[[], Any], name: str) -> Env:
    try:
        env = function()
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            f"{name} makes no environment ({type(error).__name__}: {error}).",
            "Give a function that can be called without arguments.",
        ) from error
    return checked(env)


def _way_of_copying(env: Env) -> Callable[[], Env]:
    """Returns the first way of making environments that do as an instance does, or itself."""

    def copied() -> Env:
        return deepcopy(env)

    def made() -> Env:
        return gym.make(env.spec)  # type: ignore[arg-type]  # None fails as any other may

    for way in (copied, made):
        try:
            with aside(), kept_luck():
                other = way()
                if _do_the_same(env, other):
                    return way
        except Exception:  # noqa: BLE001  whatever it is, this way does not work
            continue
    return lambda: env


def _do_the_same(env: Env, other: Env) -> bool:
    """Returns whether two environments do the same from the same seed on, or cannot be compared."""
    called = Actions.of(env.action_space, name_of(env)).called
    actions = [called[i % len(called)] for i in range(_STEPS)]

    def played(which: Env) -> list[Any]:
        return [begun(which, seed=0), *trace(which, actions)]

    if (env.observation_space, env.action_space) != (other.observation_space, other.action_space):
        return False
    first = played(env)
    return played(other) == first or played(env) != first
