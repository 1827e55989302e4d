"""Rewards that came as foreseen, and promises that were not kept."""

from collections.abc import Iterator
from itertools import groupby

import numpy as np

from trdlab.arrays import IntArray
from trdlab.explanations.episode.played import EPISODES, Played
from trdlab.explanations.rules import Claim, Found, every
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import next_flag

HALF = 0.5  # of a reward counts as it, where it is expected and where it comes
LEAST_SPAN = 6  # steps until a promise is called broken: chance can delay a reward
SMALLEST_DISCOUNT = 1e-6  # a smaller one is not taken out of a component


def foreseen(played: Played) -> list[Claim]:
    """Returns the rewards that were foreseen, largest first, of equals the longest foreseen first.

    There is none where the reward was always the same: then nothing had to be foreseen.
    """
    claims = every(played, *told_ahead)
    return sorted(claims, key=lambda claim: (-abs(claim.reward), -claim.steps, claim.step))


@EPISODES.kinds(
    {
        "foreseen-fully": (
            "{reward:paid} at {step:step} was foreseen {steps:steps} before, as early as it can be "
            "told."
        ),
        "foreseen-before": "{reward:paid} at {step:step} was foreseen {steps:steps} before.",
    }
)
def told_ahead(played: Played) -> Iterator[Found]:
    """Rewards foreseen as early as there was a component for them, or later than that."""
    episode, rewards = played.episode, played.episode.rewards
    if np.ptp(rewards) == 0.0:
        return
    steps, limits = _foreseen_steps(episode)  # [T] each
    for at in np.flatnonzero((steps >= 1) & (rewards != 0.0)).tolist():
        fields = {"reward": float(rewards[at]), "step": at, "steps": int(steps[at])}
        kind = "foreseen-fully" if steps[at] == limits[at] else "foreseen-before"
        yield kind, fields | {"limit": int(limits[at])}


def _foreseen_steps(episode: Episode) -> tuple[IntArray, IntArray]:
    """Returns `[T]` twice: how long before each reward was foreseen, and could have been at most.

    It is −1 where it was not even expected when it came.
    """
    axis, total = episode.time_axis, len(episode)
    t, rewards, predicted = np.arange(total), episode.rewards, episode.predicted
    began = np.maximum.accumulate(np.append(0, np.where(episode.ends, t + 1, 0)))[:total]
    limit = np.minimum(t - began, axis.num_steps - 1)
    steps, still = np.full(total, -1), np.ones(total, dtype=np.bool_)
    for ahead in range(axis.num_steps):
        expected = predicted[np.maximum(t - ahead, 0), ahead // axis.width] * np.sign(rewards)
        enough = (expected > 0.0) & (expected >= HALF * np.abs(rewards) * axis.gamma**ahead)
        still &= enough & (ahead <= limit)
        if not still.any():
            break
        steps[still] = ahead
    return steps, limit


def broken_promises(played: Played) -> list[Claim]:
    """Returns the promises that were not kept in time, the longest first."""
    claims = every(played, *overdue)
    return sorted(claims, key=lambda claim: claim.first - claim.last)


_STAYED = "From {first:step} to {last:step} a reward was always {away:text} away"


@EPISODES.kinds(
    {
        "broken-promise": f"{_STAYED}, and never came.",
        "overdue-promise": f"{_STAYED}, and had not come when the episode was cut off.",
        "late-promise": f"{_STAYED}, and came only at {{came:step}}.",
    }
)
def overdue(played: Played) -> Iterator[Found]:
    """The stretches of steps at which a promised reward was overdue, and whether it came."""
    episode, axis = played.episode, played.episode.time_axis
    for first, last, component in _stays(episode):
        kept = _kept_at(episode, first, last, component)
        is_long = last - first + 1 > (component + 1) * axis.width
        if is_long and (kept is None or kept > last):
            steps = [component * axis.width, (component + 1) * axis.width - 1]
            away = " to ".join(f"{step:,}" for step in dict.fromkeys(steps))
            noun = "step" if steps[-1] == 1 else "steps"
            fields = {"first": first, "last": last, "component": component, "came": kept}
            never = "broken-promise" if episode.terminated else "overdue-promise"
            yield never if kept is None else "late-promise", fields | {"away": f"{away} {noun}"}


def _kept_at(episode: Episode, first: int, last: int, component: int) -> int | None:
    """Returns the first step by which half of what was promised was paid; None if there is none."""
    width, discount = episode.time_axis.width, episode.time_axis.discounts[component]
    least = HALF * float(episode.predicted[first : last + 1, component].min())
    for step in range(first, len(episode)):
        if discount * episode.rewards[max(first, step - width + 1) : step + 1].sum() >= least:
            return step
    return None


def promised(episode: Episode) -> IntArray:
    """Returns `[T]`, the component of which a reward is promised at each step; −1 where none is.

    It is the largest explicit component of the action taken, if it is above 0 and, without the
    discount, at least half of the largest one that was predicted in the episode and of the largest
    reward that came.
    """
    explicit = episode.predicted[:, :-1].astype(np.float64)  # [T, N]
    if not explicit.size:
        return np.full(len(episode), -1)
    discounts = np.maximum(episode.time_axis.discounts[:-1], SMALLEST_DISCOUNT)
    most = max(float((explicit / discounts).max()), float(episode.rewards.max()))
    least = HALF * most * discounts
    best = explicit.argmax(axis=1)
    largest = explicit[np.arange(len(episode)), best]
    return np.where((largest > 0.0) & (largest >= least[best]), best, -1)


def _stays(episode: Episode) -> Iterator[tuple[int, int, int]]:
    """Yields the first and the last step of every stretch with one promised component."""
    end = next_flag(episode.ends, len(episode))  # [T], the same on this side of an end
    keys = zip(promised(episode).tolist(), end.tolist(), strict=True)
    for (component, _), group in groupby(enumerate(keys), key=lambda pair: pair[1]):
        steps = [step for step, _ in group]
        if component >= 1 and len(steps) >= LEAST_SPAN:
            yield steps[0], steps[-1], component
