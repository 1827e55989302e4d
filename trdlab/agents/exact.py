"""Agents that act by the exact table of a model."""

import gymnasium as gym

from trdlab.agents.agent import Agent
from trdlab.agents.models import Model
from trdlab.agents.places import AXIS, Place, find_place, look
from trdlab.decomposition import TimeAxis
from trdlab.environments.interface import Interface
from trdlab.environments.naming import is_numbered
from trdlab.policies import Memoryless
from trdlab.rollouts.branches import Copying
from trdlab.tabular import ExactTable, exact


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
