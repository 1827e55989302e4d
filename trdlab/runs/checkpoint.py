"""Checkpoints: each whole or not there, and every byte checked when it is read.

A checkpoint is a folder `checkpoints/STEP` with `state.json`, one safetensors file for each
top-level key of the state that holds arrays, and `index.json`, which lists the files and the blocks
with their lengths and checksums. A block is a file in `replay/` whose name holds its checksum:
it never changes, and checkpoints share it.
"""

import json
import re
import shlex
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from zlib import crc32

from safetensors import SafetensorError
from safetensors.numpy import load, save

from trdlab.errors import InputError, OutputError, TrdlabError, closest
from trdlab.files import is_leftover, read_json, remove, write_whole
from trdlab.runs.folder import RunFolder
from trdlab.runs.state import Arrays, pack, unpack

STATE, INDEX, TENSORS = "state.json", "index.json", ".safetensors"
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")
FOLDER = re.compile(r"(\d+)(?:\.(\d+))?")  # a step, and which try where there were several

Sums = dict[str, tuple[int, int]]
"""Length and CRC-32 by name."""


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
    keep: int = 2,
) -> None:
    """Saves a checkpoint, and then deletes old ones and the blocks that none needs any more.

    Checkpoints of this step or later are replaced: the run went back, and they are of a past that
    did not happen. Only the process that holds the run may save.

    Args:
        run: the run.
        step: when, in agent steps.
        state: nested mappings and lists of JSON values, numpy arrays and bytes.
        blocks: bytes, or what can be read like them, by name; only those not saved yet are written.
        keep: how many checkpoints to keep, this one included.

    Raises:
        InputError: the state holds what cannot be saved, or a key cannot name a file.
        OutputError: the disk is full, or cannot be written. Earlier checkpoints are untouched.
    """
    tree, arrays = pack(state)
    blocks = blocks or {}
    for name in (*arrays, *blocks):
        if not NAME.fullmatch(name):
            raise InputError(f"'{name}' cannot name a file.", "Use letters, digits, '_', '.', '-'.")
    sums = {name: _sum(block) for name, block in blocks.items()}
    folder = _new_folder(run, step)
    try:
        _sweep(run)  # makes room before room is needed
        saved = _saved_blocks(run, step)
        for name, block in blocks.items():
            path = run.replay / _block_name(name, sums[name])
            if path not in saved:
                write_whole(path, partial(Path.write_bytes, data=block))
        write_whole(folder, lambda temporary: _write(temporary, tree, arrays, sums))
    except (OutputError, OSError) as error:
        with suppress(OSError):  # the first failure is the one to tell
            _sweep(run)
        raise _not_saved(run, step, error) from error
    try:
        _forget(run, folder, step, keep)
    except OSError as error:
        raise OutputError(
            f"The checkpoint at step {step} is saved, but an old one cannot be deleted: "
            f"{error.strerror or error}.",
            f"See '{run.path}'.",
        ) from error


def load_checkpoint(run: RunFolder, step: int | None = None) -> Checkpoint:
    """Loads a checkpoint, the newest one unless a step is given; every byte is checked.

    Raises:
        InputError: there is none, or none at that step.
        TrdlabError: it is torn. Another one that is whole is named, and not taken silently.
    """
    step = _chosen(run, step)
    try:
        return _load(run, step)
    except TrdlabError as error:
        raise _torn(run, step, error) from error


def read_arrays(run: RunFolder, key: str, step: int | None = None) -> Arrays:
    """Returns the arrays under one top-level key of a checkpoint's state, reading nothing else.

    Args:
        run: the run.
        key: such as `q_network`.
        step: of the checkpoint, the newest one if not given.

    Raises:
        InputError: there is no such checkpoint, or it has no arrays under that key.
        TrdlabError: it is torn. Another one that is whole is named, and not taken silently.
    """
    step = _chosen(run, step)
    folder = _folders(run)[step]
    try:
        files, _ = _index(folder)
        name = f"{key}{TENSORS}"
        arrays = _arrays(folder / name, files[name]) if name in files else None
    except TrdlabError as error:
        raise _torn(run, step, error) from error
    if arrays is None:
        keys = [name.removesuffix(TENSORS) for name in files if name != STATE]
        raise InputError(f"The checkpoint at step {step} has no '{key}'.", closest(key, keys))
    return arrays


def checkpoint_steps(run: RunFolder) -> list[int]:
    """Returns the steps at which there is a checkpoint, the newest last."""
    return list(_folders(run))


def _write(temporary: Path, tree: dict[str, Any], arrays: dict[str, Arrays], sums: Sums) -> None:
    """Writes all files of a checkpoint."""
    temporary.mkdir()
    files = {STATE: _written(temporary / STATE, json.dumps(tree, allow_nan=False).encode())}
    for key, held in arrays.items():
        name = f"{key}{TENSORS}"
        files[name] = _written(temporary / name, save(held))
    _written(temporary / INDEX, json.dumps({"files": files, "blocks": sums}).encode())


def _load(run: RunFolder, step: int) -> Checkpoint:
    folder = _folders(run)[step]
    files, blocks = _index(folder)
    try:
        tree = json.loads(_read(folder / STATE, files.pop(STATE)))
    except (KeyError, ValueError, RecursionError) as error:  # it was doctored: its sum is right
        raise TrdlabError(f"'{folder / STATE}' is not valid: {error}.") from error
    arrays = {name.removesuffix(TENSORS): _arrays(folder / name, files[name]) for name in files}
    return Checkpoint(
        step,
        unpack(tree, arrays),
        {name: _read(run.replay / _block_name(name, sum_), sum_) for name, sum_ in blocks.items()},
    )


def _is_whole(run: RunFolder, step: int) -> bool:
    try:
        _load(run, step)
    except TrdlabError:
        return False
    return True


