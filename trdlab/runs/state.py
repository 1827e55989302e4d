"""Nested state as plain JSON and named arrays, and back again to the bit."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.errors import InputError, TrdlabError

Array = npt.NDArray[Any]
Arrays = dict[str, Array]

DTYPES = frozenset(np.dtype(code) for code in "?bhilqBHILQefd")
"""What safetensors and numpy both know; in the byte order of this machine."""
ARRAY, BYTES, FLOAT = "$array", "$bytes", "$float"


def pack(state: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Arrays]]:
    """Separates a nested state into what JSON can hold and what it cannot.

    Args:
        state: mappings and lists of JSON values, numpy arrays and bytes.

    Returns:
        The state with references in place of arrays and bytes, and the arrays by the top-level
        key that they stand under and a name: the path to them.

    Raises:
        InputError: a value is of another type.

    >>> tree, arrays = pack({"net": {"bias": np.zeros(2)}, "steps": 7})
    >>> tree, list(arrays["net"])
    ({'net': {'bias': {'$array': 'bias'}}, 'steps': 7}, ['bias'])
    """
    tree, arrays = {}, {}
    for key, value in state.items():
        held: Arrays = {}
        tree[key] = _pack(value, (key,), held)
        if held:
            arrays[key] = held
    return tree, arrays


def unpack(tree: Mapping[str, Any], arrays: Mapping[str, Arrays]) -> dict[str, Any]:
    """Returns the state that `pack` separated.

    Raises:
        TrdlabError: it refers to an array that is not there.
    """
    return {key: _unpack(value, key, arrays.get(key, {})) for key, value in tree.items()}


def _pack(value: Any, path: tuple[str, ...], arrays: Arrays) -> Any:
    match value:
        case np.ndarray() if value.dtype in DTYPES:
            return {ARRAY: _keep(np.asarray(value, order="C"), path, arrays)}
        case bytes():
            return {BYTES: _keep(np.frombuffer(value, dtype=np.uint8), path, arrays)}
        case float() if not math.isfinite(value):
            return {FLOAT: repr(float(value))}
        case None | bool() | int() | float() | str():
            return value
        case list():
            return [_pack(each, (*path, str(at)), arrays) for at, each in enumerate(value)]
        case Mapping() if all(isinstance(name, str) and name[:1] != "$" for name in value):
            return {name: _pack(each, (*path, name), arrays) for name, each in value.items()}
    kind = f"array of {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
    raise InputError(
        f"The state's '{'/'.join(path)}' is of type {kind}, which cannot be saved.",
        "Give JSON values, bytes and arrays of numbers; names are texts without a '$' in front.",
    )


def _keep(array: Array, path: tuple[str, ...], arrays: Arrays) -> str:
    """Puts an array under a name that is free, and returns it."""
    name = "/".join(path[1:]) or path[0]
    while name in arrays or name == "__metadata__":  # which has a meaning of its own in the file
        name += "_"
    arrays[name] = array
    return name


def _unpack(value: Any, path: str, arrays: Arrays) -> Any:
    match value:
        case {**entry} if entry.keys() <= {ARRAY, BYTES} and len(entry) == 1:
            [(kind, name)] = entry.items()
            if not isinstance(name, str) or name not in arrays:
                raise TrdlabError(f"The array '{name}' of '{path}' is missing.")
            return arrays[name] if kind == ARRAY else arrays[name].tobytes()
        case {"$float": text}:
            return float(text)
        case {**entry}:
            return {name: _unpack(each, f"{path}/{name}", arrays) for name, each in entry.items()}
        case list():
            return [_unpack(each, f"{path}/{at}", arrays) for at, each in enumerate(value)]
    return value
