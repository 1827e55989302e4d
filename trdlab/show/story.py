"""The story of an episode as English sentences, and sentences read back into findings."""

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from trdlab.explanations.claims import Claim, Shown
from trdlab.explanations.episode import promises, story, surprises
from trdlab.explanations.episode.played import Played, StoryClaim
from trdlab.explanations.episode.story import Story, first_end
from trdlab.explanations.rules import plain_data
from trdlab.explanations.slots import Form, Language, forms_of
from trdlab.formatting import amount, number
from trdlab.time_axis import TimeAxis

_TURNED = "{action} at step {step:count} turned out {gap:gap} {outcome:outcome} than expected"
_STAYED = "From step {first:count} to step {last:count} a reward stayed {component:away} away; it "
_COUNTED = r"\d[\d,]*(?: to \d[\d,]*)? steps?(?: \(.+? s\))?"

TEMPLATES: dict[type[Claim], str] = {
    story.ExpectedAtStart: (
        "At the start it expected rewards worth {value:value} in all; the largest component is "
        "that of {component:when}."
    ),
    story.ExpectedInAll: "At the start it expected rewards worth {value:value} in all.",
    story.ExpectedNothing: "At the start it expected no rewards.",
    surprises.Surprise: f"{_TURNED}.",
    surprises.EndSurprise: (
        f"{_TURNED}, above all because {{ending:ending}} while rewards worth {{promised:value}} "
        "were still expected."
    ),
    surprises.RewardSurprise: (
        f"{_TURNED}, above all because {{reward:paid}} came where {{expected:value}} was expected."
    ),
    surprises.NoRewardSurprise: (
        f"{_TURNED}, above all because no reward came where {{expected:value}} was expected."
    ),
    surprises.BeliefSurprise: (
        f"{_TURNED}, above all because what is expected at {{component:when}} went from "
        "{was:value} to {now:value}."
    ),
    surprises.SpreadSurprise: (
        f"{_TURNED}; the change is spread over the steps ahead, half of it by {{by:until}}."
    ),
    surprises.Moved: (
        "With {action} at step {step:count} {things:things} worth {worth:value} were {way:way} "
        "from {origin:label} to {to:label}; the total changed little."
    ),
    surprises.Exchanged: (
        "With {action} at step {step:count} {gain:value} was gained at {up:label} and {loss:value} "
        "lost at {down:label}; the total changed little."
    ),
    promises.Foreseen: (
        "The reward of {reward:amount} at step {step:count} was foreseen {steps:ahead} before."
    ),
    promises.ForeseenFully: (
        "The reward of {reward:amount} at step {step:count} was foreseen {steps:ahead} before, as "
        "early as it could be."
    ),
    promises.BrokenPromise: f"{_STAYED}never came.",
    promises.OverduePromise: f"{_STAYED}had not come when the episode was cut off.",
    promises.LatePromise: f"{_STAYED}came only at step {{came:count}}.",
    story.NothingChanged: "No step changed what it expected.",
    story.LittleChanged: "No step changed what it expected by more than {most:bound}.",
    story.Ended: "The episode ended after {steps:ahead}.",
    story.CutOff: "The episode was cut off after {steps:ahead}.",
    story.AsExpected: (
        "Seen from the start, it got rewards worth {got:value} {until:scope}, as it had expected."
    ),
    story.OtherThanExpected: (
        "Seen from the start, it got rewards worth {got:value} {until:scope}; it had expected "
        "{expected:value}."
    ),
}


def _forms(played: Played) -> dict[str, Form]:
    axis, seconds = played.episode.time_axis, played.seconds_per_step
    end = first_end(played.episode)
    return forms_of(axis, played.action_names, seconds) | {
        "outcome": _one_of("better", "worse"),
        "way": _one_of("brought forward", "put off"),
        "things": _one_of("rewards", "costs"),
        "ending": _one_of("the episode ended", "a life was lost"),
        "gap": _shown(_gap),
        "bound": _shown(_bound),
        "paid": _shown(amount, "a reward of " if axis.width == 1 else "rewards worth "),
        "ahead": _spelt(lambda steps: _steps([steps], seconds), _COUNTED, _first_number),
        "away": _spelt(
            lambda component: _steps(_ends(axis, component), seconds),
            _COUNTED,
            lambda text: _first_number(text) // axis.width,
        ),
        "scope": _spelt(
            lambda step: _scope(step, played),
            r"in all|up to .+? lost",
            lambda _: -1 if end is None else end,
        ),
    }


