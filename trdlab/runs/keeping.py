"""Which checkpoints are on disk, which are kept, and what may be deleted."""

import re
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from trdlab.errors import OutputError, TrdlabError
from trdlab.files import is_leftover, remove
from trdlab.runs.folder import RunFolder
from trdlab.runs.index import Index

FOLDER = re.compile(r"(\d+)(?:\.(\d+))?")  # a step, and which attempt where there were several


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


def all_saved(run: RunFolder) -> list[Saved]:
    """Returns the checkpoints on disk, the newest last."""
    paths = run.checkpoints.iterdir() if run.checkpoints.is_dir() else ()
    matches = [(FOLDER.fullmatch(path.name), path) for path in paths]
    return sorted(Saved(int(of[1]), int(of[2] or 1), path) for of, path in matches if of)


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


def forget(run: RunFolder, step: int, newest: Path, keep: int) -> None:
    """Deletes what the newest checkpoint replaces, and the oldest ones."""
    others = [saved for saved in all_saved(run) if saved.folder != newest]
    earlier = [saved for saved in others if saved.step < step]
    kept = earlier[max(0, len(earlier) - keep + 1) :]
    try:
        for folder in (saved.folder for saved in others if saved not in kept):
            folder.replace(folder.with_name(f".{folder.name}"))  # gone at once; its files follow
        sweep(run)
    except OSError as error:
        raise OutputError(
            f"The checkpoint at step {step} is saved, but an old one cannot be deleted: "
            f"{error.strerror or error}.",
            f"See to '{run.path}'.",
        ) from error


def sweep(run: RunFolder) -> None:
    """Deletes what killed processes left, and the blocks that no checkpoint needs."""
    for folder in (run.checkpoints, run.replay):
        folder.mkdir(exist_ok=True)  # some ways to copy a run leave out empty folders
        for path in filter(is_leftover, folder.iterdir()):
            remove(path)
    try:
        needed = {file for saved in all_saved(run) for file in saved.block_files()}
    except TrdlabError:  # one is torn, and nobody knows what it needs
        return
    for path in run.replay.iterdir():
        if path.name not in needed:
            path.unlink()
