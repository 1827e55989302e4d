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

    def gaps(self) -> Iterator[Fields]:
        """Yields each difference that was forecast, and what came: at components, then in all.

        The component of what comes in all is None.
        """
        found, names = self.found, (self.action, self.foil)
        for entry, said in enumerate(found.predicted.tolist()):
            came = found.observed[entry]
            if said == 0.0 or np.isnan(came.value):
                continue
            more, less = names if said > 0.0 else names[::-1]
            at = None if entry == len(found.predicted) - 1 else entry
            came = came if said > 0.0 else -came
            yield {"more": more, "less": less, "came": came, "said": abs(said), "component": at}

    def to_dict(self) -> dict[str, Any]:
        """Returns the numbers and the claims as plain data at full precision."""
        names = {"action": self.action, "foil": self.foil}
        told = {"findings": [claim.to_dict() for claim in _told(self)]}
        return {**plain_data(self.found), **names, **told}


def _forms(trial: Trial) -> dict[str, Form]:
    axis, whole = trial.found.time_axis, trial.found.whole
    forms = forms_of(axis, trial.seconds_per_step)

    def at(component: int | None, digits: int) -> str:
        if component is not None:
            return " " + forms["when"].show(component, digits)
        return "" if whole else " " + forms["within"].show(axis.num_steps - 1, digits)

    def paid(component: int | None, is_past: bool) -> str:
        if component is None and whole:
            return "was worth" if is_past else "is worth"
        return "paid" if is_past else "pays"

    return forms | {
        "at": Form(at),
        "paid": Form(lambda component, _: paid(component, is_past=True)),
        "pays": Form(lambda component, _: paid(component, is_past=False)),
    }


TRIALS = Language[Trial]("this trial", _forms)
rule = TRIALS.rule

# ---- how often -----------------------------------------------------------------------------------


@rule("{action} and {foil} were each tried {copies:times} from here{how:text}.")
def tried(trial: Trial) -> Iterator[Fields]:
    how = ", and each brought the same every time" if trial.found.same_every_time else ""
    if not trial.is_seen:
        how = ", but cut off before anything could come"
    yield {"action": trial.action, "foil": trial.foil, "copies": trial.found.copies, "how": how}


# ---- whether what was forecast came --------------------------------------------------------------
# `more` is the action that was forecast to be ahead, so what was said is above 0.


def _includes(came: Estimate, value: float) -> bool:
    """Returns whether an interval holds a number; where there is no chance, up to rounding."""
    slack = 1e-9 * max(abs(came.low), abs(came.high))
    return came.low - slack <= value <= came.high + slack


@rule("As forecast, {more} {component:paid} {said:number} more than {less}{component:at}.")
def came_exactly(trial: Trial) -> Iterator[Fields]:
    """There is no chance, and it is what was forecast."""
    for gap in trial.gaps():
        came = gap["came"]
        if came.low == came.high > 0.0 and _includes(came, gap["said"]):
            yield gap


@rule(
    "As forecast, {more} {component:paid} {came:estimate} more than {less}{component:at}; "
    "{said:number} was forecast."
)
def came_as_forecast(trial: Trial) -> Iterator[Fields]:
    for gap in trial.gaps():
        is_certain = gap["came"].low == gap["came"].high
        if gap["came"].low > 0.0 and _includes(gap["came"], gap["said"]) and not is_certain:
            yield gap


@rule(
    "{more} {component:paid} {came:estimate} more than {less}{component:at}, {than:text} than the "
    "{said:number} that was forecast."
)
def by_another_amount(trial: Trial) -> Iterator[Fields]:
    for gap in trial.gaps():
        if gap["came"].low > 0.0 and not _includes(gap["came"], gap["said"]):
            yield gap | {"than": "more" if gap["came"].low > gap["said"] else "less"}


@rule(
    "{more} {component:paid} at most {most:number} more than {less}{component:at}, less than the "
    "{said:number} that was forecast."
)
def less_than_forecast(trial: Trial) -> Iterator[Fields]:
    for gap in trial.gaps():
        came = gap["came"]
        if came.low <= 0.0 <= came.high < gap["said"] and came.low < came.high:
            yield gap | {"most": came.high}


@rule(
    "Against the forecast, {less} {component:paid} {ahead:estimate} more than {more}"
    "{component:at}; {more} was to be {said:number} ahead."
)
def against_the_forecast(trial: Trial) -> Iterator[Fields]:
    for gap in trial.gaps():
        if gap["came"].high < 0.0:
            yield gap | {"ahead": -gap["came"]}


@rule(
    "Against the forecast, {more} {component:paid} no more than {less}{component:at}; "
    "{said:number} more was forecast."
)
def no_difference(trial: Trial) -> Iterator[Fields]:
    for gap in trial.gaps():
        if gap["came"].low == gap["came"].high == 0.0:
            yield gap


def _open(trial: Trial) -> Iterator[Fields]:
    """Yields the differences that may have come or not, and how many tries would tell."""
    for gap in trial.gaps():
        came, copies = gap["came"], trial.found.copies
        if came.low <= 0.0 and gap["said"] <= came.high and came.low < came.high:
            needed = enough(copies, (came.high - came.low) / 2.0, gap["said"])
            yield gap | {"copies": copies, "enough": needed and max(needed, 2 * copies)}


@rule(
    "Trying each {copies:times} was too few to tell whether {more} {component:pays} more than "
    "{less}{component:at}; about {enough:count} would do."
)
def too_few_tries(trial: Trial) -> Iterator[Fields]:
    yield from (gap for gap in _open(trial) if gap["enough"] is not None)


@rule(
    "Trying cannot tell whether {more} {component:pays} more than {less}{component:at}: they are "
    "too close."
)
def too_close_to_tell(trial: Trial) -> Iterator[Fields]:
    yield from (gap for gap in _open(trial) if gap["enough"] is None)


# ---- what is told --------------------------------------------------------------------------------

_OUTCOMES = (
    came_exactly,
    came_as_forecast,
    by_another_amount,
    less_than_forecast,
    against_the_forecast,
    no_difference,
    too_few_tries,
    too_close_to_tell,
)


def sections(trial: Trial) -> tuple[Section, ...]:
    """Returns what came of two actions that were tried: in all, when, and how often."""
    return (Section("trial", "Tried out", _told(trial)),)


def in_brief(trial: Trial) -> list[Claim]:
    """Returns what came in all, and what came against the forecast when; nothing if not seen."""
    told = [claim for claim in _told(trial) if claim.rule in _OUTCOMES]
    return [
        claim for claim in told if claim.component is None or claim.rule is against_the_forecast
    ][:2]


def _told(trial: Trial) -> tuple[Claim, ...]:
    order, furthest = _outcomes(trial), _furthest(trial)
    told = [claim for claim in order if claim.component is None or claim.component in furthest]
    return (*told, *tried(trial))


def _outcomes(trial: Trial) -> list[Claim]:
    """Returns what came in all, and then of each component."""
    if not trial.is_seen:
        return []
    found = every(trial, *_OUTCOMES)
    return sorted(found, key=lambda claim: -1 if claim.component is None else claim.component)


def _furthest(trial: Trial) -> set[int]:
    """Returns the components at which each action was forecast to be furthest ahead.

    One that holds less than `WORTH_SAYING` of all that differs is not worth a sentence.
    """
    explicit = trial.found.predicted[: trial.found.time_axis.horizon]
    least = WORTH_SAYING * np.abs(explicit).sum()
    furthest = {int(explicit.argmax()), int(explicit.argmin())} if explicit.size else set()
    return {i for i in furthest if abs(explicit[i]) >= least}
