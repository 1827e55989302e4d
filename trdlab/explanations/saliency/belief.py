"""Whether to believe what is said to matter: what the checks have found, in words."""

from collections.abc import Iterator

from trdlab.explanations.rules import Fields, Found
from trdlab.explanations.saliency.groups import Group
from trdlab.explanations.saliency.saliency import SALIENCY, Entries, Places, Saliency

BAD = ("redrawn-bad", "hidden-bad")
"""The kinds that say that something is not to be believed."""
_NUMBER = "(rank correlation {value:correlation})"


@SALIENCY.kinds(
    {
        "redrawn-good": (
            f"With new weights, other {{parts:text}} count {{group:span}} {_NUMBER}, as should be."
        ),
        "redrawn-bad": (
            "Do not believe what counts {group:span}: with new weights it is much the same "
            f"{_NUMBER}."
        ),
        "redrawn-not-tested": (
            "Whether what counts {group:span} depends on what was learned could not be tested."
        ),
    }
)
def redrawn(saliency: Saliency) -> Iterator[Found]:
    """Whether it depends on what was learned."""
    yield from _checked(saliency, "redrawn")


@SALIENCY.kinds(
    {
        "hidden-good": (
            f"Where much counts {{group:span}}, hiding changes more {_NUMBER}, as it should."
        ),
        "hidden-bad": (
            "Do not believe what counts {group:span}: hiding changes hardly more there than "
            f"elsewhere {_NUMBER}."
        ),
        "hidden-not-tested": (
            "Whether hiding changes more where much counts {group:span} could not be tested."
        ),
    }
)
def hidden(saliency: Saliency) -> Iterator[Found]:
    """Whether hiding changes more where it is strong."""
    yield from _checked(saliency, "hidden")


def _checked(saliency: Saliency, name: str) -> Iterator[Found]:
    if isinstance(saliency.of, Entries) and saliency.of.method != "gradients":
        return
    parts = "places" if isinstance(saliency.of, Places) else "entries"
    for group in saliency.told:
        check = getattr(saliency.of.checks(group), name)
        fields = {"parts": parts, "group": tuple(group), "value": check.value}
        yield f"{name}-{check.verdict.replace(' ', '-')}", fields


@SALIENCY.rule("This is of a solved model, so there is nothing to doubt.")
def certain(saliency: Saliency) -> Iterator[Fields]:
    if isinstance(saliency.of, Entries) and saliency.of.method == "exchange":
        yield {}


@SALIENCY.rule("This was tried out, with what was met at {count:count} other moments.")
def tried_out(saliency: Saliency) -> Iterator[Fields]:
    if isinstance(saliency.of, Entries) and saliency.of.method == "hiding":
        yield {"count": saliency.of.met}


@SALIENCY.rule(
    "{whose:text} {group:span} has not proved better than a guess, so what that hangs on tells "
    "little."
)
def doubtful(saliency: Saliency) -> Iterator[Fields]:
    for group in saliency.told:
        if saliency.is_doubtful(group):
            yield saliency.whose | {"group": tuple(group)}


def caption(saliency: Saliency, group: Group) -> str:
    """Returns in a few words whether to believe an attribution, for beneath a picture of it."""
    checks = saliency.of.checks(group)
    found = []
    for name, check in zip(("weights", "hiding"), checks, strict=True):
        verdict = {"good": "passed", "bad": "failed", "not tested": "not tested"}[check.verdict]
        number = "" if check.verdict == "not tested" else f" ({check.value:.2f})"
        found.append(f"{name}: {verdict}{number}")
    return ", ".join(found).replace("-", "−")
