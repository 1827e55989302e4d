"""Chances: what is uncertain about what an action is expected to pay."""

from collections.abc import Iterator, Sequence

import numpy as np

from trdlab.explanations.moment.moment import CHOICES, Choice
from trdlab.explanations.moment.steps import NEGLIGIBLE, SHARE, explicit_end, largest, undiscounted
from trdlab.explanations.rules import Fields, Found


def outcomes_of(choice: Choice) -> Sequence[dict[float, float]]:
    """Returns the chance of each reward at each explicit step; nothing where it is not known."""
    known = choice.moment.uncertainty
    if known is None or not known.outcomes:
        return ()
    end = explicit_end(choice.moment, choice.action)
    return known.outcomes[choice.moment.index(choice.action)][:end]


@CHOICES.rule(
    "The agent puts the chance that {action} pays {reward:number}, {component:when}, at "
    "{chance:percent}."
)
def put_at(choice: Choice) -> Iterator[Fields]:
    """The chance that the largest component implies, where one reward or none is ever observed.

    With w = 1 component k is γ^k·c times the probability that step k pays c (errata P9, P10).
    """
    moment, paid = choice.moment, choice.moment.only_reward
    row = undiscounted(moment, choice.action)
    if paid is None or moment.is_exact or choice.time_axis.width != 1 or not row.any():
        return
    i = largest(moment, choice.action)
    chance = float(row[i] / paid)
    if 0.0 < chance <= 1.0:
        yield {"action": choice.action, "reward": paid, "component": i, "chance": chance}


@CHOICES.rule(
    "{action} is worth {value:number} on average; single episodes differ from that by about "
    "{deviation:number}."
)
def give_or_take(choice: Choice) -> Iterator[Fields]:
    """One standard deviation of the whole discounted reward, if it is not `NEGLIGIBLE`."""
    moment, action = choice.moment, choice.action
    if moment.uncertainty is not None:
        deviation = float(moment.uncertainty.return_deviation[moment.index(action)])
        value = moment.q_value(action)
        if deviation > NEGLIGIBLE * abs(value):
            yield {"action": action, "value": value, "deviation": deviation}


@CHOICES.rule("There is {chance:chance} that {action} {reward:pays}, {component:when}.")
def either_or(choice: Choice) -> Iterator[Fields]:
    """A step that pays one amount or nothing; of several, where most of it is expected.

    The amount matters: it is at least `SHARE` of the action's value and of the largest reward that
    is expected of it at one step, and what is expected of it at least `NEGLIGIBLE`.
    """
    either = {
        i: (reward, chance)
        for i, step in enumerate(outcomes_of(choice))
        for reward, chance in step.items()
        if set(step) == {0.0, reward} and reward != 0.0
    }
    if not either:
        return
    expected = {i: abs(reward) * chance for i, (reward, chance) in either.items()}
    i = max(expected, key=expected.__getitem__)
    row = undiscounted(choice.moment, choice.action)
    scale = max(abs(choice.moment.q_value(choice.action)), float(np.abs(row).max()))
    reward, chance = either[i]
    if abs(reward) >= SHARE * scale and expected[i] >= NEGLIGIBLE * scale:
        yield {"action": choice.action, "reward": reward, "component": i, "chance": chance}


@CHOICES.kinds(
    {
        "likely-over": (
            "With {action}, there is {chance:chance} that the episode ends {last_step:within}."
        ),
        "surely-over": "With {action}, the episode ends {last_step:within}.",
        "learned-over": (
            "With {action}, there is {chance:likely} that the episode {goes:text} {count:first}."
        ),
    }
)
def over(choice: Choice) -> Iterator[Found]:
    """The first component at whose beginning the episode has more likely ended than not.

    Where that was learned and there is none, how likely the episode still runs at the last: that no
    reward is coming is something else than that nobody is there to get it.
    """
    moment, action = choice.moment, {"action": choice.action}
    survival = moment.survival(choice.action)
    i = int((survival < 0.5).argmax()) or len(survival) - 1
    count, runs, ends = choice.time_axis.start(i), float(survival[i]), 1.0 - float(survival[i])
    if moment.uncertainty is None and i:
        goes, chance = ("ends in", ends) if runs < 0.5 else ("still runs after", runs)
        yield "learned-over", action | {"goes": goes, "count": count, "chance": chance}
    elif runs < 0.5:
        kind = "likely-over" if ends < 1.0 else "surely-over"
        yield kind, action | {"last_step": count - 1, "chance": ends}
