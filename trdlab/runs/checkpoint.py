"""Checkpoints: each whole or not there, and every byte checked when it is read.

A checkpoint is a folder `checkpoints/STEP` with `state.json`, one safetensors file for each
top-level key of the state that holds arrays, and `index.json`, which lists these files, and the
blocks that belong to it, with lengths and checksums. A block is a file in `replay/` that never
changes, so that checkpoints can share it.
"""

import json
import re
import shlex
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from safetensors import SafetensorError
from safetensors.numpy import load, save

from trdlab.errors import InputError, OutputError, TrdlabError, closest
from trdlab.files import is_leftover, remove, write_whole
from trdlab.runs.folder import RunFolder
from trdlab.runs.index import Index, Sum, check_names, read_whole
from trdlab.runs.state import Arrays, pack, unpack

STATE, TENSORS = "state.json", ".safetensors"
FOLDER = re.compile(r"(\d+)(?:\.(\d+))?")  # a step, and which try where there were several


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


class _Saved(NamedTuple):
    """A checkpoint on disk; the later of two sorts last."""

    step: int
    attempt: int
    folder: Path


def save_checkpoint(
    run: RunFolder,
    step: int,
    state: Mapping[str, Any],
    blocks: Mapping[str, Any] | None = None,
    *,
    keep: int = 2,
) -> None:
    """Saves a checkpoint, and then deletes old ones and the blocks that none needs any more.

    Checkpoints at this step or later are deleted then, too: the run went back, and they are of a
    past that did not happen. Only the process that holds the run may save.

    Args:
        run: the run.
        step: when, in agent steps.
        state: nested mappings and lists of JSON values, numpy arrays and bytes.
        blocks: bytes, or what can be read like them, by name. Those that the checkpoint before has,
            with the same contents, are not written again.
        keep: how many checkpoints to keep, this one included.

    Raises:
        InputError: the state holds what cannot be saved, or a key cannot name a file.
        OutputError: the disk is full, or cannot be written. Earlier checkpoints are untouched.
    """
    tree, arrays = pack(state)
    blocks = blocks or {}
    check_names((*arrays, *blocks))
    index = Index({}, {name: Sum.of(block) for name, block in blocks.items()})
    try:
        _sweep(run)  # makes room before room is needed
        folder, there = _new_folder(run, step), _blocks_before(run, step)
        for name, file in index.block_files.items():
            if file not in there:
                write_whole(run.replay / file, partial(Path.write_bytes, data=blocks[name]))
        write_whole(folder, lambda temporary: _write(temporary, tree, arrays, index.blocks))
    except (OutputError, OSError) as error:
        with suppress(OSError):  # the first failure is the one to tell
            _sweep(run)
        raise _not_saved(run, step, error) from error
    _forget(run, step, folder, keep)


def load_checkpoint(run: RunFolder, step: int | None = None) -> Checkpoint:
    """Loads a checkpoint, the newest one unless a step is given; every byte is checked.

    Raises:
        InputError: there is none, or none at that step.
        TrdlabError: it is torn. Another one that is whole is named, and not taken silently.
    """
    saved = _chosen(run, step)
    try:
        return _load(run, saved)
    except TrdlabError as error:
        raise _torn(run, saved, error) from error


def read_arrays(run: RunFolder, key: str, step: int | None = None) -> Arrays:
    """Returns the arrays under one top-level key of a checkpoint's state, reading nothing else.

    Args:
        run: the run.
        key: such as `q_network`.
        step: of the checkpoint; by default the newest.

    Raises:
        InputError: there is no such checkpoint, or it has no arrays under that key.
        TrdlabError: it is torn. Another one that is whole is named, and not taken silently.
    """
    saved, name = _chosen(run, step), f"{key}{TENSORS}"
    try:
        files = Index.read(saved.folder).files
        arrays = _arrays(saved.folder / name, files[name]) if name in files else None
    except TrdlabError as error:
        raise _torn(run, saved, error) from error
    if arrays is None:
        keys = [name.removesuffix(TENSORS) for name in files if name != STATE]
        raise InputError(f"The checkpoint at step {saved.step} has no '{key}'.", closest(key, keys))
    return arrays


def checkpoint_steps(run: RunFolder) -> list[int]:
    """Returns the steps at which there is a checkpoint, the newest last."""
    return sorted({saved.step for saved in _all(run)})


