"""What came of two actions that were tried, beside what was forecast of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.explanations.rules import Claim, Fields, Form, Language, every, plain_data
from trdlab.explanations.sections import Section
from trdlab.explanations.words import forms_of
from trdlab.rollouts.counterfactual import Counterfactual
from trdlab.statistics import Estimate, enough

WORTH_SAYING = 0.1
"""The share of Σ|difference| below which a component is not told of."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Two actions that were tried, with their names.

    Args:
        found: what was forecast and what followed.
        action_names: A names.
        seconds_per_step: how long a step takes as people play, if that is known.
    """

    found: Counterfactual
    action_names: tuple[str, ...]
    seconds_per_step: float | None = None

    @property
    def action(self) -> str:
        """The name of one action."""
        return self.action_names[self.found.action]

    @property
    def foil(self) -> str:
        """The name of the other."""
        return self.action_names[self.found.foil]

    @property
    def is_seen(self) -> bool:
        """Whether something is known of what came."""
        return not np.isnan(self.found.observed.value[-1])

    def to_dict(self) -> dict[str, Any]:
        """Returns the numbers and the claims as plain data at full precision."""
        told = [claim.to_dict() for claim in _told(self)]
        about = {"action": self.action, "foil": self.foil, "findings": told}
        return dict(plain_data(self.found)) | about


def _forms(trial: Trial) -> dict[str, Form]:
    axis, whole = trial.found.time_axis, trial.found.whole
    forms = forms_of(axis, trial.seconds_per_step)

    def then(component: int | None, digits: int) -> str:
        if component is not None:
            return " " + forms["when"].show(component, digits)
        return "" if whole else " " + forms["within"].show(axis.num_steps - 1, digits)

    def at(component: int | None, digits: int) -> str:
        told = then(component, digits).strip()
        return f"{told}, " if told else ""

    def alone(component: int | None, _: int) -> str:
        steps = None if component is None else axis.steps(component)
        if steps is None or steps[0] == 0 < steps[-1]:
            return ""  # a time that begins with the action, or never ends, is not misread
        return " in that step alone" if len(steps) == 1 else " in these steps alone"

    def does(in_all: str, of_a_part: str) -> Form:
        return Form(lambda component, _: in_all if component is None and whole else of_a_part)

    gained, leads = does("was worth", "gained"), does("is worth more than", "is ahead of")
    of_time = {"at": Form(at), "then": Form(then), "alone": Form(alone)}
    return forms | of_time | {"gained": gained, "leads": leads}


TRIALS = Language[Trial]("this trial", _forms)


@TRIALS.rule("{action} and {foil} were each tried {copies:times} from here{how:text}.")
def tried(trial: Trial) -> Iterator[Fields]:
    how = "; each gave the same result every time" if trial.found.same_every_time else ""
    if not trial.is_seen:
        how = ", but cut off before anything could come"
    yield {"action": trial.action, "foil": trial.foil, "copies": trial.found.copies, "how": how}


# ---- whether what was forecast came --------------------------------------------------------------

_MORE = "{component:at}{more} {component:gained} %s more than {less}{component:alone}"


@TRIALS.kinds(
    {
        "came-exactly": f"As forecast, {_MORE % '{said:number}'}.",
        "came-as-forecast": (
            f"When tried, {_MORE % '{came:estimate}'}; the forecast, {{said:number}}, fits."
        ),
        "by-another-amount": (
            f"{_MORE % '{came:estimate}'}, {{than:text}} than the {{said:number}} that was "
            "forecast."
        ),
        "less-than-forecast": (
            f"{_MORE % 'at most {most:number}'}, less than the {{said:number}} that was forecast."
        ),
        "against-the-forecast": (
            "The forecast was wrong: {more} was to be {said:number} ahead, but "
            "{component:at}{less} {component:gained} {ahead:estimate} more{component:alone}."
        ),
        "no-difference": (
            "The forecast was wrong: {component:at}{more} {component:gained} the same as "
            "{less}{component:alone}, though {said:number} more was forecast."
        ),
        "too-few-tries": (
            "{copies:count} tries of each are too few to tell whether {more} "
            "{component:leads} {less}{component:then}; about {enough:count} would do."
        ),
        "too-close-to-tell": (
            "Tries cannot tell whether {more} {component:leads} {less}{component:then}: they are "
            "too close."
        ),
    }
)
def outcomes(trial: Trial) -> Iterator[tuple[str, Fields]]:
    """Of each difference that was forecast, whether it came."""
    for gap in _gaps(trial):
        came, said, copies = gap["came"], gap["said"], trial.found.copies
        if came.low > 0.0:
            if not _includes(came, said):
                yield "by-another-amount", gap | {"than": "more" if came.low > said else "less"}
            else:
                yield "came-as-forecast" if came.low < came.high else "came-exactly", gap
        elif came.high < 0.0:
            yield "against-the-forecast", gap | {"ahead": -came}
        elif came.low == came.high:
            yield "no-difference", gap
        elif came.high < said:
            yield "less-than-forecast", gap | {"most": came.high}
        else:
            needed = enough(copies, (came.high - came.low) / 2.0, said)
            kind = "too-close-to-tell" if needed is None else "too-few-tries"
            yield kind, gap | {"copies": copies, "enough": needed and max(needed, 2 * copies)}


def _gaps(trial: Trial) -> Iterator[Fields]:
    """Yields each difference that was forecast, and what came: at components, then in all.

    `more` is the action that was forecast to be ahead, so what was said is above 0. The component
    of what comes in all is None.
    """
    found, names = trial.found, (trial.action, trial.foil)
    for entry, said in enumerate(found.predicted.tolist()):
        came = found.observed[entry] if said > 0.0 else -found.observed[entry]
        if said and not np.isnan(came.value):
            more, less = names if said > 0.0 else names[::-1]
            at = None if entry == len(found.predicted) - 1 else entry
            yield {"more": more, "less": less, "came": came, "said": abs(said), "component": at}


def _includes(came: Estimate, value: float) -> bool:
    """Returns whether an interval holds a number; where there is no chance, up to rounding."""
    slack = 1e-9 * max(abs(came.low), abs(came.high))
    return came.low - slack <= value <= came.high + slack


# ---- what is told --------------------------------------------------------------------------------


def sections(trial: Trial) -> tuple[Section, ...]:
    """Returns what came of two actions that were tried: in all, when, and how often."""
    return (Section("trial", "Tried out", _told(trial)),)


def in_brief(trial: Trial) -> list[Claim]:
    """Returns what came in all, and what came against the forecast when; nothing if not seen."""
    return [
        claim
        for claim in _outcomes(trial)
        if claim.component is None or claim.kind == "against-the-forecast"
    ][:2]


def _told(trial: Trial) -> tuple[Claim, ...]:
    return (*_outcomes(trial), *tried(trial))


def _outcomes(trial: Trial) -> list[Claim]:
    """Returns what came in all, and then where each action was forecast to be furthest ahead.

    A component that holds less than `WORTH_SAYING` of all that differs is not worth a sentence.
    """
    if not trial.is_seen:
        return []
    explicit = trial.found.predicted[: trial.found.time_axis.horizon]
    least = WORTH_SAYING * np.abs(explicit).sum()
    furthest = {int(explicit.argmax()), int(explicit.argmin())} if explicit.size else set()
    told = {None, *(i for i in furthest if abs(explicit[i]) >= least)}
    found = [claim for claim in every(trial, *outcomes) if claim.component in told]
    return sorted(found, key=lambda claim: -1 if claim.component is None else claim.component)
