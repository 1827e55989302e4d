"""Files of agents: what they hold, as tensors and plain data, whoever has written them."""

import json
import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from trdlab.errors import InputError, closest

if TYPE_CHECKING:
    from collections.abc import Callable

    from trdlab.policies.adapted import Found

    Adapter = Callable[["AgentFile", "Options"], Found | None]

_AGAIN = "Save the model again: model.save(…)."
_VERSION = "_stable_baselines3_version"
_MOST = 1_000_000_000  # bytes of weights; what says to be larger is no agent


@dataclass(frozen=True)
class Options:
    """What a file does not say, and how its agent should act.

    Args:
        activation: between the layers; by default what the file says, or the algorithm's own.
        greedy: whether to take the likeliest action rather than draw one; by default as the
            algorithm does, and the best of what plain layers say.
        normalize: a file that `VecNormalize.save` wrote, where the agent was trained with that.
        N: the explicit components of each action of a TRD-DQN in flax's format.
        w: the steps in each of them.
    """

    activation: str | None = None
    greedy: bool | None = None
    normalize: str | None = None
    N: int | None = None
    w: int | None = None

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
            (options.N, int, "It must be a whole number."),
            (options.w, int, "It must be a whole number."),
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
        data: what stands beside them in an archive of Stable-Baselines3, as plain data; None where
            it is none.
        version: of the library that wrote such an archive.
        num_actions: tells how many actions there are where its agent acts; None if that is not
            known.
    """

    path: Path
    weights: Mapping[str, npt.NDArray[Any]]
    data: Mapping[str, Any] | None = None
    version: str = ""
    num_actions: "Callable[[], int | None]" = lambda: None


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

    parts, needed = _parts(path), {"data", "policy.pth"}
    if not needed & parts:
        return AgentFile(path, read_weights(path))
    if missing := needed - parts:
        raise InputError(
            f"'{path}' is an archive of Stable-Baselines3 without its {min(missing)}.", _AGAIN
        )
    weights = read_part(_read(path, "policy.pth"), f"{path}: policy.pth")
    said = _read(path, _VERSION) if _VERSION in parts else b""
    version = re.match(rb"[\w.+-]{0,20}", said.strip())
    return AgentFile(path, weights, _data(path), version[0].decode() if version else "")


def _parts(path: Path) -> set[str]:
    """Returns the names of the parts of an archive; none where the file is no archive."""
    try:
        with path.open("rb") as file:
            if file.read(4) != b"PK\x03\x04":
                return set()
        with zipfile.ZipFile(path) as archive:
            return set(archive.namelist())
    except OSError as error:
        raise InputError(
            f"'{path}' cannot be read: {error.strerror or error}.", "Name another file."
        ) from error
    except (zipfile.BadZipFile, ValueError) as error:
        raise InputError(f"'{path}' is torn: its end is missing.", "Copy it again.") from error


def _read(path: Path, name: str) -> bytes:
    """Returns a part of an archive."""
    try:
        with zipfile.ZipFile(path) as archive:
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
        data = json.loads(_read(path, "data"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"'data' in '{path}' is torn: {error}.", "Copy it again.") from error
    if not isinstance(data, dict):
        raise InputError(f"'data' in '{path}' holds no names.", _AGAIN)
    return data
