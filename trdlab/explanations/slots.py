"""Sentences that can be read back: one template writes a finding and reads it again.

Whatever is printed can so be tested: `Language.check` reads a rendered text back into claims and
numbers, and holds them against what they speak of.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Generic, NamedTuple, TypeVar

from trdlab.explanations.claims import Claim, Shown
from trdlab.explanations.rules import UnsupportedSentenceError
from trdlab.formatting import amount, decimals_between, number, percent, plain, significant
from trdlab.statistics import Estimate
from trdlab.time_axis import TimeAxis, step_label

S = TypeVar("S")
"""What sentences speak of."""

_SLOT = re.compile(r"\{(\w+)(?::(\w+))?\}")
_NUMBER = r"-?(?:\d+(?:\.\d+)?(?:e[+-]?\d+)?|inf)"
_ESTIMATE = rf"{_NUMBER}(?: on average \({_NUMBER} to {_NUMBER}\))?"
_COUNT = r"\d[\d,]*"
_STEP = r"t(?:\+\d+)?"
_LABEL = r"t\S*?"
_SECONDS = r"(?: \(in \S+ s\))?"
_COMPARED: dict[str, Callable[[Any], float]] = {
    "value": float,
    "amount": float,
    "estimate": lambda estimate: float(estimate.value),
}


class Form(NamedTuple):
    """How a value in a sentence is shown, recognised, and read back.

    Args:
        show: from the value, and the decimals at which the numbers of its sentence are told apart,
            to its text.
        pattern: of the text, as a regular expression.
        read: from the text to the value, None if it is none.
    """

    show: Callable[[Any, int], str]
    pattern: str
    read: Callable[[str], Any]


@dataclass(frozen=True, eq=False, repr=False)
class Language(Generic[S]):
    """Sentences for the findings about one kind of subject.

    Args:
        templates: a sentence with slots `{field:form}` for each kind of finding; the form of a
            bare slot is `action`.
        forms: from a subject to the forms that its slots can take.
        about: what a subject is called, for errors.
        evidence: from a subject to what its findings are held against.
        given: from a subject to the values of fields that no slot names.
    """

    templates: Mapping[type[Claim], str]
    forms: Callable[[S], Mapping[str, Form]]
    about: str = "these numbers"
    evidence: Callable[[S], Any] = lambda subject: subject
    given: Callable[[S], Mapping[str, Any]] = field(default=lambda _: {})

    def say(self, finding: Claim, subject: S) -> str:
        """Returns a finding as a sentence."""
        template, forms = self.templates[type(finding)], self.forms(subject)
        told = [(name, form) for name, form in _slots(template) if form in _COMPARED]
        values = [_COMPARED[form](getattr(finding, name)) for name, form in told]
        decimals = decimals_between(values[0], values[-1]) if values else 2

        def shown(slot: re.Match[str]) -> str:
            return forms[slot[2] or "action"].show(getattr(finding, slot[1]), decimals)

        text = _SLOT.sub(shown, template)
        return text[0].upper() + text[1:]

    def check(self, text: str, subject: S) -> list[Claim]:
        """Reads a rendered text back, tests each claim, and returns the claims.

        Args:
            text: sentences as `say` returns them, separated by white space.
            subject: what they speak of.

        Raises:
            UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
        """
        return [checked(piece, [(self, subject)]) for piece in split(text)]

    def claims(self, piece: str, subject: S) -> Iterator[tuple[Claim, bool]]:
        """Yields what one sentence can be read as, each with whether it is true of a subject."""
        forms, evidence, given = self.forms(subject), self.evidence(subject), self.given(subject)
        for kind, template in self.templates.items():
            values = read(template, piece, forms)
            if values is not None:
                context = {name: value for name, value in given.items() if name in kind.fields}
                claim = kind(**context | values)
                yield claim, claim.holds(evidence)


def checked(piece: str, known: Sequence[tuple[Language[Any], Any]]) -> Claim:
    """Returns the claim that a sentence of any of some languages makes.

    Args:
        piece: the sentence.
        known: languages, each with what its sentences speak of.

    Raises:
        UnsupportedSentenceError: it is none of their sentences, or is not true.
    """
    was_read = False
    for language, subject in known:
        for claim, is_true in language.claims(piece, subject):
            if is_true:
                return claim
            was_read = True
    about = " and ".join(language.about for language, _ in known)
    raise UnsupportedSentenceError(
        f"The sentence '{piece}' {'is not true of' if was_read else 'is no statement about'} "
        f"{about}."
    )


def forms_of(
    axis: TimeAxis, actions: Sequence[str] = (), seconds: float | None = None
) -> dict[str, Form]:
    """Returns the forms that a slot `{field:form}` can take.

    Args:
        axis: what components mean.
        actions: A names.
        seconds: how long a step takes as people play, if that is known.
    """
    labels = axis.labels

    def component(label: str) -> int | None:
        return labels.index(label) if label in labels else None

    def many(text: str) -> tuple[int, ...] | None:
        found = [component(label) for label in _apart(text)]
        return None if None in found else tuple(c for c in found if c is not None)

    return {
        "action": Form(_text, _names(tuple(actions)), lambda text: _name(text, actions)),
        "names": Form(lambda names, _: _joined(names), r".+", lambda text: tuple(_apart(text))),
        "text": Form(_text, r".+?", str),
        "count": Form(lambda count, _: f"{count:,}", _COUNT, _read_count),
        "steps": _counted("step"),
        "episodes": _counted("episode"),
        "value": Form(number, _NUMBER, _read_value),
        "amount": Form(amount, _NUMBER, _read_amount),
        "skill": Form(lambda x, _: number(x), _NUMBER, lambda text: Shown(text, number)),
        "estimate": Form(_show_estimate, _ESTIMATE, _read_estimate),
        "plain": Form(lambda x, _: plain(x), _NUMBER, lambda text: Shown(text, plain)),
        "precise": Form(lambda x, _: _precise(x), _NUMBER, lambda text: Shown(text, _precise)),
        "percent": Form(
            lambda x, _: f"{percent(x)} %",
            r"-?\d+(?:\.\d+)? %",
            lambda text: Shown(text.removesuffix(" %"), percent),
        ),
        "roots": Form(
            lambda roots, _: _joined([significant(root) for root in roots]),
            r".+",
            lambda text: tuple(Shown(root, significant) for root in _apart(text)),
        ),
        "step": Form(lambda step, _: step_label(step), _STEP, _read_step),
        "label": Form(lambda c, _: axis.label(c), _LABEL, component),
        "labels": Form(lambda cs, _: _joined([axis.label(c) for c in cs]), r"t.*?", many),
        "begin": Form(
            lambda c, _: step_label(axis.start(c)),
            _STEP,
            lambda text: _component_from(_read_step(text), axis),
        ),
        "when": _timed(axis.label, axis.start, component, _LABEL, seconds),
        "until": _timed(step_label, int, _read_step, _STEP, seconds),
    }


def read(template: str, text: str, forms: Mapping[str, Form]) -> dict[str, Any] | None:
    """Returns the fields of a sentence, None if it is none of this template.

    Numbers are read as `Shown`: they equal every number that is printed the same way.
    """
    slots = _slots(template)
    match = _pattern(template, tuple(forms[form].pattern for _, form in slots)).fullmatch(text)
    if match is None:
        return None
    values = {name: forms[form].read(match[name]) for name, form in slots}
    return None if None in values.values() else values


def split(text: str) -> list[str]:
    """Returns the sentences of a text."""
    return [piece for piece in re.split(r"(?<=\.)\s+", text.strip()) if piece]


@cache
def _slots(template: str) -> tuple[tuple[str, str], ...]:
    """Returns the field and the form of each slot."""
    return tuple((slot[1], slot[2] or "action") for slot in _SLOT.finditer(template))


@cache
def _pattern(template: str, patterns: tuple[str, ...]) -> re.Pattern[str]:
    pattern, end, seen = "", 0, set()
    for slot, of in zip(_SLOT.finditer(template), patterns, strict=True):
        again = f"(?P={slot[1]})" if slot[1] in seen else f"(?P<{slot[1]}>{of})"
        pattern += re.escape(template[end : slot.start()]) + again
        end = slot.end()
        seen.add(slot[1])
    pattern += re.escape(template[end:])
    return re.compile(pattern)


@cache
def _names(actions: tuple[str, ...]) -> str:
    """Returns the pattern of a name; only the subject's own actions are names."""
    names = {name[0].upper() + name[1:] for name in actions} | set(actions)
    return "|".join(re.escape(name) for name in sorted(names, key=len, reverse=True)) or r"(?!)"


