"""The states that two agents came to, and what each of them expects there."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trdlab.agents.agent import Agent
from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.policies import acting, ask, greedy
from trdlab.rollouts.playing import Playing, Progress, Watch, unwatched

_ROUNDING = 1e-9  # of the largest component; what differs by less is the same
_BATCH = 256
_PHASES = 2**20


@dataclass(frozen=True, eq=False)
class Visits:
    """What two estimators expect at the same M states, on one time axis.

    Args:
        time_axis: what the components mean.
        components: `[2, M, A, N+1]`, in discounted reward; 0 of an action that is forbidden.
        probabilities: `[2, M, A]`, of each action under the policy of each.
        player: `[M]`, 0 or 1: in whose episode the state is.
        seed: `[M]`, of that episode.
        step: `[M]`, how many steps had been taken in it.
        different: how many different episodes the states are from.
        cut: how many episodes were not played to their end.
        allowed: `[M, A]`, which actions can be taken; by default all.
    """

    time_axis: TimeAxis
    components: FloatArray
    probabilities: FloatArray
    player: IntArray
    seed: IntArray
    step: IntArray
    different: int
    cut: int = 0
    allowed: BoolArray | bool = True

    def __len__(self) -> int:
        return len(self.player)

    @cached_property
    def expected(self) -> FloatArray:
        """`[2, M, N+1]`: what each expects of what it would do itself."""
        return np.asarray((self.probabilities[..., None, :] @ self.components)[..., 0, :])

    @cached_property
    def actions(self) -> IntArray:
        """`[2, M]`: what each would most likely do."""
        return np.asarray(self.probabilities.argmax(axis=-1))

    @cached_property
    def difference(self) -> FloatArray:
        """`[M, N+1]`: the second's expectation minus the first's, each of its own action."""
        return self._without_rounding(self.expected[1] - self.expected[0])

    @cached_property
    def of_any_action(self) -> FloatArray:
        """`[M, N+1]`: how far apart the two are of one action, on average over the allowed ones."""
        apart = np.abs(self._without_rounding(self.components[1] - self.components[0]))
        allowed = np.broadcast_to(self.allowed, apart.shape[:2])  # [M, A]
        return np.asarray(apart.sum(axis=1) / allowed.sum(axis=1, keepdims=True))

    @cached_property
    def apart(self) -> FloatArray:
        """`[M]`: how far apart the two are, over all components of what each would do."""
        return np.asarray(np.abs(self.difference).sum(axis=-1))

    def furthest(self, count: int) -> list[int]:
        """Returns the states at which the two are furthest apart, no two of them much alike.

        Alike are two whose differences are closer to each other than half of the smaller one.
        """
        found: list[int] = []
        share = self.apart / (self.apart.max(initial=0.0) or 1.0)
        share = np.round(share / _ROUNDING)  # so that rounding does not put them in order
        for m in np.argsort(-share, kind="stable"):
            if len(found) == count or not share[m]:
                break
            others = np.abs(self.difference[found] - self.difference[m]).sum(axis=-1)
            if (others > (0.5 + _ROUNDING) * self.apart[m]).all():
                found.append(int(m))
        return found

    @cached_property
    def least(self) -> float:
        """The least difference that is more than rounding."""
        return _ROUNDING * float(np.abs(self.components).max(initial=0.0))

    def _without_rounding(self, difference: FloatArray) -> FloatArray:
        return np.where(np.abs(difference) <= self.least, 0.0, difference)


def visit(
    players: tuple[Agent, Agent],
    *,
    episodes: int,
    seed: int = 0,
    most_states: int,
    max_steps: int | None = None,
    watch: Watch = unwatched,
) -> Visits:
    """Plays episodes of two agents, and asks both what they expect at the states of them all.

    As many states are kept of the one's episodes as of the other's: who gets stuck and goes on and
    on would else have the say.

    Args:
        players: the two; they see and do the same.
        episodes: how many each plays, with the seeds from `seed` on.
        seed: of the first episode, and of the choice of states.
        most_states: how many states are kept at most, evenly spaced over all episodes.
        max_steps: after which an episode is cut off, if not before.
        watch: told how far the episodes are, after every step.
    """
    rng, different, cut = np.random.default_rng(seed), set(), 0
    kept = _Kept(most_states // 2), _Kept(most_states // 2)
    for player in range(2):
        for own in range(seed, seed + episodes):
            done, phase = player * episodes + own - seed, int(rng.integers(_PHASES))
            told = blake2b()
            for seen, happened, is_cut in _played(players, player, own, max_steps):
                kept[player].offer(phase + seen.step, seen)
                told.update(seen.observation.tobytes() + happened)
                cut += is_cut
                watch(Progress("episodes to compare at", done, 2 * episodes, seen.step))
            different.add(told.digest())
    count = min(len(of.found) for of in kept)
    found = [item for of in kept for item in of.evenly(count)]
    axis = players[0].estimator.time_axis.shared(players[1].estimator.time_axis)
    components, probabilities = zip(
        *(_decided(agent, i, found, axis) for i, agent in enumerate(players)), strict=True
    )
    masks = [seen.allowed for seen in found if seen.allowed is not None]
    allowed = np.concatenate(masks) if masks else True
    return Visits(
        time_axis=axis,
        components=np.where(np.asarray(allowed)[..., None], np.stack(components), 0.0),
        probabilities=np.stack(probabilities),
        player=np.array([seen.player for seen in found]),
        seed=np.array([seen.seed for seen in found]),
        step=np.array([seen.step for seen in found]),
        different=len(different),
        cut=cut,
        allowed=allowed,
    )


@dataclass(frozen=True, eq=False)
class _Seen:
    """An observation, in whose episode it was made and where, and what the two would do there."""

    player: int
    seed: int
    step: int
    observation: NDArray[Any]
    probabilities: tuple[FloatArray | None, ...]  # [1, A] each; None of who can be asked later
    allowed: BoolArray | None  # [1, A], which actions can be taken; None where all can be


class _Kept:
    """Observations, evenly spaced over all that were offered: every 2^k-th of each episode."""

    def __init__(self, most: int) -> None:
        self.most, self.every = most, 1
        self.found: list[tuple[int, _Seen]] = []

    def offer(self, tick: int, seen: _Seen) -> None:
        if tick % self.every == 0:
            self.found.append((tick, seen))
        if len(self.found) > self.most:
            self.every *= 2
            self.found = [(tick, seen) for tick, seen in self.found if tick % self.every == 0]

    def evenly(self, count: int) -> list[_Seen]:
        """Returns so many of them, evenly spaced."""
        which = np.linspace(0, len(self.found) - 1, count).round().astype(np.int64)
        return [self.found[i][1] for i in which]


def _played(
    players: tuple[Agent, Agent], player: int, seed: int, max_steps: int | None
) -> Iterator[tuple[_Seen, bytes, bool]]:
    """Yields what was seen at each step of an episode, what was done and paid, and if it was cut.

    It is played just as it is explained, so that each of its steps can be. The other one looks on,
    and is asked at every step if it may remember what came before.
    """
    agent, other, memory = players[player], players[1 - player].policy, None
    with closing(agent.make(1, seed)) as environments:
        policy, rng = acting(agent.policy or agent.estimator), np.random.default_rng(seed)
        playing = Playing(None, environments, rng, policy=policy, max_steps=max_steps)
        while playing.running[0]:
            at, observation = playing.steps, np.array(playing.stack.observations)  # [1, ...]
            turn, likely = playing.turn(), None
            if other is not None:
                begins = np.array([at == 0])
                seen_by = playing.shown(other)
                likely, memory = ask(other, seen_by, memory, begins, playing.allowed)
            told = (turn.probabilities, likely)[:: 1 if player == 0 else -1]
            allowed = None if playing.allowed is None else playing.allowed.copy()
            seen = _Seen(player, seed, at, observation[0], told, allowed)
            step = playing.take(turn.actions)
            is_cut = bool(playing.finished[0] and not step.ended[0])
            yield seen, turn.actions.tobytes() + step.rewards.tobytes(), is_cut


def _decided(
    agent: Agent, number: int, found: Sequence[_Seen], axis: TimeAxis
) -> tuple[FloatArray, FloatArray]:
    """Returns components `[M, A, N+1]` on an axis, and probabilities `[M, A]`."""
    batches = [
        agent.estimator.decompose(np.stack([seen.observation for seen in found[i : i + _BATCH]]))
        for i in range(0, len(found), _BATCH)
    ]
    told = [seen.probabilities[number] for seen in found]
    masks = [seen.allowed for seen in found if seen.allowed is not None]
    values = np.concatenate([batch.value for batch in batches])
    likely = (
        greedy(values, np.concatenate(masks) if masks else None)
        if agent.policy is None
        else np.concatenate([row for row in told if row is not None])
    )
    components = np.concatenate([batch.on(axis).components for batch in batches])
    return components.astype(np.float64), likely.astype(np.float64)
