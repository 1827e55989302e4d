"""The agent of a run: loaded as an Estimator, and evaluated."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trdlab.deep.settings import TrainSettings
from trdlab.environments import Environments
from trdlab.environments.interface import Interface
from trdlab.environments.making import check_imported
from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.estimator import Estimator
from trdlab.files import check_own, write_json
from trdlab.rollouts.evaluation import Evaluation, score
from trdlab.rollouts.playing import Watch, unwatched, usual_limit
from trdlab.runs import RunFolder, best_step, checkpoint_steps, find_checkpoint, read_arrays
from trdlab.runs.fits import fit_path, run_of
from trdlab.runs.folder import is_fit
from trdlab.runs.pretrained import is_shipped
from trdlab.training.fitted import is_done, load_fit
from trdlab.training.machine import use_threads
from trdlab.training.setup import future, make_environments

if TYPE_CHECKING:
    from trdlab.deep.estimator import NetworkEstimator
    from trdlab.deep.networks import DecompositionNetwork

EVALUATION_SEED = 1000
"""Not that of a run, so that an agent is evaluated from starts that it was not trained from."""
CHECKPOINT_SEED = 2000
"""Nor that of an evaluation, so that no agent is chosen for what it then is evaluated by."""


def load(path: str | Path, step: int | None = None, *, joint: bool = False) -> "NetworkEstimator":
    """Loads the agent of a run as an Estimator; its environment is not needed.

    Where the agent was fitted when its training was over, it is the fit that tells its future.

    `trdlab.load("runs/…").decompose(observations)` is the shortest way from a trained network to
    the components of every action.

    Args:
        path: the run's folder, `RUN@STEP`, or `pretrained:GAME`; or that of a fit.
        step: of a checkpoint, in agent steps; by default that of the run's agent: the newest one,
            or the best where checkpoints are evaluated.
        joint: the components as they were learned with the policy, though there is a fit.

    Raises:
        InputError: there is no run, or no such checkpoint; or the fit of an agent that is kept
            elsewhere reads its features.
        TrdlabError: something is torn.
    """
    path, named = find_checkpoint(str(path))
    step = named if step is None else step
    if step is None and is_fit(path):
        fitted, _, plan = load_fit(path)
        if plan.layers != "frozen":
            return fitted
        if (of := run_of(path)) is None:
            raise InputError(
                f"'{path}' reads the features of '{plan.agent}'.",
                f"Load both: trdlab.agent('{path}').estimator",
            )
        return _upon(_loaded(RunFolder.open(of[0]), of[1])[1], path)
    step, network = _loaded(RunFolder.open(path), step)
    own = None if joint else own_fit(path, step)
    return network if own is None else _upon(network, own)


def own_fit(path: Path, step: int | None) -> Path | None:
    """Returns the fit in a run's folder of one of its checkpoints; None where there is none.

    Args:
        path: the run's folder.
        step: of the checkpoint, in agent steps; by default that of the run's agent.

    Raises:
        InputError: the run's settings are none, or out of their range.
        TrdlabError: the fit is torn.
    """
    found = fit_path(path, chosen_step(RunFolder.open(path)) if step is None else step)
    return found if is_fit(found) and is_done(RunFolder.open(found)) else None


def _upon(network: "NetworkEstimator", fit: Path) -> "NetworkEstimator":
    """Returns the fit of the agent of a run."""
    from trdlab.deep.features import upon

    fitted, _, plan = load_fit(fit)
    return upon(network, fitted) if plan.layers == "frozen" else fitted


def _loaded(folder: RunFolder, step: int | None) -> tuple[int, "NetworkEstimator"]:
    """Returns the step of a checkpoint, that of the run's agent unless given, and its agent."""
    from trdlab.deep.networks import build_network
    from trdlab.deep.update import load_weights

    settings = run_settings(folder)
    known, hidden = interface_of(folder), settings.hidden
    actions = len(known.action_names)
    has_head = settings.distil == "policy"
    network = build_network(
        known.space, actions, settings.time_axis, hidden=hidden, policy_head=has_head
    )
    step, weights = read_arrays(folder, "q_network", agent_step(folder) if step is None else step)
    load_weights(network, weights)
    return step, estimator_of(settings, network)


def estimator_of(
    settings: TrainSettings, network: "DecompositionNetwork", device: Any = "cpu"
) -> "NetworkEstimator":
    """Returns the network of a run as an Estimator, which acts too where it has a policy head."""
    from trdlab.deep.estimator import ActingEstimator, NetworkEstimator

    told = network, settings.time_axis, future(settings), device
    if network.policy_head is None:
        return NetworkEstimator(*told)
    return ActingEstimator(*told, draw=settings.draw)


def agent_step(folder: RunFolder) -> int | None:
    """Returns the step of the checkpoint that is the run's agent; None for the newest.

    Raises:
        InputError: its settings are none, or out of their range.
    """
    return best_step(folder) if run_settings(folder).checkpoint_episodes else None


