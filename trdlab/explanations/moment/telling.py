"""What is told of a choice: all of it in sections, and the few sentences that matter most."""

from collections.abc import Iterator

from trdlab.explanations.moment import contrast, forecast, sensitivity
from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.explanations.moment.together import first_together
from trdlab.explanations.rules import Claim, Fields, every, first
from trdlab.explanations.sections import Section, at_first


def sections(choice: Choice) -> tuple[Section, ...]:
    """Returns all that is told of a choice, by the question that it answers."""
    context = every(choice, tied_actions, tied_later, decided_by, signs_count, ended_by)
    if choice.moment.is_over:
        return (Section("forecast", "Here", tuple(every(choice, episode_is_over))),)
    parts = (
        Section("contrast", _why(choice), tuple(_contrast(choice))),
        Section("flips", "What would change that", tuple(sensitivity.sensitivity(choice))),
        Section("forecast", f"What to expect of {choice.action}", tuple(forecast.forecast(choice))),
        Section("context", "Whose future", tuple(context)),
    )
    return tuple(part for part in parts if part)


def in_brief(choice: Choice) -> list[Claim]:
    """Returns what matters most: the contrast, ties, the first reward, the nearest flip."""
    if choice.moment.is_over:
        return every(choice, episode_is_over)
    told = contrast.in_brief(choice) if choice.foil is not None else every(choice, no_alternative)
    ties = first(choice, tied_actions, tied_later)
    if told and told[0].kind.startswith("nothing"):
        return told + ties
    flips = first(choice, sensitivity.flips)
    return list(at_first([*told, *ties, *forecast.forecast(choice)[:1], *flips]))


def _why(choice: Choice) -> str:
    if choice.foil is None:
        return f"Why {choice.action}"
    chance = None if choice.moment.policy is None else choice.moment.policy
    is_chosen = chance is None or chance[choice.moment.index(choice.action)] > 0.0
    return (
        f"Why {choice.action}, not {choice.foil}"
        if is_chosen
        else f"How {choice.action} differs from {choice.foil}"
    )


def _contrast(choice: Choice) -> list[Claim]:
    if choice.foil is None:
        return every(choice, no_alternative)
    return contrast.contrast(choice) + every(choice, first_together)


@CHOICES.rule("The episode is over here: no action pays anything any more.")
def episode_is_over(choice: Choice) -> Iterator[Fields]:
    if choice.moment.is_over:
        yield {}


@CHOICES.rule(
    "Every other action leaves things as they are, or most likely does, so nothing is compared."
)
def no_alternative(choice: Choice) -> Iterator[Fields]:
    names, stays = choice.moment.action_names, choice.moment.stays
    if choice.foil is None and stays is not None and len(names) > 1:
        yield {"others": tuple(name for name in names if name != choice.action)}


@CHOICES.rule(
    "{actions:names} are equally good here, but pay other amounts or at other times; the agent "
    "{takes:text}."
)
def tied_actions(choice: Choice) -> Iterator[Fields]:
    if choice.moment.tied:
        is_mixed = "mixes" in choice.moment.future.policy
        takes = "takes each equally often" if is_mixed else f"takes {choice.moment.tied[0]}"
        yield {"actions": choice.moment.tied, "takes": takes}


@CHOICES.rule(
    "In {states:states} to come several actions are equally good: totals and times depend on "
    "which is taken."
)
def tied_later(choice: Choice) -> Iterator[Fields]:
    if choice.moment.tied_later:
        yield {"states": choice.moment.tied_later}


@CHOICES.rule("After the first action, {policy:text} acts.")
def decided_by(choice: Choice) -> Iterator[Fields]:
    yield {"policy": choice.moment.future.policy}


@CHOICES.rule("Of each reward only the sign counts.")
def signs_count(choice: Choice) -> Iterator[Fields]:
    if choice.moment.future.clip_rewards:
        yield {}


@CHOICES.rule("All steps count, up to {ending:text}.")
def ended_by(choice: Choice) -> Iterator[Fields]:
    yield {"ending": choice.moment.future.ending}
