"""Findings about a moment as English sentences, and sentences read back into findings."""

import re
from collections.abc import Sequence

from trdlab.explanations.claims import Claim, Finding, Shown
from trdlab.explanations.moment import (
    chances,
    contrast,
    explanation,
    forecast,
    leads,
    limits,
    peaks,
    sensitivity,
    worth,
)
from trdlab.explanations.moment.explanation import Explanation
from trdlab.explanations.rules import UnsupportedSentenceError
from trdlab.explanations.slots import Form, Language, forms_of
from trdlab.formatting import decimals_for

__all__ = ["TEMPLATES", "UnsupportedSentenceError", "check", "sentence", "sentences"]

TEMPLATES: dict[type[Claim], str] = {
    worth.EqualTotals: "Both routes pay {total:amount} in total.",
    worth.DifferentTotals: (
        "In total {more} pays {more_total:amount} and {less} {less_total:amount}."
    ),
    worth.NoTotal: "{action} has no undiscounted total, for its rewards may never end.",
    leads.MoreImmediate: (
        "{leader} gives more immediate rewards than {other}: by {last_step:step} they are worth "
        "{leader_sum:value} against {other_sum:value}."
    ),
    leads.PaysMore: (
        "By {last_step:step} {leader} is expected to have paid more than {other}: worth "
        "{leader_sum:value} against {other_sum:value} now."
    ),
    leads.PaysMoreNet: (
        "By {last_step:step} {leader} is expected to have paid more than {other}, costs "
        "subtracted: worth {leader_sum:value} against {other_sum:value} now."
    ),
    leads.CostsLess: (
        "By {last_step:step} {leader} is expected to have cost less than {other}: "
        "{leader_sum:value} against {other_sum:value} in present worth."
    ),
    contrast.SameComponents: "{action} and {foil} have the same components.",
    contrast.DoubtfulDifference: (
        "{share:percent} of what tells {action} and {foil} apart lies at steps where such "
        "forecasts have not proved better than a guess."
    ),
    worth.BetterByDiscount: (
        "Without the discount both are worth the same; with γ = {gamma:plain} {better} is worth "
        "{better_value:value} and {worse} {worse_value:value}."
    ),
    worth.Better: (
        "With γ = {gamma:plain} {better} is worth {better_value:value} and {worse} "
        "{worse_value:value}."
    ),
    worth.EqualValues: ("With γ = {gamma:plain} {action} and {foil} are both worth {value:value}."),
    leads.Overtakes: (
        "{leader} overtakes {other} at {component:when}: what is expected by then is worth "
        "{leader_total:value} against {other_total:value} now."
    ),
    leads.MakesUp: (
        "What comes at {component:label} makes up for the lead of {other}: it is worth "
        "{more:value} more after {leader}."
    ),
    leads.StaysAhead: "{other} never catches up with {leader}.",
    contrast.Dominates: "Nothing speaks for {worse}: no component is larger than that of {better}.",
    contrast.Reasons: (
        "To prefer {better} it is enough to look at {components:labels}: {advantage:value} more "
        "there, against {disadvantage:value} for {worse} elsewhere."
    ),
    sensitivity.Flips: (
        "The preference flips where {quantity:text} is {at:roots} instead of {current:plain} "
        "(searched from {low:plain} to {high:plain}, policy re-optimised)."
    ),
    sensitivity.NeverFlips: (
        "No value of {quantity:text} was found from {low:plain} to {high:plain} that makes {worse} "
        "better than {better} (policy re-optimised)."
    ),
    forecast.EarnsNothing: "Nothing is expected of {action} at any step.",
    forecast.AllBeyond: (
        "All of the {value:value} that {action} is worth lies at {component:label}."
    ),
    forecast.NextToNothing: "Next to nothing is expected of {action} before {end:begin}.",
    forecast.NothingBefore: "Nothing is expected of {action} before {end:begin}.",
    forecast.FirstStepReward: (
        "The first {effect:effect} to be expected of {action} is that of {component:when}: "
        "{reward:amount} on average, worth {discounted:value} now."
    ),
    forecast.FirstReward: (
        "The first {effect:effect} to be expected of {action} is that of {component:when}, worth "
        "{discounted:value} now."
    ),
    forecast.FirstChance: (
        "The first {effect:effect} to be expected of {action} is that of {component:when}: "
        "{amount:amount} with a chance of {chance:percent}, and otherwise nothing; worth "
        "{discounted:value} now."
    ),
    chances.PutAt: (
        "After {action} the chance of the reward of {reward:amount} at {component:when} is put at "
        "{chance:percent}."
    ),
    peaks.Steady: (
        "At each step before {end:begin} about the same {effect:effect} is expected of {action}: "
        "{mean:amount} on average."
    ),
    peaks.Rhythm: (
        "Before {end:begin} the {effect:effect} expected of {action} peaks every {period:period}, "
        "from {first:label} to {last:label}."
    ),
    peaks.Peak: (
        "Before {end:begin} the largest {effect:effect} to be expected of {action} is that of "
        "{component:when}, worth {discounted:value} now."
    ),
    peaks.Peaks: (
        "Before {end:begin} the {effect:effect} expected of {action} peaks most clearly at "
        "{peaks:peaks}."
    ),
    peaks.Spread: (
        "Around {component:when} the {effect:effect} expected of {action} is spread over "
        "{steps:steps}, {first:label} to {last:label}: either the time is uncertain, or it comes "
        "bit by bit."
    ),
    forecast.OffBy: (
        "Such forecasts of {component:when} are off by {error:value} in present worth (root mean "
        "square)."
    ),
    forecast.CentreOfMass: (
        "Weighted by what they are worth now, the {effect:effect}s expected of {action} before "
        "{end:begin} come {step:tenths} steps from now on average."
    ),
    forecast.ShareBeyond: "{share:percent} of the value of {action} lies at {component:label}.",
    chances.GiveOrTake: (
        "{action} is worth {value:value} on average; single episodes differ from that by "
        "{deviation:value} (one standard deviation)."
    ),
    chances.EitherOr: (
        "At {component:label} {action} {verb:text} {amount:amount} with a chance of "
        "{chance:percent}, and otherwise nothing."
    ),
    chances.LikelyOver: (
        "After {action} the episode is more likely over than not by {component:begin} "
        "({chance:percent})."
    ),
    chances.SurelyOver: "After {action} the episode is over by {component:begin}.",
    limits.TrustedWhole: "All that was tested of such forecasts can be trusted.",
    limits.NowhereTrusted: "Such forecasts have not proved better than a guess at any step.",
    limits.NotTrustedAt: (
        "What such forecasts say of {component:label} has not proved better than a guess."
    ),
    limits.NotTrustedFrom: (
        "From {component:begin} on such forecasts have not proved better than a guess."
    ),
    limits.NotTrustedBetween: (
        "From {component:begin} on such forecasts have not proved better than a guess, but for "
        "what lies at {residual:label}."
    ),
    explanation.WhoseFuture: (
        "After the first action it is the future of {policy:text}; it counts the {reward:text} and "
        "ends at {ending:text}."
    ),
    explanation.TiedActions: (
        "Here {actions:names} tie: their values cannot be told apart, their futures can."
    ),
    explanation.TiedLater: (
        "Later states in which optimal actions tie but their futures differ: {states:count}."
    ),
}

