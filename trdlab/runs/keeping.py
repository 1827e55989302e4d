"""Which checkpoints are on disk, which are kept, and what may be deleted."""

import re
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from trdlab.errors import OutputError, TrdlabError
from trdlab.files import free_name, is_leftover, remove, write_whole
from trdlab.runs.folder import RunFolder
from trdlab.runs.index import INDEX, Index, Sum, read_whole

FOLDER = re.compile(r"(\d{9,})(?:\.(\d+))?")  # a step, and which attempt where there were several
SCORE = "score.json"
OLD = ".old"
"""After the name of a checkpoint whose parts may go, as far as its index names them."""


class Saved(NamedTuple):
    """A checkpoint on disk; the later of two sorts last."""

    step: int
    attempt: int
    folder: Path

    def block_files(self) -> set[str]:
        """Returns the files of blocks that it needs.

        Raises:
            TrdlabError: its index is torn.
        """
        return set(Index.read(self.folder).block_files.values())

    def score(self) -> float | None:
        """Returns the score of its agent; None if there was none, or it is torn."""
        with suppress(TrdlabError, ValueError):
            files = Index.read(self.folder).files
            if SCORE in files:
                return float(read_whole(self.folder / SCORE, files[SCORE]))
        return None


def all_saved(run: RunFolder) -> list[Saved]:
    """Returns the checkpoints on disk, the newest last."""
    paths = run.checkpoints.iterdir() if run.checkpoints.is_dir() else ()
    matches = [(FOLDER.fullmatch(path.name), path) for path in paths]
    return sorted(Saved(int(of[1]), int(of[2] or 1), path) for of, path in matches if of)


def best_of(saved: Iterable[Saved]) -> Saved | None:
    """Returns the checkpoint of the largest score, of tied ones the newest; None without scores."""
    scores = [(score, each) for each in saved if (score := each.score()) is not None]
    return max(scores)[1] if scores else None


def new_folder(run: RunFolder, step: int) -> Path:
    """Returns a folder that is not there: no checkpoint is replaced before the next is whole."""
    attempts = [saved.attempt for saved in all_saved(run) if saved.step == step]
    return run.checkpoints / (f"{step:09d}" + (f".{attempts[-1] + 1}" if attempts else ""))


def blocks_before(run: RunFolder, step: int) -> set[str]:
    """Returns the files of blocks that are there and belong to an earlier checkpoint.

    What belongs to later ones only is not trusted: perhaps the run went back because it is torn.
    """
    known: set[str] = set()
    for saved in all_saved(run):
        with suppress(TrdlabError):  # torn: its blocks are written again
            if saved.step < step:
                known |= saved.block_files()
    return {name for name in known if (run.replay / name).exists()}


def announce(run: RunFolder, folder: Path, blocks: Mapping[str, Sum]) -> None:
    """Writes down which blocks are about to be written, so that they go if their checkpoint fails.

    Args:
        run: the run.
        folder: of the checkpoint.
        blocks: those that are not there yet.
    """

    def write(temporary: Path) -> None:
        temporary.mkdir()
        Index({}, blocks).write(temporary)

    if blocks:
        write_whole(_old(run, folder), write)


def forget(run: RunFolder, step: int, newest: Path, keep: int) -> None:
    """Deletes what the newest checkpoint replaces, and the oldest ones but for the best.

    Raises:
        OutputError: a file cannot be deleted.
    """
    saved = all_saved(run)
    valid = [each for each in saved if each.step < step or each.folder == newest]
    kept = {*valid[max(0, len(valid) - keep) :], best_of(valid)}
    try:
        for folder in (each.folder for each in saved if each not in kept):
            folder.replace(_old(run, folder))  # gone at once; its files follow
        sweep(run)
    except OSError as error:
        raise OutputError(
            f"The checkpoint at step {step} is saved, but an old one cannot be deleted: "
            f"{error.strerror or error}.",
            f"See to '{run.path}'.",
        ) from error


def sweep(run: RunFolder) -> None:
    """Deletes what killed processes left, and what old checkpoints were made of.

    Only what an index of the run names is its own to delete; whatever else lies there stays.
    """
    for folder in (run.checkpoints, run.replay):
        folder.mkdir(exist_ok=True)  # some ways to copy a run leave out empty folders
        for path in filter(is_leftover, folder.iterdir()):
            remove(path)
    try:
        needed = {file for saved in all_saved(run) for file in saved.block_files()}
    except TrdlabError:  # one is torn, and nobody knows what it needs
        return
    for folder in sorted(run.checkpoints.glob(f"*{OLD}*")):
        _delete(run, folder, needed)


def _delete(run: RunFolder, folder: Path, needed: Collection[str]) -> None:
    """Deletes the parts of an old checkpoint, its index last, but for blocks that are `needed`."""
    with suppress(TrdlabError):  # without an index, nobody knows what was the run's own
        index = Index.read(folder)
        for file in index.block_files.values():
            if file not in needed:
                (run.replay / file).unlink(missing_ok=True)
        for name in (*index.files, INDEX):
            (folder / name).unlink(missing_ok=True)
    with suppress(OSError):  # somebody has put something else into it
        folder.rmdir()


def _old(run: RunFolder, folder: Path) -> Path:
    return free_name(run.checkpoints, f"{folder.name}{OLD}")
