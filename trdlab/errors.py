"""The errors trdlab raises: each names its cause, the value, and the cure."""

from collections.abc import Iterable


class TrdlabError(Exception):
    """Base class of every error raised on purpose; the command line exits with `exit_code`.

    A message names arguments as Python does, between backticks, such as `env` or `episodes=50`;
    only the command line knows the options that they are there.

    Args:
        cause: what went wrong, with the offending value.
        cure: what to do about it, if there is something to do.
    """

    exit_code = 1

    def __init__(self, cause: str, cure: str = "") -> None:
        super().__init__(f"{cause} {cure}".strip())
        self.cause = cause
        self.cure = cure


class InputError(TrdlabError, ValueError):
    """A value given by the caller cannot be used."""

    exit_code = 2


class MapError(InputError):
    """A gridworld map cannot be read, or cannot be played."""


class OutputError(InputError):
    """A result cannot be written where it was asked for."""


class NotImported(InputError):  # noqa: N818  it says what a module is, not what failed
    """A run needs a module that nobody has named: its code is not executed because a file says so.

    Args:
        cause: what needs it.
        module: its name.
    """

    def __init__(self, cause: str, module: str) -> None:
        super().__init__(cause, f"If you trust it, import {module} first.")
        self.module = module


def closest(name: str, known: Iterable[str]) -> str:
    """Returns the cure for a misspelt name: the nearest known one, or all of them.

    >>> closest("dron", ["drone", "bridge"])
    "Did you mean 'drone'?"
    >>> closest("xyz", ["drone", "bridge"])
    'Known: bridge, drone.'
    """
    from difflib import get_close_matches

    names = sorted(known)
    options = {option.lower(): option for option in names}
    near = get_close_matches(name.lower(), options, n=1, cutoff=0.7)
    return f"Did you mean '{options[near[0]]}'?" if near else f"Known: {', '.join(names)}."
