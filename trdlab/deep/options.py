"""Fields that are options: of which kind and in which range their values are, said once."""

from collections.abc import Mapping, Sequence
from dataclasses import Field, field
from typing import Any

from trdlab.errors import InputError, closest

_LARGE = 2**63 - 1  # what a file, and a computer, can hold of a whole number
_SINGULAR = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}
_PLURAL = {int: "whole numbers", str: "texts"}


def option(
    default: Any,
    about: str,
    panel: str,
    *,
    key: str | None = None,
    kind: type | None = None,
    metavar: str | None = None,
    least: float | None = None,
    most: float = _LARGE,
) -> Any:
    """Returns a field that is an option of the commands, and a line of the configuration.

    Args:
        default: its value where nothing is said.
        about: the help.
        panel: under which heading the help stands.
        key: what it is called outside, if not like the field.
        kind: the type of its values, or of their elements; by default that of the default.
        metavar: what the help calls a value, if not by its type.
        least: of numbers, or of each element; without it, they are checked elsewhere.
        most: likewise.
    """
    told: dict[str, Any] = {"help": about, "panel": panel, "key": key, "metavar": metavar}
    told |= {"kind": kind or type(default), "least": least, "most": most}
    return field(default=default, metadata=told)


def check_range(of: Field[Any], value: Any) -> None:
    """Refuses a value, or an element of it, that is out of the range of its option.

    Raises:
        InputError: it is.
    """
    least, most = of.metadata.get("least"), of.metadata.get("most")
    if least is None or value is None:
        return
    for each in value if isinstance(value, tuple) else (value,):
        if not least <= each <= most:  # nor is NaN
            wanted = f"{least} or more" if each < least else "less than 2**63"
            raise InputError(
                f"`{of.name}` is {each}.",
                f"It must be {wanted if most == _LARGE else f'from {least} to {most:,}'}.",
            )


def key_of(of: Field[Any]) -> str:
    """Returns what an option is called in a configuration."""
    return str(of.metadata.get("key") or of.name)


def given_options(
    options: Sequence[Field[Any]], config: Mapping[str, Any], where: str
) -> dict[str, Any]:
    """Returns the values of options, by the names of their fields, from lines of a configuration.

    Raises:
        InputError: a key is unknown, or a value has another type.
    """
    known, given = {key_of(of): of for of in options}, {}
    for key, value in config.items():
        if key not in known:
            raise InputError(f"{where} has an unknown key '{key}'.", closest(key, known))
        of = known[key]
        listed = isinstance(of.default, tuple)
        given[of.name] = _typed(value, of.metadata.get("kind", str), listed, key, where)
    return given


def _typed(value: Any, kind: type, listed: bool, key: str, where: str) -> Any:
    """Returns a value of a configuration as the type of the option."""
    values = value if listed and isinstance(value, list | tuple) else [value]
    if isinstance(value, list | tuple) != listed or not all(_fits(of, kind) for of in values):
        wanted = f"a list of {_PLURAL[kind]}" if listed else _SINGULAR[kind]
        raise InputError(f"{where} has {key} = {value!r}.", f"It must be {wanted}.")
    return tuple(kind(of) for of in values) if listed else kind(value)


def _fits(value: Any, kind: type) -> bool:
    """Returns whether a value is of a type; whole numbers may be written like 1e6."""
    if kind in (bool, str):
        return isinstance(value, kind)
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    if kind is int:
        return value % 1 == 0
    return isinstance(value, float) or abs(value) < 2**1023  # 10**400 is no float
