"""Weights as flax writes them (`flax.serialization.to_bytes`), read without flax.

They are msgpack: maps with names, and in them arrays, each an extension of type 1 whose content is
`(shape, name of the type, bytes)`, itself in msgpack. How much memory a file can take depends on
nothing but how long it is: msgpack refuses lengths that go beyond its end.
"""

from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.errors import InputError, TrdlabError

_LARGEST = 1_000_000_000  # bytes; what is larger is no agent
_ARRAY = 1  # the type of the extension
_DIMENSIONS = 16  # that an array can have at most
_TYPES = ("float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "bool")


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
        TrdlabError: msgpack is not installed.
    """
    try:
        import msgpack
    except ImportError as error:
        raise TrdlabError(
            f"'{path}' is in flax's format, and msgpack is not installed.",
            "Run: pip install 'trdlab[flax]'",
        ) from error

    def array(kind: int, content: bytes) -> npt.NDArray[Any]:
        told = msgpack.unpackb(content) if kind == _ARRAY else None
        match told:
            case [[*shape], str(name), bytes(numbers)] if name in _TYPES:
                sizes = [side for side in shape if type(side) is int]
                dtype = np.dtype(name)
                fits = len(sizes) == len(shape) and prod(sizes) * dtype.itemsize == len(numbers)
                if fits and len(sizes) <= _DIMENSIONS:
                    return np.frombuffer(numbers, dtype).reshape(sizes).copy()
        raise ValueError("what should be an array of numbers is none")

    with path.open("rb") as file:
        data = file.read(_LARGEST + 1)
    try:
        if len(data) > _LARGEST:
            raise ValueError(f"it has more than {_LARGEST:,} bytes")  # noqa: TRY301
        return dict(_named(msgpack.unpackb(data, ext_hook=array), ""))
    except ValueError as error:  # also how msgpack says so
        reason = str(error) or "maps stand in maps without end"
        raise InputError(
            f"'{path}' is no file of flax, or torn: {reason}.", "Copy or save it again."
        ) from error


def _named(held: Any, name: str) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """Yields the arrays in maps within maps, with points between their names."""
    if isinstance(held, np.ndarray):
        yield name, held
    elif isinstance(held, dict):
        for key, part in held.items():
            yield from _named(part, f"{name}.{key}" if name else str(key))
    else:
        raise ValueError(f"'{name[:80]}' holds no array")  # noqa: TRY004  of a file, as msgpack's
