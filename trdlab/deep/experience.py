"""Experience: what a frozen policy saw, did and was paid, some of its actions forced."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.environments.batches import Make
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.policies import Policy
from trdlab.rollouts.playing import Playing
from trdlab.time_axis import TimeAxis

FAR = int(np.iinfo(np.int64).max)


@dataclass(frozen=True, eq=False)
class Experience:
    """Episodes one after another, in M rows; the last row of each is what was seen after it.

    Args:
        observations: `[M, ...]`.
        probabilities: `[M, A]`, of each action under the policy.
        actions: `[M]`; of no moment in a last row, nor are the rewards.
        rewards: `[M]`, as the future counts them.
        ends: `[M]`, whether nothing is left to come after a step.
        forced: `[M]`, whether the action was forced, and not drawn from the policy.
        last: `[M]`, the number of the last row of the same episode.
    """

    observations: NDArray[Any]
    probabilities: FloatArray
    actions: IntArray
    rewards: FloatArray
    ends: BoolArray
    forced: BoolArray
    last: IntArray

    def __len__(self) -> int:
        return len(self.actions)

    @cached_property
    def steps(self) -> IntArray:
        """The rows in which something was done."""
        return np.flatnonzero(np.arange(len(self)) < self.last)

    @cached_property
    def _next_end(self) -> IntArray:
        """`[M]`: the next step after which nothing is left to come; `FAR` if none is known."""
        return _next(self.ends)

    @cached_property
    def _next_forced(self) -> IntArray:
        """`[M]`: the next forced action after each row."""
        return np.append(_next(self.forced)[1:], FAR)

    def ahead(self, rows: IntArray, axis: TimeAxis, most: int | None = None) -> "Ahead":
        """Returns what followed some steps, as far as the policy itself acted after the first.

        Args:
            rows: `[K]`, the numbers of the steps.
            axis: γ, N and w.
            most: after how many components it is not looked any further; by default after N, or
                after one where N = 0.
        """
        w, reach = axis.width, max(axis.horizon, 1)
        most = reach if most is None else min(most, reach)
        end, last = self._next_end[rows], self.last[rows]  # [K] each
        stop = np.minimum(self._next_forced[rows], last)  # [K], the first step not to be counted
        over = (end < stop) & (end < rows + most * w)  # [K]
        span = np.where(over, reach, np.minimum((stop - rows) // w, most))  # [K]
        steps = np.arange(reach * w)
        told = np.where(over, end + 1, rows + span * w)[:, None]  # [K, 1]
        at = rows[:, None] + steps  # [K, L·w]
        paid = np.where(at < told, self.rewards[np.minimum(at, last[:, None])], 0.0)
        paid *= axis.gamma**steps
        rewards = paid.reshape(len(rows), reach, w).sum(axis=2)  # [K, L]
        return Ahead(rewards, span, over, np.minimum(rows + span * w, last))


@dataclass(frozen=True, eq=False)
class Ahead:
    """What followed K steps, in L groups of w: N of them, or one where N = 0.

    Args:
        rewards: `[K, L]`, what came in each, discounted; 0 from `span` on.
        span: `[K]`, of how many that is known.
        over: `[K]`, whether nothing is left to come after that; `span` is L then.
        follows: `[K]`, the row at which all that is not known is still to come.
    """

    rewards: FloatArray
    span: IntArray
    over: BoolArray
    follows: IntArray

    def known(self, axis: TimeAxis) -> BoolArray:
        """Returns `[K, N+1]`: what is known without any expectation of what is still to come."""
        explicit = np.arange(axis.horizon) < self.span[:, None]
        return np.column_stack([explicit, self.over])

    def target(self, axis: TimeAxis, following: FloatArray) -> FloatArray:
        """Returns the components `[K, N+1]`: what came, and from there on what is expected.

        It is the law, applied as often as there are components that are known.

        Args:
            axis: γ, N and w.
            following: `[K, N+1]`, what is expected in the rows that follow, of the policy's action.

        >>> ahead = Ahead(np.array([[1.0, 0.0]]), np.array([1]), np.array([False]), np.array([1]))
        >>> ahead.target(TimeAxis(0.5, 2), np.array([[2.0, 4.0, 6.0]]))
        array([[1., 1., 5.]])
        """
        horizon, span = axis.horizon, self.span[:, None]  # [K, 1]
        discount = np.where(self.over, 0.0, axis.gamma ** (axis.width * self.span))[:, None]
        place = np.arange(horizon) - span  # [K, N]
        shifted = np.take_along_axis(following, np.maximum(place, 0), axis=1)
        explicit = np.where(place < 0, self.rewards[:, :horizon], discount * shifted)
        later = following[:, ::-1].cumsum(axis=1)[:, ::-1]  # [K, N+1], from each component on
        rest = np.take_along_axis(later, np.maximum(horizon - span, 0), axis=1)
        residual = self.rewards[:, horizon:].sum(axis=1, keepdims=True) + discount * rest
        return np.column_stack([explicit, residual])


def gather(
    make: Make,
    policy: Policy,
    future: Future,
    *,
    steps: int,
    share: float,
    pause: int = 0,
    num_envs: int = 16,
    max_steps: int | None = None,
    seed: int = 0,
    tell: Callable[[int], None] = lambda taken: None,
) -> Experience:
    """Plays episodes of a policy, with some of its actions forced, so that others are seen, too.

    Args:
        make: makes the environments.
        policy: who acts.
        future: which rewards count, and what ends.
        steps: how many are taken at least; the last episodes are played to their end.
        share: the chance that an action is forced: any of them, evenly.
        pause: for how many steps none is forced after that.
        num_envs: how many episodes are played beside each other.
        max_steps: after which an episode is cut off.
        seed: of everything.
        tell: told how many steps have been taken, now and then.

    Raises:
        InputError: there is no step, or the share is outside [0, 1].
    """
    if steps < 1 or not 0.0 <= share <= 1.0:
        raise InputError(
            f"There are {steps} steps, and a share of {share} is forced.",
            "Ask for at least 1 step, and a share from 0 to 1.",
        )
    rng, taken, batch, parts = np.random.default_rng(seed), 0, 0, list[Experience]()
    while taken < steps:
        own = int(np.random.SeedSequence([seed, batch]).generate_state(1)[0] >> 1)
        with closing(make(num_envs, own)) as environments:
            playing = Playing(None, environments, rng, policy=policy, max_steps=max_steps)
            parts.append(_played(playing, future, share, pause, rng))
        taken, batch = taken + len(parts[-1].steps), batch + 1
        tell(taken)
    starts = np.cumsum([0, *map(len, parts[:-1])])
    lasts = [part.last + start for part, start in zip(parts, starts, strict=True)]
    named = (of.name for of in fields(Experience) if of.name != "last")
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in named}
    return Experience(**columns, last=np.concatenate(lasts))


def _played(
    playing: Playing, future: Future, share: float, pause: int, rng: np.random.Generator
) -> Experience:
    """Plays one episode in each environment to its end."""
    count, num_actions = len(playing.running), playing.environments.num_actions
    log: list[tuple[Any, ...]] = []  # of some episodes a row each
    free = np.zeros(count, dtype=np.int64)  # [B], from which step on an action may be forced
    while playing.running.any():
        running, seen, turn = playing.running, playing.stack.observations, playing.turn()
        seen = seen[running]  # a copy: what is seen changes with the step
        forced = running & (rng.random(count) < share) & (playing.steps >= free)
        free = np.where(forced, playing.steps + 1 + pause, free)
        actions = np.where(forced, rng.integers(num_actions, size=count), turn.own)
        step = playing.take(actions)
        ends = future.ends(step.terminated, step.truncated, step.life_lost)
        told = (part[running] for part in (actions, future.count(step.rewards), ends, forced))
        log.append((np.flatnonzero(running), seen, turn.probabilities, *told))
        if playing.finished.any():
            over = np.flatnonzero(playing.finished)
            nothing = np.zeros(len(over))
            none = nothing > 0.0
            log.append((over, *playing.last_seen(), nothing.astype(np.int64), nothing, none, none))
    episode, *columns = (np.concatenate(column) for column in zip(*log, strict=True))
    order = np.argsort(episode, kind="stable")
    lengths = np.bincount(episode)
    last = np.repeat(lengths.cumsum() - 1, lengths)
    return Experience(*(*(column[order] for column in columns), last))


def _next(flags: BoolArray) -> IntArray:
    places = np.where(flags, np.arange(len(flags)), FAR)
    return np.asarray(np.minimum.accumulate(places[::-1])[::-1])
