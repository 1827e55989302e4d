"""Of which files a checkpoint is made, and whether they are still what was written."""

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self
from zlib import crc32

from trdlab.errors import InputError, TrdlabError
from trdlab.files import read_json

INDEX = "index.json"
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")


class Sum(NamedTuple):
    """What tells whether a file is whole: its length in bytes, and the CRC-32 of what is in it.

    (Four gigabytes a second, where BLAKE2 checks one; nobody is kept from forging it.)
    """

    length: int
    crc: int

    @classmethod
    def of(cls, data: Any) -> Self:
        """Returns the sum of bytes, or of anything that can be read like them."""
        return cls(memoryview(data).nbytes, crc32(data))


@dataclass(frozen=True)
class Index:
    """The parts of a checkpoint.

    Args:
        files: in its folder, by name.
        blocks: that it shares with other checkpoints, by name.
    """

    files: Mapping[str, Sum]
    blocks: Mapping[str, Sum]

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Reads the index of the checkpoint in this folder.

        Raises:
            TrdlabError: it is torn, or names a file that would lie in another folder.
        """
        index = read_json(folder / INDEX)
        try:
            parts = [
                {name: Sum(int(length), int(crc)) for name, (length, crc) in index[part].items()}
                for part in ("files", "blocks")
            ]
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise TrdlabError(f"'{folder / INDEX}' is torn.") from error
        for name in (*parts[0], *parts[1]):
            if not NAME.fullmatch(name):
                raise TrdlabError(f"'{folder / INDEX}' has a file named '{name}'.")
        return cls(*parts)

    def write(self, folder: Path) -> None:
        """Writes it into the folder of its checkpoint."""
        text = json.dumps({"files": self.files, "blocks": self.blocks})
        (folder / INDEX).write_bytes(text.encode())

    @property
    def block_files(self) -> dict[str, str]:
        """The file of each block. It is named after what is in it, and so never changes."""
        return {name: f"{name}-{sum_.crc:08x}" for name, sum_ in self.blocks.items()}


def check_names(names: Iterable[str]) -> None:
    """Checks that these can name files.

    Raises:
        InputError: one cannot.
    """
    for name in names:
        if not NAME.fullmatch(name):
            raise InputError(f"'{name}' cannot name a file.", "Use letters, digits, '_', '.', '-'.")


def read_whole(path: Path, expected: Sum) -> bytes:
    """Returns what is in a file, if it is what was written.

    Raises:
        TrdlabError: it is not, or it cannot be read.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise TrdlabError(f"'{path}' cannot be read: {error.strerror or error}.") from error
    if len(data) != expected.length:
        raise TrdlabError(f"'{path}' has {len(data)} bytes instead of {expected.length}.")
    if crc32(data) != expected.crc:
        raise TrdlabError(f"'{path}' is not what was written: its checksum is wrong.")
    return data
