"""Statistics by which Stable-Baselines3's `VecNormalize` changed what an agent saw in training.

They lie in a pickle. It is read with every class in it replaced by an inert one, except numpy's
arrays: nothing of it is executed, and what is no part of such a file is refused by name.
"""

import io
import pickle
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.arrays import FloatArray
from trdlab.errors import InputError

Shape = tuple[int, ...]

_LARGEST = 100_000_000  # bytes; such files have some thousands
_ARRAYS = {  # what arrays and numbers of numpy are made of
    ("ndarray", "numpy"),
    ("dtype", "numpy"),
    ("_reconstruct", "multiarray"),
    ("scalar", "multiarray"),
    ("_frombuffer", "numeric"),
}
_INERT = ("stable_baselines3", "gym", "gymnasium", "numpy", "collections", "copyreg", "builtins")
_CODE = {"builtins": {"object", "set", "frozenset", "bytearray", "type", "complex"}}


@dataclass(frozen=True, eq=False)
class Normalisation:
    """What observations go through before an agent sees them.

    Args:
        means: `[...]`, of each number.
        deviations: `[...]`, likewise.
        clip: `[...]`, how far from 0 each may then be.
    """

    means: FloatArray
    deviations: FloatArray
    clip: FloatArray

    def __call__(self, observations: Any) -> FloatArray:
        """Returns observations `[B, ...]` as the agent saw them."""
        apart = (np.asarray(observations) - self.means) / self.deviations
        return np.asarray(np.clip(apart, -self.clip, self.clip), dtype=np.float32)


def read_normalisation(
    path: Path, seen: Shape | None, parts: Mapping[str, Shape]
) -> Normalisation | None:
    """Returns the statistics in a file that `VecNormalize.save` wrote; None if it changes nothing.

    Args:
        path: of the file.
        seen: the shape of an observation.
        parts: the shapes of its parts, where it has several; some may be left alone.

    Raises:
        InputError: it is no such file, holds code, or is of other observations.
    """
    held = vars(_read(path))
    if not held.get("norm_obs", True):
        return None
    statistics = held.get("obs_rms")
    if not parts:
        return _normalisation(path, held, statistics, seen)
    if not isinstance(statistics, dict) or not set(statistics) <= set(parts):
        named = sorted(map(str, statistics)) if isinstance(statistics, dict) else "one thing"
        raise InputError(
            f"'{path}' is of {named}, and the agent sees {list(parts)}.",
            "Name the one that was saved with this agent.",
        )
    each = [
        _normalisation(path, held, statistics[name], shape)
        if name in statistics
        else Normalisation(np.zeros(shape), np.ones(shape), np.full(shape, np.inf))
        for name, shape in parts.items()
    ]
    fields = ("means", "deviations", "clip")
    return Normalisation(
        *(np.concatenate([getattr(of, name).ravel() for of in each]) for name in fields)
    )


def reward_unit(path: Path) -> float:
    """Returns what rewards were divided by when a file was saved; 1 where they were left alone.

    In training it changed as it was learned; by its end it hardly did.

    Args:
        path: a file that `VecNormalize.save` wrote.

    Raises:
        InputError: it is no such file, holds code, or no statistics of rewards.
    """
    held = vars(_read(path))
    if not held.get("norm_reward", False):
        return 1.0
    try:
        unit = float(np.sqrt(_floats(vars(held["ret_rms"])["var"]) + float(held["epsilon"])))
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"'{path}' holds no statistics of rewards.", "Name what VecNormalize.save wrote."
        ) from error
    return unit


def _normalisation(
    path: Path, held: Mapping[str, Any], statistics: Any, seen: Shape | None
) -> Normalisation:
    """Returns what one kind of observation, of the shape `seen`, goes through."""
    of = vars(statistics) if isinstance(statistics, _Inert) else {}
    try:
        means, variances = (_floats(of[name]) for name in ("mean", "var"))
        clip, epsilon = float(held["clip_obs"]), float(held["epsilon"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"'{path}' holds no statistics of observations.", "Name what VecNormalize.save wrote."
        ) from error
    if means.shape != variances.shape or means.shape != seen:
        raise InputError(
            f"'{path}' is of observations of shape {means.shape}, and the agent sees {seen}.",
            "Name the one that was saved with this agent.",
        )
    return Normalisation(means, np.sqrt(variances + epsilon), np.full(means.shape, clip))


class _Inert:
    """Stands for an object of another library: holds what is said of it, and does nothing."""

    def __init__(self, *arguments: Any, **named: Any) -> None: ...

    def __setitem__(self, key: Any, value: Any) -> None: ...

    def append(self, item: Any) -> None:
        """Does nothing, where a file fills a list of another kind."""

    def __setstate__(self, state: Any) -> None:
        parts = state if isinstance(state, tuple) else (state,)
        for part in parts:
            if isinstance(part, dict):
                self.__dict__.update({str(name): of for name, of in part.items()})


class _Reader(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        """Returns what may be made of a class that a file names."""
        if module.split(".")[0] == "numpy" and (name, module.rpartition(".")[2]) in _ARRAYS:
            return super().find_class(module, name)
        top = module.partition(".")[0]
        if top not in _INERT or name not in _CODE.get(top, {name}):
            raise _CodeError(f"{module}.{name}")
        return _Inert


class _CodeError(Exception):
    """A file names something that may do something."""


def _read(path: Path) -> Any:
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the names that numpy had for its own parts
            held = _Reader(io.BytesIO(data)).load()
    except OSError as error:
        raise InputError(
            f"'{path}' cannot be read: {error.strerror or error}.", "Name another file."
        ) from error
    except _CodeError as error:
        raise InputError(
            f"'{path}' holds code ({error}).",
            "Nothing was executed. Name what VecNormalize.save wrote.",
        ) from error
    except Exception as error:  # whatever a torn pickle leads to
        raise InputError(
            f"'{path}' is torn, or no file of VecNormalize.", "Name what VecNormalize.save wrote."
        ) from error
    if not isinstance(held, _Inert):
        raise InputError(f"'{path}' is no file of VecNormalize.", "Name what its save wrote.")
    return held


def _floats(held: Any) -> npt.NDArray[np.float64]:
    found = np.asarray(held, dtype=np.float64)
    if not np.isfinite(found).all():
        raise ValueError("not finite")
    return found
