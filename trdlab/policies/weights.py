"""Weights from files: safetensors, and PyTorch's own files as long as they hold nothing else."""

import pickle
import re
import warnings
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor

from trdlab.errors import InputError
from trdlab.policies.flax import is_flax, read_flax

_HELD_UNDER = ("state_dict", "model_state_dict", "q_network", "network", "model", "weights")


def read_weights(path: str | Path) -> dict[str, npt.NDArray[Any]]:
    """Returns the weights that a file holds, by name; floating-point ones as float32.

    Args:
        path: a safetensors file, or a state dict as `torch.save` writes it; a list of tensors, by
            their numbers; what flax writes (`to_bytes`), with points in its names; also a mapping
            that has a state dict under `state_dict`, `model_state_dict`, `q_network`, `network`,
            `model` or `weights`. What it is follows from what it holds, not from its name.

    Raises:
        InputError: it cannot be read, or holds anything else, or what is no finite number. A
            pickle with code is refused, and the code is not executed.
    """
    path = Path(path)
    return weights_in(lambda: _read(path), path)


def read_part(part: bytes, called: str) -> dict[str, npt.NDArray[Any]]:
    """Returns the weights that a part of a larger file holds, as `read_weights` does.

    Args:
        part: what `torch.save` wrote.
        called: how messages name it.

    Raises:
        InputError: likewise.
    """
    return weights_in(lambda: _unpickled(BytesIO(part)), called)


def weights_in(read: Callable[[], Any], called: str | Path) -> dict[str, npt.NDArray[Any]]:
    """Returns the weights in what is read, by name.

    Args:
        read: reads it.
        called: how messages name it.

    Raises:
        InputError: see `read_weights`.
    """
    try:
        held = read()
    except InputError:
        raise
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"'{called}' cannot be read: {reason}.", "Name another file.") from error
    except pickle.UnpicklingError as error:  # its own text advises to execute the file
        code = re.search(r"GLOBAL ([\w.]+)", str(error))
        raise InputError(
            f"'{called}' holds code{f' ({code[1]})' if code else ''}, or is no file of weights.",
            "Nothing was executed. Give the weights alone: torch.save(network.state_dict(), …).",
        ) from error
    except (SafetensorError, RuntimeError, EOFError, LookupError, ValueError) as error:
        raise InputError(
            f"'{called}' is torn, or holds no weights.",
            "Name a safetensors file or a state dict.",
        ) from error
    weights = {name: _array(weight) for name, weight in _state_dict(held, called).items()}
    for name, weight in weights.items():
        finite = np.isfinite(weight)
        if not finite.all():
            raise InputError(
                f"'{called}' has {weight[~finite][0]} in '{name}'.", "Name other weights."
            )
    return weights


def _read(path: Path) -> Any:
    if _is_safetensors(path):
        return load_file(path)
    if is_flax(path):
        return {name: torch.from_numpy(array) for name, array in read_flax(path).items()}
    return _unpickled(path)


def _is_safetensors(path: Path) -> bool:
    """Returns whether a file begins as safetensors do: a length, and then a header in JSON."""
    with path.open("rb") as file:
        return file.read(9)[8:] == b"{"


def _unpickled(file: Path | BytesIO) -> Any:
    """Returns what `torch.save` wrote, if it consists of tensors and plain values."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of pickles that torch has not written
        return torch.load(file, map_location="cpu", weights_only=True)


def _state_dict(held: Any, called: str | Path) -> Mapping[str, Tensor]:
    """Returns the weights by name, wherever they stand in what a file holds."""
    if isinstance(held, list):
        held = {str(number): part for number, part in enumerate(held)}
    inner = [held.get(key) for key in _HELD_UNDER] if isinstance(held, Mapping) else []
    for found in (held, *inner):
        if isinstance(found, Mapping) and found and all(map(_is_weight, found.items())):
            return found
    raise InputError(
        f"'{called}' holds no weights by name.", "Give a state dict: names and tensors, no more."
    )


def _is_weight(entry: tuple[Any, Any]) -> bool:
    name, weight = entry
    return isinstance(name, str) and name.isprintable() and isinstance(weight, Tensor)


def _array(tensor: Tensor) -> npt.NDArray[Any]:
    tensor = tensor.detach().cpu()
    return np.asarray((tensor.float() if tensor.is_floating_point() else tensor).numpy())
