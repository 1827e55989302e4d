"""Exact models: by names such as `gridworld:ledge,slip=0.2`, or of what carries one."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.environments.arguments import parse_name, say_name
from trdlab.environments.naming import numbered
from trdlab.errors import InputError, closest
from trdlab.gridworld import Gridworld
from trdlab.gridworld.env import GridworldEnv
from trdlab.tabular import MDP
from trdlab.tabular.episodes import ModelEnvironments
from trdlab.tabular.named import TabularWorld
from trdlab.tabular.reach import reachable
from trdlab.tabular.toytext import make_world, tabular_world

GRIDWORLD, TABULAR = "gridworld:", "tabular:"
"""What stands before the name of a map or its file, and of an environment with a `P` table."""

World = Gridworld | TabularWorld
"""A model in words."""

_ANYWHERE = "exploring_starts"
_OF_GRIDWORLDS = ("slip", "treasure", _ANYWHERE)  # of `GridworldEnv`, what shapes its episodes
_LEAST_STEPS, _MOST_STEPS = 100, 2_000  # of a time limit where a model has none
_LONG = 60  # letters of a name in a message


@dataclass(frozen=True, eq=False)
class Model:
    """An exact model, and how its episodes begin and are cut off.

    Args:
        name: what it is called, with the arguments it was made with.
        world: the model in words.
        starts: `[S]`, how likely episodes begin in each state; None where all begin in one.
        time_limit: its own, if it has one.
    """

    name: str
    world: World
    starts: FloatArray | None
    time_limit: int | None

    def environments(self, num_envs: int, seed: int, time_axis: TimeAxis) -> ModelEnvironments:
        """Returns episodes of it; a limit that is not its own lets four horizons pass."""
        return ModelEnvironments(
            self.world.mdp,
            num_envs,
            seed=seed,
            starts=self.starts,
            time_limit=self.time_limit or max(_usual_limit(self.world), 4 * time_axis.num_steps),
            action_names=self.world.action_names,
        )


def is_model(name: str) -> bool:
    """Returns whether this names an exact model rather than a run.

    Raises:
        InputError: nothing can be called that.
    """
    if name.startswith((GRIDWORLD, TABULAR)):
        return True
    path = Path(name.partition(",")[0])
    try:
        return path.is_file()
    except OSError as error:
        short = name if len(name) <= _LONG else f"{name[:_LONG]}…"
        raise InputError(
            f"'{short}' names no agent: {error.strerror}.",
            f"Give a run's folder, {GRIDWORLD}NAME or {TABULAR}ENV_ID.",
        ) from error


def find_model(name: str) -> Model:
    """Returns the model of a name, for which `is_model` is true.

    Raises:
        InputError: it cannot be made.
    """
    return tabular_model(name) if name.startswith(TABULAR) else _gridworld_model(name)


def tabular_model(text: str) -> Model:
    """Returns the model of an environment that carries its transition table.

    Args:
        text: its Gymnasium id, and after commas what to make it with.

    Raises:
        InputError: there is no such environment, it has no table, or does not take an argument.
    """
    env_id, arguments = parse_name(text.removeprefix(TABULAR))
    world = make_world(env_id, arguments)
    return _of_world(world, say_name(world.name.rpartition("/")[2], arguments))


def _gridworld_model(text: str) -> Model:
    name, arguments = parse_name(text.removeprefix(GRIDWORLD))
    for key in arguments:
        if key not in _OF_GRIDWORLDS:
            cause = f"A gridworld takes no argument '{key}'."
            raise InputError(cause, closest(key, _OF_GRIDWORLDS))
    if not isinstance(arguments.get(_ANYWHERE, False), bool):
        cause = f"The argument {_ANYWHERE} is '{arguments[_ANYWHERE]}'."
        raise InputError(cause, "It must be true or false.")
    env = GridworldEnv(name, **arguments)
    return _of_gridworld(env.world, say_name(env.world.grid.name, arguments), env.exploring_starts)


def model_of(what: Any) -> Model | None:
    """Returns the exact model that an object is or carries, None where there is none.

    Args:
        what: a gridworld, a model with or without words, or an environment with a transition table.

    Raises:
        InputError: the table is no model.
    """
    if isinstance(what, Model):
        return what
    if isinstance(what, Gridworld):
        return _of_gridworld(what, what.grid.name)
    if isinstance(what, TabularWorld):
        return _of_world(what, what.name)
    if isinstance(what, MDP):
        return _of_world(TabularWorld(what, "a model", numbered(what.num_actions)), "a model")
    base, spec = getattr(what, "unwrapped", None), getattr(what, "spec", None)
    if isinstance(base, GridworldEnv):
        model = _of_gridworld(base.world, base.world.grid.name, base.exploring_starts)
        return replace(model, time_limit=spec.max_episode_steps if spec else None)
    if hasattr(base, "P") or isinstance(getattr(base, "mdp", None), MDP):
        world = tabular_world(what)
        return _of_world(world, world.name)
    return None


def _of_gridworld(world: Gridworld, name: str, exploring_starts: bool = False) -> Model:
    running = reachable(world.mdp) & ~world.mdp.terminal_states
    return Model(name, world, running / running.sum() if exploring_starts else None, None)


def _of_world(world: TabularWorld, name: str) -> Model:
    return Model(name, world, world.starts, world.time_limit)


def _usual_limit(world: World) -> int:
    """Returns the steps after which episodes are cut off where a model has no limit."""
    if isinstance(world, Gridworld):
        rows, columns = world.grid.shape
        return max(_LEAST_STEPS, 4 * rows * columns)
    return min(max(_LEAST_STEPS, 4 * world.mdp.num_states), _MOST_STEPS)
