"""What a run is made of, from its settings: the environments, the device, the plan."""

import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np

from trdlab.deep.presets import preset
from trdlab.deep.settings import Kind, TrainSettings, checked
from trdlab.environments import Environments
from trdlab.environments.arguments import parse_arguments
from trdlab.environments.stack import observation_space
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.files import check_small_text
from trdlab.runs import free_name, read_config
from trdlab.training.machine import check_threads, memory_of, resolved, use_threads

if TYPE_CHECKING:
    from trdlab.deep.trainer import Trainer

_MEASURED_SECONDS = 3.0


def read_settings(
    kind: Kind,
    env: str,
    preset_name: str | None,
    config: Path | None,
    given: Mapping[str, Any],
) -> TrainSettings:
    """Returns settings from a preset, then a file, then single options; later ones win.

    A file that says what it is for is complete, such as a run's own: no preset stands behind it.

    Raises:
        InputError: there is no such preset or file, or a key or value cannot be used.
    """
    base, in_file = preset(kind, env, preset_name), {}
    if config is not None:
        check_small_text(config)
        lines = read_config(config)
        for key, here in (("kind", kind), ("env", env)):
            if lines.get(key, here) != here:
                raise InputError(f"'{config}' is for another {key}.", f"Here it is '{here}'.")
        if lines.keys() >= {"kind", "env"}:
            base = TrainSettings(kind, env)
        in_file = checked(lines, f"'{config}'")
    # together, since one may only be in its range beside another
    return replace(base, **{**in_file, **checked(given, "The command")})


def default_path(settings: TrainSettings) -> Path:
    """Returns a folder for a run that does not exist yet, named after what it learns."""
    env = re.sub(r"[^A-Za-z0-9.-]+", "-", settings.env.rpartition("/")[2])
    stem = f"{env}-N{settings.horizon}-w{settings.width}-seed{settings.seed}"
    return free_name(Path("runs"), stem)


def make_environments(
    settings: TrainSettings, *, num_envs: int | None = None, seed: int | None = None
) -> Environments:
    """Makes the environments of a run, or of its evaluation.

    Args:
        settings: which ones.
        num_envs: how many; by default as many as the run has.
        seed: what their seeds are drawn from; by default that of the run.

    Raises:
        InputError: they cannot be made.
    """
    arguments = parse_arguments(settings.env_arg)
    count = settings.num_envs if num_envs is None else num_envs
    seed = settings.seed if seed is None else seed
    if settings.kind == "atari":
        from trdlab.atari import AtariEnvironments

        return AtariEnvironments(settings.env, count, seed=seed, **_for_atari(arguments))
    from trdlab.environments import GymEnvironments

    return GymEnvironments(settings.env, count, seed=seed, env_arguments=arguments)


def new_trainer(settings: TrainSettings, environments: Environments) -> "Trainer":
    """Returns the trainer of a run, and lets PyTorch use as many threads as it should."""
    from trdlab.deep.trainer import Trainer

    use_threads(settings)
    return Trainer(settings, environments)


def describe(environments: Environments, action_names: Sequence[str] = ()) -> dict[str, Any]:
    """Returns what must be known of environments to use their agent without them; plain data.

    Args:
        environments: which ones.
        action_names: A names, where people call the actions otherwise than the environment.

    Raises:
        InputError: there are more or fewer names than actions.
    """
    if action_names and len(action_names) != environments.num_actions:
        raise InputError(
            f"There are {len(action_names)} names for {environments.num_actions} actions: "
            f"{', '.join(action_names)}.",
            "Give one for each action.",
        )
    space = observation_space(environments)
    if isinstance(space, gym.spaces.Discrete):
        seen: dict[str, Any] = {"states": int(space.n), "first_state": int(space.start)}
    else:
        seen = {"shape": list(space.shape or ()), "dtype": np.dtype(space.dtype).name}
    return {
        "observation": seen,
        "num_actions": environments.num_actions,
        "first_action": environments.first_action,
        "action_names": list(action_names or environments.action_names),
        "time_limit": environments.time_limit,
        "frame_skip": environments.frame_skip,
        "frames_per_second": environments.frames_per_second,
    }


def described_space(observation: Mapping[str, Any]) -> gym.spaces.Space[Any]:
    """Returns the observation space that `describe` wrote down (bounds are not kept)."""
    if "states" in observation:
        return gym.spaces.Discrete(observation["states"], start=observation["first_state"])
    dtype = np.dtype(observation["dtype"])
    low, high = (0, 255) if dtype == np.uint8 else (-np.inf, np.inf)
    return gym.spaces.Box(low, high, tuple(observation["shape"]), dtype=dtype.type)


def future(settings: TrainSettings) -> Future:
    """Returns whose future the agent of a run tells: which policy, which reward, which ending."""
    policy = "the greedy policy of the network"
    if settings.width > 1:
        policy += f" (for the first {settings.width} steps, the ε-greedy one it learned from)"
    reward = "sign of each reward" if settings.clip_rewards else Future(policy).reward
    ending = "a lost life, or the end of the game" if settings.life_loss_ends else "terminal states"
    return Future(policy, reward, ending)


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


def plan(settings: TrainSettings) -> Plan:
    """Makes a run in miniature, learns for a few seconds, and says what the whole one will take.

    Raises:
        InputError: the environments cannot be made, or have no network.
        TrdlabError: the run does not fit into what is free.
    """
    from trdlab.deep.memory import available_memory
    from trdlab.deep.weights import read_weights

    check_threads(settings)
    environments = make_environments(settings)
    try:
        settings = resolved(settings, environments)
        describe(environments, settings.action_names)  # refuses what a run would refuse
        warm_up = 4 * max(settings.batch_size, settings.width * settings.num_envs)
        begun = replace(settings, learning_starts=warm_up, capacity=20 * warm_up)
        trainer = new_trainer(begun, environments)
        if settings.weights:
            trainer.begin_with(read_weights(settings.weights))
        acting = _steps_per_second(trainer, until=warm_up, at_most=_MEASURED_SECONDS)
        while trainer.learner.num_updates < 2:  # what PyTorch does once
            trainer.step()
        # ε is 1 in the beginning; what acts greedily must look at the network
        trainer.settings = replace(begun, epsilon_start=settings.epsilon_end)
        learning = _steps_per_second(trainer, until=None, at_most=_MEASURED_SECONDS)
        first = min(settings.learning_starts, settings.agent_steps)
        seconds = first / acting + (settings.agent_steps - first) / learning
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


def _steps_per_second(trainer: "Trainer", *, until: int | None, at_most: float) -> float:
    begun, before = time.perf_counter(), trainer.agent_steps
    while (passed := time.perf_counter() - begun) < at_most:
        if until is not None and trainer.agent_steps >= until:
            break
        trainer.step()
    return (trainer.agent_steps - before) / max(passed, 1e-9)


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
