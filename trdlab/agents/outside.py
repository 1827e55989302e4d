"""Agents that were trained elsewhere: who acts is known, and what it expects is not yet."""

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.agents.places import AXIS, Place, Where, find_place
from trdlab.environments.arguments import parse_name
from trdlab.environments.flat import FlatSpace
from trdlab.environments.interface import Interface
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError
from trdlab.estimator import Unfitted
from trdlab.policies import Policy, ask
from trdlab.policies.adapted import About
from trdlab.policies.files import Options
from trdlab.policies.functions import as_they_are, from_function
from trdlab.policies.registry import read_policy


def file_agent(name: str, *, env: Where | None, env_arguments: Sequence[str] = ()) -> Agent:
    """Returns the agent in a file of another library, where it acts in `env`.

    Args:
        name: of the file, with what it does not say after commas, such as
            `ppo.zip,activation=relu,greedy=true` (see `Options`).
        env: where it acts; also an Atari game.
        env_arguments: what to make that one with, as `KEY=VALUE`.

    Raises:
        InputError: nobody who is known here wrote the file, or it does not fit the environment.
    """
    file, arguments = parse_name(name)
    path = Path(file)
    policy = read_policy(path, Options.of(arguments))
    if env is None:
        about: About = getattr(policy, "about")  # noqa: B009  which every adapter gives
        raise InputError(
            f"Nothing says where '{file}' acts: it is a {about.title}.",
            f"Give its `env`: it needs {about.needs}.",
        )
    place = find_place(env, env_arguments, AXIS)
    agent = policy_agent(policy, place, path.stem)
    return replace(agent, origin=place.origin(name, None, away=True))


def policy_agent(who: Policy | Callable[[Any], Any], place: Place, name: str) -> Agent:
    """Returns the agent by which a policy, or a function, acts somewhere.

    Args:
        who: a policy; or a function, see `from_function`. A function is shown a Dict or Tuple of
            observations as such, a policy as one vector (see `FlatSpace`).
        place: where.
        name: what to call it.

    Raises:
        InputError: it sees or does something else there, or answers with no distribution.
    """
    with closing(place.make(1, 0)) as environments:
        found = Interface.of(environments)
        first = FrameStack(environments.reset(), environments.stack, environments.padding)
    count = len(found.action_names)
    policy = who
    if not isinstance(policy, Policy):
        shown = found.space.unflat if isinstance(found.space, FlatSpace) else as_they_are
        policy = from_function(policy, np.repeat(first.observations, 2, axis=0), count, shown)
    about = getattr(policy, "about", None)
    if isinstance(about, About):
        about.check_fits(found, place.name, name)
    told = ask(policy, first.observations)[0].shape[1]
    if told != count:
        raise InputError(
            f"'{name}' gives {told} probabilities, and '{place.name}' has {found.done}.",
            "It must give one for each action.",
        )
    return Agent(
        name=name,
        estimator=Unfitted(),
        action_names=found.action_names,
        make=place.make,
        policy=policy,
        seconds_per_step=found.seconds_per_step,
    )
