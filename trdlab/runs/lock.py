"""Who trains a run: one process at a time."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from trdlab.errors import OutputError, TrdlabError
from trdlab.files import check_own, read_json, write_json

LOCK, HOLDER = ".lock", ".holder.json"
PATIENCE = 1.0
"""Seconds to wait for the lock: whoever looks whether it is free takes it for a moment."""


@contextmanager
def hold(run: Path) -> Iterator[None]:
    """Holds a run for this process alone, as long as the block lasts, or the process.

    The lock is one of the operating system: it is gone with the process, however it ends.

    Raises:
        TrdlabError: another process holds it.
        OutputError: the folder cannot be written, or the lock is a link.
    """
    lock = _lock(run)
    try:
        lock.acquire(timeout=PATIENCE, poll_interval=0.1)
    except Timeout as error:
        pid = _written_pid(run)
        who, cure = (f"process {pid}", f", or end it: kill {pid}") if pid else ("a process", "")
        raise TrdlabError(
            f"The run '{run}' is being trained by {who}.", f"Wait until it ends{cure}."
        ) from error
    except OSError as error:
        raise OutputError(
            f"The run '{run}' cannot be locked: {error.strerror or error}.",
            "Copy it to a folder that can be written.",
        ) from error
    try:
        write_json(run / HOLDER, {"pid": os.getpid(), "host": socket.gethostname()})
        yield
    finally:
        with suppress(OSError):  # it is the lock that counts
            (run / HOLDER).unlink()
        lock.release()


def holder(run: Path) -> int | None:
    """Returns the process that trains a run, 0 if its number is not known, None if there is none.

    Raises:
        OSError: it cannot be told, because the folder cannot be written.
        OutputError: likewise, because the lock is a link.
    """
    if not (run / LOCK).exists():
        return None
    try:
        with _lock(run).acquire(timeout=0):
            return None
    except Timeout:
        return _written_pid(run)


def _lock(run: Path) -> FileLock:
    check_own(run / LOCK)  # whoever takes it empties the file
    return FileLock(run / LOCK)


def _written_pid(run: Path) -> int:
    """Returns the number that the holder wrote; 0 in the moment before it has."""
    try:
        return int(read_json(run / HOLDER)["pid"])
    except (TrdlabError, TypeError, LookupError, ValueError):
        return 0
