"""Keeps what took long to make, and makes it again when what it was made from has changed.

Each result is one zip file, written under another name and renamed when it is whole. What cannot
be read as one is not there: it is made again. So the folder may be deleted, torn or copied.
"""

import sys
import zipfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from hashlib import sha256
from importlib.metadata import distributions
from pathlib import Path
from tempfile import NamedTemporaryFile

from filelock import FileLock

Files = dict[str, bytes]
"""The content of some files by their names."""


def fingerprint(*sources: Path | str) -> str:
    """Returns a hash of texts, of files and folders, and of this Python and its packages."""
    digest = sha256(_installed().encode())
    for source in sources:
        if isinstance(source, str):
            digest.update(f"{len(source)} {source}".encode())
            continue
        for file in sorted(source.rglob("*")) if source.is_dir() else [source]:
            if file.is_file() and "__pycache__" not in file.parts:
                content = file.read_bytes()
                digest.update(f"{file.relative_to(source.parent)} {len(content)} ".encode())
                digest.update(content)
    return digest.hexdigest()


@cache
def _installed() -> str:
    packages = sorted(f"{one.name} {one.version}" for one in distributions())
    return "\n".join([sys.version, *packages])


def kept(path: Path) -> Files | None:
    """Returns what is kept under a path, or None if nothing whole is."""
    try:
        with zipfile.ZipFile(path) as file:
            return {name: file.read(name) for name in file.namelist()}  # checks each checksum
    except (OSError, zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError):
        return None


def keep(path: Path, files: Mapping[str, bytes]) -> None:
    """Keeps files under a path, in place of what was kept of the same thing before.

    The name of the path is `THING-HASH.zip`. Where nothing can be written, nothing is kept.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with (
            NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as part,
            zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as file,
        ):
            for name, content in files.items():
                file.writestr(name, content)
        Path(part.name).replace(path)
    except OSError:
        return
    for old in path.parent.glob(f"{path.stem.rpartition('-')[0]}-*.zip"):
        if old != path:
            old.unlink(missing_ok=True)


def made(folder: Path, thing: str, hashed: Callable[[], str], make: Callable[[], Files]) -> Files:
    """Returns what is kept of a thing, or makes it and keeps it.

    Who asks while another makes it waits, and gets the same. What changes while it is made is not
    kept: nobody knows from which version it was made.
    """
    before = hashed()
    path = folder / f"{thing}-{before[:16]}.zip"
    if (files := kept(path)) is None:
        with _alone(folder / f"{thing}.lock"):
            if (files := kept(path)) is None:
                files = make()
                if hashed() == before:
                    keep(path, files)
    return files


def _alone(lock: Path) -> AbstractContextManager[object]:
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        lock.touch()
    except OSError:  # where nothing can be written, nothing is kept, and each makes its own
        return nullcontext()
    return FileLock(lock)
