"""Findings as English sentences, and sentences read back into findings.

One template serves both directions, so that whatever is printed can be tested: `check` reads a
rendered text back into claims and numbers, and holds them against the moment.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

from trdlab.errors import TrdlabError
from trdlab.explain import contrast, explanation, flips, forecast, limits
from trdlab.explain.explanation import Explanation
from trdlab.explain.finding import Finding, Shown
from trdlab.formatting import amount, decimals_between, number, percent, plain, significant
from trdlab.time_axis import TimeAxis, step_label

TEMPLATES: dict[type[Finding], str] = {
    contrast.EqualTotals: "Both routes pay {total:amount} in total.",
    contrast.DifferentTotals: (
        "In total {more} pays {more_total:amount} and {less} {less_total:amount}."
    ),
    contrast.NoTotal: "{action} has no undiscounted total, for its rewards may never end.",
    contrast.MoreImmediate: (
        "{leader} gives more immediate rewards than {other}: by {last_step:step} they are worth "
        "{leader_sum:value} against {other_sum:value}."
    ),
    contrast.LessCostly: (
        "{leader} costs less at first than {other}: by {last_step:step} its rewards are worth "
        "{leader_sum:value} against {other_sum:value}."
    ),
    contrast.SameComponents: "{action} and {foil} have the same components.",
    contrast.BetterByDiscount: (
        "Only the discount tells them apart: with γ = {gamma:plain} {better} is worth "
        "{better_value:value} and {worse} {worse_value:value}."
    ),
    contrast.Better: (
        "With γ = {gamma:plain} {better} is worth {better_value:value} and {worse} "
        "{worse_value:value}."
    ),
    contrast.EqualValues: (
        "With γ = {gamma:plain} {action} and {foil} are both worth {value:value}."
    ),
    contrast.Overtakes: (
        "Counted as they come in, the rewards of {leader} overtake those of {other} at "
        "{component:label}: {leader_total:value} against {other_total:value}."
    ),
    contrast.StaysAhead: "{other} never catches up with {leader}.",
    contrast.Dominates: "Nothing speaks for {worse}: no component is larger than that of {better}.",
    contrast.Reasons: (
        "To prefer {better} it is enough to look at {components:labels}: {advantage:value} more "
        "there, against {disadvantage:value} for {worse} elsewhere."
    ),
    flips.Flips: (
        "The preference flips where {quantity} is {at:roots} instead of {current:plain} (searched"
        " from {low:plain} to {high:plain}, policy re-optimised)."
    ),
    flips.NeverFlips: (
        "No value of {quantity} was found from {low:plain} to {high:plain} that makes {worse} "
        "better than {better} (policy re-optimised)."
    ),
    forecast.EarnsNothing: "Nothing is expected of {action} at any step.",
    forecast.AllBeyond: (
        "All of the {value:value} that {action} is worth lies at {component:label}."
    ),
    forecast.FirstStepReward: (
        "The first reward to be expected of {action} is that of {component:label}: "
        "{reward:amount} on average, worth {discounted:value} now."
    ),
    forecast.FirstReward: (
        "The first reward to be expected of {action} is that of {component:label}, worth "
        "{discounted:value} now."
    ),
    forecast.FirstStepCost: (
        "{action} is first expected to cost something at {component:label}: {reward:amount} on "
        "average, worth {discounted:value} now."
    ),
    forecast.FirstCost: (
        "{action} is first expected to cost something at {component:label}, worth "
        "{discounted:value} now."
    ),
    forecast.Peak: (
        "The largest component of {action} is that of {component:label}: {discounted:value}."
    ),
    forecast.CentreOfMass: (
        "Weighted by what they are worth now, the rewards of {action} before the residual centre "
        "on t+{step:value}."
    ),
    forecast.ShareBeyond: "{share:percent} of the value of {action} lies at {component:label}.",
    forecast.GiveOrTake: (
        "What {action} is worth on average, {value:value}, varies by {deviation:value} from "
        "episode to episode (one standard deviation)."
    ),
    forecast.EitherOr: (
        "At {component:label} {action} pays either {reward:amount} or nothing; the chance that it "
        "pays is {chance:percent}."
    ),
    forecast.LikelyOver: (
        "After {action} the episode is likely over by {component:begin}: {chance:percent}."
    ),
    forecast.SurelyOver: "After {action} the episode is over by {component:begin}.",
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
        "After the first action it is the future of {policy}; it counts the {reward} and ends at "
        "{ending}."
    ),
    explanation.TiedActions: (
        "Here {actions:names} tie: their values cannot be told apart, their futures can."
    ),
    explanation.TiedLater: (
        "Later states in which optimal actions tie but their futures differ: {states:count}."
    ),
}

_NUMBER = r"-?(?:\d+(?:\.\d+)?(?:e[+-]?\d+)?|inf)"


class UnsupportedSentenceError(TrdlabError):
    """A rendered sentence makes a claim that the numbers do not support."""


def sentences(explanation: Explanation) -> list[str]:
    """Returns the findings of an explanation as sentences, in their order."""
    return [sentence(finding, explanation) for finding in explanation.findings]


def sentence(finding: Finding, explanation: Explanation) -> str:
    """Returns one finding as a sentence."""
    template = TEMPLATES[type(finding)]
    compared = [slot.field for slot in _slots(template) if slot.form in ("value", "amount")]
    values = [float(getattr(finding, field)) for field in compared]
    style = _Style(explanation, decimals_between(values[0], values[-1]) if values else 2)
    text = _SLOT.sub(
        lambda match: _FORMS[match[2] or "word"].show(getattr(finding, match[1]), style),
        template,
    )
    return text[0].upper() + text[1:]


def check(text: str, explanation: Explanation) -> list[Finding]:
    """Reads a rendered text back, tests each claim against the moment, and returns the claims.

    Args:
        text: sentences as `sentences` renders them, separated by white space.
        explanation: what they speak of; its findings are not consulted, only its moment.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    return [
        _checked(piece, explanation) for piece in re.split(r"(?<=\.)\s+", text.strip()) if piece
    ]


