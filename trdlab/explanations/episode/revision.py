"""Belief revision: what each step of an episode changed in what was expected."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.bellman import target
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import next_flag


@dataclass(frozen=True, eq=False)
class Revision:
    """What was expected at T′ steps of an episode, and what the next w steps made of it.

    All of it is in discounted reward as of the step itself, and component 0 after is the reward
    that came.

    Args:
        steps: `[T′]`, in order.
        last: `[T′]`, the last of the steps that component 0 covers: w − 1 later, or the end.
        ended: `[T′]`, whether the future ended with it.
        before: `[T′, N+1]`, what was predicted of the action taken.
        after: `[T′, N+1]`, what the law makes of the reward that came and of what is expected then.
    """

    steps: IntArray
    last: IntArray
    ended: BoolArray
    before: FloatArray
    after: FloatArray

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def change(self) -> FloatArray:
        """`[T′, N+1]`: after − before; the sum of a row is the TD error of its step."""
        return self.after - self.before


def revise(episode: Episode) -> Revision:
    """Returns what each step changed in what was expected.

    With r the discounted reward of the next w steps and n what is expected at t + w, before is the
    prediction p(t) of the action taken, and after is `target(r, γ^w·g, n)`; g = 0 where an end came
    in between, else 1. After − before is zero on average if p(t) is right. So is every single one
    where there is no chance.

    A step is left out where a truncation cut its w steps short, for a shortened window would
    misalign every component (errata C3), and where one of them but the first was random.
    """
    axis, total, far = episode.time_axis, len(episode), np.iinfo(np.int64).max
    t, within = np.arange(total), np.arange(axis.width)
    end = next_flag(episode.ends, far)  # [T]
    last = np.minimum(end, t + axis.width - 1)
    random = next_flag(np.append(episode.random, False), far)[1 : total + 1]  # [T], after t
    steps = np.flatnonzero((last < total) & (random > last))  # [T′]
    last, ended = last[steps], end[steps] <= last[steps]

    ahead = steps[:, None] + within  # [T′, w]
    padded = np.append(episode.rewards, np.zeros(axis.width - 1))
    rewards = np.where(ahead <= last[:, None], padded[ahead], 0.0)
    discounts = float(axis.gamma) ** within
    after = target(
        rewards @ discounts,
        np.where(ended, 0.0, float(axis.gamma) ** axis.width),
        episode.expected[last + 1].astype(np.float64),
    )
    before = episode.predicted[steps].astype(np.float64)
    return Revision(steps, last, ended, before, after)
