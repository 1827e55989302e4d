"""What came of two actions that were tried, beside what was forecast of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.explanations.rules import Claim, Fields, Form, Found, Language, every, plain_data
from trdlab.explanations.sections import Section
from trdlab.explanations.words import forms_of
from trdlab.rollouts.counterfactual import Counterfactual
from trdlab.statistics import enough

WORTH_SAYING = 0.1  # of Σ|difference|: what a component has to hold to be told of


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

    def paid(pays: str, is_worth: str) -> Form:
        return Form(lambda at, _: is_worth if at is None and whole else pays)

    own = {"at": Form(at), "paid": paid("paid", "was worth"), "pays": paid("pays", "is worth")}
    return forms | own


TRIALS = Language[Trial]("this trial", _forms)


@TRIALS.rule("{action} and {foil} were each tried {copies:times} from here{how:text}.")
def tried(trial: Trial) -> Iterator[Fields]:
    how = ", and each brought the same every time" if trial.found.same_every_time else ""
    if not trial.is_seen:
        how = ", but cut off before anything could come"
    yield {"action": trial.action, "foil": trial.foil, "copies": trial.found.copies, "how": how}


@TRIALS.kinds(
    {
        "came-exactly": (
            "As forecast, {more} {component:paid} {said:number} more than {less}{component:at}."
        ),
        "came-as-forecast": (
            "As forecast, {more} {component:paid} {came:estimate} more than {less}{component:at}; "
            "{said:number} was forecast."
        ),
        "by-another-amount": (
            "{more} {component:paid} {came:estimate} more than {less}{component:at}, {than:text} "
            "than the {said:number} that was forecast."
        ),
        "less-than-forecast": (
            "{more} {component:paid} at most {most:number} more than {less}{component:at}, less "
            "than the {said:number} that was forecast."
        ),
        "against-the-forecast": (
            "Against the forecast, {less} {component:paid} {ahead:estimate} more than "
            "{more}{component:at}; {more} was to be {said:number} ahead."
        ),
        "no-difference": (
            "Against the forecast, {more} {component:paid} no more than {less}{component:at}; "
            "{said:number} more was forecast."
        ),
        "too-few-tries": (
            "Trying each {copies:times} was too few to tell whether {more} {component:pays} more "
            "than {less}{component:at}; about {enough:count} would do."
        ),
        "too-close-to-tell": (
            "Trying cannot tell whether {more} {component:pays} more than {less}{component:at}: "
            "they are too close."
        ),
    }
)
def outcomes(trial: Trial) -> Iterator[Found]:
    """Whether what was forecast came; `more` is what was forecast to be ahead, by `said` > 0."""
    for gap in trial.gaps():
        came, said, copies = gap["came"], gap["said"], trial.found.copies
        is_certain = came.low == came.high
        slack = 1e-9 * max(abs(came.low), abs(came.high))  # where there is no chance
        if came.low > 0.0 and came.low - slack <= said <= came.high + slack:
            yield "came-exactly" if is_certain else "came-as-forecast", gap
        elif came.low > 0.0:
            yield "by-another-amount", gap | {"than": "more" if came.low > said else "less"}
        elif came.high < 0.0:
            yield "against-the-forecast", gap | {"ahead": -came}
        elif is_certain:
            yield "no-difference", gap
        elif came.low <= 0.0 <= came.high < said:
            yield "less-than-forecast", gap | {"most": came.high}
        elif came.low <= 0.0 and said <= came.high:
            needed = enough(copies, (came.high - came.low) / 2.0, said)
            tries = {"copies": copies, "enough": needed and max(needed, 2 * copies)}
            kind = "too-close-to-tell" if tries["enough"] is None else "too-few-tries"
            yield kind, gap | tries


def sections(trial: Trial) -> tuple[Section, ...]:
    """Returns what came of two actions that were tried: in all, when, and how often."""
    return (Section("trial", "Tried out", _told(trial)),)


def in_brief(trial: Trial) -> list[Claim]:
    """Returns what came in all, and what came against the forecast when; nothing if not seen."""
    against = "against-the-forecast"
    return [claim for claim in _came(trial) if claim.component is None or claim.kind == against][:2]


def _told(trial: Trial) -> tuple[Claim, ...]:
    return (*_came(trial), *tried(trial))


def _came(trial: Trial) -> list[Claim]:
    """Returns what came in all, and then of the components that are worth a sentence."""
    if not trial.is_seen:
        return []
    found, furthest = every(trial, *outcomes), {None, *_furthest(trial)}
    told = [claim for claim in found if claim.component in furthest]
    return sorted(told, key=lambda claim: -1 if claim.component is None else claim.component)


def _furthest(trial: Trial) -> set[int]:
    """Returns the components at which each action was forecast to be furthest ahead.

    One that holds less than `WORTH_SAYING` of all that differs is not worth a sentence.
    """
    explicit = trial.found.predicted[: trial.found.time_axis.horizon]
    least = WORTH_SAYING * np.abs(explicit).sum()
    furthest = {int(explicit.argmax()), int(explicit.argmin())} if explicit.size else set()
    return {i for i in furthest if abs(explicit[i]) >= least}
