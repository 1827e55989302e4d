"""Writing results: never over an old one by accident, never half a file."""

import errno
import json
import os
from collections.abc import Callable, Collection
from contextlib import suppress
from itertools import count
from pathlib import Path
from secrets import token_hex
from shutil import rmtree
from stat import S_ISREG
from typing import Any

from trdlab.errors import InputError, OutputError, TrdlabError, closest

_LEFTOVER = ".trdlab-"


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
        raise OutputError(f"The file '{path}' exists.", "Choose another name, or `overwrite=True`.")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"The folder '{folder}' is not writable.", "Choose another one.")


def check_small_text(path: Path) -> None:
    """Checks that a file can be a text written by hand, before all of it is read.

    Raises:
        InputError: it is a device, such as `/dev/zero`, or larger than a megabyte.
    """
    if path.is_char_device() or path.is_block_device():
        raise InputError(f"'{path}' is a device.", "Name a text file.")
    if path.is_file() and (size := path.stat().st_size) > 1_000_000:
        raise InputError(f"'{path}' has {size:,} bytes.", "Name a text file, below a megabyte.")


def free_name(parent: Path, stem: str) -> Path:
    """Returns the first of `stem`, `stem-2`, `stem-3`, … that is not there yet."""
    names = (parent / (stem if at == 1 else f"{stem}-{at}") for at in count(1))
    return next(path for path in names if not path.exists() and not path.is_symlink())


def new_folder(parent: Path, stem: str) -> Path:
    """Makes a folder of the first free name, which is then this process's own.

    Raises:
        OutputError: it cannot be made.
    """
    while True:
        path = free_name(parent, stem)
        try:
            path.mkdir(parents=True)
        except OSError as error:
            if not path.exists():  # else another process was quicker
                cause = f"Cannot make the folder '{path}': {error.strerror or error}."
                raise OutputError(cause, "Choose another folder.") from error
        else:
            return path


def free_file(parent: Path, stem: str, suffix: str) -> Path:
    """Returns the first of `stem`, `stem-2`, … with an ending that is not there yet, in a folder.

    The folder is made if there is none.

    Raises:
        OutputError: it cannot be made.
    """
    try:
        parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        cause = f"Cannot make the folder '{parent}': {error.strerror or error}."
        raise OutputError(cause, "Choose another folder.") from error
    names = (parent / f"{stem}{'' if at == 1 else f'-{at}'}{suffix}" for at in count(1))
    return next(path for path in names if not path.exists() and not path.is_symlink())


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Writes a file or a folder under a temporary name beside it, and renames it when complete.

    Whatever happens, a power cut included, there is what was there before or all of what is new.

    Args:
        path: the file to write, or the folder, which may be there only if it is empty.
        write: writes to the path that it is given (with the same ending), or makes a folder there.

    Raises:
        OutputError: the disk is full, or it cannot be written for another reason.
    """
    # Names have limits, and this one is nobody else's: a killed process leaves it behind.
    temporary = path.with_name(f"{_LEFTOVER}{token_hex(4)}-{path.stem[:40]}{path.suffix}")
    try:
        write(temporary)
        _sync(temporary)
        temporary.replace(path)
        _sync_entry(path.parent)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"Cannot write '{path}': {reason}.", "Choose another place.") from error
    finally:
        with suppress(OSError):  # the failure, if there is one, is told already
            remove(temporary)


def is_leftover(path: Path) -> bool:
    """Returns whether this is what `write_whole` leaves behind if the process is killed."""
    return path.name.startswith(_LEFTOVER)


def check_own(path: Path) -> None:
    """Refuses a link: what lies behind it may be somebody else's, and is not written to or deleted.

    Args:
        path: a file that is to be written in place, or a folder in which files are to be deleted;
            it need not be there.

    Raises:
        OutputError: it is a link, or a file that has another name elsewhere.
    """
    cure = "Put a copy of what it leads to in its place."
    try:
        found = path.lstat()
    except OSError:  # whoever writes it will say why that cannot be done
        return
    # junctions are what Windows has for folders
    if path.is_symlink() or getattr(os.path, "isjunction", lambda path: False)(path):
        raise OutputError(f"'{path}' is a link, and is not written through.", cure)
    if S_ISREG(found.st_mode) and found.st_nlink > 1 and found.st_size:
        raise OutputError(f"'{path}' is a hard link: it has another name elsewhere.", cure)


def remove(path: Path) -> None:
    """Removes a file, or a folder with all that is in it, if it is there."""
    if path.is_dir() and not path.is_symlink():
        rmtree(path)
    else:
        path.unlink(missing_ok=True)


def write_json(path: Path, data: object) -> None:
    """Writes plain data as a JSON file, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
    """
    text = json.dumps(data, indent=1, allow_nan=False)
    write_whole(path, lambda temporary: temporary.write_text(text + "\n", encoding="utf-8"))


def read_json(path: Path) -> Any:
    """Returns what a JSON file holds.

    Raises:
        TrdlabError: it cannot be read, or it is torn.
    """
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        reason = error.strerror or error
        raise TrdlabError(f"'{path}' cannot be read: {reason}.") from error
    except (ValueError, RecursionError) as error:
        raise TrdlabError(f"'{path}' is torn: {error}.") from error


def _sync(path: Path) -> None:
    """Waits until a file, or a folder with all that is in it, is on the disk."""
    if path.is_dir():
        for entry in path.iterdir():
            _sync(entry)
        _sync_entry(path)
    else:
        with path.open("rb+") as file:
            os.fsync(file.fileno())


def _sync_entry(folder: Path) -> None:
    """Waits until the names in a folder are on the disk."""
    if os.name == "nt":  # where a folder cannot be opened
        return
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno != errno.EINVAL:  # some file systems cannot be asked that of a folder
            raise
    finally:
        os.close(number)