def _write(
    folder: Path, tree: dict[str, Any], arrays: dict[str, Arrays], blocks: Mapping[str, Sum]
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
    Index(sums, blocks).write(folder)


def _load(run: RunFolder, saved: _Saved) -> Checkpoint:
    index, folder = Index.read(saved.folder), saved.folder
    files = dict(index.files)
    try:
        tree = json.loads(read_whole(folder / STATE, files.pop(STATE)))
    except (KeyError, ValueError, RecursionError) as error:  # it was doctored: its sum is right
        raise TrdlabError(f"'{folder / STATE}' is not valid: {error}.") from error
    arrays = {
        name.removesuffix(TENSORS): _arrays(folder / name, sum_) for name, sum_ in files.items()
    }
    state = unpack(tree, arrays)
    blocks = {
        name: read_whole(run.replay / file, index.blocks[name])
        for name, file in index.block_files.items()
    }
    return Checkpoint(saved.step, state, blocks)


def _arrays(path: Path, expected: Sum) -> Arrays:
    data = read_whole(path, expected)
    try:
        return dict(sorted(load(data).items()))  # it has no order of its own
    except (SafetensorError, KeyError) as error:  # it was doctored: its sum is right
        raise TrdlabError(f"'{path}' is no valid safetensors file: {error}.") from error


def _all(run: RunFolder) -> list[_Saved]:
    """Returns the checkpoints on disk, the newest last."""
    paths = run.checkpoints.iterdir() if run.checkpoints.is_dir() else ()
    matches = [(FOLDER.fullmatch(path.name), path) for path in paths]
    return sorted(_Saved(int(of[1]), int(of[2] or 1), path) for of, path in matches if of)


def _new_folder(run: RunFolder, step: int) -> Path:
    """Returns a folder that is not there: no checkpoint is replaced before the next is whole."""
    attempts = [saved.attempt for saved in _all(run) if saved.step == step]
    return run.checkpoints / (f"{step:09d}" + (f".{attempts[-1] + 1}" if attempts else ""))


def _blocks_before(run: RunFolder, step: int) -> set[str]:
    """Returns the files of blocks that are there and belong to an earlier checkpoint.

    What belongs to later ones only is not trusted: perhaps the run went back because it is torn.
    """
    known: set[str] = set()
    for saved in _all(run):
        with suppress(TrdlabError):  # torn: its blocks are written again
            if saved.step < step:
                known |= set(Index.read(saved.folder).block_files.values())
    return {name for name in known if (run.replay / name).exists()}


def _forget(run: RunFolder, step: int, newest: Path, keep: int) -> None:
    """Deletes what the newest checkpoint replaces, and the oldest ones."""
    others = [saved for saved in _all(run) if saved.folder != newest]
    earlier = [saved for saved in others if saved.step < step]
    kept = earlier[max(0, len(earlier) - keep + 1) :]
    try:
        for _, _, folder in (saved for saved in others if saved not in kept):
            folder.replace(folder.with_name(f".{folder.name}"))  # gone at once; its files follow
        _sweep(run)
    except OSError as error:
        raise OutputError(
            f"The checkpoint at step {step} is saved, but an old one cannot be deleted: "
            f"{error.strerror or error}.",
            f"See to '{run.path}'.",
        ) from error


def _sweep(run: RunFolder) -> None:
    """Deletes what killed processes left, and the blocks that no checkpoint needs."""
    for folder in (run.checkpoints, run.replay):
        folder.mkdir(exist_ok=True)  # some ways to copy a run leave out empty folders
        for path in filter(is_leftover, folder.iterdir()):
            remove(path)
    try:
        needed = {file for of in _all(run) for file in Index.read(of.folder).block_files.values()}
    except TrdlabError:  # one is torn, and nobody knows what it needs
        return
    for path in run.replay.iterdir():
        if path.name not in needed:
            path.unlink()


def _chosen(run: RunFolder, step: int | None) -> _Saved:
    saved = {saved.step: saved for saved in _all(run)}
    if not saved:
        raise InputError(
            f"The run '{run.path}' has no checkpoint: it ended before the first one.",
            "Begin it anew, with another --out.",
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
    again = (
        f"When it can be written again, trdlab resume {shlex.quote(str(run.path))} goes on from "
    )
    return OutputError(
        f"The checkpoint at step {step} cannot be saved: {cause}",
        again + (f"step {steps[-1]}." if steps else "the beginning."),
    )


def _torn(run: RunFolder, torn: _Saved, error: TrdlabError) -> TrdlabError:
    whole = (other.step for other in reversed(_all(run)) if other != torn and _is_whole(run, other))
    step = next(whole, None)
    return TrdlabError(
        f"The checkpoint at step {torn.step} cannot be used: {error.cause}",
        "No other one is whole."
        if step is None
        else f"The one at step {step} is whole: --checkpoint {step}.",
    )


def _is_whole(run: RunFolder, saved: _Saved) -> bool:
    try:
        _load(run, saved)
    except TrdlabError:
        return False
    return True
