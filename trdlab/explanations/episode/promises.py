"""Claims about rewards that came as foreseen, and about promises that were not kept."""

from collections.abc import Iterator
from itertools import groupby

import numpy as np

from trdlab.arrays import IntArray
from trdlab.explanations.claims import agrees
from trdlab.explanations.episode.played import Played, StoryClaim
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import next_flag

HALF = 0.5
"""The share of a reward that counts as it, where it is expected and where it comes."""
LEAST_SPAN = 6
"""A promise is not called broken after fewer steps than this: chance can delay a reward."""
SMALLEST_DISCOUNT = 1e-6
"""A discount smaller than this is not taken out of a component."""


# ---- rewards that came as foreseen ---------------------------------------------------------------


class _Foreseen(StoryClaim):
    """At least half of a reward was expected of the right component, for so many steps on end.

    The right component of j steps before is the one that covers the step t + j. None is expected
    across an end, nor of the residual.
    """

    reward: float
    step: int
    steps: int

    @property
    def place(self) -> int:
        return self.step

    def _is_foreseen(self, played: Played, *, fully: bool) -> bool:
        episode, step = played.episode, self.step
        if not (0 <= step < len(episode) and agrees(self.reward, episode.rewards[step])):
            return False
        steps = 0
        while _can_tell(episode, step, steps) and _tells(episode, step, steps):
            steps += 1
        is_all = not _can_tell(episode, step, steps)
        return self.steps == steps - 1 >= 1 and is_all == fully


class Foreseen(_Foreseen):
    """It was not foreseen any earlier, although it could have been."""

    def holds(self, played: Played) -> bool:
        return self._is_foreseen(played, fully=False)


class ForeseenFully(_Foreseen):
    """It was foreseen since the future began, or as far ahead as there are explicit components."""

    def holds(self, played: Played) -> bool:
        return self._is_foreseen(played, fully=True)


def _can_tell(episode: Episode, step: int, ahead: int) -> bool:
    """Returns whether a reward could be told of so many steps ahead."""
    began = step - ahead
    in_sight = began >= 0 and ahead < episode.time_axis.num_steps
    return in_sight and not episode.ends[began:step].any()


def _tells(episode: Episode, step: int, ahead: int) -> bool:
    """Returns whether half of a reward was expected so many steps ahead."""
    axis, reward = episode.time_axis, episode.rewards[step]
    expected = episode.predicted[step - ahead, ahead // axis.width] * np.sign(reward)
    return bool(expected > 0.0 and expected >= HALF * abs(reward) * axis.gamma**ahead)


def foreseen(played: Played) -> tuple[Foreseen | ForeseenFully, ...]:
    """Returns the rewards that were foreseen, largest first, of equals the longest foreseen first.

    There is none where the reward was always the same: then nothing had to be foreseen.
    """
    episode, rewards = played.episode, played.episode.rewards
    if np.ptp(rewards) == 0.0:
        return ()
    steps, limit = _foreseen_steps(episode)  # [T] each
    known = np.flatnonzero((steps >= 1) & (rewards != 0.0))
    order = known[np.lexsort((-steps[known], -np.abs(rewards[known])))]
    return tuple(
        (ForeseenFully if steps[at] == limit[at] else Foreseen)(
            float(rewards[at]), int(at), int(steps[at])
        )
        for at in order
    )


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


# ---- promises that were not kept -----------------------------------------------------------------


class _Broken(StoryClaim):
    """A reward stayed k components away from a step to another one, and did not come by then.

    At all the steps s … e component k ≥ 1 is what is promised (see `promised`), which it is not at
    s − 1 or e + 1, and no end lies between them. They are more than (k + 1)·w steps, so that what
    was promised at s is overdue at e, and at least `LEAST_SPAN`. Up to e no w steps on end from s
    on paid half of what was promised, which is the least of component k at these steps, without
    its discount.
    """

    first: int
    last: int
    component: int

    @property
    def place(self) -> int:
        return self.first

    def _is_overdue(self, played: Played) -> bool:
        episode, c, first, last = played.episode, self.component, self.first, self.last
        length, total = last - first + 1, len(episode)
        if not 0 <= first <= last < total or episode.ends[first:last].any():
            return False
        found = promised(episode)
        same = c >= 1 and bool((found[first : last + 1] == c).all())
        begins = first == 0 or episode.ends[first - 1] or found[first - 1] != c
        stops = last == total - 1 or episode.ends[last] or found[last + 1] != c
        overdue = length > (c + 1) * episode.time_axis.width and length >= LEAST_SPAN
        return bool(same and begins and stops and overdue)

    def _kept_at(self, played: Played) -> int | None:
        """Returns the first step from s on by which the promise was kept; None if there is none."""
        episode, axis = played.episode, played.episode.time_axis
        least = float(episode.predicted[self.first : self.last + 1, self.component].min())
        for step in range(self.first, len(episode)):
            begin = max(self.first, step - axis.width + 1)
            paid = axis.discounts[self.component] * episode.rewards[begin : step + 1].sum()
            if paid >= HALF * least:
                return step
        return None


class BrokenPromise(_Broken):
    """It never came, and the episode ended."""

    def holds(self, played: Played) -> bool:
        never = self._is_overdue(played) and self._kept_at(played) is None
        return never and played.episode.terminated


class OverduePromise(_Broken):
    """It had not come when the episode was cut off."""

    def holds(self, played: Played) -> bool:
        not_yet = self._is_overdue(played) and self._kept_at(played) is None
        return not_yet and not played.episode.terminated


class LatePromise(_Broken):
    """It came later."""

    came: int

    def holds(self, played: Played) -> bool:
        overdue = self._is_overdue(played) and self.came > self.last
        return overdue and self._kept_at(played) == self.came


Broken = BrokenPromise | OverduePromise | LatePromise


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
    least = (
        HALF * max(float((explicit / discounts).max()), float(episode.rewards.max())) * discounts
    )
    best = explicit.argmax(axis=1)
    largest = explicit[np.arange(len(episode)), best]
    return np.where((largest > 0.0) & (largest >= least[best]), best, -1)


def broken_promises(played: Played) -> tuple[Broken, ...]:
    """Returns the promises that were not kept in time, the longest first."""
    found = sorted(_stays(played.episode), key=lambda stay: stay[0] - stay[1])
    claims: list[Broken] = []
    for stay in found:
        broken = (BrokenPromise if played.episode.terminated else OverduePromise)(*stay)
        kept = broken._kept_at(played)
        claims.append(broken if kept is None else LatePromise(*stay, kept))
    return tuple(claim for claim in claims if claim.holds(played))


def _stays(episode: Episode) -> Iterator[tuple[int, int, int]]:
    """Yields the first and the last step of every stretch with one promised component."""
    end = next_flag(episode.ends, len(episode))  # [T], the same on this side of an end
    keys = zip(promised(episode).tolist(), end.tolist(), strict=True)
    for (component, _), group in groupby(enumerate(keys), key=lambda pair: pair[1]):
        steps = [step for step, _ in group]
        if component >= 1 and len(steps) >= LEAST_SPAN:
            yield steps[0], steps[-1], component
