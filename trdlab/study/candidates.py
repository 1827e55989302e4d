"""The three agents of a blind reading: they differ in when reward comes, and in what they risk."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Candidate:
    """One of the agents that a trial may be about.

    Args:
        letter: how readers name it.
        about: what it does, in a few words.
    """

    letter: str
    about: str


CANDIDATES = (
    Candidate("A", "takes a risk for rewards that come soon"),
    Candidate("B", "takes a risk for rewards that come late"),
    Candidate(
        "C", "plays safe: it avoids the danger of an action that would otherwise be worth more"
    ),
)
LETTERS = "".join(candidate.letter for candidate in CANDIDATES)
