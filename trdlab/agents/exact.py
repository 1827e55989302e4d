"""Agents that act by the exact table of a model."""

from collections.abc import Sequence
from dataclasses import replace

import gymnasium as gym

from trdlab.agents.agent import Agent
from trdlab.agents.models import GRIDWORLD, TABULAR, Model, gridworld_model, tabular_model
from trdlab.agents.places import AXIS, Origin, Place, Where, find_place, look, refuse_arguments
from trdlab.decomposition import TimeAxis
from trdlab.environments.interface import Interface
from trdlab.environments.naming import is_numbered
from trdlab.policies import Memoryless
from trdlab.rollouts.branches import Copying
from trdlab.tabular import ExactTable, exact

_COPYING = Copying(episodes=100)


def gridworld_agent(
    map_name: str,
    time_axis: TimeAxis,
    *,
    env: Where | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns the exact table of a gridworld as an agent that acts optimally in it.

    Args:
        map_name: a built-in map, or a file, and after commas what to make it with, such as
            `ledge,slip=0.2`; `gridworld:` may stand before it.
        time_axis: γ, N and w.
        env: an environment to act in instead, with the same states (see `find_place`).
        env_arguments: what to make that one with.

    Raises:
        InputError: a map cannot be read, or the other environment does not fit.
    """
    called = GRIDWORLD + map_name.removeprefix(GRIDWORLD)
    return _named(called, gridworld_model(map_name), time_axis, env, env_arguments)


def tabular_agent(
    env_id: str,
    time_axis: TimeAxis,
    *,
    env: Where | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns the exact table of an environment's model as an agent that acts optimally in it.

    Args:
        env_id: a Gymnasium environment with a transition table, and after commas what to make it
            with, such as `FrozenLake-v1,is_slippery=false`; `tabular:` may stand before it.
        time_axis: γ, N and w.
        env: an environment to act in instead, with the same states (see `find_place`).
        env_arguments: what to make that one with.

    Raises:
        InputError: there is no such environment, it has no table, or the other one does not fit.
    """
    called = TABULAR + env_id.removeprefix(TABULAR)
    return _named(called, tabular_model(env_id), time_axis, env, env_arguments)


def _named(
    called: str,
    model: Model,
    time_axis: TimeAxis,
    env: Where | None,
    env_arguments: Sequence[str],
) -> Agent:
    if env is None:
        refuse_arguments(called, env_arguments)
    place = find_place(called if env is None else env, env_arguments, time_axis)
    agent = model_agent(model, time_axis, place=place)
    if not place.is_named:
        return agent
    origin = Origin(called, place.name, place.env_arguments, env is not None, time_axis)
    return replace(agent, origin=origin)


def model_agent(
    model: Model,
    time_axis: TimeAxis = AXIS,
    *,
    place: Place | None = None,
    table: ExactTable | None = None,
) -> Agent:
    """Returns the exact table of a model as an agent that acts by its policy.

    Args:
        model: that of the world.
        time_axis: γ, N and w.
        place: where to act instead of in the model.
        table: the table, if it is solved already; by default that of the optimal policy.

    Raises:
        InputError: what is seen or can be done in the place is something else.
    """
    world = model.world
    own = Interface(gym.spaces.Discrete(world.mdp.num_states), world.action_names)
    if place is None:
        place = find_place(model, (), time_axis)
    else:
        found = look(place)
        own.check_fits(found, place.name)
        if is_numbered(world.action_names):
            own = replace(own, action_names=found.action_names)
    solved = exact(world.mdp, time_axis) if table is None else table
    policy = solved.solution.policy
    return Agent(
        name=model.name,
        estimator=solved,
        action_names=own.action_names,
        make=place.make,
        policy=Memoryless(lambda states: policy[states]),
        world=world,
        copying=_COPYING,
    )
