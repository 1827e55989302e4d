"""What some claims mean, by the definition: independent of how the package searches for them."""

import numpy as np
import pytest

from trdlab.explanations.episode.played import Played
from trdlab.explanations.moment.moment import Choice
from trdlab.explanations.rules import Claim
from trdlab.rollouts.episodes import Episode


def holds(claim: Claim) -> bool:
    """Returns whether a claim is true by its definition; so is one that has none here."""
    defined = DEFINITIONS.get(claim.kind)
    return defined is None or defined(claim.evidence, claim)


def is_sufficient(choice: Choice, claim: Claim) -> bool:
    """These components outweigh all that is against, and no fewer do."""
    delta = choice.moment.difference(claim.better, claim.worse)
    against = -delta[delta < 0].sum()
    chosen = sorted(delta[list(claim.components)], reverse=True)
    rest = np.delete(delta, claim.components)
    return bool(
        sum(chosen) > against > 0.0
        and sum(chosen[:-1]) <= against
        and (rest <= chosen[-1]).all()
        and claim.advantage == pytest.approx(sum(chosen), rel=1e-9)
        and claim.disadvantage == pytest.approx(against, rel=1e-9)
    )


def flips_there(choice: Choice, claim: Claim) -> bool:
    """The worse action is the better one just beyond each bound."""
    of = next(of for of in choice.moment.what_ifs if of.name == claim.quantity)
    i, j = choice.moment.index(claim.worse), choice.moment.index(claim.better)
    return all(of.gap(i, j, at + (claim.inside - at) * 1e-6) > 0.0 for at in claim.bounds)


def is_foreseen(played: Played, claim: Claim) -> bool:
    """Half of a reward was expected of the right component for so many steps, and no longer.

    The right component of j steps before is the one that covers the step t + j. None is expected
    across an end, nor of the residual.
    """
    episode, step, steps = played.episode, claim.step, claim.steps
    is_told = all(
        _can_tell(episode, step, j) and _tells(episode, step, j) for j in range(steps + 1)
    )
    could = _can_tell(episode, step, steps + 1)
    longer = could and _tells(episode, step, steps + 1)
    return is_told and not longer and could == (claim.kind == "foreseen-before")


def _can_tell(episode: Episode, step: int, ahead: int) -> bool:
    began = step - ahead
    in_sight = began >= 0 and ahead < episode.time_axis.num_steps
    return in_sight and not episode.ends[began:step].any()


def _tells(episode: Episode, step: int, ahead: int) -> bool:
    axis, reward = episode.time_axis, episode.rewards[step]
    expected = episode.predicted[step - ahead, ahead // axis.width] * np.sign(reward)
    return bool(expected > 0.0 and expected >= 0.5 * abs(reward) * axis.gamma**ahead)


def is_overdue(played: Played, claim: Claim) -> bool:
    """A reward stayed so far away from a step to another one, and did not come.

    At all these steps the component stands out (half of the largest), which it does not at the
    step before or after, and no end lies between them. Before it came no w steps on end paid half
    of what was promised: the least of the component there, without its discount.
    """
    episode, i, total = played.episode, claim.component, len(played.episode)
    discounts = episode.time_axis.discounts
    explicit = episode.predicted[:, :-1] / np.maximum(discounts[:-1], 1e-6)
    most = max(explicit.max(), episode.rewards.max())

    def is_promised(step: int) -> bool:
        row = episode.predicted[step, :-1]
        return row.argmax() == i and row[i] > 0.0 and explicit[step, i] >= 0.5 * most - 1e-12

    first, last = claim.first, claim.last
    is_same = all(is_promised(step) for step in range(first, last + 1))
    begins = first == 0 or episode.ends[first - 1] or not is_promised(first - 1)
    stops = last == total - 1 or episode.ends[last] or not is_promised(last + 1)
    is_one = not episode.ends[first:last].any()
    least = episode.predicted[first : last + 1, i].min()
    width = episode.time_axis.width
    before = range(first, total if claim.came is None else claim.came)
    paid = [discounts[i] * episode.rewards[max(first, t - width + 1) : t + 1].sum() for t in before]
    return bool(is_same and begins and stops and is_one and max(paid) < 0.5 * least)


DEFINITIONS = {
    "reasons": is_sufficient,
    "flips": flips_there,
    "foreseen-fully": is_foreseen,
    "foreseen-before": is_foreseen,
    "broken-promise": is_overdue,
    "overdue-promise": is_overdue,
    "late-promise": is_overdue,
}
