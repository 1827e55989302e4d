"""The arguments an environment is made with, as people write them."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from trdlab.errors import InputError

_BEGIN_JSON = ("[", "{", '"')
_WORDS = {"true": True, "false": False, "null": None}


def parse_arguments(words: Sequence[str]) -> dict[str, Any]:
    """Returns the arguments that are written as `KEY=VALUE`, each value as what it looks like.

    A value that begins as a list, an object or a string of JSON is one; `null` is None.

    Raises:
        InputError: one is not written like that, or stands there twice.

    >>> parse_arguments(["is_slippery=false", "map_name=8x8", 'desc=["SFF", "FHG"]'])
    {'is_slippery': False, 'map_name': '8x8', 'desc': ['SFF', 'FHG']}
    """
    arguments: dict[str, Any] = {}
    for word in words:
        name, separator, text = word.partition("=")
        if not separator or not name.isidentifier():
            raise InputError(
                f"The argument '{word}' is not KEY=VALUE.", "For example: is_slippery=false."
            )
        if name in arguments:
            raise InputError(f"The argument '{name}' is given twice.", "Give it once.")
        arguments[name] = _parsed(name, text)
    return arguments


def say_arguments(arguments: Mapping[str, Any]) -> str:
    """Returns arguments as they are written on the command line.

    >>> say_arguments({"map_name": "8x8", "is_slippery": False, "desc": ["SFF", "FHG"]})
    'map_name=8x8, is_slippery=false, desc=["SFF","FHG"]'
    """
    return ", ".join(_said(name, value) for name, value in arguments.items())


def parse_name(text: str) -> tuple[str, dict[str, Any]]:
    """Returns a name and the arguments that follow it after commas.

    Raises:
        InputError: what follows is not `KEY=VALUE`, or a key stands there twice.

    >>> parse_name('FrozenLake-v1,desc=["SFF","FHG"],is_slippery=false')
    ('FrozenLake-v1', {'desc': ['SFF', 'FHG'], 'is_slippery': False})
    """
    name, comma, rest = text.partition(",")
    return name, parse_arguments(list(_words(rest)) if comma else [])


def say_name(name: str, arguments: Mapping[str, Any]) -> str:
    """Returns a name with its arguments, as `parse_name` reads it.

    >>> say_name("ledge", {"slip": 0.2})
    'ledge,slip=0.2'
    """
    return ",".join([name, *(_said(key, value) for key, value in arguments.items())])


def _words(text: str) -> Iterator[str]:
    """Yields the words between commas; those within a value of JSON part nothing."""
    begin = 0
    while begin <= len(text):
        value = text.find("=", begin) + 1
        end = begin
        if value and text.startswith(_BEGIN_JSON, value) and "," not in text[begin:value]:
            end = value + _json(text[begin : value - 1], text[value:])[1]
        comma = text.find(",", end)
        end = len(text) if comma < 0 else comma
        yield text[begin:end]
        begin = end + 1


def _parsed(name: str, text: str) -> Any:
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    if text.startswith(_BEGIN_JSON):
        value, length = _json(name, text)
        if text[length:].strip():
            raise InputError(f"'{text[length:]}' follows the value of {name}.", "Leave it out.")
        return value
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _json(name: str, text: str) -> tuple[Any, int]:
    """Returns the value that a text begins with, and how long that is."""
    try:
        return json.JSONDecoder().raw_decode(text)
    except ValueError as error:
        raise InputError(
            f"The value of {name} begins as JSON and is none: {error}.",
            'For example: ["SFFF","FHFG"].',
        ) from error


def _said(name: str, value: Any) -> str:
    if isinstance(value, str) and "," not in value and _reads_as(name, value):
        return f"{name}={value}"
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f"{name}={value}"
    return f"{name}={json.dumps(value, separators=(',', ':'), default=_plain)}"


def _reads_as(name: str, text: str) -> bool:
    """Returns whether a text without quotes is read as itself."""
    return not text.startswith(_BEGIN_JSON) and _parsed(name, text) == text


def _plain(value: Any) -> Any:
    """Returns what JSON can hold in place of what it cannot, such as an array."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
