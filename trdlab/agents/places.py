"""Where an agent acts: its own environments, or others that it is put into."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from trdlab.agents.models import World, find_model, is_model
from trdlab.decomposition import TimeAxis
from trdlab.environments import Environments
from trdlab.environments.arguments import parse_arguments
from trdlab.environments.gym import GymEnvironments
from trdlab.environments.naming import is_numbered
from trdlab.environments.stack import observation_space
from trdlab.errors import InputError

Make = Callable[[int, int], Environments]
"""From the number of environments and their seed to the environments."""


@dataclass(frozen=True)
class Place:
    """Where an agent acts.

    Args:
        make: makes its environments.
        words: the options that name it on the command line.
    """

    make: Make
    words: tuple[str, ...]


def find_place(env: str, env_arguments: Sequence[str], time_axis: TimeAxis) -> Place:
    """Returns the place of a name: an exact model, or a Gymnasium environment.

    Their states can be copied, where that is possible.

    Args:
        env: `gridworld:NAME`, a map file, or `tabular:ENV_ID`, with arguments after commas; or the
            id of a Gymnasium environment.
        env_arguments: what to make the latter with, as `KEY=VALUE`.
        time_axis: of the agent; episodes of a model without a limit last four horizons or longer.

    Raises:
        InputError: there is no such model, or it is given arguments that are not in its name.
    """
    words = ("--env", env, *(word for given in env_arguments for word in ("--env-arg", given)))
    if not is_model(env):
        arguments = parse_arguments(env_arguments)
        return Place(
            lambda num_envs, seed: GymEnvironments(
                env, num_envs, seed=seed, env_arguments=arguments
            ),
            words,
        )
    refuse_arguments(env, env_arguments)
    model = find_model(env)
    return Place(lambda num_envs, seed: model.environments(num_envs, seed, time_axis), words)


def refuse_arguments(name: str, env_arguments: Sequence[str]) -> None:
    """Refuses arguments of an exact model that do not stand in its name.

    Raises:
        InputError: there are some.
    """
    if env_arguments:
        raise InputError(
            f"--env-arg is for Gymnasium environments, and '{name}' is an exact model.",
            f"Write {name},{','.join(env_arguments)}",
        )


def check_fits(place: Place, world: World) -> None:
    """Checks that the agent of a model sees and does in a place what it knows.

    Args:
        place: where it is to act.
        world: its model.

    Raises:
        InputError: it does not.
    """
    environments = place.make(1, 0)
    try:
        told = environments.action_names
        names = world.action_names if is_numbered(told) else told
        found = seen(environments), environments.num_actions, names
    finally:
        environments.close()
    own = f"{world.mdp.num_states} states", world.mdp.num_actions, world.action_names
    if found != own:
        raise InputError(
            f"'{place.words[1]}' does not fit the agent: it has {_say(*found)}, "
            f"and the agent knows {_say(*own)}.",
            "Give an environment with the same ones.",
        )


def seen(environments: Environments) -> str:
    """Returns what an agent sees of environments, in words."""
    space: Any = observation_space(environments)
    if hasattr(space, "n"):
        return f"{space.n} states"
    return f"{'×'.join(map(str, space.shape)) or '1'} {space.dtype}"


def _say(observation: str, num_actions: int, names: Sequence[str]) -> str:
    named = f" ({', '.join(names)})" if len(names) == num_actions else ""
    return f"{observation} and {num_actions} actions{named}"
