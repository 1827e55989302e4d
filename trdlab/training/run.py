"""A run in its folder: begun, carried on, stopped, picked up again."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from hashlib import file_digest
from pathlib import Path
from typing import Any

from trdlab.deep.board import board, check_board
from trdlab.deep.lessons import Levels
from trdlab.deep.settings import TrainSettings
from trdlab.deep.trainer import Trainer, TrainMetrics
from trdlab.environments.interface import Interface
from trdlab.environments.making import check_imported
from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.policies.functions import PYTHON
from trdlab.policies.weights import read_weights
from trdlab.rollouts.playing import Watch, unwatched
from trdlab.runs import (
    MetricsFile,
    RunFolder,
    checkpoint_steps,
    load_checkpoint,
    save_checkpoint,
)
from trdlab.runs.folder import check_free, is_run
from trdlab.runs.pretrained import PRETRAINED, is_shipped
from trdlab.training.loading import (
    estimator_of,
    evaluate_checkpoint,
    interface_of,
    run_settings,
)
from trdlab.training.machine import check_threads, memory_of, resolved
from trdlab.training.setup import default_path, describe, make_environments, new_trainer
from trdlab.training.teaching import Candidate, FindTeacher, levels_of, measure


@dataclass(eq=False)
class Run:
    """A run that this process holds.

    Args:
        folder: where it is kept.
        trainer: what learns.
        metrics: where its numbers go.
        memory: the bytes that the replay memory takes when it is full.
        seconds: how long it has been trained, this process and those before.
        problem: what could not be restored when it was picked up, or None.
    """

    folder: RunFolder
    trainer: Trainer
    metrics: MetricsFile
    memory: int
    seconds: float = 0.0
    problem: TrdlabError | None = None

    def save(self, *, stopped: bool = False) -> None:
        """Saves a checkpoint, with the score by which the best is found.

        Args:
            stopped: whether it is there only because the run was stopped. No episodes are played to
                score it: the agent of a run does not depend on where it was interrupted.

        Raises:
            OutputError: the disk is full; earlier checkpoints stay.
            EnvironmentFault: an environment in which it is evaluated fails; likewise.
        """
        score = self._score(stopped=stopped)
        state = self.trainer.state_dict()
        state["q_network"] = state["learner"].pop("q_network")  # so that it can be read alone
        blocks = state["memory"]["frames"].pop("sealed")
        state["run"] = {"seconds": self.seconds}
        self.metrics.sync()
        save_checkpoint(self.folder, self.trainer.clock, state, blocks, score=score)

    def _score(self, *, stopped: bool) -> float | None:
        """Returns the mean return of episodes played for it, or else of those of training."""
        settings, begun = self.trainer.settings, time.perf_counter()
        if not settings.checkpoint_episodes and self.trainer.phase == "online":
            return self.trainer.scores.mean_return
        if stopped or not settings.checkpoint_episodes or self.trainer.phase == "teacher":
            return None
        learner, step = self.trainer.learner, self.trainer.clock
        agent = estimator_of(settings, learner.agent, learner.device)
        result = evaluate_checkpoint(self.folder, settings, step, agent)
        self.seconds += time.perf_counter() - begun
        return float(result.returns.mean())


@contextmanager
def begin(
    settings: TrainSettings,
    path: Path | None = None,
    *,
    find: FindTeacher | None = None,
    watch: Watch = unwatched,
) -> Iterator[Run]:
    """Begins a run in a new folder.

    Args:
        settings: what to do.
        path: the folder; by default a new one, of a name that no other run takes meanwhile.
        find: finds its teacher, if it has one.
        watch: told how far the episodes are in which the teacher is measured.

    Raises:
        InputError: the environments cannot be made, or have no network; or the teacher does not
            fit, or is not clearly better than random actions.
        OutputError: the folder exists, or cannot be written.
        TrdlabError: it does not fit into what is free.
    """
    with ExitStack() as stack:
        if path is not None:
            check_free(path)
        check_threads(settings)
        candidate, noted = _candidate(settings, find), dict[str, Any]()
        if candidate is not None:
            settings = replace(settings, teacher=candidate.name)

        def measured(settings: TrainSettings, who: Candidate) -> Levels:
            levels, told = measure(settings, who, watch)
            noted.update(told)
            return levels

        trainer, memory = _trainer(settings, stack, candidate, measured)
        folder = _new_folder(trainer, path, noted)
        stack.enter_context(folder.held())
        yield Run(folder, trainer, stack.enter_context(MetricsFile(folder.metrics, 0)), memory)


@contextmanager
def resume(
    path: Path,
    step: int | None = None,
    *,
    agent_steps: int | None = None,
    find: FindTeacher | None = None,
    teacher: str | None = None,
) -> Iterator[Run]:
    """Picks up a run where its newest checkpoint stands, or at its beginning if there is none.

    Args:
        path: its folder.
        step: of an older checkpoint, by the trainer's clock.
        agent_steps: to take in all, if that is to be more than before. Only the learning rate
            depends on it, where it is told to fall: from then on it is that of a run which was to
            be so long from the beginning. Without that, the run becomes that run, to the bit.
        find: finds its teacher, if it has one.
        teacher: where that is now, if it was moved. One that is code must be named: nothing is
            executed because a run says so.

    Raises:
        InputError: there is no run, no such checkpoint, its configuration has been changed, it
            takes more steps than that already, or its teacher is another one now.
        NotImported: its environment needs a module that has not been imported.
        TrdlabError: another process holds it, or something is torn.
    """
    if is_shipped(path):
        name = f"{PRETRAINED}{path.name}"
        raise InputError(
            f"'{name}' comes with trdlab, and is left as it is.",
            f"Let another one learn from it: --teacher {name}",
        )
    folder = RunFolder.open(path)
    before = run_settings(folder)
    settings = _longer(before, agent_steps)
    check_imported(settings.env)
    with ExitStack() as stack:
        stack.enter_context(folder.held())
        candidate = _candidate(_trusted(settings, teacher), find)
        trainer, memory = _trainer(
            settings, stack, candidate, lambda _, who: levels_of(folder, who)
        )
        interface_of(folder).check_fits(Interface.of(trainer.environments), settings.env)
        if checkpoint_steps(folder) or step is not None:
            seconds, problem = _restore(trainer, folder, step)
        else:
            _check_same_weights(folder, _given_weights(trainer))
            seconds, problem = 0.0, None
        if settings != before:
            folder = folder.extended(settings.agent_steps, trainer.agent_steps)
        metrics = stack.enter_context(MetricsFile(folder.metrics, trainer.clock))
        yield Run(folder, trainer, metrics, memory, seconds, problem)


def carry_on(
    run: Run,
    *,
    on_metrics: Callable[[TrainMetrics], None] = lambda metrics: None,
    on_step: Callable[[Trainer], None] = lambda trainer: None,
    should_stop: Callable[[], bool] = lambda: False,
) -> bool:
    """Trains to the end, or until it should stop; saves in either case.

    Args:
        run: what to carry on.
        on_metrics: told every `log_every` steps of the clock, after the line was written.
        on_step: told after each step of the trainer.
        should_stop: asked before each step.

    Returns:
        Whether the run has come to its end.

    Raises:
        TrdlabError: the loss is not finite. The last checkpoint stays the one before.
        OutputError: the disk is full; likewise.
    """
    trainer, settings = run.trainer, run.trainer.settings
    if trainer.done:  # and saved
        return True
    saved, since = -1, time.perf_counter()
    with board(run.folder.tensorboard, trainer.clock, wanted=settings.tensorboard) as shown:
        while not trainer.done and not should_stop():
            before, phase = trainer.clock, trainer.phase
            trainer.step()
            now = time.perf_counter()
            run.seconds, since = run.seconds + now - since, now
            if _passes(before, trainer.clock, settings.log_every):
                metrics = trainer.metrics()
                row = {**metrics.row(), "seconds": round(run.seconds, 3)}
                run.metrics.append(row)
                shown.write(row, trainer.clock)
                on_metrics(metrics)
            if _passes(before, trainer.clock, settings.checkpoint_every) or trainer.phase != phase:
                run.save()
                saved, since = trainer.clock, time.perf_counter()
            on_step(trainer)
    if saved != trainer.clock:
        run.save(stopped=not trainer.done)
    return trainer.done


def _candidate(settings: TrainSettings, find: FindTeacher | None) -> Candidate | None:
    """Returns the agent that settings name as a teacher; None where they name none."""
    if settings.teacher is None:
        return None
    if find is None:
        raise TypeError("Nobody was given who finds a teacher.")
    return find(settings)


def _trusted(settings: TrainSettings, teacher: str | None) -> TrainSettings:
    """Returns settings with the name by which to find the teacher of a run that goes on."""
    if settings.teacher is None and teacher is not None:
        raise InputError("The run has no teacher.", "Leave out `teacher`.")
    if (settings.teacher or "").startswith(PYTHON) and teacher is None:
        raise InputError(
            f"The teacher of the run is code, which would be executed: '{settings.teacher}'.",
            "If you trust it, name it again as `teacher`.",
        )
    return settings if teacher is None else replace(settings, teacher=teacher)


def _longer(settings: TrainSettings, agent_steps: int | None) -> TrainSettings:
    """Returns settings for more agent steps, if there are to be more."""
    if agent_steps is None:
        return settings
    if agent_steps < settings.agent_steps:
        raise InputError(
            f"`agent_steps` is {agent_steps}, and the run takes {settings.agent_steps} already.",
            "Choose more: a run can become longer, and not shorter.",
        )
    return replace(settings, agent_steps=agent_steps)


def _trainer(
    settings: TrainSettings,
    stack: ExitStack,
    teacher: Candidate | None,
    level: Callable[[TrainSettings, Candidate], Levels],
) -> tuple[Trainer, int]:
    """Returns a trainer at its beginning, and the bytes that its replay memory will take."""
    check_board(wanted=settings.tensorboard)
    if teacher is not None:
        settings = teacher.settled(settings)
    environments = teacher.make(settings) if teacher else make_environments(settings)
    stack.callback(environments.close)
    settings = resolved(settings, environments)
    taught = None
    if teacher is not None:
        taught = teacher.teacher(settings), level(settings, teacher)
    return new_trainer(settings, environments, taught), memory_of(settings, environments)


def _new_folder(trainer: Trainer, path: Path | None, noted: dict[str, Any]) -> RunFolder:
    """Makes the folder of a run; without a path it looks for a name until one is its own."""
    extra = {"environment": describe(trainer.environments), **_given_weights(trainer), **noted}
    while True:
        place = path or default_path(trainer.settings)
        try:
            return RunFolder.create(place, trainer.settings.to_config(), extra)
        except OutputError:
            if path or not is_run(place):
                raise  # else a run that began at the same time was quicker


def _restore(
    trainer: Trainer, folder: RunFolder, step: int | None
) -> tuple[float, TrdlabError | None]:
    """Puts a trainer where a checkpoint stands.

    Returns:
        The seconds of training until then, and what could not be restored.
    """
    checkpoint = load_checkpoint(folder, step)
    state = checkpoint.state
    state["learner"]["q_network"] = state.pop("q_network")
    state["memory"]["frames"]["sealed"] = checkpoint.blocks
    problem = trainer.load_state_dict(state)
    return state["run"]["seconds"], problem


def _given_weights(trainer: Trainer) -> dict[str, Any]:
    """Gives a trainer the weights that its settings name; returns what to note of them."""
    file = trainer.settings.weights
    if file is None:
        return {}
    trainer.begin_with(read_weights(file))
    with Path(file).open("rb") as content:
        return {"weights": {"file": file, "sha256": file_digest(content, "sha256").hexdigest()}}


def _check_same_weights(folder: RunFolder, given: dict[str, Any]) -> None:
    begun_with = folder.manifest.get("weights")
    if given.get("weights") != begun_with:
        file = (begun_with or given["weights"])["file"]
        raise InputError(
            f"The run '{folder.path}' began with other weights than those in '{file}' now.",
            "Put them back, or begin another run.",
        )


def _passes(before: int, after: int, every: int) -> bool:
    return after // every > before // every
