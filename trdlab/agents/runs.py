"""The agent of a run: its network, its environments, and what is known of both."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from trdlab.agents.agent import Agent
from trdlab.agents.models import is_model
from trdlab.agents.places import Place, Where, find_place, look
from trdlab.environments.making import check_imported
from trdlab.environments.naming import is_numbered
from trdlab.errors import InputError
from trdlab.rollouts.branches import Copying
from trdlab.runs.folder import RunFolder

if TYPE_CHECKING:
    from trdlab.deep.settings import TrainSettings

_OF_GAMES = Copying(episodes=12, moments=2, copies=2, tries=10)  # a copy plays all of a game again


def run_agent(
    path: Path,
    *,
    step: int | None = None,
    env: Where | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns the agent of a run, or of its checkpoint at some agent step.

    It acts in the environments it was trained in, or in others that fit (see `find_agent`).

    Raises:
        InputError: there is no run or no such checkpoint, or the environment does not fit.
        TrdlabError: something is torn.
    """
    from trdlab.training.loading import interface_of, load, run_settings
    from trdlab.training.machine import use_threads

    folder = RunFolder.open(path)
    settings = run_settings(folder)
    if env_arguments and env is None:
        raise InputError("The run says what its environment is made with.", "Give `env` too.")
    use_threads(settings)
    estimator = load(path, step)
    place, is_game = _place(settings, env, env_arguments)
    found, known = look(place.make), interface_of(folder)
    if settings.action_names and env is None:
        found = found.named(settings.action_names)
    known.check_fits(found, place.name)
    at = "" if step is None else f"@{step}"
    module = settings.env.rpartition(":")[0]
    return Agent(
        name=f"{folder.path.name}{at}",
        estimator=estimator,
        action_names=(known if is_numbered(found.action_names) else found).action_names,
        make=place.make,
        seconds_per_step=found.seconds_per_step,
        origin=place.origin(f"{path}{at}", None, away=env is not None, module=module),
        copying=_OF_GAMES if is_game else Copying(),
    )


def _place(
    settings: "TrainSettings", env: Where | None, env_arguments: Sequence[str]
) -> tuple[Place, bool]:
    """Returns where the agent of a run acts, by default where it was trained; and if in a game."""
    from trdlab.training.setup import make_environments

    if env is None:
        check_imported(settings.env)
        env, env_arguments = settings.env, settings.env_arg
    place = find_place(env, env_arguments, settings.time_axis)
    if settings.kind != "atari" or not isinstance(env, str) or is_model(env):
        return place, False
    there = replace(settings, env=env, env_arg=tuple(env_arguments))
    make = lambda num, seed: make_environments(there, num_envs=num, seed=seed)  # noqa: E731
    return replace(place, make=make), True
