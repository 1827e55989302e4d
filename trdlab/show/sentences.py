"""Findings about a moment as English sentences, and sentences read back into findings."""

from trdlab.explain import (
    chances,
    contrast,
    explanation,
    flips,
    forecast,
    limits,
    rhythm,
    worth,
)
from trdlab.explain.explanation import Explanation
from trdlab.explain.finding import Claim, Finding
from trdlab.show.templates import Form, Language, UnsupportedSentenceError, forms_of

__all__ = ["TEMPLATES", "UnsupportedSentenceError", "check", "sentence", "sentences"]

TEMPLATES: dict[type[Claim], str] = {
    worth.EqualTotals: "Both routes pay {total:amount} in total.",
    worth.DifferentTotals: (
        "In total {more} pays {more_total:amount} and {less} {less_total:amount}."
    ),
    worth.NoTotal: "{action} has no undiscounted total, for its rewards may never end.",
    contrast.MoreImmediate: (
        "{leader} gives more immediate rewards than {other}: by {last_step:step} they are worth "
        "{leader_sum:value} against {other_sum:value}."
    ),
    contrast.LessCostly: (
        "{leader} costs less at first than {other}: by {last_step:step} its rewards are worth "
        "{leader_sum:value} against {other_sum:value}."
    ),
    contrast.SameComponents: "{action} and {foil} have the same components.",
    contrast.DoubtfulDifference: (
        "{share:percent} of what tells {action} and {foil} apart lies at steps where such "
        "forecasts have not proved better than a guess."
    ),
    worth.BetterByDiscount: (
        "Only the discount tells them apart: with γ = {gamma:plain} {better} is worth "
        "{better_value:value} and {worse} {worse_value:value}."
    ),
    worth.Better: (
        "With γ = {gamma:plain} {better} is worth {better_value:value} and {worse} "
        "{worse_value:value}."
    ),
    worth.EqualValues: ("With γ = {gamma:plain} {action} and {foil} are both worth {value:value}."),
    contrast.Overtakes: (
        "Counted as they come in, the rewards of {leader} overtake those of {other} at "
        "{component:when}: {leader_total:value} against {other_total:value}."
    ),
    contrast.StaysAhead: "{other} never catches up with {leader}.",
    contrast.Dominates: "Nothing speaks for {worse}: no component is larger than that of {better}.",
    contrast.Reasons: (
        "To prefer {better} it is enough to look at {components:labels}: {advantage:value} more "
        "there, against {disadvantage:value} for {worse} elsewhere."
    ),
    flips.Flips: (
        "The preference flips where {quantity:text} is {at:roots} instead of {current:plain} "
        "(searched from {low:plain} to {high:plain}, policy re-optimised)."
    ),
    flips.NeverFlips: (
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
    chances.PutAt: (
        "After {action} the chance of the reward of {reward:amount} at {component:when} is put at "
        "{chance:percent}."
    ),
    rhythm.Steady: (
        "At each step before {end:begin} about the same {effect:effect} is expected of {action}: "
        "{mean:amount} on average."
    ),
    rhythm.Rhythm: (
        "Before {end:begin} the {effect:effect} expected of {action} peaks about every "
        "{period:period}, from {first:label} to {last:label}."
    ),
    rhythm.Peak: (
        "Before {end:begin} the largest {effect:effect} to be expected of {action} is that of "
        "{component:when}, worth {discounted:value} now."
    ),
    rhythm.Peaks: (
        "Before {end:begin} the {effect:effect} expected of {action} peaks most clearly at "
        "{components:labels}."
    ),
    rhythm.Spread: (
        "Around {component:when} the {effect:effect} expected of {action} is spread over "
        "{steps:steps}, {first:label} to {last:label}: either the time is uncertain, or it comes "
        "bit by bit."
    ),
    forecast.OffBy: (
        "Such forecasts of {component:when} are off by {error:value} in present worth (root mean "
        "square)."
    ),
    forecast.CentreOfMass: (
        "Weighted by what they are worth now, the rewards expected of {action} before {end:begin} "
        "centre on t+{step:value}."
    ),
    forecast.ShareBeyond: "{share:percent} of the value of {action} lies at {component:label}.",
    chances.GiveOrTake: (
        "What {action} is worth on average, {value:value}, varies by {deviation:value} from "
        "episode to episode (one standard deviation)."
    ),
    chances.EitherOr: (
        "At {component:label} {action} either {verb:text} {amount:amount} or nothing; the chance "
        "that it does is {chance:percent}."
    ),
    chances.LikelyOver: (
        "After {action} the episode is likely over by {component:begin}: {chance:percent}."
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

_EFFECT = Form(lambda effect, _: str(effect), r"(?:notable )?(?:reward|cost)", str)


def _forms(told: Explanation) -> dict[str, Form]:
    moment = told.moment
    seconds = moment.seconds_per_step
    forms = forms_of(moment.time_axis, moment.action_names, seconds)
    return forms | {"effect": _EFFECT, "period": _period(forms["steps"], seconds)}


def _period(steps: Form, seconds: float | None) -> Form:
    """Returns the form of so many steps, with their seconds of play where these are known."""

    def show(count: int, _: int = 0) -> str:
        text = steps.show(count, 0)
        return text if seconds is None else f"{text} ({count * seconds:.2g} s)"

    def read_back(text: str) -> int | None:
        count: int | None = steps.read(text.partition(" (")[0])
        return count if count is not None and show(count) == text else None

    return Form(show, steps.pattern + r"(?: \(\S+ s\))?", read_back)


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
