"""The agent of a run: its network, its environments, and what is known of both."""

from collections.abc import Sequence
from pathlib import Path

from trdlab.agents.agent import Agent
from trdlab.agents.places import Where, find_place, look, place_of
from trdlab.environments.making import check_imported
from trdlab.environments.naming import is_numbered
from trdlab.errors import InputError
from trdlab.runs.folder import RunFolder


def run_agent(
    path: Path,
    *,
    step: int | None = None,
    env: Where | None = None,
    env_arguments: Sequence[str] = (),
) -> Agent:
    """Returns the agent of a run, or of its checkpoint at an older agent step.

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
    if env is None:
        check_imported(settings.env)
        place = place_of(settings)
    else:
        games = settings.kind == "atari"
        place = find_place(env, env_arguments, settings.time_axis, games=games)
    found, known = look(place.make), interface_of(folder)
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
        copying=place.copying,
    )
