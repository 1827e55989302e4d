"""What is told of a choice: all of it in sections, and the few sentences that matter most."""

from collections.abc import Iterator
from dataclasses import replace

from trdlab.explanations.moment import contrast, forecast, outlook, sensitivity
from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.explanations.rules import Claim, Fields, Found, every, first
from trdlab.explanations.sections import Section, at_first

_FIRST = ("first-reward", "first-expected")


def sections(choice: Choice) -> tuple[Section, ...]:
    """Returns all that is told of a choice, by the question that it answers."""
    if choice.moment.is_over:
        return (Section("forecast", "Here", tuple(every(choice, episode_is_over))),)
    told = every(choice, no_alternative)
    if choice.foil is not None:
        told = contrast.contrast(choice) + every(choice, first_together)
    parts = (
        Section("contrast", _why(choice), tuple(told)),
        Section("flips", "What would change that", tuple(sensitivity.sensitivity(choice))),
        Section("forecast", f"What to expect of {choice.action}", tuple(forecast.forecast(choice))),
        Section("outcomes", "What else to expect", tuple(outlook.forecast(choice))),
        Section("differences", "What else differs", tuple(outlook.contrast(choice))),
        Section("context", "Whose future", tuple(every(choice, *ties, *future))),
    )
    return tuple(part for part in parts if part)


def in_brief(choice: Choice) -> list[Claim]:
    """Returns what matters most: the contrast, ties, the first reward, the nearest flip."""
    if choice.moment.is_over:
        return every(choice, episode_is_over)
    told = contrast.in_brief(choice) if choice.foil is not None else every(choice, no_alternative)
    tied = first(choice, *ties)
    if told and told[0].kind.startswith("nothing"):
        return told + tied
    flips = first(choice, sensitivity.flips)
    return list(at_first([*told, *tied, *forecast.forecast(choice)[:1], *flips]))


def _why(choice: Choice) -> str:
    if choice.foil is None:
        return f"Why {choice.action}"
    moment = choice.moment
    if moment.is_own(choice.action) and moment.q_value(choice.action) >= moment.q_value(
        choice.foil
    ):
        return f"Why {choice.action}, not {choice.foil}"
    return f"How {choice.action} differs from {choice.foil}"


@CHOICES.rule(
    "With both {action} and {foil}, the first {effect:text}{expected:text} comes {component:when}."
)
def first_together(choice: Choice) -> Iterator[Fields]:
    """Nothing that stands out comes before it; how much it is may differ."""
    for action, foil in choice.orders[:1]:
        ones, others = (
            every(replace(choice, action=name, foil=None), *forecast.firsts)
            for name in (action, foil)
        )
        coming = {(other.kind, other.effect, other.component) for other in others}
        for one in ones if choice.moment.difference(action, foil).any() else ():
            if one.kind in _FIRST and (one.kind, one.effect, one.component) in coming:
                yield {
                    "action": action,
                    "foil": foil,
                    "effect": one.effect,
                    "expected": "" if one.is_sure else " to expect",
                    "component": one.component,
                }


@CHOICES.rule("The episode is over here: no action pays anything any more.")
def episode_is_over(choice: Choice) -> Iterator[Fields]:
    if choice.moment.is_over:
        yield {}


@CHOICES.rule(
    "Every other action leaves things as they are, surely or most likely, so there is nothing to "
    "compare."
)
def no_alternative(choice: Choice) -> Iterator[Fields]:
    names, stays = choice.moment.action_names, choice.moment.stays
    if choice.foil is None and stays is not None and len(names) > 1:
        yield {"others": tuple(name for name in names if name != choice.action)}


@CHOICES.kinds(
    {
        "tied-actions": (
            "{actions:names} are equally good here, but pay other amounts or at other times; the "
            "agent {takes:text}."
        ),
        "tied-later": (
            "In {states:states} to come several actions are equally good: totals and times depend "
            "on which is taken."
        ),
    }
)
def ties(choice: Choice) -> Iterator[Found]:
    moment = choice.moment
    if moment.tied:
        is_mixed = "mixes" in moment.future.policy
        takes = "takes each equally often" if is_mixed else f"takes {moment.tied[0]}"
        yield "tied-actions", {"actions": moment.tied, "takes": takes}
    if moment.tied_later:
        yield "tied-later", {"states": moment.tied_later}


@CHOICES.kinds(
    {
        "decided-by": "After the first action, {policy:text} acts.",
        "signs-count": "Of each reward only the sign counts.",
        "ended-by": "All steps count, up to {ending:text}.",
    }
)
def future(choice: Choice) -> Iterator[Found]:
    of = choice.moment.future
    yield "decided-by", {"policy": of.policy}
    if of.clip_rewards:
        yield "signs-count", {}
    yield "ended-by", {"ending": of.ending}