def _checked(piece: str, explanation: Explanation) -> Finding:
    read = False
    for kind in TEMPLATES:
        finding = _parsed(kind, piece, explanation)
        if finding is not None:
            read = True
            if finding.holds(explanation.moment):
                return finding
    raise UnsupportedSentenceError(
        f"The sentence '{piece}' {'is not true of' if read else 'is no statement about'} "
        "these numbers."
    )


def _parsed(kind: type[Finding], piece: str, explanation: Explanation) -> Finding | None:
    template = TEMPLATES[kind]
    match = _pattern(template, explanation.moment.action_names).fullmatch(piece)
    if match is None:
        return None
    style = _Style(explanation)
    given = {"action": explanation.action, "foil": explanation.foil}  # where no slot names them
    values: dict[str, Any] = {x.name: given[x.name] for x in fields(kind) if x.name in given}
    for slot in _slots(template):
        value = _FORMS[slot.form].read(match[slot.field], style)
        if value is None:
            return None
        values[slot.field] = value
    return kind(**values)


# ---- the forms a slot can take: how each is shown, recognised, and read back ---------------------


@dataclass(frozen=True)
class _Style:
    explanation: Explanation
    decimals: int = 2

    @property
    def axis(self) -> TimeAxis:
        return self.explanation.moment.time_axis

    def label(self, component: int) -> str:
        return self.axis.label(component)

    def component(self, label: str) -> int | None:
        return self.axis.labels.index(label) if label in self.axis.labels else None


@dataclass(frozen=True)
class _Form:
    show: Callable[[Any, _Style], str]
    pattern: str
    read: Callable[[str, _Style], Any]


@dataclass(frozen=True)
class _Slot:
    field: str
    form: str


_SLOT = re.compile(r"\{(\w+)(?::(\w+))?\}")


def _joined(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _split(text: str) -> list[str]:
    return re.split(r", | and ", text)


def _read_value(text: str, _: _Style) -> Shown:
    decimals = _decimals(text)
    return Shown(text, lambda x: number(x, decimals))


def _read_amount(text: str, _: _Style) -> Shown:
    decimals = _decimals(text)
    return Shown(text, lambda x: amount(x, decimals))


def _decimals(text: str) -> int:
    """Returns the decimals of a printed number; any above 2, where it took an exponent."""
    return 3 if "e" in text else len(text.partition(".")[2]) or 2


def _component_that_begins(step: int, axis: TimeAxis) -> int | None:
    component, within = divmod(step, axis.width)
    return component if not within and component < axis.num_components else None


def _read_labels(text: str, style: _Style) -> tuple[int, ...] | None:
    components = [style.component(label) for label in _split(text)]
    return None if None in components else tuple(c for c in components if c is not None)


def _read_word(text: str, style: _Style) -> str:
    names = style.explanation.moment.action_names
    lowered = text[0].lower() + text[1:]  # it may stand at the start of a sentence
    return lowered if text not in names and lowered in names else text


_FORMS = {
    "word": _Form(lambda x, _: str(x), "", _read_word),
    "names": _Form(lambda x, _: _joined(list(x)), r".+", lambda t, _: tuple(_split(t))),
    "value": _Form(lambda x, style: number(x, style.decimals), _NUMBER, _read_value),
    "amount": _Form(lambda x, style: amount(x, style.decimals), _NUMBER, _read_amount),
    "plain": _Form(lambda x, _: plain(x), _NUMBER, lambda t, _: Shown(t, plain)),
    "step": _Form(lambda x, _: step_label(x), r"t(?:\+\d+)?", lambda t, _: int(t[2:] or 0)),
    "count": _Form(lambda x, _: str(x), r"\d+", lambda t, _: int(t)),
    "percent": _Form(
        lambda x, _: f"{percent(x)} %",
        r"\d+(?:\.\d+)? %",
        lambda t, _: Shown(t.removesuffix(" %"), percent),
    ),
    "begin": _Form(
        lambda x, style: step_label(style.axis.start(x)),
        r"t(?:\+\d+)?",
        lambda t, style: _component_that_begins(int(t[2:] or 0), style.axis),
    ),
    "roots": _Form(
        lambda x, _: _joined([significant(root) for root in x]),
        r".+",
        lambda t, _: tuple(Shown(root, significant) for root in _split(t)),
    ),
    "label": _Form(lambda x, style: style.label(x), r"t\S*?", lambda t, style: style.component(t)),
    "labels": _Form(lambda x, style: _joined([style.label(c) for c in x]), r"t.*?", _read_labels),
}


@cache
def _slots(template: str) -> tuple[_Slot, ...]:
    return tuple(_Slot(m[1], m[2] or "word") for m in _SLOT.finditer(template))


@cache
def _pattern(template: str, action_names: tuple[str, ...]) -> re.Pattern[str]:
    """Returns what a template's sentences look like; only the model's own actions are names."""
    names = {name[0].upper() + name[1:] for name in action_names} | set(action_names)
    action = "|".join(re.escape(name) for name in sorted(names, key=len, reverse=True))
    pattern, end = "", 0
    for match in _SLOT.finditer(template):
        free = match[1] in ("policy", "reward", "ending", "quantity")
        form = _FORMS[match[2] or "word"].pattern or (".+?" if free else action)
        pattern += re.escape(template[end : match.start()]) + f"(?P<{match[1]}>{form})"
        end = match.end()
    return re.compile(pattern + re.escape(template[end:]))
