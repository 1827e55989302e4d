"""`trdlab train` and `resume`: a network that decomposes, start to score."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from trdlab.cli import common
from trdlab.cli.evaluate import RunPath, checkpoint_option, compare_with_chance, evaluated, named
from trdlab.cli.options import with_settings
from trdlab.deep.presets import PRESETS

if TYPE_CHECKING:
    from trdlab.deep.settings import Kind, TrainSettings
    from trdlab.training.run import Run

train = typer.Typer(help="Train a network that decomposes.", no_args_is_help=True)


def _presets(kind: "Kind") -> Any:
    """Returns the option that names where settings begin, with a help that lists them."""
    known = "; ".join(f"{name}: {about}" for name, (about, _) in PRESETS[kind].items())
    usual = {"gym": "that of the environment, or classic", "atari": "gpu or cpu, whatever is there"}
    return typer.Option(
        "--preset",
        metavar="NAME",
        help=f"Settings to begin from. {known}.",
        show_default=usual[kind],
    )


GymPreset = Annotated[str | None, _presets("gym")]
AtariPreset = Annotated[str | None, _presets("atari")]
ConfigFile = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="Settings in a .toml file.")
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="The run's folder.", show_default="a new one in runs"
    ),
]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Say what it would take, and write nothing.")
]
Newest = Annotated[int | None, checkpoint_option("the newest")]


@train.command(name="gym")
@with_settings("gym")
def train_gym(
    env_id: Annotated[
        str,
        typer.Argument(
            metavar="ENV_ID",
            help="A Gymnasium environment with discrete actions, such as CartPole-v1 or "
            "trdlab/DroneGridworld-v0; or MODULE:ENV_ID, to import a module first.",
        ),
    ],
    preset: GymPreset = None,
    config: ConfigFile = None,
    out: Out = None,
    dry_run: DryRun = False,
    verbose: common.Verbose = False,
    given: dict[str, Any] | None = None,
) -> None:
    """Train on a Gymnasium environment.

    Settings come from the preset, then from --config, then from the options. A task that is known
    has a preset of its own; the defaults that are shown here are those of classic.
    """
    _train("gym", env_id, preset, config, out, dry_run, given or {})


@train.command(name="atari")
@with_settings("atari")
def train_atari(
    game: Annotated[str, typer.Argument(metavar="GAME", help="An Atari game, such as Breakout.")],
    preset: AtariPreset = None,
    config: ConfigFile = None,
    out: Out = None,
    from_scratch: Annotated[
        bool, typer.Option("--from-scratch", help="Learn from nobody, unless --teacher is given.")
    ] = False,
    dry_run: DryRun = False,
    verbose: common.Verbose = False,
    given: dict[str, Any] | None = None,
) -> None:
    """Train on an Atari game: 84×84 grey, frame skip 4, stacks of 4.

    On a CPU it learns from the agent that comes with trdlab, if there is one of this game. When
    training is over, the decomposition of its policy is fitted. Settings come from the preset, then
    from --config, then from the options; the defaults that are shown here are those of cpu.
    """
    _train("atari", game, preset, config, out, dry_run, given or {}, from_scratch=from_scratch)


def resume(
    run: RunPath,
    checkpoint: Newest = None,
    agent_steps: Annotated[
        int | None,
        typer.Option(
            "--agent-steps", help="Steps in all, if more than before.", show_default="as it began"
        ),
    ] = None,
    teacher: Annotated[
        str | None,
        typer.Option(
            "--teacher",
            metavar="AGENT",
            help="Where its teacher is now, if it was moved; one that is code must be named.",
            show_default="as it began",
        ),
    ] = None,
    modules: common.Import = None,
    verbose: common.Verbose = False,
) -> None:
    """Go on with a run or a fit that was stopped, as if it had not been; or make a run longer."""
    from trdlab.agents.teachers import find_teacher
    from trdlab.cli.fit import go_on
    from trdlab.runs.folder import is_fit
    from trdlab.training.run import resume as pick_up

    path, step = named(run, checkpoint)
    if is_fit(path) and step is agent_steps is None:
        go_on(path)
        return

    def picked_up() -> "AbstractContextManager[Run]":
        return pick_up(path, step, agent_steps=agent_steps, find=find_teacher, teacher=teacher)

    _carry_on(picked_up, longer=agent_steps is not None)


def _train(
    kind: "Kind",
    env: str,
    preset_name: str | None,
    config: Path | None,
    out: Path | None,
    dry_run: bool,
    given: dict[str, Any],
    *,
    from_scratch: bool = False,
) -> None:
    from trdlab.training.run import begin
    from trdlab.training.setup import course_line, origin_line, plan, read_settings

    settings = read_settings(kind, env, preset_name, config, given, from_scratch=from_scratch)
    course = "" if config else course_line(settings, preset_name, given)
    origin = f"{origin_line(kind, env, preset_name, config)} {course}".strip()
    if dry_run:
        from trdlab.agents.teachers import find_teacher
        from trdlab.show.training import plan_page

        common.print_text(plan_page(plan(settings, find_teacher), origin))
        return
    if settings.teacher is None:
        _carry_on(lambda: begin(settings, out), origin)
        return
    _carry_on(lambda: _taught(settings, out), origin)


@contextmanager
def _taught(settings: "TrainSettings", out: Path | None) -> Iterator["Run"]:
    """Begins a run that learns from a teacher, and shows how that one is measured."""
    from trdlab.agents.teachers import find_teacher
    from trdlab.cli.progress import EpisodeProgress
    from trdlab.training.run import begin

    with ExitStack() as stack:
        with EpisodeProgress(common.errors(), "Measuring the teacher") as progress:
            told = progress.on_progress
            run = stack.enter_context(begin(settings, out, find=find_teacher, watch=told))
        yield run


def _carry_on(
    open_run: Callable[[], "AbstractContextManager[Run]"], origin: str = "", *, longer: bool = False
) -> None:
    """Trains a run to its end or to the next signal, and evaluates it at the end.

    Args:
        open_run: begins it, or picks it up.
        origin: where its settings are from, to be said.
        longer: whether it was told to take more steps, to be said too.
    """
    from trdlab.cli.fit import fit_run
    from trdlab.cli.progress import TrainingProgress, stopping
    from trdlab.deep.memory import available_memory
    from trdlab.environments.faults import EnvironmentFault
    from trdlab.errors import OutputError
    from trdlab.runs import best_step
    from trdlab.show.training import (
        best_line,
        duration,
        longer_line,
        memory_line,
        reached_line,
        stopped_line,
        teacher_line,
        updates_lines,
    )
    from trdlab.training.loading import own_fit
    from trdlab.training.run import carry_on

    errors = common.errors()
    with stopping() as stop, open_run() as run:
        path, settings = run.folder.path, run.trainer.settings
        go_on = f"Go on: {run.folder.resume_command}"
        common.say(errors, f"Run: {path}")
        if origin:
            common.say(errors, origin)
        if run.trainer.lessons:
            common.say(errors, teacher_line(settings, run.trainer.lessons.levels))
        if longer:
            common.say(errors, longer_line(settings, run.trainer.agent_steps))
        common.say(errors, memory_line(run.memory, available_memory()))
        for line in updates_lines(settings):
            common.say(errors, line)
        if run.problem is not None:
            common.say(errors, f"{run.problem.cause} New episodes are begun in their place.")
        with TrainingProgress(errors, settings.clock_end, run.trainer.clock) as progress:
            try:
                done = carry_on(
                    run,
                    on_metrics=progress.on_metrics,
                    on_step=progress.on_step,
                    should_stop=stop,
                )
            except (EnvironmentFault, OutputError) as error:  # which can be mended from outside
                raise type(error)(error.cause, f"{error.cure} {go_on}") from error
        steps, clock = run.trainer.agent_steps, run.trainer.clock
        if not done:
            common.say(errors, stopped_line(run.trainer.standing))
            common.say(errors, go_on)
            raise typer.Exit(stop.code or 0)
    common.say(errors, f"Trained {steps:,} agent steps in {duration(run.seconds)}.")
    best, episodes = best_step(run.folder), settings.checkpoint_episodes
    if line := best_line(path, clock, best, episodes=episodes):
        common.say(errors, line)
    if settings.evaluate_episodes:
        result = evaluated(path)
        if run.trainer.lessons:
            means = result.mean.value, result.interquartile_mean.value
            common.say(errors, reached_line(*means, run.trainer.lessons.levels))
        else:
            compare_with_chance(run.folder, result, settings)
    if settings.fit and own_fit(path, None) is None:
        fit_run(path)
