"""Where an agent acts: its own environments, or others that it is put into."""

from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import astuple, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from trdlab.agents.models import Model, World, find_model, is_model, model_of
from trdlab.decomposition import TimeAxis
from trdlab.environments import Environments
from trdlab.environments.arguments import parse_arguments, say_arguments
from trdlab.environments.batches import Make
from trdlab.environments.gym import GymEnvironments
from trdlab.environments.interface import Interface
from trdlab.environments.paying import paying, split_pays
from trdlab.environments.sources import EnvSource
from trdlab.errors import InputError
from trdlab.rollouts.branches import Effort
from trdlab.tabular import MDP

if TYPE_CHECKING:
    from trdlab.deep.settings import TrainSettings

# a game is long, and a copy plays all of it again
_OF_GAMES = Effort(judged=16, episodes=12, moments=2, copies=2, tries=10, unasked=False)

Where = EnvSource | Model | World | MDP
"""What says where an agent acts."""

AXIS = TimeAxis(0.95, 4)
"""Of an exact table, where nothing is said."""


def changed(
    axis: TimeAxis, gamma: float | None, horizon: int | None, width: int | None
) -> TimeAxis:
    """Returns a time axis with those of γ, N and w in place that are given."""
    given: dict[str, Any] = {"gamma": gamma, "horizon": horizon, "width": width}
    return replace(axis, **{name: value for name, value in given.items() if value is not None})


@dataclass(frozen=True)
class Origin:
    """How a user has named an agent and where it acts, so that it can be named again.

    Args:
        name: a run, or an exact model.
        env: the environment it acts in.
        env_arguments: what that is made with, as `KEY=VALUE`.
        time_axis: of an exact table; None of a run, which has its own.
        away: whether the environment is not its own.
        module: what has to be imported for its environment, if anything.
    """

    name: str
    env: str
    env_arguments: tuple[str, ...]
    time_axis: TimeAxis | None
    away: bool = False
    module: str = ""

    def at(self, other: "Origin") -> Self:
        """Returns the same agent, where another one acts."""
        away = self.away or (other.env, other.env_arguments) != (self.env, self.env_arguments)
        return replace(self, env=other.env, env_arguments=other.env_arguments, away=away)

    # What follows is the one place outside the command line that knows how it is written there.

    @property
    def words(self) -> tuple[str, ...]:
        """What names the agent on the command line."""
        flags, own = ("--gamma", "--N", "--w"), astuple(self.time_axis or AXIS)
        told = zip(flags, own, astuple(AXIS), strict=True)
        said = [
            word for flag, value, usual in told if value != usual for word in (flag, str(value))
        ]
        needed = ("--import", self.module) if self.module and not self.away else ()
        place = self.place if self.away else ()
        return (self.name, *said, *needed, *place)

    @property
    def place(self) -> tuple[str, ...]:
        """The options that name where it acts."""
        return ("--env", self.env, *(x for a in self.env_arguments for x in ("--env-arg", a)))


@dataclass(frozen=True)
class Place:
    """Where an agent acts.

    Args:
        make: makes its environments.
        name: what it is called.
        env_arguments: what it is made with, as `KEY=VALUE`.
        is_named: whether it can be found again by its name.
        mdp: the model that it is; None where it carries none.
        effort: how much is played and copied there to judge who acts.
    """

    make: Make
    name: str
    env_arguments: tuple[str, ...] = ()
    is_named: bool = True
    mdp: MDP | None = None
    effort: Effort = Effort()  # noqa: RUF009  it is frozen

    def is_model(self, mdp: MDP) -> bool:
        """Returns whether episodes here go as a model says."""
        own, names = self.mdp, ("offsets", "next_states", "probabilities", "rewards", "terminated")
        return own is not None and all(
            np.array_equal(getattr(own, name), getattr(mdp, name)) for name in names
        )

    def origin(self, agent: str, axis: TimeAxis | None, **how: Any) -> Origin | None:
        """Returns how an agent that acts here is named; None where the place has no name."""
        return Origin(agent, self.name, self.env_arguments, axis, **how) if self.is_named else None