def chosen_step(folder: RunFolder) -> int:
    """Returns the step of the checkpoint that is the run's agent; 0 while there is none.

    Raises:
        InputError: its settings are none, or out of their range.
    """
    step = agent_step(folder)
    return max(checkpoint_steps(folder), default=0) if step is None else step


def run_settings(folder: RunFolder) -> TrainSettings:
    """Returns the settings that a run began with.

    Raises:
        InputError: they are no settings, or out of their range; or it is a fit.
    """
    if is_fit(folder.path):
        raise InputError(
            f"'{folder.path}' is a fit, and no training run.",
            f"Its agent is played by: trdlab agent {folder.path}",
        )
    return TrainSettings.from_config(folder.config, f"'{folder.path / 'config.toml'}'")


def interface_of(folder: RunFolder) -> Interface:
    """Returns what the agent of a run sees and does.

    Raises:
        TrdlabError: the manifest is torn.
    """
    try:
        return Interface.from_dict(folder.manifest["environment"])
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
    max_steps: int | None = None,
    watch: Watch = unwatched,
) -> tuple[Evaluation, Path | OutputError]:
    """Evaluates the agent of a run, and keeps the result in its folder if that can be written.

    Args:
        path: the run's folder.
        episodes: how many; by default as the run's configuration says.
        epsilon: the chance of a random action; likewise.
        seed: of the environments and the random actions.
        step: of a checkpoint, in agent steps; by default that of the run's agent.
        max_steps: after which an episode is cut off, if not before; by default the environment's
            own limit, or where it has none what `usual_limit` says.
        watch: told how far the episodes are.

    Returns:
        The evaluation, and the file that holds it, or why it could not be kept.

    Raises:
        InputError: there is no run, no such checkpoint, or the environments cannot be made, or
            are not what the agent was trained in.
        NotImported: its environment needs a module that has not been imported.
        TrdlabError: something is torn.
    """
    folder = RunFolder.open(path)
    settings = run_settings(folder)
    check_imported(settings.env)
    use_threads(settings)
    chance = settings.evaluate_epsilon if epsilon is None else epsilon
    if not 0.0 <= chance <= 1.0:  # nor is NaN
        raise InputError(f"`epsilon` is {chance}.", "It lies from 0 to 1.")
    step, estimator = _loaded(folder, step)
    count = episodes or settings.evaluate_episodes or 30
    how = count, chance, seed, max_steps
    return _evaluated(folder, settings, step, estimator, *how, watch)


def evaluate_checkpoint(
    folder: RunFolder, settings: TrainSettings, step: int, estimator: Estimator
) -> Evaluation:
    """Evaluates the agent of a checkpoint that is about to be saved, as its run's settings say.

    Args:
        folder: the run's; the result is kept in it if it can be written.
        settings: the run's.
        step: of the checkpoint, in agent steps.
        estimator: its agent.

    Raises:
        InputError: the environments cannot be made.
        EnvironmentFault: they fail.
    """
    how = settings.checkpoint_episodes, settings.evaluate_epsilon, CHECKPOINT_SEED
    return _evaluated(folder, settings, step, estimator, *how)[0]


def _evaluated(
    folder: RunFolder,
    settings: TrainSettings,
    step: int,
    estimator: Estimator,
    count: int,
    chance: float,
    seed: int,
    max_steps: int | None = None,
    watch: Watch = unwatched,
) -> tuple[Evaluation, Path | OutputError]:
    """Plays episodes with the agent of a checkpoint, and keeps the result if it can be written."""

    def make(num_envs: int, seed: int) -> Environments:
        environments = make_environments(settings, num_envs=num_envs, seed=seed)
        interface_of(folder).check_fits(Interface.of(environments), settings.env)
        return environments

    result = score(
        estimator,
        make,
        count,
        epsilon=chance,
        max_steps=max_steps,
        enough=usual_limit(settings.time_axis),
        seed=seed,
        watch=watch,
    )
    limit = f"-max-steps-{max_steps}" if max_steps else ""
    name = f"step-{step}-episodes-{count}-epsilon-{chance:g}-seed-{seed}{limit}.json"
    return result, _keep(folder.evaluations / name, {"agent_steps": step, **result.to_dict()})


def _keep(path: Path, data: dict[str, Any]) -> Path | OutputError:
    """Writes an evaluation into the folder of its run, or returns why that cannot be done."""
    if is_shipped(path.parents[1]):
        return OutputError("What comes with trdlab is left as it is.")
    with suppress(OSError):  # some ways to copy a run leave out empty folders
        path.parent.mkdir(exist_ok=True)
    try:
        check_own(path.parent)
        write_json(path, data)
    except OutputError as error:
        return error
    return path