_TENTHS = Form(lambda x, _: f"{x:.1f}", r"\d+\.\d", lambda text: Shown(text, "{:.1f}".format))
_EFFECT = Form(lambda effect, _: str(effect), r"(?:notable )?(?:reward|cost)", str)


def _forms(told: Explanation) -> dict[str, Form]:
    moment = told.moment
    forms = forms_of(moment.time_axis, moment.action_names, moment.seconds_per_step)
    return forms | {
        "effect": _EFFECT,
        "tenths": _TENTHS,
        "period": _period(moment.seconds_per_step),
        "peaks": _peaks(forms["labels"], forms["value"]),
    }


def _period(seconds: float | None) -> Form:
    """Returns the form of a period from so many to so many steps, with its seconds of play."""

    def show(period: tuple[int, int], _: int = 0) -> str:
        text = f"{_from_to([f'{steps}' for steps in period])} steps"
        if seconds is None:
            return text
        return f"{text} ({_from_to([f'{steps * seconds:.2g}' for steps in period])} s)"

    def read_back(text: str) -> tuple[int, int] | None:
        ends = [int(steps) for steps in text.partition(" steps")[0].split(" to ")]
        period = ends[0], ends[-1]
        return period if show(period) == text else None

    return Form(show, r"\d+(?: to \d+)? steps(?: \([^)]+ s\))?", read_back)


def _from_to(ends: list[str]) -> str:
    return " to ".join(dict.fromkeys(ends))


def _peaks(labels: Form, value: Form) -> Form:
    """Returns the form of peaks and what each is worth: `t+2 (worth 0.65 now) and t+7 (0.31)`."""

    def text_of(components: Sequence[int], worths: Sequence[str]) -> str:
        told = iter([f"(worth {worths[0]} now)", *(f"({worth})" for worth in worths[1:])])
        return re.sub(r"t[^ ,]*", lambda at: f"{at[0]} {next(told)}", labels.show(components, 0))

    def show(peaks: Sequence[tuple[int, float]], _: int) -> str:
        components, worths = zip(*peaks, strict=True)
        decimals = decimals_for(worths)
        return text_of(components, [value.show(worth, decimals) for worth in worths])

    def read_back(text: str) -> tuple[tuple[int, float], ...] | None:
        components = labels.read(re.sub(r" \([^)]*\)", "", text))
        worths = re.findall(rf"\((?:worth )?({value.pattern})(?: now)?\)", text)
        if components is None or len(worths) != len(components):
            return None
        peaks = tuple(zip(components, map(value.read, worths), strict=True))
        return peaks if text_of(components, worths) == text else None

    return Form(show, r"t.*?", read_back)


MOMENTS = Language[Explanation](
    TEMPLATES,
    _forms,
    evidence=lambda told: told.moment,
    given=lambda told: {"action": told.action, "foil": told.foil},
)


def sentences(explanation: Explanation) -> list[str]:
    """Returns the findings of an explanation as sentences, in their order."""
    return [sentence(finding, explanation) for finding in explanation.findings]


def sentence(finding: Finding, explanation: Explanation) -> str:
    """Returns one finding as a sentence."""
    return MOMENTS.say(finding, explanation)


def check(text: str, explanation: Explanation) -> list[Claim]:
    """Reads a rendered text back, tests each claim against the moment, and returns the claims.

    Args:
        text: sentences as `sentences` renders them, separated by white space.
        explanation: what they speak of; its findings are not consulted, only its moment.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    return MOMENTS.check(text, explanation)
