"""Agents that act by the exact table of a model."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym

from trdlab.agents.agent import Agent
from trdlab.agents.models import GRIDWORLD, TABULAR, Model, find_model
from trdlab.agents.places import AXIS, Origin, Place, Where, find_place, look, refuse_arguments
from trdlab.decomposition import TimeAxis
from trdlab.environments.interface import Interface
from trdlab.environments.naming import is_numbered
from trdlab.policies import Memoryless
from trdlab.rollouts.branches import Copying
from trdlab.tabular import ExactTable, exact


def gridworld_agent(map_name: str, time_axis: TimeAxis, **where: Any) -> Agent:
    """Returns `exact_agent` of a built-in map or a map file."""
    return exact_agent(GRIDWORLD + map_name.removeprefix(GRIDWORLD), time_axis, **where)


def tabular_agent(env_id: str, time_axis: TimeAxis, **where: Any) -> Agent:
    """Returns `exact_agent` of a Gymnasium environment with a transition table."""
    return exact_agent(TABULAR + env_id.removeprefix(TABULAR), time_axis, **where)


def exact_agent(
    name: str, time_axis: TimeAxis, *, env: Where | None = None, env_arguments: Sequence[str] = ()
) -> Agent:
    """Returns the exact table of a model with a name as an agent that acts optimally in it.

    The name, and another environment to act in, are given as to `find_agent`.

    Raises:
        InputError: the model cannot be made, or the other environment does not fit.
    """
    model = find_model(name)
    if env is None:
        refuse_arguments(name, env_arguments)
        return replace(model_agent(model, time_axis), origin=Origin(name, name, (), time_axis))
    place = find_place(env, env_arguments, time_axis)
    agent = model_agent(model, time_axis, place=place)
    return replace(agent, origin=place.origin(name, time_axis, away=True))


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
    world, names = model.world, model.world.action_names
    if place is None:
        place = find_place(model, (), time_axis)
    else:
        own, found = gym.spaces.Discrete(world.mdp.num_states), look(place.make)
        Interface(own, names).check_fits(found, place.name)
        names = found.action_names if is_numbered(names) else names
    solved = exact(world.mdp, time_axis) if table is None else table
    policy = solved.solution.policy
    return Agent(
        name=model.name,
        estimator=solved,
        action_names=names,
        make=place.make,
        policy=Memoryless(lambda states: policy[states]),
        world=world,
        is_away=not place.is_model(solved.mdp),
        copying=Copying(episodes=100),
    )
