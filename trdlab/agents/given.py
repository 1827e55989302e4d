"""Agents made of what is given as an object: a model, a table, an estimator, a policy."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.agents.agent import Agent
from trdlab.agents.models import Model, model_of
from trdlab.agents.places import AXIS, Place, find_place, look
from trdlab.environments.flat import FlatSpace
from trdlab.environments.interface import Interface
from trdlab.environments.naming import is_numbered
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError
from trdlab.estimator import Estimator, Unfitted
from trdlab.policies import Memoryless, Policy, ask
from trdlab.policies.adapted import About, games_for, sees_screens
from trdlab.policies.functions import as_they_are, from_function
from trdlab.policies.registry import policy_of
from trdlab.rollouts.branches import Effort
from trdlab.rollouts.playing import shown
from trdlab.tabular import ExactTable, exact
from trdlab.time_axis import TimeAxis


def agent_of(what: Any, env: Any, env_arguments: Sequence[str], axis: TimeAxis) -> Agent:
    """Returns the agent that an object is, or that can be made of it, where it acts in `env`.

    Args:
        what: an agent, a model, a table, another estimator, a policy, or a function.
        env: see `find_place`; None where it was made for, if it was made for one.
        env_arguments: likewise.
        axis: γ, N and w of a model that has to be solved.

    Raises:
        InputError: it is no agent, or does not fit its environment.
    """
    known = what.estimator if isinstance(what, Agent) and what.is_fitted else what
    own = getattr(known, "time_axis", axis)
    wanted = games_for(what.policy if isinstance(what, Agent) else what)
    place = None if env is None else find_place(env, env_arguments, own, wanted=wanted)
    if isinstance(what, Agent):
        if place is None:
            return what
        what.interface.check_fits(look(place.make), place.name)
        is_away = isinstance(known, ExactTable) and not place.is_model(known.mdp)
        return replace(what, make=place.make, origin=None, is_away=is_away)
    if isinstance(what, ExactTable):
        return model_agent(_model_around(what, env), place=place, table=what)
    if isinstance(what, gym.Env):
        raise InputError(
            f"This {type(what.unwrapped).__name__} is an environment, and no agent.",
            "Give who acts in it, or solve it with trdlab.solve.",
        )
    if (model := model_of(what)) is not None:
        return model_agent(model, axis, place=place)
    missing = [name for name in ("decompose", "time_axis", "future") if not hasattr(what, name)]
    policy = policy_of(what) if missing else None
    if missing and policy is None and not callable(what):
        raise InputError(
            f"This {type(what).__name__} is no agent: it has no {' and no '.join(missing)}.",
            "Give a run's folder, gridworld:NAME, tabular:ENV_ID, a model, an Estimator, a Policy, "
            "a model of Stable-Baselines3, or a function.",
        )
    if place is None:
        raise InputError(
            f"Nothing says where this {type(what).__name__} acts.",
            "Give its environment: an id, an environment, or a function that makes one.",
        )
    called = getattr(what, "__name__", type(what).__name__)
    return acting_agent(policy or what, place, called.strip("<>"))


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
        effort=Effort(judged=300, episodes=100),  # of an exact table they are cheap
    )


def acting_agent(who: Estimator | Policy | Callable[[Any], Any], place: Place, name: str) -> Agent:
    """Returns the agent that acts somewhere.

    Args:
        who: an estimator, by its greedy policy; a policy; or a function, see `from_function`. A
            function is shown a Dict or Tuple as such, all others one vector (see `FlatSpace`).
        place: where.
        name: what to call it.

    Raises:
        InputError: it sees or does something else there, or answers in another shape.
    """
    with closing(place.make(1, 0)) as environments:
        found = Interface.of(environments)
        first = FrameStack(environments.reset(), environments.stack, environments.padding)
        screens = getattr(environments, "screens", None)
        looked_at = shown(who, environments, first) if screens is not None else first.observations
    seen, count = first.observations, len(found.action_names)
    agent = Agent(
        name=name,
        estimator=Unfitted(),
        action_names=found.action_names,
        make=place.make,
        seconds_per_step=found.seconds_per_step,
        effort=place.effort,
    )
    about = getattr(who, "about", None)
    if isinstance(about, About):
        about.check_fits(_looking(found, looked_at, who), place.name, name)
    if isinstance(who, Estimator):
        told = np.shape(who.decompose(seen).components)
        wanted = (1, count, who.time_axis.num_components)
        if told != wanted:
            raise InputError(
                f"The estimator decomposes an observation of {place.name} into shape {told}.",
                f"It should be [B, A, N+1] = {wanted}.",
            )
        return replace(agent, estimator=who, policy=who if isinstance(who, Policy) else None)
    if not isinstance(who, Policy):
        unflat = found.space.unflat if isinstance(found.space, FlatSpace) else as_they_are
        who = from_function(who, np.repeat(seen, 2, axis=0), count, unflat)
    given = ask(who, looked_at)[0].shape[1]
    if given != count:
        raise InputError(
            f"'{name}' gives {given} probabilities, and '{place.name}' has {found.done}.",
            "It must give one for each action.",
        )
    return replace(agent, policy=who)


def _looking(found: Interface, looked_at: Any, who: Any) -> Interface:
    """Returns an interface as somebody meets it: with the whole screens, if it looks at those."""
    if not sees_screens(who):
        return found
    space = gym.spaces.Box(0, 255, np.shape(looked_at)[1:], np.uint8)
    return replace(found, space=space)


def _model_around(table: ExactTable, env: Any) -> Model:
    """Returns the model of a table, in the words of an environment that is the same model."""
    models = filter(None, (model_of(env), model_of(table.mdp)))  # the latter always fits
    return next(model for model in models if model.world.mdp.shape == table.mdp.shape)
