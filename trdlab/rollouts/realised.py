"""What followed: the rewards that came after each step, on the time axis of the predictions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.rollouts.episodes import Episode


@dataclass(frozen=True, eq=False)
class Samples:
    """Predictions, each with what followed it; M of them, from E episodes.

    Args:
        time_axis: what the components mean.
        predicted: `[M, N+1]`, in discounted reward.
        observed: `[M, N+1]`, in discounted reward; 0 where it is not known.
        known: `[M, N+1]`, whether what followed is known.
        episode: `[M]`, the number of the episode of each, in order.
        num_episodes: E.
    """

    time_axis: TimeAxis
    predicted: FloatArray
    observed: FloatArray
    known: BoolArray
    episode: IntArray
    num_episodes: int

    def __len__(self) -> int:
        return len(self.predicted)

    def per_episode(self, values: FloatArray, every: int = 1) -> FloatArray:
        """Returns `[E, ...]`: the sums by episode of `values [M/every, ...]`, of one in `every`."""
        sums = np.zeros((self.num_episodes, *values.shape[1:]))
        there, starts = np.unique(self.episode[::every], return_index=True)
        sums[there] = np.add.reduceat(values, starts, axis=0)
        return sums


def what_followed(episode: Episode) -> tuple[FloatArray, BoolArray]:
    """Returns `[T, N+1]` twice: the discounted reward that came, and where that is known.

    With w = 1, component k of step t is γ^k·R_(t+k); a group is the sum of its steps, and the
    residual is what came later. After an end they are exactly zero. Not known is

    - what a truncation cut off, and in an episode with a `time_limit` every component that reaches
      beyond it, even where the episode ended in time: otherwise, of the last steps only those that
      ended would count, and an end would look likelier than it is;
    - what came after a random action, which the prediction does not speak of;
    - the residual, unless the episode came to an end; with ε > 0 it is never known. (Of several
      episodes it is known only if it is of all of their steps, see `pool`.)
    """
    axis, total, far = episode.time_axis, len(episode), np.iinfo(np.int64).max
    starts, end = np.arange(total), next_flag(episode.ends, far)  # [T], after which nothing comes
    padded = np.append(episode.rewards, np.zeros(axis.num_steps))
    windows = np.lib.stride_tricks.sliding_window_view(padded, axis.num_steps)[:total]
    alive = starts[:, None] + np.arange(axis.num_steps) <= end[:, None]  # [T, N·w]
    later = np.append(returns(episode, axis.gamma), np.zeros(axis.num_steps))[axis.num_steps :]
    residual = np.where(starts + axis.num_steps <= end, later * axis.gamma**axis.num_steps, 0.0)
    random = _next_random(episode)
    until = np.where(end < far, random, np.minimum(random, total))
    if episode.time_limit is not None:
        until = np.minimum(until, episode.time_limit)
    whole = (end < far) & (episode.epsilon == 0.0)
    return on_axis(axis, np.where(alive, windows, 0.0), residual, until - starts, whole)


def on_axis(
    axis: TimeAxis, rewards: FloatArray, residual: FloatArray, until: IntArray, whole: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Returns `[B, N+1]` twice: what came in each component, 0 if not known; and if it is known.

    Args:
        axis: γ, N and w.
        rewards: `[B, N·w]`, one for each step.
        residual: `[B]`, what came later, discounted.
        until: `[B]`, for how many steps it is known what comes of the policy.
        whole: `[B]`, whether all that came later is known.
    """
    paid = rewards * axis.gamma ** np.arange(axis.num_steps)
    explicit = paid.reshape(len(rewards), axis.horizon, axis.width).sum(axis=2)
    reach = axis.width * np.arange(1, axis.num_components)  # [N], where each is over
    known = np.column_stack([reach <= until[:, None], whole])
    return np.where(known, np.column_stack([explicit, residual]), 0.0), known


def pool(episodes: Sequence[Episode]) -> Samples:
    """Returns every step of some episodes as a sample.

    Where the residual of some step is not known, it counts as known of none: the others are those
    that ended early, from which nothing can be told of those that went on.

    Raises:
        InputError: there are no episodes, or they are of different time axes.
    """
    time_axis = common_axis(episodes)
    observed, known = map(np.concatenate, zip(*map(what_followed, episodes), strict=True))
    known[:, -1] &= known[:, -1].all()
    return Samples(
        time_axis=time_axis,
        predicted=np.concatenate([episode.predicted for episode in episodes]).astype(np.float64),
        observed=observed,
        known=known,
        episode=np.repeat(np.arange(len(episodes)), [len(episode) for episode in episodes]),
        num_episodes=len(episodes),
    )


def common_axis(episodes: Sequence[Episode]) -> TimeAxis:
    """Returns the time axis of some episodes.

    Raises:
        InputError: there are no episodes, or they are of different time axes.
    """
    axes = {episode.time_axis for episode in episodes}
    if len(axes) != 1:
        raise InputError(
            f"There are {len(episodes)} episodes on {len(axes)} time axes.",
            "Give one episode or more, all of one estimator.",
        )
    return axes.pop()


def next_flag(flags: BoolArray, nowhere: int) -> IntArray:
    """Returns, for each place, the first flag there or later; `nowhere` where none comes."""
    places = np.where(flags, np.arange(len(flags)), nowhere)
    return np.asarray(np.minimum.accumulate(places[::-1])[::-1])


def windows(episode: Episode, *, fair: bool = False) -> tuple[IntArray, IntArray, BoolArray]:
    """Returns `[K]` thrice: steps, the last of the w from each, and whether an end came by then.

    A step is left out where a truncation cut its w steps short, for a shortened window would
    misalign every component (errata C3), and where one of them but the first was random.

    Args:
        episode: of T steps.
        fair: whether a step is left out also where that would have been so, had no end come.
            Otherwise, of the last steps only those that ended would count.
    """
    width, total, far = episode.time_axis.width, len(episode), np.iinfo(np.int64).max
    t, random = np.arange(total), _next_random(episode)
    end = next_flag(episode.ends, far)  # [T]
    last = np.minimum(end, t + width - 1)
    usable = (last < total) & (random > last)
    if fair:
        limit = far if episode.time_limit is None else episode.time_limit
        usable &= t + width <= np.minimum(random, limit)
    return t[usable], last[usable], (end <= last)[usable]


def _next_random(episode: Episode) -> IntArray:
    """Returns `[T]`: the first random action after each step."""
    nowhere = np.iinfo(np.int64).max
    return next_flag(np.append(episode.random, False), nowhere)[1 : len(episode) + 1]


def returns(
    episode: Episode, gamma: float | FloatArray, beyond: float | FloatArray = 0.0
) -> FloatArray:
    """Returns `[T, ...]`: the discounted reward from each step on, up to the next end.

    Args:
        episode: of T steps.
        gamma: `[...]`, one discount factor or several.
        beyond: what counts for all that would have come, where an episode was cut off.
    """
    found, ahead = np.zeros((len(episode), *np.shape(gamma))), beyond
    for step in reversed(range(len(episode))):
        ahead = episode.rewards[step] + (0.0 if episode.ends[step] else gamma * ahead)
        found[step] = ahead
    return found
