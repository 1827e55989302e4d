"""What a run finds on this machine: its device, its threads, its memory, its precision."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from trdlab.deep.settings import TrainSettings
from trdlab.environments import Environments
from trdlab.environments.stack import observation_space
from trdlab.errors import InputError


def resolved(settings: TrainSettings, environments: Environments) -> TrainSettings:
    """Returns the settings with what `auto`, 0 and a relative path stand for here.

    Args:
        settings: of which `auto` as the precision is found out in a second or two.
        environments: what it learns from.

    Raises:
        InputError: PyTorch does not find the device.
        TrdlabError: the replay memory, or the network with a batch, does not fit into what is free.
    """
    images = len(environments.observation_space.shape or ()) >= 2
    threads = settings.threads or (_cores() if images else 1)
    weights = str(Path(settings.weights).resolve()) if settings.weights else None
    device = _device(settings.device)
    settings = replace(settings, device=device, threads=threads, weights=weights)
    _check_fits(settings, environments)
    if settings.precision != "auto":
        return settings
    from trdlab.deep.precision import quicker_precision

    use_threads(settings)
    space, num_actions = observation_space(environments), environments.num_actions
    return replace(settings, precision=quicker_precision(space, num_actions, settings))


def check_threads(settings: TrainSettings) -> None:
    """Refuses more threads than there are processors: PyTorch would crash with some of them.

    Only where a run begins: one that began on a larger machine may go on here.

    Raises:
        InputError: there are more.
    """
    processors = max(os.cpu_count() or 1, _cores())
    if settings.threads > processors:
        raise InputError(
            f"`threads` is {settings.threads}, and the machine has {processors} "
            f"processor{'' if processors == 1 else 's'}.",
            "Choose at most as many, or 0.",
        )


def use_threads(settings: TrainSettings) -> None:
    """Lets PyTorch use as many threads as a run was made for, in all of this process.

    More of them make a small network slower, and other results than those of the run.
    """
    import torch

    torch.set_num_threads(settings.threads)


def memory_of(
    settings: TrainSettings, environments: Environments, frame_nbytes: float | None = None
) -> int:
    """Returns the bytes that the full replay memory of a run takes: the larger one, if it has two.

    Args:
        settings: with its capacity.
        environments: what it remembers.
        frame_nbytes: what a frame takes in it, if that has been measured.
    """
    from trdlab.deep.lessons import TAUGHT
    from trdlab.deep.memory import memory_needed

    space, has_teacher = environments.observation_space, settings.teacher is not None
    extras = {TAUGHT: ((environments.num_actions,), np.float32)} if has_teacher else None
    return memory_needed(
        max(settings.capacity, settings.teacher_steps if has_teacher else 0),
        space.shape or (),
        np.dtype(space.dtype),
        num_envs=environments.num_envs,
        frame_nbytes=frame_nbytes,
        extras=extras,
    )


def _check_fits(settings: TrainSettings, environments: Environments) -> None:
    from trdlab.deep.device_frames import device_nbytes
    from trdlab.deep.memory import check_learner, check_memory, learner_nbytes
    from trdlab.deep.networks import build_network

    check_memory(memory_of(settings, environments), settings.capacity)
    if "cuda" in settings.device:
        space, most = environments.observation_space, max(settings.capacity, settings.teacher_steps)
        frames = device_nbytes(most, space.shape or (), np.dtype(space.dtype))
        free = _free_on(settings.device)
        check_memory(frames, most, free, f"On {settings.device}, a replay memory")
    network = build_network(
        observation_space(environments),
        environments.num_actions,
        settings.time_axis,
        seed=None,  # shapes alone
        hidden=settings.hidden,
        policy_head=settings.distil == "policy",
    )
    check_learner(learner_nbytes(network, settings.batch_size), _free_on(settings.device))


def _cores() -> int:
    """Returns how many threads may compute here: as the user says, or the system."""
    told = os.environ.get("OMP_NUM_THREADS", "")
    if told.isdigit() and int(told) > 0:
        return int(told)
    if hasattr(os, "sched_getaffinity"):  # a container may have fewer than the machine
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _device(wanted: str) -> str:
    import torch

    found = ["cpu"]
    if torch.cuda.is_available():
        found.append("cuda")
    if torch.backends.mps.is_available():
        found.append("mps")
    if wanted == "auto":
        return found[1] if len(found) > 1 else "cpu"
    try:
        known = torch.device(wanted).type in found
    except RuntimeError:  # it is no device anywhere
        known = False
    if not known:
        raise InputError(
            f"PyTorch finds no device '{wanted}' here.", f"Use one of: auto, {', '.join(found)}."
        )
    return wanted


def _free_on(device: str) -> int | None:
    """Returns the bytes that are free where a network is to learn; None if unknown."""
    import torch

    from trdlab.deep.memory import available_memory

    return torch.cuda.mem_get_info(device)[0] if "cuda" in device else available_memory()
