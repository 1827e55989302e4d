"""Sections: what there is to tell, in order; text, pages and data are renderings of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from trdlab.explanations.rules import Claim

MOST_AT_FIRST = 5  # sentences, where nobody has asked for details


@dataclass(frozen=True)
class Section:
    """A part of what is told, under its heading.

    Args:
        name: of the part, as JSON carries it: `contrast`.
        heading: the question that it answers, in short.
        claims: the answer, what matters most first.
        notes: what there is to say of what is missing.
    """

    name: str
    heading: str
    claims: tuple[Claim, ...] = ()
    notes: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.claims or self.notes)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The claims and the notes in words."""
        return (*(claim.sentence for claim in self.claims), *self.notes)

    def to_dict(self) -> dict[str, Any]:
        """Returns the section as plain data at full precision."""
        return {
            "name": self.name,
            "heading": self.heading,
            "findings": [claim.to_dict() for claim in self.claims],
            "notes": list(self.notes),
        }


def at_first(claims: Sequence[Claim]) -> tuple[Claim, ...]:
    """Returns the claims that are told where nobody has asked for details: each once, no more."""
    told: dict[str, Claim] = {}
    for claim in claims:
        told.setdefault(claim.sentence, claim)
    return tuple(told.values())[:MOST_AT_FIRST]
