"""The folder of a run: how it is made, opened and named, and who may write to it."""

import os
import platform
import shlex
import socket
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from itertools import count
from pathlib import Path
from typing import Any, Self

from filelock import FileLock, Timeout

from trdlab.errors import InputError, OutputError, TrdlabError, closest
from trdlab.files import read_json, write_json, write_whole
from trdlab.runs.config import Config, read_config, to_toml

FORMAT = 1
"""Of the run folder; a change that older versions cannot read raises it."""
PACKAGES = ("numpy", "torch", "gymnasium", "ale-py", "lz4", "safetensors")
CONFIG, MANIFEST, LOCK, HOLDER = "config.toml", "manifest.json", ".lock", ".holder.json"
PATIENCE = 1.0
"""Seconds to wait for the lock: `trdlab runs` takes it for a moment to see whether it is free."""


@dataclass(frozen=True)
class RunFolder:
    """The folder of a run.

    Args:
        path: the folder.
        config: what the run was told to do.
        manifest: what it was made with: versions, command, start.
    """

    path: Path
    config: dict[str, Any]
    manifest: dict[str, Any]

    @classmethod
    def create(
        cls, path: Path, config: Config, manifest_extra: Mapping[str, Any] | None = None
    ) -> Self:
        """Makes the folder, all of it or nothing.

        Args:
            path: where; there may be an empty folder.
            config: what the run is told to do.
            manifest_extra: plain values to add to the manifest, such as a teacher's sha256.

        Raises:
            InputError: the configuration cannot be written as TOML.
            OutputError: there is something already, or it cannot be written.
        """
        text, manifest = to_toml(config), {**new_manifest(), **(manifest_extra or {})}
        check_free(path)

        def write(temporary: Path) -> None:
            for name in ("", "checkpoints", "replay", "evaluations"):
                (temporary / name).mkdir()
            (temporary / CONFIG).write_text(text, encoding="utf-8")
            write_json(temporary / MANIFEST, manifest)

        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            reason = error.strerror or error
            raise OutputError(
                f"Cannot make '{path}': {reason}.", "Choose another --out."
            ) from error
        try:
            write_whole(path, write)
        except OutputError:
            check_free(path)  # another process may have made it meanwhile
            raise
        return cls.open(path)

    @classmethod
    def open(cls, path: Path) -> Self:
        """Reads a run's configuration and manifest.

        Raises:
            InputError: there is no run here.
            TrdlabError: it is torn, or was written by a version whose format is another.
        """
        if not is_run(path):
            what = f"The folder '{path}' holds no run" if path.is_dir() else f"There is no '{path}'"
            runs = run_paths(path.parent)
            near = closest(path.name, [run.name for run in runs]) if runs else ""
            raise InputError(f"{what}.", near or "Name the folder that `trdlab train` made.")
        manifest = read_json(path / MANIFEST)
        written = manifest.get("format") if isinstance(manifest, dict) else None
        if not isinstance(written, int):
            raise TrdlabError(f"'{path / MANIFEST}' is torn: it does not say its format.")
        if written != FORMAT:
            author = manifest.get("trdlab")
            raise TrdlabError(
                f"The run '{path}' has format {written}, written by trdlab {author}; "
                f"trdlab {_version('trdlab')} reads format {FORMAT}.",
                f"Use trdlab {author}" + (" or newer." if written > FORMAT else "."),
            )
        return cls(path, read_config(path / CONFIG), manifest)

    @property
    def metrics(self) -> Path:
        """The file with the metrics, see `MetricsFile`."""
        return self.path / "metrics.jsonl"

    @property
    def checkpoints(self) -> Path:
        """The folder with the checkpoints."""
        return self.path / "checkpoints"

    @property
    def replay(self) -> Path:
        """The folder with the blocks that checkpoints share."""
        return self.path / "replay"

    @property
    def evaluations(self) -> Path:
        """The folder with the results of evaluations."""
        return self.path / "evaluations"

    @contextmanager
    def held(self) -> Iterator[None]:
        """Holds the run for this process alone, as long as the block lasts, or the process.

        Raises:
            TrdlabError: another one holds it.
            OutputError: the folder cannot be written.
        """
        lock = FileLock(self.path / LOCK)
        try:
            lock.acquire(timeout=PATIENCE, poll_interval=0.1)
        except Timeout as error:
            pid = _read_holder(self.path)
            raise TrdlabError(
                f"The run '{self.path}' is held by {f'process {pid}' if pid else 'a process'}, "
                "which trains it.",
                f"Wait until it ends, or end it: kill {pid}" if pid else "Wait until it ends.",
            ) from error
        except OSError as error:
            reason = error.strerror or error
            raise OutputError(
                f"The run '{self.path}' cannot be locked: {reason}.", "Copy it to another place."
            ) from error
        try:
            write_json(self.path / HOLDER, {"pid": os.getpid(), "host": socket.gethostname()})
            yield
        finally:
            with suppress(OSError):  # the lock is what counts
                (self.path / HOLDER).unlink()
            lock.release()


def new_manifest() -> dict[str, Any]:
    """Returns what a run that begins now is made with."""
    program = Path(sys.argv[0])
    name = program.parent.name if program.name == "__main__.py" else program.name
    return {
        "format": FORMAT,
        "trdlab": _version("trdlab"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": {package: _version(package) for package in PACKAGES},
        "command": shlex.join([name, *sys.argv[1:]]),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def check_free(path: Path) -> None:
    """Checks that a run can be made here.

    Raises:
        OutputError: there is something already.
    """
    if is_run(path):
        raise OutputError(
            f"'{path}' holds a run already.",
            f"Go on with it: trdlab resume {shlex.quote(str(path))}, or choose another --out.",
        )
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        kind = "is not empty" if path.is_dir() else "is a file"
        raise OutputError(f"'{path}' {kind}.", "Choose another --out.")


def free_name(parent: Path, stem: str) -> Path:
    """Returns the first of `stem`, `stem-2`, `stem-3`, … that is not there yet."""
    names = (parent / (stem if at == 1 else f"{stem}-{at}") for at in count(1))
    return next(path for path in names if not path.exists())


def is_run(path: Path) -> bool:
    """Returns whether this is the folder of a run, be it torn."""
    return (path / MANIFEST).exists() or (path / CONFIG).exists()


def run_paths(parent: Path) -> list[Path]:
    """Returns the folders of runs in a folder, by name."""
    if not parent.is_dir():
        return []
    return sorted(path for path in parent.iterdir() if path.name[0] != "." and is_run(path))


def holder(path: Path) -> int | None:
    """Returns the process that trains a run, 0 if its number is not known, None if there is none.

    Raises:
        OSError: it cannot be told, because the folder cannot be written.
    """
    if not (path / LOCK).exists():
        return None
    try:
        with FileLock(path / LOCK).acquire(timeout=0):
            return None
    except Timeout:
        return _read_holder(path)


def _read_holder(path: Path) -> int:
    try:
        return int(read_json(path / HOLDER)["pid"])
    except (TrdlabError, TypeError, KeyError, ValueError):
        return 0


def _version(package: str) -> str | None:
    with suppress(metadata.PackageNotFoundError):
        return metadata.version(package)
    return None
