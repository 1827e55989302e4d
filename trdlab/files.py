"""Writing results: never over an old one by accident, never half a file."""

import os
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path

from trdlab.errors import OutputError, closest


def check_output(path: Path, suffixes: Collection[str], *, overwrite: bool = False) -> None:
    """Checks that a file can be written, before any work is done for it.

    Args:
        path: the file.
        suffixes: the endings that can be written, such as `.png`.
        overwrite: whether it may replace a file.

    Raises:
        OutputError: unknown ending, no such folder, not writable, or the file exists.
    """
    if path.suffix.lower() not in suffixes:
        near = closest(path.suffix.lower(), suffixes)
        raise OutputError(f"Cannot write '{path}': '{path.suffix}' is no known ending.", near)
    folder = path.parent
    try:
        has_folder, is_folder, exists = folder.is_dir(), path.is_dir(), path.exists()
        with suppress(FileNotFoundError, NotADirectoryError):
            path.stat()  # raises where no file can have this name
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"Cannot write '{path}': {reason}.", "Choose another name.") from error
    if not has_folder:
        raise OutputError(f"The folder '{folder}' does not exist.", "Create it first.")
    if is_folder:
        raise OutputError(f"'{path}' is a folder.", "Name a file.")
    if exists and not overwrite:
        raise OutputError(f"The file '{path}' exists.", "Choose another name, or --overwrite.")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"The folder '{folder}' is not writable.", "Choose another one.")


def write_whole(path: Path, write: Callable[[Path], None]) -> None:
    """Writes a file under a temporary name beside it, and renames it when it is complete.

    Args:
        path: the file to write.
        write: writes to the path that it is given (with the same ending).

    Raises:
        OutputError: the disk is full, or the file cannot be written for another reason.
    """
    temporary = path.with_name(f".{path.stem[:40]}.{os.getpid()}{path.suffix}")  # names have limits
    try:
        write(temporary)
        temporary.replace(path)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"Cannot write '{path}': {reason}.", "Choose another place.") from error
    finally:
        with suppress(OSError):  # gone already, or never there
            temporary.unlink()
