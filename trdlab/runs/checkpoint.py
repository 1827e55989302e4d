"""Checkpoints: each whole or not there, and every byte checked when it is read.

A checkpoint is a folder `checkpoints/STEP` with `state.json`, `score.json` if there was a score,
one safetensors file for each top-level key of the state that holds arrays, and `index.json`, which
lists these files, and the blocks that belong to it, with lengths and checksums. A block is a file
in `replay/` that never changes, so that checkpoints can share it.
"""

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from safetensors import SafetensorError
from safetensors.numpy import load, save

from trdlab.errors import InputError, OutputError, TrdlabError, closest
from trdlab.files import write_whole
from trdlab.runs.folder import RunFolder
from trdlab.runs.index import Index, Sum, check_names, read_whole
from trdlab.runs.keeping import (
    SCORE,
    Saved,
    all_saved,
    announce,
    best_of,
    blocks_before,
    forget,
    new_folder,
    sweep,
)
from trdlab.runs.pretrained import PRETRAINED, pretrained_path
from trdlab.runs.state import Arrays, pack, unpack

Read = TypeVar("Read")
STATE, TENSORS = "state.json", ".safetensors"
BEST = "best"
"""Instead of a step: the checkpoint of the best score."""


@dataclass(frozen=True)
class Checkpoint:
    """What was saved.

    Args:
        step: when, in agent steps.
        state: nested mappings and lists of plain values, arrays (writable) and bytes.
        blocks: the shared blocks by name.
    """

    step: int
    state: dict[str, Any]
    blocks: dict[str, bytes]


def save_checkpoint(
    run: RunFolder,
    step: int,
    state: Mapping[str, Any],
    blocks: Mapping[str, Any] | None = None,
    *,
    score: float | None = None,
    keep: int = 2,
) -> None:
    """Saves a checkpoint, and then deletes old ones and the blocks that none needs any more.

    The one of the best score is never deleted for its age. Checkpoints at this step or later are
    deleted, too: the run went back, and they are of a past that did not happen. Only the process
    that holds the run may save.

    Args:
        run: the run.
        step: when, in agent steps.
        state: nested mappings and lists of JSON values, numpy arrays and bytes.
        blocks: bytes, or what can be read like them, by name. Those that the checkpoint before has,
            with the same contents, are not written again.
        score: by which checkpoints are compared, larger being better.
        keep: how many checkpoints to keep, this one included, besides the best.

    Raises:
        InputError: the state holds what cannot be saved, or a key cannot name a file.
        OutputError: the disk is full, or cannot be written. Earlier checkpoints are untouched.
    """
    tree, arrays = pack(state)
    blocks = blocks or {}
    check_names((*arrays, *blocks))
    index = Index({}, {name: Sum.of(block) for name, block in blocks.items()})
    try:
        sweep(run)  # makes room before room is needed
        folder, there = new_folder(run, step), blocks_before(run, step)
        new = {name: file for name, file in index.block_files.items() if file not in there}
        announce(run, folder, {name: index.blocks[name] for name in new})
        for name, file in new.items():
            write_whole(run.replay / file, partial(Path.write_bytes, data=blocks[name]))
        write_whole(folder, lambda temporary: _write(temporary, tree, arrays, index.blocks, score))
    except (OutputError, OSError) as error:
        with suppress(OSError):  # the first failure is the one to tell
            sweep(run)
        raise _not_saved(run, step, error) from error
    forget(run, step, folder, keep)


def load_checkpoint(run: RunFolder, step: int | None = None) -> Checkpoint:
    """Loads a checkpoint, the newest one unless a step is given; every byte is checked.

    Raises:
        InputError: there is none, or none at that step.
        TrdlabError: it is torn. Another one that is whole is named, and not taken silently.
    """
    return _read(run, step, partial(_load, run))


def read_arrays(run: RunFolder, key: str, step: int | None = None) -> tuple[int, Arrays]:
    """Returns the arrays under one top-level key of a checkpoint's state, reading nothing else.

    Args:
        run: the run; it may be trained meanwhile.
        key: such as `q_network`.
        step: of the checkpoint; by default the newest.

    Returns:
        The step of the checkpoint, and its arrays.

    Raises:
        InputError: there is no such checkpoint, or it has no arrays under that key.
        TrdlabError: it is torn. Another one that is whole is named, and not taken silently.
    """
    name = f"{key}{TENSORS}"

    def read(saved: Saved) -> tuple[int, Arrays]:
        files = Index.read(saved.folder).files
        if name in files:
            return saved.step, _arrays(saved.folder / name, files[name])
        keys = [name.removesuffix(TENSORS) for name in files if name.endswith(TENSORS)]
        cure = closest(key, keys) if keys else ""
        raise InputError(f"The checkpoint at step {saved.step} has no '{key}'.", cure)

    return _read(run, step, read)


def checkpoint_steps(run: RunFolder) -> list[int]:
    """Returns the steps at which there is a checkpoint, the newest last."""
    return list(_by_step(run))


