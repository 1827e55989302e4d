"""A finding: one small true statement, with the numbers that support it.

Each one can check itself: `holds(evidence)` tests the claim by its definition, not by the search
that found it. The numbers it compares may be exact, or `Shown`: read back from printed text.
"""

import re
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from inspect import get_annotations
from typing import Any, ClassVar, dataclass_transform

from trdlab.arrays import FloatArray, same
from trdlab.explanations.moment.moment import Moment


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


@dataclass_transform(frozen_default=True)
class Claim:
    """Base class: one small statement and its numbers, which cannot be changed once they are set.

    The numbers are fields, written as those of a dataclass are. A direct subclass begins a family,
    of claims about one kind of evidence; what is derived from it is a kind of claim, unless its
    name begins with an underscore. All of them share the methods here: dataclass would generate
    them anew for each of some hundred kinds, which takes longer than all that claims are used for.
    """

    kinds: ClassVar[dict[str, type["Claim"]]] = {}
    fields: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        own = get_annotations(cls).items()
        cls.fields += tuple(name for name, of in own if not str(of).startswith("typing.ClassVar"))
        if Claim in cls.__bases__:
            cls.kinds = {}
        elif not cls.__name__.startswith("_"):
            cls.kinds[cls.kind()] = cls

    def __init__(self, *values: Any, **named: Any) -> None:
        given = dict(zip(self.fields, values, strict=False)) | named
        if len(given) != len(values) + len(named) or given.keys() != set(self.fields):
            raise TypeError(f"{type(self).__name__} takes {', '.join(self.fields) or 'nothing'}")
        self.__dict__.update(given)

    def __setattr__(self, name: str, value: object) -> None:
        raise FrozenInstanceError(f"the {name} of a finding cannot be changed")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((type(self), *(self.__dict__[name] for name in self.fields)))

    def __repr__(self) -> str:
        values = ", ".join(f"{name}={self.__dict__[name]!r}" for name in self.fields)
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
        return {"kind": self.kind()} | {name: self.__dict__[name] for name in self.fields}


class Finding(Claim):
    """A claim about a moment."""

    def holds(self, moment: Moment) -> bool:
        """Returns whether the claim is true of a moment, tested by its definition."""
        raise NotImplementedError


def one_sign(row: FloatArray) -> bool:
    """Returns whether shares and means of components make sense: one sign, and not all zero."""
    return bool(row.any() and ((row >= 0.0).all() or (row <= 0.0).all()))
