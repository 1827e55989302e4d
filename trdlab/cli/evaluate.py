"""`trdlab evaluate`: how well the agent of a run plays."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from trdlab.cli import common

if TYPE_CHECKING:
    from trdlab.deep.settings import TrainSettings
    from trdlab.rollouts.evaluation import Evaluation
    from trdlab.runs import RunFolder

RunPath = Annotated[
    Path,
    typer.Argument(
        metavar="RUN", help="The run's folder; RUN@STEP or RUN@best for another checkpoint."
    ),
]


def checkpoint_option(shown: str) -> Any:
    """Returns the option that names a checkpoint."""
    return typer.Option("--checkpoint", metavar="STEP", help="Another one.", show_default=shown)


OfAgent = Annotated[int | None, checkpoint_option("that of the run's agent")]


def evaluate(
    run: RunPath,
    episodes: Annotated[
        int | None,
        typer.Option("--episodes", min=1, help="How many.", show_default="as configured"),
    ] = None,
    epsilon: Annotated[
        float | None,
        typer.Option(
            "--epsilon",
            min=0,
            max=1,
            help="Chance of a random action.",
            show_default="as configured",
        ),
    ] = None,
    seed: common.EpisodesSeed = 1000,
    max_steps: Annotated[
        int | None,
        common.max_steps_option("the environment's limit, or else 1000 or four horizons"),
    ] = None,
    checkpoint: OfAgent = None,
    modules: common.Import = None,
    as_json: common.AsJson = False,
    verbose: common.Verbose = False,
) -> None:
    """Play whole episodes with a run's agent, and say how well it does.

    The score is the plain sum of the rewards that the environment pays.
    """
    path, step = named(run, checkpoint)
    evaluated(
        path,
        as_json,
        episodes=episodes,
        epsilon=epsilon,
        seed=seed,
        step=step,
        max_steps=max_steps,
    )


def named(run: Path, checkpoint: int | None) -> tuple[Path, int | None]:
    """Returns the folder of a run, and the step of the checkpoint that is named, if one is."""
    from trdlab.errors import InputError
    from trdlab.runs import find_checkpoint

    path, step = find_checkpoint(str(run))
    if step is not None and checkpoint is not None:
        raise InputError(f"'{run}' names a checkpoint, as `checkpoint` does.", "Use one of them.")
    return path, checkpoint if step is None else step


def evaluated(path: Path, as_json: bool = False, **how: Any) -> "Evaluation":
    """Evaluates the agent of a run, prints the result, and says where it is kept."""
    from trdlab.atari.names import find_game
    from trdlab.cli.progress import EpisodeProgress
    from trdlab.environments.paying import has_own_reward
    from trdlab.runs import RunFolder
    from trdlab.show.training import acts, evaluation_page, human_line
    from trdlab.training.loading import evaluate_run, run_settings

    errors = common.errors()
    with EpisodeProgress(errors) as progress:
        result, kept = evaluate_run(path, **how, watch=progress.on_progress)
    if as_json:
        common.print_json(result.to_dict())
    else:
        settings = run_settings(RunFolder.open(path))
        common.print_text(evaluation_page(result, how=acts(settings)))
        mean = float(result.returns.mean())
        is_scored = settings.kind == "atari" and not has_own_reward(settings.env_arg)
        if is_scored and (line := human_line(find_game(settings.env), mean)):
            common.print_line(line)
    common.say(errors, f"Kept: {kept}" if isinstance(kept, Path) else f"Not kept: {kept.cause}")
    return result


def compare_with_chance(
    folder: "RunFolder", result: "Evaluation", settings: "TrainSettings"
) -> None:
    """Says so if an agent plays no better than random actions do."""
    from trdlab.cli.progress import EpisodeProgress
    from trdlab.show.training import chance_line
    from trdlab.training.loading import evaluate_run

    errors = common.errors()
    with EpisodeProgress(errors) as progress:
        chance, _ = evaluate_run(folder.path, epsilon=1.0, watch=progress.on_progress)
    more = f"{folder.resume_command} --agent-steps {2 * settings.agent_steps}"
    cure = f"Train longer: {more}; or try other settings"
    if settings.epsilon_hold == 1:
        cure += ", such as --epsilon-hold 10"
    if line := chance_line(result, chance, f"{cure}."):
        common.say(errors, line)