def find_place(
    env: Where,
    env_arguments: Sequence[str],
    time_axis: TimeAxis,
    *,
    games: bool = False,
    wanted: Mapping[str, Any] | None = None,
) -> Place:
    """Returns the place of a name, or of an environment.

    Args:
        env: `gridworld:NAME`, a map file, or `tabular:ENV_ID`, with arguments after commas; the id
            of a Gymnasium environment; an Atari game; an environment, or a function that makes one;
            or a model. An environment is acted in even where it carries a model.
        env_arguments: what to make one of an id with, as `KEY=VALUE`.
        time_axis: of the agent; episodes of a model without a limit last four horizons or longer.
        games: whether each name that is not of a model is meant to be that of an Atari game.
        wanted: how an Atari game is to be played for who acts there, where nothing else is said.

    Raises:
        InputError: there is no such model, or it is given arguments that are not in its name.
    """
    named = isinstance(env, str)
    model = model_of(env) if isinstance(env, Model | World | MDP) else None
    if isinstance(env, str) and is_model(env):
        refuse_arguments(env, env_arguments)
        model = find_model(env)
    if model is not None:
        make = partial(model.environments, time_axis=time_axis)
        called = str(env) if named else model.name
        return Place(make, called, is_named=named, mdp=model.world.mdp)
    source: Any = env
    if named and (games or _is_game(source)):
        from trdlab.deep.settings import TrainSettings

        said = parse_arguments(env_arguments)
        more = {name: value for name, value in (wanted or {}).items() if name not in said}
        words = (*env_arguments, *(say_arguments({name: value}) for name, value in more.items()))
        place = place_of(TrainSettings("atari", source, env_arg=words))
        return replace(place, env_arguments=tuple(env_arguments))
    arguments, pays = split_pays(parse_arguments(env_arguments))

    def made(num_envs: int, seed: int) -> Environments:
        return paying(GymEnvironments(source, num_envs, seed=seed, env_arguments=arguments), pays)

    called, mdp = str(env) if named else "the environment", None if pays else _mdp_of(env)
    return Place(made, called, tuple(env_arguments), named, mdp)


def place_of(settings: "TrainSettings") -> Place:
    """Returns where the agent of a run acts."""
    from trdlab.training.setup import make_environments

    effort = _OF_GAMES if settings.kind == "atari" else Effort()
    make = partial(make_environments, settings)
    return Place(make, settings.env, settings.env_arg, effort=effort)


def _is_game(env: str) -> bool:
    """Returns whether a word names an Atari game, and no other environment of Gymnasium."""
    if ":" in env or (env in gym.registry and not env.startswith("ALE/")):
        return False
    from trdlab.atari.names import find_game

    with suppress(InputError):
        return bool(find_game(env))
    return False


def _mdp_of(env: Any) -> MDP | None:
    """Returns the model of an environment, unless a wrapper may change what comes of it."""
    bare = env
    while isinstance(bare, TimeLimit | OrderEnforcing | PassiveEnvChecker):  # they change nothing
        bare = bare.env
    try:
        found = model_of(bare) if bare is getattr(bare, "unwrapped", None) else None
    except InputError:  # it carries something else
        return None
    return None if found is None else found.world.mdp


def refuse_arguments(name: str, env_arguments: Sequence[str]) -> None:
    """Refuses arguments of an exact model that do not stand in its name.

    Raises:
        InputError: there are some.
    """
    if env_arguments:
        raise InputError(
            f"`env_arguments` are for Gymnasium environments, and '{name}' is an exact model.",
            f"Write {name},{','.join(env_arguments)}",
        )


def look(make: Make) -> Interface:
    """Returns what is seen and can be done in environments, one of which is made."""
    with closing(make(1, 0)) as environments:
        return Interface.of(environments)
