"""What a run is made of, from its settings: the environments, the device, the plan."""

import math
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trdlab.deep.presets import preset, preset_line, with_teacher
from trdlab.deep.settings import Kind, TrainSettings, checked
from trdlab.environments import Environments
from trdlab.environments.arguments import parse_arguments
from trdlab.environments.interface import Interface
from trdlab.environments.paying import paying, split_pays
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.files import check_small_text, free_name
from trdlab.runs import read_config
from trdlab.runs.pretrained import PRETRAINED, pretrained_names
from trdlab.training.machine import check_threads, memory_of, resolved, use_threads

if TYPE_CHECKING:
    from trdlab.deep.lessons import Levels
    from trdlab.deep.trainer import Trainer
    from trdlab.policies.teacher import Teacher
    from trdlab.training.teaching import FindTeacher

_MEASURED_SECONDS = 3.0


def read_settings(
    kind: Kind,
    env: str,
    preset_name: str | None,
    config: Path | None,
    given: Mapping[str, Any],
    *,
    from_scratch: bool = False,
) -> TrainSettings:
    """Returns settings from a preset, then a file, then single options; later ones win.

    A file that says what it is for is complete, such as a run's own: no preset stands behind it.
    Without either, Atari games are learned as suits the machine, and on a CPU from the agent that
    comes with trdlab, if there is one of that game.

    Args:
        kind: of the run.
        env: where it acts.
        preset_name: of the preset; None for the environment's own, or what suits the machine.
        config: the file.
        given: the options.
        from_scratch: whether to learn from nobody, unless a teacher is given.

    Raises:
        InputError: there is no such preset or file, or a key or value cannot be used.
    """
    preset_name = preset_name or usual_preset(kind)
    base, in_file, lines = preset(kind, env, preset_name), dict[str, Any](), dict[str, Any]()
    if config is not None:
        lines = _lines_of(config)
        for key, here in (("kind", kind), ("env", env)):
            if lines.get(key, here) != here:
                raise InputError(f"'{config}' is for another {key}.", f"Here it is '{here}'.")
        if _is_complete(lines):
            base = TrainSettings(kind, env)
        in_file = checked(lines, f"'{config}'")
    # together, since one may only be in its range beside another
    told = {**in_file, **checked(given, "The command")}
    own = shipped_teacher(kind, env) if preset_name == "cpu" and not from_scratch else None
    if own is not None and not _is_complete(lines):
        told = {"teacher": own, **told}
    is_taught = "teacher" in told and base.teacher is None and not _is_complete(lines)
    taught = with_teacher(kind, base, preset_name) if is_taught else {}
    return replace(base, **{**taught, **told})


def usual_preset(kind: Kind) -> str | None:
    """Returns the preset of Atari games that suits the machine; None for other environments."""
    if kind != "atari":
        return None
    import torch

    return "gpu" if torch.cuda.is_available() else "cpu"


def shipped_teacher(kind: Kind, env: str) -> str | None:
    """Returns the agent that comes with trdlab for an Atari game; None where there is none.

    Raises:
        InputError: there is no such game.
    """
    if kind != "atari":
        return None
    from trdlab.atari.names import find_game

    game = find_game(env)
    return f"{PRETRAINED}{game}" if game in pretrained_names() else None


def origin_line(kind: Kind, env: str, preset_name: str | None, config: Path | None) -> str:
    """Returns where `read_settings` takes its settings from, and what may be expected of them.

    Raises:
        InputError: there is no such file.
    """
    if config is not None and _is_complete(_lines_of(config)):
        return f"Settings: those of '{config}'."
    return preset_line(kind, env, preset_name or usual_preset(kind))


