"""The arguments an environment is made with, as people write them."""

from collections.abc import Mapping, Sequence
from typing import Any

from trdlab.errors import InputError


def parse_arguments(words: Sequence[str]) -> dict[str, bool | int | float | str]:
    """Returns the arguments that are written as `KEY=VALUE`, each value as what it looks like.

    Raises:
        InputError: one is not written like that, or stands there twice.

    >>> parse_arguments(["is_slippery=false", "map_name=8x8", "success_rate=0.8"])
    {'is_slippery': False, 'map_name': '8x8', 'success_rate': 0.8}
    """
    arguments: dict[str, bool | int | float | str] = {}
    for word in words:
        name, separator, text = word.partition("=")
        if not separator or not name.isidentifier():
            raise InputError(
                f"The argument '{word}' is not KEY=VALUE.", "For example: is_slippery=false."
            )
        if name in arguments:
            raise InputError(f"The argument '{name}' is given twice.", "Give it once.")
        arguments[name] = _parsed(text)
    return arguments


def say_arguments(arguments: Mapping[str, Any]) -> str:
    """Returns arguments as they are written on the command line.

    >>> say_arguments({"map_name": "8x8", "is_slippery": False})
    'map_name=8x8, is_slippery=false'
    """
    return ", ".join(
        f"{name}={str(value).lower() if isinstance(value, bool) else value}"
        for name, value in arguments.items()
    )


def _parsed(text: str) -> bool | int | float | str:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
