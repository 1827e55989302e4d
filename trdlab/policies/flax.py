"""Weights as flax writes them (`flax.serialization.to_bytes`), read without flax or msgpack.

Of msgpack no more is read than such files hold: maps with names, and in them arrays, each an
extension of type 1 whose content is `(shape, name of the type, bytes)`, itself in msgpack. Nothing
of a file decides how much memory is taken, except how long it is.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.errors import InputError

_LARGEST = 1_000_000_000  # bytes; what is larger is no agent
_DEEPEST = 16  # maps within maps
_ARRAY = 1  # the type of the extension
_TYPES = ("float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "bool")

_MAPS, _LISTS = {0xDE: ">H", 0xDF: ">I"}, {0xDC: ">H", 0xDD: ">I"}
_TEXTS, _BYTES = {0xD9: ">B", 0xDA: ">H", 0xDB: ">I"}, {0xC4: ">B", 0xC5: ">H", 0xC6: ">I"}
_WHOLE = {0xCC: ">B", 0xCD: ">H", 0xCE: ">I", 0xCF: ">Q"}
_EXTENSIONS = {0xC7: ">B", 0xC8: ">H", 0xC9: ">I"}
_FIXED = {0xD4: 1, 0xD5: 2, 0xD6: 4, 0xD7: 8, 0xD8: 16}  # extensions of so many bytes


def is_flax(path: Path) -> bool:
    """Returns whether a file begins as those do: a map, and in it a short name.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        begin = file.read(6)
    wide = {0xDE: 3, 0xDF: 5}.get(begin[0], 1) if begin else 1
    is_map = begin[:1] and (0x80 < begin[0] < 0x90 or wide > 1)
    return bool(is_map) and len(begin) > wide and 0xA1 <= begin[wide] < 0xC0


def read_flax(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Returns the arrays in a file, by name, `params.Dense_0.kernel`.

    Raises:
        InputError: it is torn, or holds something else.
    """
    with path.open("rb") as file:
        data = file.read(_LARGEST + 1)
    try:
        if len(data) > _LARGEST:
            raise _TornError(f"it has more than {_LARGEST:,} bytes")  # noqa: TRY301
        whole = _Reader(data)
        arrays = dict(_named(whole.value(), ""))
        if whole.at != len(data):
            raise _TornError(f"{len(data) - whole.at:,} bytes follow its end")  # noqa: TRY301
    except _TornError as error:
        raise InputError(
            f"'{path}' is no file of flax, or torn: {error}.", "Copy or save it again."
        ) from error
    return arrays


class _TornError(Exception):
    """Why a file cannot be read."""


def _named(held: Any, name: str) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """Yields the arrays in maps within maps, with points between their names."""
    if isinstance(held, np.ndarray):
        yield name, held
    elif isinstance(held, dict):
        for key, part in held.items():
            yield from _named(part, f"{name}.{key}" if name else key)
    else:
        raise _TornError(f"'{name[:80]}' holds no array")


@dataclass
class _Reader:
    """Reads values one after another.

    Args:
        data: what is read.
        at: where the next one begins.
        depth: in how many maps or lists it stands.
        in_array: whether it is what an array consists of, and holds no other one.
    """

    data: bytes
    at: int = 0
    depth: int = 0
    in_array: bool = False

    def value(self) -> Any:
        """Returns the next value: a dict, a list, a text, bytes, a whole number or an array."""
        kind = self._number(">B")
        if kind < 0x80:
            return kind
        if kind < 0x90 or kind in _MAPS:
            return self._map(kind - 0x80 if kind < 0x90 else self._number(_MAPS[kind]))
        if kind < 0xA0 or kind in _LISTS:
            return self._list(kind - 0x90 if kind < 0xA0 else self._number(_LISTS[kind]))
        if kind < 0xC0 or kind in _TEXTS:
            return self._text(kind - 0xA0 if kind < 0xC0 else self._number(_TEXTS[kind]))
        if kind in _BYTES:
            return self._take(self._number(_BYTES[kind]))
        if kind in _WHOLE:
            return self._number(_WHOLE[kind])
        if kind in _EXTENSIONS or kind in _FIXED:
            size = _FIXED[kind] if kind in _FIXED else self._number(_EXTENSIONS[kind])
            return self._array(self._number(">b"), size)
        raise _TornError(f"byte {self.at - 1:,} is {kind:#x}, which such files do not have")

    def _take(self, size: int) -> bytes:
        if size > len(self.data) - self.at:
            raise _TornError(f"{size:,} bytes should follow byte {self.at:,}, and fewer do")
        self.at += size
        return self.data[self.at - size : self.at]

    def _number(self, how: str) -> int:
        return int(struct.unpack(how, self._take(struct.calcsize(how)))[0])

    def _text(self, size: int) -> str:
        try:
            text = self._take(size).decode()
        except UnicodeDecodeError as error:
            raise _TornError(f"a name before byte {self.at:,} is no text") from error
        return text

    def _map(self, size: int) -> dict[str, Any]:
        self._enter(2 * size)
        held: dict[str, Any] = {}
        for _ in range(size):
            name = self.value()
            if not isinstance(name, str) or not name.isprintable() or name in held:
                raise _TornError(f"a name before byte {self.at:,} is none, or stands there twice")
            held[name] = self.value()
        self.depth -= 1
        return held

    def _list(self, size: int) -> list[Any]:
        self._enter(size)
        held = [self.value() for _ in range(size)]
        self.depth -= 1
        return held

    def _enter(self, values: int) -> None:
        self.depth += 1
        if self.depth > _DEEPEST or values > len(self.data) - self.at:
            raise _TornError(f"what begins before byte {self.at:,} has no end")

    def _array(self, kind: int, size: int) -> npt.NDArray[Any]:
        content = self._take(size)
        if kind != _ARRAY or self.in_array:
            raise _TornError(f"what ends at byte {self.at:,} is no array")
        told = _Reader(content, in_array=True).value()
        match told:
            case [[*shape], str(name), bytes(numbers)] if name in _TYPES:
                sizes = [side for side in shape if type(side) is int]
                dtype = np.dtype(name)
                fits = len(sizes) == len(shape) and prod(sizes) * dtype.itemsize == len(numbers)
                if fits and len(sizes) <= _DEEPEST:
                    return np.frombuffer(numbers, dtype).reshape(sizes).copy()
        raise _TornError(f"what ends at byte {self.at:,} is no array of numbers")