def course_line(settings: TrainSettings, preset_name: str | None, given: Mapping[str, Any]) -> str:
    """Returns what may be expected of the preset `cpu` as it is; empty where more was told.

    Args:
        settings: of the run.
        preset_name: of the preset; None for the usual one.
        given: all that was told beside it.

    >>> told = {"teacher": "a.pt"}
    >>> course_line(preset("atari", "Pong").changed(told), "cpu", told)
    'With a teacher it takes about half an hour on two cores.'
    >>> course_line(preset("atari", "Pong", "paper"), "paper", {})
    ''
    """
    is_cpu = (preset_name or usual_preset(settings.kind)) == "cpu"
    if not is_cpu or given.keys() - {"teacher", "seed"}:
        return ""
    if settings.teacher is not None:
        return "With a teacher it takes about half an hour on two cores."
    return (
        "From scratch a CPU takes hours for a million steps, and in these few games get far: "
        "--teacher takes less."
    )


def _lines_of(config: Path) -> dict[str, Any]:
    check_small_text(config)
    return read_config(config)


def _is_complete(lines: Mapping[str, Any]) -> bool:
    return lines.keys() >= {"kind", "env"}


def default_path(settings: TrainSettings) -> Path:
    """Returns a folder for a run that does not exist yet, named after what it learns."""
    env = re.sub(r"[^A-Za-z0-9.-]+", "-", settings.env.rpartition("/")[2])
    stem = f"{env}-N{settings.horizon}-w{settings.width}-seed{settings.seed}"
    return free_name(Path("runs"), stem)


def make_environments(
    settings: TrainSettings, num_envs: int | None = None, seed: int | None = None
) -> Environments:
    """Makes the environments of a run, or of its evaluation.

    Args:
        settings: which ones.
        num_envs: how many; by default as many as the run has.
        seed: what their seeds are drawn from; by default that of the run.

    Raises:
        InputError: they cannot be made, or have more or fewer actions than the settings name.
    """
    environments = _made(settings, num_envs, seed)
    if settings.action_names:
        named = Interface.of(environments).named(settings.action_names)
        environments.action_names = named.action_names
    return environments


def _made(settings: TrainSettings, num_envs: int | None, seed: int | None) -> Environments:
    arguments, pays = split_pays(parse_arguments(settings.env_arg))
    count = settings.num_envs if num_envs is None else num_envs
    seed = settings.seed if seed is None else seed
    if settings.kind == "atari":
        from trdlab.atari import AtariEnvironments, GreyAndColour

        made = GreyAndColour if arguments.pop("screens", False) else AtariEnvironments
        return paying(made(settings.env, count, seed=seed, **_for_atari(arguments)), pays)
    from trdlab.environments import GymEnvironments

    return paying(GymEnvironments(settings.env, count, seed=seed, env_arguments=arguments), pays)


def new_trainer(
    settings: TrainSettings,
    environments: Environments,
    teacher: "tuple[Teacher, Levels] | None" = None,
) -> "Trainer":
    """Returns the trainer of a run, and lets PyTorch use as many threads as it should."""
    from trdlab.deep.trainer import Trainer

    use_threads(settings)
    return Trainer(settings, environments, teacher)


def describe(environments: Environments) -> dict[str, Any]:
    """Returns what must be known of environments to use their agent without them; plain data."""
    return {
        **Interface.of(environments).to_dict(),
        "time_limit": environments.time_limit,
        "frame_skip": environments.frame_skip,
        "frames_per_second": environments.frames_per_second,
    }


def future(settings: TrainSettings) -> Future:
    """Returns whose future the agent of a run tells: which policy, which reward, which ending."""
    policy = "the greedy policy of the network"
    if settings.distil == "policy":
        how = "drawing its actions" if settings.draw else "its likeliest action each time"
        policy = f"the policy head of the network ({how})"
    if settings.width > 1:
        policy += f" (for the first {settings.width} steps, the ε-greedy one it learned from)"
    return Future(policy, settings.clip_rewards, settings.life_loss_ends)


@dataclass(frozen=True)
class Plan:
    """What a run will take on this machine.

    Args:
        settings: as resolved.
        memory: the bytes of the full replay memory.
        available: the bytes that are free; None if unknown.
        seconds: of training, as measured in a few seconds of it.
        steps_per_second: agent steps of all environments together, while learning.
    """

    settings: TrainSettings
    memory: int
    available: int | None
    seconds: float
    steps_per_second: float


