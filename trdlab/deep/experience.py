"""Experience: what a frozen policy saw, did and was paid, some of its actions forced."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.deep.episode_log import EpisodeLog
from trdlab.deep.memory import available_memory
from trdlab.environments import Environments, NotParallel
from trdlab.environments.batches import Make
from trdlab.environments.outcomes import Outcomes
from trdlab.environments.protocol import Padding
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Future
from trdlab.policies import Policy
from trdlab.rollouts.playing import Playing, any_actions
from trdlab.rollouts.realised import next_flag
from trdlab.time_axis import TimeAxis

Look = Callable[[Any], NDArray[Any]]
"""Returns what is kept of observations `[B, ...]`: `[B, F]`."""

FAR = int(np.iinfo(np.int64).max)
_NEVER = 2**40  # steps: no episode is so long


@dataclass(frozen=True, eq=False)
class Experience:
    """Episodes one after another, in M rows; the last row of each is what was seen after it.

    Args:
        frames: `[M, ...]`, the newest of what was seen.
        probabilities: `[M, A]`, of each action under the policy.
        actions: `[M]`; of no moment in a last row, nor are the rewards.
        forced: `[M]`, whether the action was forced.
        rewards: `[M]`, as the future counts them.
        outcomes: `[M, Q]`, what else is forecast, in numbers.
        ends: `[M]`, whether nothing is left to come after a step.
        until: `[M]`, the number of the row after each at which the policy would act no more, had
            the episode gone on for so long: at which another action is forced, or the time is up.
            It can lie beyond the last row, so that what is left out because of it does not depend
            on whether an episode had ended by then.
        last: `[M]`, the number of the last row of the same episode.
        stack: how many frames an observation holds; None where it is one frame.
        padding: what stands in a stack before the first frame (see `ReplayBuffer`).
    """

    frames: NDArray[Any]
    probabilities: FloatArray
    actions: IntArray
    forced: BoolArray
    rewards: FloatArray
    outcomes: FloatArray
    ends: BoolArray
    until: IntArray
    last: IntArray
    stack: int | None = None
    padding: Padding = "reset"

    def __len__(self) -> int:
        return len(self.actions)

    @cached_property
    def steps(self) -> IntArray:
        """The rows in which something was done."""
        return np.flatnonzero(np.arange(len(self)) < self.last)

    @cached_property
    def columns(self) -> dict[str, NDArray[Any]]:
        """Its arrays, by name."""
        return {name: of for name, of in vars(self).items() if name in _COLUMNS}

    def seen(self, rows: IntArray) -> NDArray[Any]:
        """Returns the observations in some rows: `[K, ...]`, or stacks `[K, k, ...]`."""
        if self.stack is None:
            return self.frames[rows]
        first = np.searchsorted(self.last, self.last[rows])[:, None]  # [K, 1], rows
        at = rows[:, None] - np.arange(self.stack)[::-1]  # [K, k]
        stacks: NDArray[Any] = self.frames[np.maximum(at, first)]
        if self.padding == "zero":
            stacks[at < first] = 0
        return stacks

    @cached_property
    def next_end(self) -> IntArray:
        """`[M]`: the next step after which nothing is left to come; `FAR` if none is known."""
        return next_flag(self.ends, FAR)

    def ahead(
        self, rows: IntArray, axis: TimeAxis, groups: FloatArray, most: int | None = None
    ) -> "Ahead":
        """Returns what followed some steps, as far as the policy itself acted after the first.

        Args:
            rows: `[K]`, the numbers of the steps.
            axis: γ, N and w.
            groups: `[M, C]`, what the w steps from each row on brought, in C channels.
            most: after how many components it is not looked any further; by default after N, or
                after one where N = 0.
        """
        w, reach = axis.width, max(axis.horizon, 1)
        most = reach if most is None else min(most, reach)
        end, last, until = self.next_end[rows], self.last[rows], self.until[rows]  # [K] each
        own = (until - rows) // w  # [K], groups; an end in the part of one counts as little as
        over = (end < last) & (end < rows + np.minimum(own, most) * w)  # [K], going on would
        whole = np.minimum((last - rows) // w, most)  # [K]
        span = np.where(over, reach, np.minimum(own, whole))  # [K]
        told = np.where(over, end + 1 - rows, span * w)[:, None]  # [K, 1], steps
        steps = w * np.arange(reach)
        discounts = np.where(steps < told, axis.gamma**steps, 0.0)  # [K, L]
        padded = np.concatenate([groups, np.zeros((reach * w, groups.shape[1]), groups.dtype)])
        windows = sliding_window_view(padded.T, reach * w, axis=1)[..., ::w]  # [C, M+1, L]
        came = windows[:, rows] * discounts.astype(groups.dtype)  # [C, K, L]
        follows = np.minimum(rows + span * w, last)
        return Ahead(came.swapaxes(0, 1), span, over, follows, own)


_COLUMNS = [of.name for of in fields(Experience) if of.name not in ("stack", "padding")]


@dataclass(frozen=True, eq=False)
class Ahead:
    """What followed K steps, in C channels and L groups of w: N of them, or one where N = 0.

    Args:
        came: `[K, C, L]`, what came in each, discounted; 0 from `span` on.
        span: `[K]`, of how many that is known.
        over: `[K]`, whether nothing is left to come after that; `span` is L then.
        follows: `[K]`, the row at which all that is not known is still to come.
        own: `[K]`, for how many groups the policy acts, were the episode to go on.
    """

    came: FloatArray
    span: IntArray
    over: BoolArray
    follows: IntArray
    own: IntArray

    def known(self, axis: TimeAxis) -> BoolArray:
        """Returns `[K, N]`: what is known without any expectation of what is still to come.

        Of steps at which others acted later nothing is known of that, even where the episode had
        ended by then: it would look likelier to end than it is.
        """
        own = np.minimum(self.span, self.own)[:, None]
        return np.asarray(np.arange(axis.horizon) < own)

    def target(
        self, axis: TimeAxis, following: FloatArray, which: IntArray | None = None
    ) -> FloatArray:
        """Returns the components `[K, C, N+1]`: what came, and from there on what is expected.

        It is the law, applied as often as there are components that are known.

        Args:
            axis: γ, N and w.
            following: `[U, C, N+1]`, what is expected in rows that follow, of the policy's action.
            which: `[K]`, which of them follows each step; by default there is one for each.

        >>> one = np.array([1])
        >>> ahead = Ahead(np.array([[[1.0, 0.0]]]), one, np.array([False]), one, one)
        >>> ahead.target(TimeAxis(0.5, 2), np.array([[[2.0, 4.0, 6.0]]]))
        array([[[1., 1., 5.]]])
        """
        horizon, which = axis.horizon, np.arange(len(self.span)) if which is None else which
        left = np.where(self.over, 0.0, axis.gamma ** (axis.width * self.span))
        discount = left.astype(self.came.dtype)[:, None, None]  # [K, 1, 1]
        skipped = np.maximum(horizon - self.span, 0)  # [K]
        later = following[..., ::-1].cumsum(axis=2)[..., ::-1]  # [U, C, N+1], from each one on
        target = np.empty((*self.came.shape[:2], horizon + 1), dtype=self.came.dtype)
        target[..., horizon] = discount[..., 0] * later[which, :, skipped]
        target[..., horizon] += self.came[..., horizon:].sum(axis=2)
        if horizon:
            nothing = np.zeros((*following.shape[:2], horizon), dtype=following.dtype)
            padded = np.concatenate([nothing, following[..., :horizon]], axis=2)  # [U, C, 2N]
            moved = sliding_window_view(padded, horizon, axis=2)  # [U, C, N+1, N]
            target[..., :horizon] = self.came[..., :horizon]
            target[..., :horizon] += discount * moved[which, :, skipped]
        return target


def gather(
    make: Make,
    policy: Policy,
    future: Future,
    *,
    steps: int,
    share: float,
    pause: int = 0,
    num_envs: int | None = None,
    max_steps: int | None = None,
    seed: int = 0,
    outcomes: Outcomes | None = None,
    look: Look | None = None,
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
        num_envs: how many episodes are played beside each other; by default one for every 1,000
            steps, from 16 to 64.
        max_steps: after which an episode is cut off.
        seed: of everything.
        outcomes: what else is read of each step.
        look: what is kept of observations `[B, ...]`, `[B, F]`; by default they themselves.
        tell: told how many steps have been taken, now and then.

    Raises:
        InputError: there is no step, the share is outside [0, 1], or an outcome is no number or
            was never there.
        TrdlabError: so many steps do not fit into what is free.
    """
    if steps < 1 or not 0.0 <= share <= 1.0:
        raise InputError(
            f"There are {steps} steps, and a share of {share} is forced.",
            "Ask for at least 1 step, and a share from 0 to 1.",
        )
    rng, taken, due, parts = np.random.default_rng(seed), 0, 1, list[Experience]()
    read = outcomes or Outcomes()

    def watch(more: int, held: int) -> None:
        nonlocal due
        if not parts and more >= due:  # soon, and then ever less often
            due = 2 * more
            _check_memory(held, more, steps)
        tell(taken + more)

    while taken < steps:
        own = int(np.random.SeedSequence([seed, len(parts)]).generate_state(1)[0] >> 1)
        with closing(_some(make, num_envs or _beside(steps), own)) as environments:
            playing = Playing(None, environments, rng, policy=policy, max_steps=max_steps)
            some = _played(
                playing, future, share, pause, rng, read, look, steps=steps - taken, tell=watch
            )
        parts.append(some)
        taken += len(parts[-1].steps)
    read.check_seen()
    if len(parts) == 1:
        return parts[0]
    starts = np.repeat(np.cumsum([0, *map(len, parts[:-1])]), [len(part) for part in parts])
    columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in _COLUMNS}
    moved = {name: columns[name] + starts for name in ("until", "last")}
    return replace(parts[0], **columns | moved)


