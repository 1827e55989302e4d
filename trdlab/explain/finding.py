"""A finding: one small true statement, with the numbers that support it.

Each one can check itself: `holds(evidence)` tests the claim by its definition, not by the search
that found it. The numbers it compares may be exact, or `Shown`: read back from printed text.
"""

import re
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from typing import Any, ClassVar

from trdlab.arrays import FloatArray
from trdlab.explain.moment import Moment, same


class Shown(float):
    """A number as it stood in a text; it equals every number that is printed the same way."""

    text: str
    reprint: Callable[[float], str]

    def __new__(cls, text: str, reprint: Callable[[float], str]) -> "Shown":
        """Reads the number; `reprint` prints another one in the same manner."""
        shown = super().__new__(cls, text)
        shown.text, shown.reprint = text, reprint
        return shown


def agrees(claimed: float, true: float) -> bool:
    """Returns whether a claimed number is the true one, at the precision it was claimed in."""
    if isinstance(claimed, Shown):
        return claimed.reprint(true) == claimed.text
    return same(claimed, true) or abs(claimed - true) <= 1e-9 * max(1.0, abs(true))


class Claim:
    """Base class: one small statement and its numbers, which cannot be changed once they are set.

    A direct subclass begins a family, of claims about one kind of evidence; what is derived from it
    is a kind of claim, unless its name begins with an underscore. Equality and the repr are written
    here once: dataclass would generate them anew for each kind, which takes longer than all that a
    claim is used for.
    """

    kinds: ClassVar[dict[str, type["Claim"]]] = {}

    def __init_subclass__(cls) -> None:
        if Claim in cls.__bases__:
            cls.kinds = {}
        elif not cls.__name__.startswith("_"):
            cls.kinds[cls.kind()] = cls

    def __setattr__(self, name: str, value: object) -> None:
        if name in self.__dict__:
            raise FrozenInstanceError(f"the {name} of a finding cannot be changed")
        super().__setattr__(name, value)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((type(self), *self.__dict__.values()))

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={value!r}" for name, value in self.__dict__.items())
        return f"{type(self).__name__}({values})"

    @classmethod
    def kind(cls) -> str:
        """Returns the name of the claim, as JSON carries it: `first-reward`."""
        return re.sub(r"(?<!^)([A-Z])", r"-\1", cls.__name__).lower()

    def holds(self, evidence: Any) -> bool:
        """Returns whether the claim is true of its evidence, tested by its definition."""
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Returns the kind and the numbers as plain data."""
        return {"kind": self.kind()} | self.__dict__


class Finding(Claim):
    """A claim about a moment."""

    def holds(self, moment: Moment) -> bool:
        """Returns whether the claim is true of a moment, tested by its definition."""
        raise NotImplementedError


def one_sign(row: FloatArray) -> bool:
    """Returns whether shares and means of components make sense: one sign, and not all zero."""
    return bool(row.any() and ((row >= 0.0).all() or (row <= 0.0).all()))
