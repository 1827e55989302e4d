"""The agent of a run: loaded as an Estimator, and evaluated."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium as gym

from trdlab.deep.settings import TrainSettings
from trdlab.errors import InputError, TrdlabError
from trdlab.evaluation import Evaluation, evaluate
from trdlab.files import write_json
from trdlab.runs import RunFolder, checkpoint_steps, read_arrays
from trdlab.training.machine import use_threads
from trdlab.training.setup import described_space, future, make_environments

if TYPE_CHECKING:
    from trdlab.deep.estimator import NetworkEstimator

EVALUATION_SEED = 1000
"""Not that of a run, so that an agent is evaluated from starts that it was not trained from."""


def load(path: str | Path, step: int | None = None) -> "NetworkEstimator":
    """Loads the agent of a run as an Estimator; its environment is not needed.

    `trdlab.load("runs/…").decompose(observations)` is the shortest way from a trained network to
    the components of every action.

    Args:
        path: the run's folder.
        step: of an older checkpoint, in agent steps; by default the newest.

    Raises:
        InputError: there is no run, or no such checkpoint.
        TrdlabError: something is torn.
    """
    from trdlab.deep.estimator import NetworkEstimator
    from trdlab.deep.networks import build_network
    from trdlab.deep.update import load_weights

    folder = RunFolder.open(Path(path))
    settings = TrainSettings.from_config(folder.config, f"'{folder.path / 'config.toml'}'")
    space, num_actions = _described(folder)
    network = build_network(space, num_actions, settings.time_axis, hidden=settings.hidden)
    load_weights(network, read_arrays(folder, "q_network", step))
    return NetworkEstimator(network, settings.time_axis, future(settings))


def _described(folder: RunFolder) -> tuple[gym.Space[Any], int]:
    """Returns the observation space and the number of actions that a run was made with."""
    try:
        environment = folder.manifest["environment"]
        return described_space(environment["observation"]), int(environment["num_actions"])
    except (LookupError, TypeError, ValueError) as error:
        raise TrdlabError(
            f"The run '{folder.path}' does not say what its agent sees: its manifest is torn.",
            "Put back the manifest.json that was written when it began.",
        ) from error


def evaluate_run(
    path: Path,
    *,
    episodes: int | None = None,
    epsilon: float | None = None,
    seed: int = EVALUATION_SEED,
    step: int | None = None,
    on_episode: Callable[[int], None] = lambda finished: None,
) -> tuple[Evaluation, Path]:
    """Evaluates the agent of a run, and keeps the result in its folder.

    Args:
        path: the run's folder.
        episodes: how many; by default as the run's configuration says.
        epsilon: the chance of a random action; likewise.
        seed: of the environments and the random actions.
        step: of an older checkpoint, in agent steps; by default the newest.
        on_episode: told the number of finished episodes whenever some finish.

    Returns:
        The evaluation, and the file that holds it.

    Raises:
        InputError: there is no run, no such checkpoint, or the environments cannot be made.
        TrdlabError: something is torn.
    """
    folder = RunFolder.open(path)
    settings = TrainSettings.from_config(folder.config, f"'{folder.path / 'config.toml'}'")
    step = checkpoint_steps(folder)[-1] if step is None and checkpoint_steps(folder) else step
    use_threads(settings)
    chance = settings.evaluate_epsilon if epsilon is None else epsilon
    if not 0.0 <= chance <= 1.0:  # nor is NaN
        raise InputError(f"The chance of a random action is {chance}.", "It lies from 0 to 1.")
    estimator = load(path, step)
    count = episodes or settings.evaluate_episodes or 30
    environments = make_environments(settings, num_envs=count, seed=seed)
    try:
        result = evaluate(estimator, environments, epsilon=chance, seed=seed, on_episode=on_episode)
    finally:
        environments.close()
    name = f"step-{step}-episodes-{count}-epsilon-{chance:g}-seed-{seed}.json"
    write_json(folder.evaluations / name, {"agent_steps": step, **result.to_dict()})
    return result, folder.evaluations / name