def find_checkpoint(name: str) -> tuple[Path, int | None]:
    """Returns the folder of a run, and the step of the checkpoint that is named after an `@`.

    Args:
        name: a run's folder, or `pretrained:GAME`, which name none; `RUN@STEP`; or `RUN@best`, for
            the one of the best score.

    Raises:
        InputError: there is no such run, or no such checkpoint of it.
    """
    if name.startswith(PRETRAINED):  # of which there is one checkpoint
        return pretrained_path(name), None
    folder, at, step = name.rpartition("@")
    if not at or not folder or Path(name).exists():
        return Path(name), None
    if step.isdecimal() and len(step) < 19:  # more digits are no number of steps
        return Path(folder), int(step)
    run = RunFolder.open(Path(folder))
    if step == BEST:
        return run.path, _best_step(run)
    steps = ", ".join(map(str, checkpoint_steps(run)))
    raise InputError(
        f"'{step}' is no step of a checkpoint of '{folder}'.",
        f"There are: {steps}, and {BEST}." if steps else "There is none yet.",
    )


def best_step(run: RunFolder) -> int | None:
    """Returns the step of the checkpoint of the best score; None while none has a score."""
    best = best_of(_by_step(run).values())
    return best and best.step


def _best_step(run: RunFolder) -> int:
    step = best_step(run)
    if step is None:
        raise InputError(
            f"No checkpoint of '{run.path}' has a score: no episode had ended by then.",
            f"Leave out @{BEST}, or train on: {run.resume_command}.",
        )
    return step


def _write(
    folder: Path,
    tree: dict[str, Any],
    arrays: dict[str, Arrays],
    blocks: Mapping[str, Sum],
    score: float | None,
) -> None:
    """Writes all files of a checkpoint."""
    folder.mkdir()
    sums = {}

    def write(name: str, data: bytes) -> None:
        (folder / name).write_bytes(data)
        sums[name] = Sum.of(data)

    write(STATE, json.dumps(tree, allow_nan=False).encode())
    for key, held in arrays.items():
        write(f"{key}{TENSORS}", save(held))
    if score is not None:
        write(SCORE, json.dumps(score, allow_nan=False).encode())
    Index(sums, blocks).write(folder)


def _read(run: RunFolder, step: int | None, read: Callable[[Saved], Read]) -> Read:
    """Reads a checkpoint, the newest one unless a step is given, and tells one that is torn."""
    saved = _chosen(run, step)
    try:
        return read(saved)
    except InputError:
        raise
    except TrdlabError as error:
        if step is None and not saved.folder.exists():  # whoever trains the run has a newer one
            return _read(run, step, read)
        raise _torn(run, saved, error) from error


def _load(run: RunFolder, saved: Saved) -> Checkpoint:
    index, folder = Index.read(saved.folder), saved.folder
    arrays = {
        name.removesuffix(TENSORS): _arrays(folder / name, sum_)
        for name, sum_ in index.files.items()
        if name.endswith(TENSORS)
    }
    try:
        state = unpack(json.loads(read_whole(folder / STATE, index.files[STATE])), arrays)
    except _DOCTORED as error:
        raise TrdlabError(f"'{folder / STATE}' is not valid: {error!r}.") from error
    blocks = {
        name: read_whole(run.replay / file, index.blocks[name])
        for name, file in index.block_files.items()
    }
    return Checkpoint(saved.step, state, blocks)


_DOCTORED = (LookupError, ValueError, TypeError, AttributeError, RecursionError)
"""What is raised by a file that is not valid although its sum is right: it was never ours."""


def _arrays(path: Path, expected: Sum) -> Arrays:
    data = read_whole(path, expected)
    try:
        return dict(sorted(load(data).items()))  # it has no order of its own
    except (SafetensorError, *_DOCTORED) as error:
        raise TrdlabError(f"'{path}' is no valid safetensors file: {error}.") from error


def _by_step(run: RunFolder) -> dict[int, Saved]:
    """Returns the checkpoint at each step, the newest last."""
    return {saved.step: saved for saved in all_saved(run)}


def _chosen(run: RunFolder, step: int | None) -> Saved:
    saved = _by_step(run)
    if not saved:
        raise InputError(
            f"The run '{run.path}' has no checkpoint yet.", f"Train on: {run.resume_command}."
        )
    if step is not None and step not in saved:
        raise InputError(
            f"The run '{run.path}' has no checkpoint at step {step}.",
            f"There are: {', '.join(map(str, saved))}.",
        )
    return saved[max(saved) if step is None else step]


def _not_saved(run: RunFolder, step: int, error: OutputError | OSError) -> OutputError:
    cause = error.cause if isinstance(error, OutputError) else f"{error.strerror or error}."
    steps = checkpoint_steps(run)
    begin = f"step {steps[-1]}" if steps else "the beginning"
    return OutputError(
        f"The checkpoint at step {step} cannot be saved: {cause}",
        f"When it can be written again, {run.resume_command} goes on from {begin}.",
    )


def _torn(run: RunFolder, torn: Saved, error: TrdlabError) -> TrdlabError:
    others = [saved for saved in _by_step(run).values() if saved.step != torn.step]
    whole = next((saved.step for saved in reversed(others) if _is_whole(run, saved)), None)
    return TrdlabError(
        f"The checkpoint at step {torn.step} cannot be used: {error.cause}",
        "No other one is whole."
        if whole is None
        else f"The one at step {whole} is whole: `checkpoint={whole}`, or {run.path}@{whole}.",
    )


def _is_whole(run: RunFolder, saved: Saved) -> bool:
    try:
        _load(run, saved)
    except TrdlabError:
        return False
    return True
