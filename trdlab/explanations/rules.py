"""Rules: a sentence with slots, and what finds every set of numbers of which it is true.

A rule is all there is to a kind of claim. What is printed is read back by the rules: one of them
has to find, in the same evidence, numbers that make this very sentence. So no sentence is shown
that its numbers do not support.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from trdlab.errors import TrdlabError
from trdlab.formatting import digits_to_tell

E = TypeVar("E")  # the evidence that sentences speak of
Fields = dict[str, Any]
Found = tuple[str, Fields]  # the kind of a claim, and its fields
_SLOT = re.compile(r"\{(\w+)(?::(\w+))?\}")


class UnsupportedSentenceError(TrdlabError):
    """A rendered sentence makes a claim that the numbers do not support."""


class Form(NamedTuple):
    """How a value looks in a sentence.

    Args:
        show: from the value and the significant digits that its sentence needs, to its text.
        value: from the value to the number that has to differ from others in print, if it is one.
    """

    show: Callable[[Any, int], str]
    value: Callable[[Any], float] | None = None


@dataclass(frozen=True, eq=False)
class Rule(Generic[E]):
    """A kind of claim; called with evidence, it returns every such claim that is true of it.

    Args:
        language: whose sentences it adds to.
        kind: as JSON carries it: `first-reward`.
        says: its sentence, with slots `{field:form}`; the form of a bare slot is `action`.
        find: yields, from the evidence, the fields of every such claim that is true.
    """

    language: "Language[E]"
    kind: str
    says: str
    find: Callable[[E], Iterable[Fields]]

    def __call__(self, evidence: E) -> "list[Claim]":
        return [Claim(self, evidence, fields) for fields in self.find(evidence)]


@dataclass(frozen=True, eq=False, repr=False)
class Claim:
    """A statement that is true of its evidence, and its numbers.

    Args:
        rule: what kind of statement it is.
        evidence: what it is true of.
        fields: its numbers and names, which are attributes too.
    """

    rule: Rule[Any]
    evidence: Any
    fields: Fields

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["fields"][name]
        except KeyError:
            raise AttributeError(f"a claim of kind '{self.kind}' has no '{name}'") from None

    def __repr__(self) -> str:
        return f"<{self.kind}: {self.sentence}>"

    @property
    def kind(self) -> str:
        """The name of the rule: `first-reward`."""
        return self.rule.kind

    @property
    def sentence(self) -> str:
        """The claim in words."""
        return self.rule.language.say(self)

    def to_dict(self) -> Fields:
        """Returns the kind, the numbers at full precision and the sentence, as plain data."""
        fields: Fields = plain_data(self.fields)
        return {"kind": self.kind} | fields | {"sentence": self.sentence}


@dataclass(frozen=True, eq=False)
class Language(Generic[E]):
    """The rules about one kind of evidence, and how values look in their sentences.

    Args:
        about: what the evidence is called, for errors.
        forms: from the evidence to the forms that slots can take.
    """

    about: str
    forms: Callable[[E], Mapping[str, Form]]
    rules: dict[str, Rule[E]] = field(default_factory=dict)

    def rule(
        self, says: str, *, kind: str | None = None
    ) -> Callable[[Callable[[E], Iterable[Fields]]], Rule[E]]:
        """Makes a rule of a function that finds its numbers; its kind is the function's name.

        Args:
            says: the sentence, with slots `{field:form}`.
            kind: where one function serves several rules.
        """

        def made(find: Callable[[E], Iterable[Fields]]) -> Rule[E]:
            name = kind or find.__name__.strip("_").replace("_", "-")
            if name in self.rules:
                raise ValueError(f"there are two rules '{name}' about {self.about}")
            self.rules[name] = Rule(self, name, says, find)
            return self.rules[name]

        return made

    def kinds(
        self, says: Mapping[str, str]
    ) -> Callable[[Callable[[E], Iterable[Found]]], tuple[Rule[E], ...]]:
        """Makes rules of a function that finds claims of several kinds, each with its sentence."""

        def made(find: Callable[[E], Iterable[Found]]) -> tuple[Rule[E], ...]:
            def of(kind: str) -> Callable[[E], list[Fields]]:
                return lambda evidence: [found for own, found in find(evidence) if own == kind]

            return tuple(self.rule(says[kind], kind=kind)(of(kind)) for kind in says)

        return made

    def say(self, claim: Claim) -> str:
        """Returns a claim as a sentence, its numbers with as many digits as tell them apart."""
        forms, fields, says = self.forms(claim.evidence), claim.fields, claim.rule.says
        slots = [(fields[slot[1]], forms[slot[2] or "action"]) for slot in _SLOT.finditer(says)]
        digits = digits_to_tell([form.value(value) for value, form in slots if form.value])
        shown = iter([form.show(value, digits) for value, form in slots])
        text = _SLOT.sub(lambda _: next(shown), says)
        return text[0].upper() + text[1:]

    def true(self, sentence: str, evidence: E) -> Claim | None:
        """Returns the claim that a sentence makes, if it is one of these rules' and true."""
        made = every(evidence, *self.like(sentence))
        return next((claim for claim in made if claim.sentence == sentence), None)

    def like(self, sentence: str) -> list[Rule[E]]:
        """Returns the rules of which a sentence could be one."""
        return [of for of in self.rules.values() if _skeleton(of.says).fullmatch(sentence)]


def check(text: str, known: Sequence[tuple[Language[Any], Any]]) -> list[Claim]:
    """Reads printed sentences back, holds each against its evidence, and returns the claims.

    Args:
        text: sentences with white space between them.
        known: languages, each with the evidence that its sentences may speak of.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    return [_checked(piece, known) for piece in split(text)]


def _checked(piece: str, known: Sequence[tuple[Language[Any], Any]]) -> Claim:
    for language, evidence in known:
        if (claim := language.true(piece, evidence)) is not None:
            return claim
    about = " and ".join(language.about for language, _ in known)
    is_known = any(language.like(piece) for language, _ in known)
    verdict = "is not true of" if is_known else "is no statement about"
    raise UnsupportedSentenceError(f"The sentence '{piece}' {verdict} {about}.")


def split(text: str) -> list[str]:
    """Returns the sentences of a text."""
    return [piece for piece in re.split(r"(?<=\.)\s+", text.strip()) if piece]


def first(evidence: E, *rules: Rule[E]) -> list[Claim]:
    """Returns the first claim of the first of some rules that finds one."""
    return next(([claim] for rule in rules for claim in rule(evidence)), [])


def every(evidence: E, *rules: Rule[E]) -> list[Claim]:
    """Returns all claims of some rules, in their order."""
    return [claim for rule in rules for claim in rule(evidence)]


def plain_data(value: Any) -> Any:
    """Returns a result as what JSON knows: what is not finite is `null`.

    The time axis, which all parts of a result share, is left out.
    """
    if is_dataclass(value):
        named = (of.name for of in fields(value) if of.name != "time_axis")
        return {name: plain_data(getattr(value, name)) for name in named}
    if isinstance(value, Mapping):
        return {str(name): plain_data(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain_data(part) for part in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain_data(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


@cache
def _skeleton(says: str) -> re.Pattern[str]:
    """Returns the pattern of a rule's sentences: any text in its slots, or none."""
    pieces = [re.escape(text) for text in re.split(r"\{[^}]*\}", says)]
    return re.compile("(.*)".join(pieces), re.IGNORECASE)  # a slot may begin the sentence