def _name(text: str, actions: Sequence[str]) -> str:
    lowered = text[0].lower() + text[1:]  # it may stand at the start of a sentence
    return lowered if text not in actions and lowered in actions else text


def _text(text: str, _: int) -> str:
    return str(text)


def _joined(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _apart(text: str) -> list[str]:
    return re.split(r", | and ", text)


def _counted(noun: str) -> Form:
    """Returns the form of so many things: `1 step`, `12,000 steps`."""

    def show(count: int, _: int = 0) -> str:
        return f"{count:,} {noun}{'' if count == 1 else 's'}"

    def read_back(text: str) -> int | None:
        count = _read_count(text.partition(" ")[0])
        return count if count is not None and show(count) == text else None

    return Form(show, rf"{_COUNT} {noun}s?", read_back)


def _timed(
    label: Callable[[int], str],
    start: Callable[[int], int],
    read_label: Callable[[str], int | None],
    pattern: str,
    seconds: float | None,
) -> Form:
    """Returns the form of a future time, with its seconds of play where these are known."""

    def show(value: int, _: int = 0) -> str:
        steps = start(value)
        if seconds is None or steps == 0:
            return label(value)
        return f"{label(value)} (in {steps * seconds:.2g} s)"

    def read_back(text: str) -> int | None:
        value = read_label(text.partition(" (")[0])
        return value if value is not None and show(value) == text else None

    return Form(show, pattern + _SECONDS, read_back)


def _read_value(text: str) -> Shown:
    decimals = _decimals(text)
    return Shown(text, lambda x: number(x, decimals))


def _read_amount(text: str) -> Shown:
    decimals = _decimals(text)
    return Shown(text, lambda x: amount(x, decimals))


def _show_estimate(of: Estimate, decimals: int) -> str:
    low, value, high = (number(x, decimals) for x in (of.low, of.value, of.high))
    return value if of.low == of.high else f"{value} on average ({low} to {high})"


def _read_estimate(text: str) -> Estimate:
    numbers = [_read_value(found) for found in re.findall(_NUMBER, text)]
    return Estimate(numbers[0], numbers[-2 if len(numbers) > 1 else 0], numbers[-1])


def _decimals(text: str) -> int:
    """Returns the decimals of a printed number; any above 2, where it took an exponent."""
    return 3 if "e" in text else len(text.partition(".")[2]) or 2


def _precise(value: float) -> str:
    return significant(value, 4)


def _read_count(text: str) -> int | None:
    count = int(text.replace(",", ""))
    return count if f"{count:,}" == text else None


def _read_step(text: str) -> int:
    return int(text[2:] or 0)


def _component_from(step: int, axis: TimeAxis) -> int | None:
    component, within = divmod(step, axis.width)
    return component if not within and component < axis.num_components else None
