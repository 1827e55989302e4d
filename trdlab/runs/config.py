"""Configurations as TOML: people read and edit them, so they may hold comments."""

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from trdlab.errors import InputError, TrdlabError

Scalar = str | int | float | bool
Value = Scalar | Sequence[Scalar]
Config = Mapping[str, Value | Mapping[str, Value]]


def to_toml(config: Config) -> str:
    """Returns a configuration as TOML: one line for each value, then one table for each mapping.

    Raises:
        InputError: TOML has no such value.

    >>> print(to_toml({"game": "Breakout", "gamma": 0.99, "teacher": {"score": 96}}), end="")
    game = "Breakout"
    gamma = 0.99
    <BLANKLINE>
    [teacher]
    score = 96
    """
    flat = {name: value for name, value in config.items() if not isinstance(value, Mapping)}
    tables = {name: value for name, value in config.items() if isinstance(value, Mapping)}
    parts = [_lines(flat), *(f"[{_key(name)}]\n{_lines(table)}" for name, table in tables.items())]
    return "\n".join(part for part in parts if part)


def read_config(path: Path) -> dict[str, Any]:
    """Returns what a TOML file holds.

    Raises:
        InputError: there is no such file, or it is not TOML; the line is named.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"'{path}' cannot be read: {reason}.", "Name a .toml file.") from error
    except (ValueError, RecursionError) as error:  # also of text that is not UTF-8
        raise InputError(f"'{path}' is not valid TOML: {error}.", "Correct it.") from error


def _lines(table: Mapping[str, Any]) -> str:
    return "".join(f"{_key(name)} = {_value(name, value)}\n" for name, value in table.items())


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def _value(name: str, value: Any) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)  # inf and nan are TOML too
        case str():
            return _text(value)
        case list() | tuple():
            return f"[{', '.join(_value(name, entry) for entry in value)}]"
    raise InputError(
        f"The configuration's '{name}' is {value!r}, which TOML cannot hold.",
        "Use text, numbers, true or false, and lists of them; leave out what is not set.",
    )


def _text(text: str) -> str:
    """Returns a text in TOML, whose escapes are those of JSON, and one more."""
    quoted = json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
    try:
        quoted.encode()
    except UnicodeEncodeError as error:
        raise TrdlabError(f"{text!r} is no Unicode text.", "Choose another name.") from error
    return quoted