def _forget(run: RunFolder, newest: Path, step: int, keep: int) -> None:
    """Deletes what the newest checkpoint replaces, and the oldest ones."""
    others = [(at, path) for at, _, path in _tries(run) if path != newest]
    earlier = [path for at, path in others if at < step]
    kept = earlier[max(0, len(earlier) - keep + 1) :]
    for _, path in others:
        if path not in kept:
            path.replace(path.with_name(f".{path.name}"))  # gone at once; its files follow
    _sweep(run)


def _saved_blocks(run: RunFolder, step: int) -> set[Path]:
    """Returns the blocks on disk that earlier checkpoints need.

    Those of later ones alone do not count: the run went back, perhaps because they are torn.
    """
    saved = set()
    for at, _, folder in _tries(run):
        with suppress(TrdlabError):  # it is torn: what it needs is written again
            blocks = _index(folder)[1] if at < step else {}
            saved |= {run.replay / _block_name(*block) for block in blocks.items()}
    return {path for path in saved if path.exists()}


def _sweep(run: RunFolder) -> None:
    """Deletes what killed processes left, and the blocks that no checkpoint needs."""
    for folder in (run.checkpoints, run.replay):
        folder.mkdir(exist_ok=True)  # some ways to copy a run leave out empty folders
        for path in filter(is_leftover, folder.iterdir()):
            remove(path)
    try:
        indices = [_index(path) for _, _, path in _tries(run)]
    except TrdlabError:  # nobody knows what that one needs
        return
    needed = {_block_name(*block) for _, blocks in indices for block in blocks.items()}
    for path in run.replay.iterdir():
        if path.name not in needed:
            path.unlink()


def _tries(run: RunFolder) -> list[tuple[int, int, Path]]:
    """Returns step, number and folder of all checkpoints, the newest last."""
    paths = run.checkpoints.iterdir() if run.checkpoints.is_dir() else ()
    matches = [(FOLDER.fullmatch(path.name), path) for path in paths]
    return sorted((int(of[1]), int(of[2] or 1), path) for of, path in matches if of)


def _folders(run: RunFolder) -> dict[int, Path]:
    """Returns the folder of the checkpoint at each step, the newest last."""
    return {step: path for step, _, path in _tries(run)}


def _new_folder(run: RunFolder, step: int) -> Path:
    """Returns a folder that is not there yet: a checkpoint is never replaced in place."""
    numbers = [number for at, number, _ in _tries(run) if at == step]
    return run.checkpoints / (f"{step:09d}" + (f".{numbers[-1] + 1}" if numbers else ""))


def _chosen(run: RunFolder, step: int | None) -> int:
    steps = checkpoint_steps(run)
    if not steps:
        raise InputError(
            f"The run '{run.path}' has no checkpoint: it ended before the first one.",
            "Begin it anew, with another --out.",
        )
    if step is not None and step not in steps:
        raise InputError(
            f"The run '{run.path}' has no checkpoint at step {step}.",
            f"There are: {', '.join(map(str, steps))}.",
        )
    return steps[-1] if step is None else step


def _index(folder: Path) -> tuple[Sums, Sums]:
    """Returns the sums of a checkpoint's files, and of the blocks that it needs."""
    index = read_json(folder / INDEX)
    try:
        files, blocks = (
            {name: (int(length), int(crc)) for name, (length, crc) in index[part].items()}
            for part in ("files", "blocks")
        )
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise TrdlabError(f"'{folder / INDEX}' is torn.") from error
    for name in (*files, *blocks):
        if not NAME.fullmatch(name):  # it might lead to another folder
            raise TrdlabError(f"'{folder / INDEX}' has a file named '{name}'.")
    return files, blocks


def _written(path: Path, data: bytes) -> tuple[int, int]:
    path.write_bytes(data)
    return _sum(data)


def _read(path: Path, expected: tuple[int, int]) -> bytes:
    """Returns what is in a file, if it is what was written."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise TrdlabError(f"'{path}' cannot be read: {error.strerror or error}.") from error
    if len(data) != expected[0]:
        raise TrdlabError(f"'{path}' has {len(data)} bytes instead of {expected[0]}.")
    if _sum(data) != expected:
        raise TrdlabError(f"'{path}' is not what was written: its checksum is wrong.")
    return data


def _arrays(path: Path, expected: tuple[int, int]) -> Arrays:
    data = _read(path, expected)
    try:
        return load(data)
    except (SafetensorError, KeyError) as error:  # it was doctored: its sum is right
        raise TrdlabError(f"'{path}' is no valid safetensors file: {error}.") from error


def _sum(data: Any) -> tuple[int, int]:
    return memoryview(data).nbytes, crc32(data)


def _block_name(name: str, sum_: tuple[int, int]) -> str:
    return f"{name}-{sum_[1]:08x}"


def _not_saved(run: RunFolder, step: int, error: OutputError | OSError) -> OutputError:
    cause = error.cause if isinstance(error, OutputError) else f"{error.strerror or error}."
    steps = checkpoint_steps(run)
    return OutputError(
        f"The checkpoint at step {step} is not saved: {cause}",
        f"Make room; trdlab resume {shlex.quote(str(run.path))} goes on from step {steps[-1]}."
        if steps
        else "Make room, and begin anew: it would have been the first.",
    )


def _torn(run: RunFolder, step: int, error: TrdlabError) -> TrdlabError:
    others = (other for other in reversed(checkpoint_steps(run)) if other != step)
    whole = next((other for other in others if _is_whole(run, other)), None)
    return TrdlabError(
        f"The checkpoint at step {step} cannot be used: {error.cause}",
        "No other one is whole."
        if whole is None
        else f"The one at step {whole} is whole: --checkpoint {whole}.",
    )