def plan(settings: TrainSettings, find: "FindTeacher | None" = None) -> Plan:
    """Makes a run in miniature, learns for a few seconds, and says what the whole one will take.

    Args:
        settings: of the run.
        find: finds its teacher, if it has one; that is not measured.

    Raises:
        InputError: the environments cannot be made, or have no network; or there is no such
            teacher.
        TrdlabError: the run does not fit into what is free.
    """
    from trdlab.deep.lessons import Levels
    from trdlab.deep.memory import available_memory
    from trdlab.policies.weights import read_weights

    check_threads(settings)
    candidate = find(settings) if find and settings.teacher else None
    if candidate is not None:
        settings = candidate.settled(settings)
    environments = candidate.make(settings) if candidate else make_environments(settings)
    try:
        settings = resolved(settings, environments)
        warm_up = 4 * max(settings.batch_size, settings.width * settings.num_envs)
        begun = replace(settings, learning_starts=warm_up, capacity=20 * warm_up)
        taught = None
        if candidate is not None:
            if settings.offline_updates:
                begun = replace(begun, teacher_steps=warm_up, offline_updates=1_000_000)
            taught = candidate.teacher(settings), Levels(1.0, 0.0)
        trainer = new_trainer(begun, environments, taught)
        if settings.weights:
            trainer.begin_with(read_weights(settings.weights))
        before = _seconds_before(trainer, settings, warm_up)
        acting = _steps_per_second(trainer, until=warm_up, at_most=_MEASURED_SECONDS)
        first_updates = trainer.learner.num_updates + 2
        while trainer.learner.num_updates < first_updates:  # what PyTorch does once
            trainer.step()
        # ε is 1 in the beginning; what acts greedily must look at the network
        trainer.settings = replace(begun, epsilon_start=settings.epsilon_end)
        learning = _steps_per_second(trainer, until=None, at_most=_MEASURED_SECONDS)
        first = min(settings.learning_starts, settings.agent_steps)
        seconds = before + first / acting + (settings.agent_steps - first) / learning
        memory = memory_of(settings, environments, _measured_frame(environments, trainer))
        return Plan(settings, memory, available_memory(), seconds, learning)
    finally:
        environments.close()


def _measured_frame(environments: Environments, trainer: "Trainer") -> float | None:
    """Returns what a frame takes in the memory, where that depends on what it shows."""
    from trdlab.deep.frames import compresses

    space = environments.observation_space
    compressed = compresses(space.shape or (), np.dtype(space.dtype))
    return trainer.memory.bytes_per_frame if compressed else None


def _seconds_before(trainer: "Trainer", settings: TrainSettings, steps: int) -> float:
    """Returns what a run takes before its agent acts, and goes there in miniature."""
    if trainer.lessons is None or not settings.offline_updates:
        return 0.0
    teacher = _steps_per_second(trainer, until=steps, at_most=math.inf)
    offline = _steps_per_second(trainer, until=None, at_most=_MEASURED_SECONDS)
    done = trainer.lessons.offline_updates + 1
    trainer.lessons.settings = replace(trainer.lessons.settings, offline_updates=done)
    trainer.step()
    return settings.teacher_steps / teacher + settings.offline_updates / offline


def _steps_per_second(trainer: "Trainer", *, until: int | None, at_most: float) -> float:
    begun, before = time.perf_counter(), trainer.clock
    while (passed := time.perf_counter() - begun) < at_most:
        if until is not None and trainer.clock - before >= until:
            break
        trainer.step()
    return (trainer.clock - before) / max(passed, 1e-9)


def _for_atari(arguments: dict[str, Any]) -> dict[str, Any]:
    """Returns the arguments of `AtariEnvironments`, checked by name."""
    from inspect import signature

    from trdlab.atari import AtariEnvironments
    from trdlab.errors import closest

    known = set(signature(AtariEnvironments).parameters) - {"game", "num_envs", "seed"}
    for name in arguments:
        if name not in known:
            raise InputError(f"Atari games take no argument '{name}'.", closest(name, known))
    return arguments
