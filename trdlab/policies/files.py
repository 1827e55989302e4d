"""Files of agents: what they hold, as tensors and plain data, whoever has written them."""

import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from trdlab.errors import InputError, closest

if TYPE_CHECKING:
    from collections.abc import Callable

    from trdlab.policies.adapted import Drawing, Valuing

    Adapter = Callable[["AgentFile", "Options"], Drawing | Valuing | None]

_MOST = 4_000_000_000  # bytes of weights; what says to be larger is no agent


@dataclass(frozen=True)
class Options:
    """What a file does not say, and how its agent should act.

    Args:
        activation: between the layers; by default what the file says, or the algorithm's own.
        greedy: whether to take the likeliest action rather than draw one; by default as the
            algorithm does, and the best of what plain layers say.
        normalize: a file that `VecNormalize.save` wrote, where the agent was trained with that.
    """

    activation: str | None = None
    greedy: bool | None = None
    normalize: str | None = None

    @classmethod
    def of(cls, arguments: Mapping[str, Any]) -> "Options":
        """Returns options by their names, as people write them.

        Raises:
            InputError: there is no such option, or its value is of another type.
        """
        known = cls.__dataclass_fields__
        for name in arguments:
            if name not in known:
                raise InputError(
                    f"An agent's file takes no argument '{name}'.", closest(name, known)
                )
        options = cls(**arguments)
        for value, kind, cure in (
            (options.greedy, bool, "It must be true or false."),
            (options.activation, str, "Give the name of one, such as tanh."),
            (options.normalize, str, "Name a file."),
        ):
            if value is not None and not isinstance(value, kind):
                raise InputError(f"An agent's file was given the argument '{value}'.", cure)
        return options


@dataclass(frozen=True, eq=False)
class AgentFile:
    """What a file of an agent holds.

    Args:
        path: where it is.
        weights: by name.
        data: what stands beside them in an archive of Stable-Baselines3, as plain data; empty else.
        version: of the library that wrote such an archive.
    """

    path: Path
    weights: Mapping[str, npt.NDArray[Any]]
    data: Mapping[str, Any] = field(default_factory=dict)
    version: str = ""


def is_text(path: Path) -> bool:
    """Returns whether a file begins as a text does; weights never do.

    Raises:
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        begin = file.read(1024)
    if b"\x00" in begin:
        return False
    try:
        begin.decode()
    except UnicodeDecodeError as error:
        return error.start >= len(begin) - 3 > 0  # a letter may be cut in two
    return not begin.startswith(b"PK\x03\x04")


def open_agent(path: Path) -> AgentFile:
    """Returns what a file holds; nothing in it is executed or unpickled.

    Args:
        path: an archive of Stable-Baselines3, safetensors, or what `torch.save` wrote.

    Raises:
        InputError: it is torn, holds code, or no weights.
    """
    from trdlab.policies.weights import read_part, read_weights

    parts = _parts(path)
    if "policy.pth" not in parts:
        if {"data", "pytorch_variables.pth"} & parts.keys():
            raise InputError(
                f"'{path}' is an archive of Stable-Baselines3 without its policy.pth.",
                "Save the model again: model.save(…).",
            )
        return AgentFile(path, read_weights(path))
    weights = read_part(_read(path, "policy.pth"), f"{path}: policy.pth")
    version = _read(path, "_stable_baselines3_version") if len(parts) > 1 else b""
    return AgentFile(path, weights, _data(path), version.decode("ascii", "replace").strip()[:20])


def _parts(path: Path) -> dict[str, int]:
    """Returns the parts of an archive and their sizes; none where the file is no archive."""
    try:
        with path.open("rb") as file:
            if file.read(4) != b"PK\x03\x04":
                return {}
        with zipfile.ZipFile(path) as archive:
            return {part.filename: part.file_size for part in archive.infolist()}
    except OSError as error:
        raise InputError(
            f"'{path}' cannot be read: {error.strerror or error}.", "Name another file."
        ) from error
    except (zipfile.BadZipFile, ValueError) as error:
        raise InputError(f"'{path}' is torn: its end is missing.", "Copy it again.") from error


def _read(path: Path, name: str) -> bytes:
    """Returns a part of an archive; nothing where there is no such part."""
    try:
        with zipfile.ZipFile(path) as archive:
            if name not in archive.namelist():
                return b""
            if (size := archive.getinfo(name).file_size) > _MOST:
                raise InputError(
                    f"'{name}' in '{path}' says to hold {size:,} bytes.", "It is no agent."
                )
            return archive.read(name)
    except (zipfile.BadZipFile, zlib.error, RuntimeError, NotImplementedError, EOFError) as error:
        raise InputError(f"'{name}' in '{path}' is torn ({error}).", "Copy it again.") from error


def _data(path: Path) -> dict[str, Any]:
    """Returns the plain data of an archive; what is pickled in it stays the text that it is."""
    try:
        data = json.loads(_read(path, "data") or b"{}")
    except (ValueError, RecursionError) as error:
        raise InputError(f"'data' in '{path}' is torn: {error}.", "Copy it again.") from error
    if not isinstance(data, dict):
        raise InputError(
            f"'data' in '{path}' holds no names.", "Save the model again: model.save(…)."
        )
    return data
