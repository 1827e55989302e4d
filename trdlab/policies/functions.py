"""Functions of one's own as policies, and files of Python that make an agent."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.errors import InputError, closest
from trdlab.policies.protocol import rows
from trdlab.policies.ready import Memoryless

PYTHON = "python:"
"""What stands before a file of Python and the name of a function in it."""

_WANTED = (
    "It must take an observation and return an action's number, or take observations [B, ...] and "
    "return the probability of each action, [B, A]."
)


def as_they_are(observations: Any) -> Any:
    """Returns observations."""
    return observations


@dataclass(frozen=True)
class OneByOne:
    """Acts by a function that is shown one observation at a time.

    Args:
        function: from an observation to the number of an action.
        num_actions: A.
        shown: from observations `[B, ...]` to those that the function takes, a batch likewise.
    """

    function: Callable[[Any], Any]
    num_actions: int
    shown: Callable[[Any], Any] = as_they_are

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns 1 for the function's action `[B, A]`; there is nothing to remember.

        Raises:
            InputError: it answers an observation with something else, or fails.
        """
        count, batch = len(observations), self.shown(observations)
        actions = [self._one(rows(batch, at), at, count) for at in range(count)]
        return np.eye(self.num_actions)[actions], None

    def _one(self, observation: Any, at: int, count: int) -> int:
        try:
            told = self.function(observation)
        except Exception as error:
            raise _failed(f"observation {at} of {count}", error) from error
        action = _number(told)
        if action is None or not 0 <= action < self.num_actions:
            raise InputError(
                f"The policy answered observation {at} of {count} with {told!r:.60}.",
                f"It must return the number of an action, from 0 to {self.num_actions - 1}.",
            )
        return action


def from_function(
    function: Callable[[Any], Any],
    observations: Any,
    num_actions: int,
    shown: Callable[[Any], Any] = as_they_are,
) -> OneByOne | Memoryless:
    """Returns the policy that a function is, by what it answers.

    Args:
        function: from an observation to an action, or from observations to probabilities.
        observations: `[2, ...]`, to try it with.
        num_actions: A.
        shown: see `OneByOne`.

    Raises:
        InputError: it is neither.

    >>> from_function(lambda seen: int(seen[0] > 0), np.zeros((2, 4)), 2).num_actions
    2
    >>> from_function(lambda seen: np.full((len(seen), 2), 0.5), np.zeros((2, 4)), 2).function
    <function ...>
    """
    batch = shown(observations)
    together = _tried(function, batch)
    if np.shape(together) == (len(observations), num_actions):
        return Memoryless(lambda seen: function(shown(seen)))
    alone = _tried(function, rows(batch, 0))
    if _number(alone) is not None:
        return OneByOne(function, num_actions, shown)
    failed = together if isinstance(together, Exception) else alone
    if isinstance(failed, Exception) and isinstance(alone, Exception):
        raise _failed("the first observation", alone) from alone
    shape = np.shape(alone if isinstance(together, Exception) else together)
    raise InputError(
        f"The function answers {len(observations)} observations with shape {shape}, for "
        f"{num_actions} actions.",
        _WANTED,
    )


def from_python(name: str) -> Any:
    """Returns what a function in a file of Python makes. The file is executed.

    Args:
        name: `FILE.py:FUNCTION`.

    Raises:
        InputError: there is no such file or function, or one of them fails.
    """
    file, _, called = name.rpartition(":")
    path = Path(file)
    if not file or not called.isidentifier():
        raise InputError(f"'{PYTHON}{name}' names no function.", f"Write {PYTHON}FILE.py:FUNCTION.")
    if not path.is_file():
        raise InputError(f"There is no file '{path}'.", f"Write {PYTHON}FILE.py:FUNCTION.")
    spec = spec_from_file_location(f"trdlab_agent_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"'{path}' is no file of Python.", "Its name must end in .py.")
    module = module_from_spec(spec)
    sys.modules[spec.name] = module  # where its classes look for their own module
    sys.path.append(str(path.parent.resolve()))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise _failed(f"'{path}'", error, "cannot be imported") from error
    finally:
        sys.path.pop()
    function = getattr(module, called, None)
    if not callable(function):
        known = [key for key, of in vars(module).items() if callable(of) and key[0] != "_"]
        cure = closest(called, known) if known else "Define it."
        raise InputError(f"There is no function '{called}' in '{path}'.", cure)
    try:
        return function()
    except InputError:
        raise
    except Exception as error:
        raise _failed(f"'{called}' in '{path}'", error, "makes no agent") from error


def _tried(function: Callable[[Any], Any], seen: Any) -> Any:
    """Returns what a function answers, or the exception that it raises."""
    try:
        return function(seen)
    except Exception as error:  # noqa: BLE001  whatever can be raised in another's code
        return error


def _number(told: Any) -> int | None:
    """Returns an answer as the number of an action, None where it is no whole number."""
    try:
        answer = np.asarray(told)
    except ValueError:
        return None
    return int(answer.item()) if answer.size == 1 and answer.dtype.kind in "iub" else None


def _failed(where: str, error: Exception, how: str = "") -> InputError:
    said = f"{type(error).__name__}: {error}"
    if how:
        return InputError(f"{where} {how} ({said}).", "Correct it, or name another.")
    return InputError(f"The policy fails at {where} ({said}).", "Correct its function.")