STORIES = Language[Played](TEMPLATES, _forms, about="this episode")


def story_sentences(told: Story) -> list[str]:
    """Returns the findings of a story as sentences, in their order."""
    return _said(told.findings, told)


def story_lines(told: Story) -> list[str]:
    """Returns its sentences with the moments numbered, as `story_figure` numbers them."""
    moments = [f"{number}. {text}" for number, text in enumerate(_said(told.moments, told), 1)]
    return [*_said(told.start, told), *moments, *_said(told.end, told)]


def _said(findings: Sequence[StoryClaim], told: Story) -> list[str]:
    return [story_sentence(finding, told.played) for finding in findings]


def story_sentence(finding: StoryClaim, played: Played) -> str:
    """Returns one finding as a sentence; `t` in it is the step that it names, or else step 0."""
    return STORIES.say(finding, played)


def check_story(text: str, played: Played) -> list[Claim]:
    """Reads a rendered text back, tests each claim against an episode, and returns the claims.

    Args:
        text: sentences as `story_sentences` returns them, separated by white space.
        played: the episode that they speak of.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    return STORIES.check(text, played)


def story_to_dict(told: Story) -> dict[str, Any]:
    """Returns a story, and the numbers of its episode, as plain data at full precision.

    `values` is `[T]`, what was expected in all of the actions taken. `td_errors` is `[T]` too, by
    how much more each step turned out to bring; `null` where a truncation hides it.
    """
    played = told.played
    episode, revision = played.episode, played.revision
    errors = np.full(len(episode), np.nan)
    errors[revision.steps] = revision.change.sum(axis=1)
    return {
        "steps": len(episode),
        "terminated": episode.terminated,
        "actions": [played.action(step) for step in range(len(episode))],
        "rewards": episode.rewards.tolist(),
        "values": episode.predicted.sum(axis=1, dtype=np.float64).tolist(),
        "td_errors": plain_data(errors),
        "findings": [
            plain_data(finding.to_dict()) | {"sentence": story_sentence(finding, played)}
            for finding in told.findings
        ],
    }


def _one_of(*words: str) -> Form:
    return Form(lambda word, _: word, "|".join(words), str)


def _shown(show: Callable[[float], str], before: str = "") -> Form:
    """Returns the form of a number with a precision of its own, and of words before it."""
    pattern = rf"{before}-?(?:\d+(?:\.\d+)?(?:e[+-]?\d+)?|inf)"
    return Form(
        lambda value, _: before + show(value),
        pattern,
        lambda text: Shown(text.removeprefix(before), show),
    )


def _spelt(show: Callable[[int], str], pattern: str, value: Callable[[str], int]) -> Form:
    """Returns the form of a whole number that is spelt out with other words."""

    def read(text: str) -> int | None:
        found = value(text)
        return found if found >= 0 and show(found) == text else None

    return Form(lambda number, _: show(number), pattern, read)


def _first_number(text: str) -> int:
    return int(re.split(r"[^\d,]", text, maxsplit=1)[0].replace(",", ""))


def _gap(value: float) -> str:
    return number(value, _decimals(value))


def _bound(value: float) -> str:
    """Returns a number rounded up, so that what is at most the number is at most what is shown."""
    decimals = _decimals(value)
    return number(math.ceil(value * 10**decimals - 1e-9) / 10**decimals, decimals)


def _decimals(value: float) -> int:
    """Returns the decimals of two significant digits, or of a whole number."""
    return min(9, max(0, 1 - math.floor(math.log10(value)))) if value > 0.0 else 0


def _steps(steps: Sequence[int], seconds: float | None) -> str:
    """Returns so many steps, or from so many to so many, with their seconds of play."""
    counts = " to ".join(f"{count:,}" for count in steps)
    times = "" if seconds is None else " to ".join(_gap(count * seconds) for count in steps)
    noun = "step" if steps[-1] == 1 else "steps"
    return f"{counts} {noun}" + (f" ({times} s)" if times else "")


def _ends(axis: TimeAxis, component: int) -> list[int]:
    """Returns the first and the last step that an explicit component covers, once if it is one."""
    first = component * axis.width
    return sorted({first, first + axis.width - 1})


def _scope(until: int, played: Played) -> str:
    if until == len(played.episode) - 1:
        return "in all"
    return f"up to step {until:,}, where a life was lost"