def _check_memory(held: int, taken: int, steps: int) -> None:
    """Refuses more steps than fit, by the bytes that those taken hold; they are copied once."""
    free, each = available_memory(), 2 * held / taken
    if free is not None and each * steps > 0.9 * (free + held):
        fits = int(0.9 * (free + held) / each)
        raise TrdlabError(
            f"{steps:,} steps take about {each * steps / 1e9:.2f} GB, and {free / 1e9:.2f} GB is "
            "free.",
            f"Play at most {fits:,}, or free some memory.",
        )


def _beside(steps: int) -> int:
    """Returns how many episodes to play beside each other, for so many steps of all.

    More of them share what a step costs beside the environments, and play more when there is
    enough: the last episodes are played to their end.
    """
    return min(max(16, steps // 1_000), 64)


def _some(make: Make, num_envs: int, seed: int) -> Environments:
    """Returns so many environments, or one where there can be but one."""
    try:
        return make(num_envs, seed)
    except NotParallel:
        return make(1, seed)


def _played(
    playing: Playing,
    future: Future,
    share: float,
    pause: int,
    rng: np.random.Generator,
    outcomes: Outcomes,
    look: Look | None,
    *,
    steps: int,
    tell: Callable[[int, int], None],
) -> Experience:
    """Plays until so many steps are taken, or an episode is cut off, and all to their end."""
    count, num_actions = len(playing.running), playing.environments.num_actions
    log, taken = EpisodeLog(count), 0
    free = np.zeros(count, dtype=np.int64)  # [B], from which step on an action may be forced
    while playing.running.any():
        running, ages, turn = playing.running, playing.ages, playing.turn()
        which = np.flatnonzero(running)
        rows = slice(None) if len(which) == count else which  # views take less time than copies
        stack = playing.stack
        # a copy: what is seen changes with the step
        seen = look(stack.observations[which]) if look else stack.newest[which]
        forced = running & (rng.random(count) < share) & (ages >= free)
        free = np.where(forced, ages + 1 + pause, free)
        others = any_actions(rng, count, num_actions, playing.allowed)
        actions = np.where(forced, others, turn.own)
        taken += len(which)
        step = playing.take(actions, play_on=taken < steps and len(which) == count)
        ends = future.ends(step.terminated, step.truncated, step.life_lost)
        read = outcomes.read(actions, step, which)  # [R, Q]
        paid, done = future.count(step.rewards)[rows], (actions[rows], forced[rows])
        log.add(which, seen, turn.probabilities, *done, paid, read, ends[rows])
        if playing.finished.any():
            over = np.flatnonzero(playing.finished)
            none, nothing = np.zeros(len(over), dtype=np.bool_), np.zeros(len(over))
            ended = (none.astype(np.int64), none, nothing, np.zeros((len(over), read.shape[1])))
            whole, likely = playing.last_seen()
            newest = look(whole) if look else whole[:, -1] if playing.stack.size else whole
            log.add(over, newest, likely, *ended, none)
            wait = rng.geometric(share, len(over)) - 1 if share else np.full(len(over), _NEVER)
            coins = np.maximum(ages[over] + 1, free[over]) + wait
            log.end(over, coins, over[playing.running[over]])
            free[over] = 0
        tell(taken, log.held)
    columns, lengths, coin = log.in_order()
    last = np.repeat(lengths.cumsum() - 1, lengths)  # [M]
    first = np.repeat(lengths.cumsum() - lengths, lengths)  # [M]
    until = np.append(next_flag(columns[_COLUMNS.index("forced")], FAR)[1:], FAR)
    until = np.where(until < last, until, first + np.repeat(coin, lengths))
    own = None if future.time_limit_ends else playing.environments.time_limit
    limits = [limit for limit in (own, playing.max_steps) if limit is not None]
    until = np.minimum(until, first + min(limits, default=_NEVER))
    told: dict[str, Any] = dict(zip(_COLUMNS, (*columns, until, last), strict=True))
    size = None if look else playing.stack.size
    return Experience(**told, stack=size, padding=playing.stack.padding)
