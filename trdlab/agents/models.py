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
from trdlab.policies.files import is_text
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
            parts=self.world.parts if isinstance(self.world, Gridworld) else None,
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
        return path.is_file() and is_text(path)
    except OSError as error:
        short = name if len(name) <= _LONG else f"{name[:_LONG]}…"
        raise InputError(
            f"'{short}' names no agent: {error.strerror}.",
            f"Give a run's folder, {GRIDWORLD}NAME or {TABULAR}ENV_ID.",
        ) from error


def find_model(name: str) -> Model:
    """Returns the model of a name, for which `is_model` is true.

    Raises:
        InputError: there is no such map or environment, it has no table, or takes no such argument.
    """
    kind = TABULAR if name.startswith(TABULAR) else GRIDWORLD
    called, arguments = parse_name(name.removeprefix(kind))
    if kind == TABULAR:
        model = _of(make_world(called, arguments))
        return replace(model, name=say_name(model.name.rpartition("/")[2], arguments))
    for key in arguments:
        if key not in _OF_GRIDWORLDS:
            cause = f"A gridworld takes no argument '{key}'."
            raise InputError(cause, closest(key, _OF_GRIDWORLDS))
    if not isinstance(arguments.get(_ANYWHERE, False), bool):
        cause = f"The argument {_ANYWHERE} is '{arguments[_ANYWHERE]}'."
        raise InputError(cause, "It must be true or false.")
    env = GridworldEnv(called, **arguments)
    model = _of(env.world, env.exploring_starts)
    return replace(model, name=say_name(model.name, arguments))


def model_of(what: Any) -> Model | None:
    """Returns the exact model that an object is or carries, None where there is none.

    Args:
        what: a gridworld, a model with or without words, or an environment with a transition table.

    Raises:
        InputError: the table is no model.
    """
    if isinstance(what, Model):
        return what
    if isinstance(what, Gridworld | TabularWorld):
        return _of(what)
    if isinstance(what, MDP):
        return _of(TabularWorld(what, "a model", numbered(what.num_actions)))
    base, spec = getattr(what, "unwrapped", None), getattr(what, "spec", None)
    if isinstance(base, GridworldEnv):
        limit = spec.max_episode_steps if spec else None
        return replace(_of(base.world, base.exploring_starts), time_limit=limit)
    if hasattr(base, "P") or isinstance(getattr(base, "mdp", None), MDP):
        return _of(tabular_world(what))
    return None


def _of(world: World, exploring_starts: bool = False) -> Model:
    """Returns the model of a world by its own name; a gridworld has neither starts nor a limit."""
    if isinstance(world, TabularWorld):
        return Model(world.name, world, world.starts, world.time_limit)
    running = reachable(world.mdp) & ~world.mdp.terminal_states
    starts = running / running.sum() if exploring_starts else None
    return Model(world.grid.name, world, starts, None)


def _usual_limit(world: World) -> int:
    """Returns the steps after which episodes are cut off where a model has no limit."""
    if isinstance(world, Gridworld):
        rows, columns = world.grid.shape
        return max(100, 4 * rows * columns)
    return min(max(100, 4 * world.mdp.num_states), 2_000)
