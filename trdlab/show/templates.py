"""Sentences that can be read back: one template writes a finding and reads it again."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from trdlab.decomposition import TimeAxis
from trdlab.explain.finding import Shown
from trdlab.formatting import number, percent, significant
from trdlab.time_axis import step_label

_SLOT = re.compile(r"\{(\w+):(\w+)\}")
_NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_COUNT = r"\d[\d,]*"
_STEP = r"t(?:\+\d+)?"


@dataclass(frozen=True)
class Form:
    """How a value in a sentence is shown, recognised, and read back.

    Args:
        show: from the value to its text.
        pattern: of the text, as a regular expression.
        read: from the text to the value, None if it is none.
    """

    show: Callable[[Any], str]
    pattern: str
    read: Callable[[str], Any]


def forms_of(axis: TimeAxis) -> dict[str, Form]:
    """Returns the forms that a slot `{field:form}` can take, on a time axis."""
    labels = axis.labels
    return {
        "count": Form("{:,}".format, _COUNT, _read_count),
        "steps": _counted("step"),
        "episodes": _counted("episode"),
        "value": Form(number, _NUMBER, lambda text: Shown(text, number)),
        "precise": Form(_precise, _NUMBER, lambda text: Shown(text, _precise)),
        "percent": Form(
            lambda x: f"{percent(x)} %",
            r"-?\d+(?:\.\d+)? %",
            lambda text: Shown(text.removesuffix(" %"), percent),
        ),
        "step": Form(step_label, _STEP, lambda text: int(text[2:] or 0)),
        "label": Form(
            axis.label,
            r"t\S*?",
            lambda text: labels.index(text) if text in labels else None,
        ),
        "begin": Form(
            lambda component: step_label(axis.start(component)),
            _STEP,
            lambda text: _component_from(int(text[2:] or 0), axis),
        ),
    }


def say(template: str, finding: object, forms: Mapping[str, Form]) -> str:
    """Returns a finding as a sentence.

    Args:
        template: with slots `{field:form}`.
        finding: whose fields fill them.
        forms: how each is shown.
    """
    return _SLOT.sub(lambda slot: forms[slot[2]].show(getattr(finding, slot[1])), template)


def read(template: str, text: str, forms: Mapping[str, Form]) -> dict[str, Any] | None:
    """Returns the fields of a sentence, None if it is none of this template.

    Numbers are read as `Shown`: they equal every number that is printed the same way.
    """
    pattern, slots = _pattern(template, tuple((name, form.pattern) for name, form in forms.items()))
    match = pattern.fullmatch(text)
    if match is None:
        return None
    fields = {field: forms[form].read(match[field]) for field, form in slots}
    return None if None in fields.values() else fields


@cache
def _pattern(
    template: str, patterns: tuple[tuple[str, str], ...]
) -> tuple[re.Pattern[str], tuple[tuple[str, str], ...]]:
    of, pattern, end, slots = dict(patterns), "", 0, []
    for slot in _SLOT.finditer(template):
        between = re.escape(template[end : slot.start()])
        pattern += f"{between}(?P<{slot[1]}>{of[slot[2]]})"
        slots.append((slot[1], slot[2]))
        end = slot.end()
    return re.compile(pattern + re.escape(template[end:])), tuple(slots)


def split(text: str) -> list[str]:
    """Returns the sentences of a text."""
    return [piece for piece in re.split(r"(?<=\.)\s+", text.strip()) if piece]


def _counted(noun: str) -> Form:
    """Returns the form of so many things: `1 step`, `12,000 steps`."""

    def show(count: int) -> str:
        return f"{count:,} {noun}{'' if count == 1 else 's'}"

    def read_back(text: str) -> int | None:
        count = _read_count(text.partition(" ")[0])
        return count if count is not None and show(count) == text else None

    return Form(show, rf"{_COUNT} {noun}s?", read_back)


def _precise(value: float) -> str:
    return significant(value, 4)


def _read_count(text: str) -> int | None:
    count = int(text.replace(",", ""))
    return count if f"{count:,}" == text else None


def _component_from(step: int, axis: TimeAxis) -> int | None:
    component, within = divmod(step, axis.width)
    return component if not within and component < axis.num_components else None
