"""Episodes: what an agent predicted at every step, and what then happened."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import Environments
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.policies import Policy, rows
from trdlab.policies.adapted import StateValues
from trdlab.rollouts.playing import Playing, Watch, unwatched


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of T steps, with what was predicted at each of them.

    Args:
        decomposition: `[T, A, N+1]`, of every action.
        expected: `[T+1, N+1]`, what is expected of the policy's own action (the mean, where it
            draws), at every observation from the first one to the true last one.
        actions: `[T]`.
        rewards: `[T]`, as the estimator counts them.
        life_lost: `[T]`, whether a life was lost and the episode went on.
        ends: `[T]`, whether nothing is left to come after a step, as the estimator's future says.
        terminated: whether the episode ended for good; otherwise it was truncated.
        random: `[T + N·w]`, whether the action was a random one instead of the policy's; also past
            the end, so that what is left out because of it does not depend on the length.
        epsilon: the chance of a random action.
        time_limit: the steps after which every such episode is truncated, if that is known.
        states: `[T+1]`, what was observed where that is one number: the state of a finite model.
        probabilities: `[T, A]`, how likely the policy took each action; None where nobody knows.
        critic: `[T]`, what the policy's own critic says that each state is worth; None where it has
            none.
    """

    decomposition: RewardDecomposition
    expected: FloatArray
    actions: IntArray
    rewards: FloatArray
    life_lost: BoolArray
    ends: BoolArray
    terminated: bool
    random: BoolArray
    epsilon: float = 0.0
    time_limit: int | None = None
    states: IntArray | None = None
    probabilities: FloatArray | None = None
    critic: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.decomposition.time_axis

    @property
    def predicted(self) -> FloatArray:
        """`[T, N+1]`: what was predicted of the actions taken."""
        return np.asarray(self.decomposition.components[np.arange(len(self)), self.actions])


class Recording:
    """Episodes that are written down as they are played, and can be paused at any step.

    Args:
        estimator: whose predictions are kept; its `future` says which rewards count, and what ends.
        environments: E of them; they are reset.
        policy: who acts, where that is not the estimator's greedy policy.
        epsilon: the chance of a random action instead. What follows one is not held against what
            was predicted before it.
        max_steps: after which an episode is truncated, if not before, as by an environment's limit.
        seed: of the actions.

    Attributes:
        playing: where the episodes stand.

    Raises:
        InputError: ε is outside [0, 1), or there is not a single step.
    """

    def __init__(
        self,
        estimator: Estimator,
        environments: Environments,
        *,
        policy: Policy | None = None,
        epsilon: float = 0.0,
        max_steps: int | None = None,
        seed: int = 0,
    ) -> None:
        if not 0.0 <= epsilon < 1.0:
            raise InputError(f"ε is {epsilon}.", "It must be at least 0 and less than 1.")
        self._estimator, self._epsilon = estimator, epsilon
        self._chance = np.random.default_rng([seed, 1])
        self.playing = Playing(
            estimator,
            environments,
            np.random.default_rng(seed),
            policy=policy,
            epsilon=epsilon,
            chance=self._chance,
            max_steps=max_steps,
        )
        count = environments.num_envs
        self._logs: list[list[tuple[Any, ...]]] = [[] for _ in range(count)]
        first = self.playing.stack.observations  # [B, ...]
        self._states = [[state] for state in first] if first.ndim == 1 else []
        self._last = np.zeros((count, estimator.time_axis.num_components))
        self._policy = policy
        self._critic: StateValues | None = getattr(policy, "state_values", None)
        self._memory, self._asked = None, np.arange(count)  # of the critic, and whose it is

    def play(
        self, until: int | None = None, *, watch: Watch = unwatched, what: str = "episodes"
    ) -> None:
        """Plays on to the ends of all episodes, or until so many steps have been taken.

        Args:
            until: the steps; by default there is no such limit.
            watch: told how far the episodes are, after every step.
            what: they are called then.
        """
        while self.playing.running.any() and self.playing.steps != until:
            self._take()
            watch(self.playing.progress(what))

    def play_to(self, step: int) -> None:
        """Plays the first episode to a step, at which it is paused.

        Raises:
            InputError: the episode is over by then, or the step is negative.
        """
        if step < 0:
            raise InputError(f"The step is {step}.", "Steps are counted from 0.")
        self.play(step)
        if not self.playing.running[0]:
            steps = len(self._logs[0])
            raise InputError(
                f"There is no step {step}: the episode is over after {steps} steps.",
                f"Choose a step from 0 to {steps - 1}.",
            )

    def _take(self) -> None:
        playing, future = self.playing, self._estimator.future
        running, decision, turn = playing.running, playing.decide(), playing.turn()
        values = self._criticise(decision.probabilities)
        step = playing.take(turn.actions)
        ends = future.ends(step.terminated, step.truncated, step.life_lost)
        told = (step.life_lost, ends, step.terminated, turn.random)
        happened = (turn.actions, future.count(step.rewards), *told, values)
        told_of = decision.decomposition.components, decision.expected, decision.probabilities
        seen = zip(*told_of, strict=True)
        for env, expectations in zip(np.flatnonzero(running), seen, strict=True):
            self._logs[env].append((*expectations, *(part[env] for part in happened)))
            if self._states:
                self._states[env].append(step.frames[env])
        if playing.finished.any():
            self._last[playing.finished] = playing.at_last().expected

    def _criticise(self, likely: FloatArray) -> FloatArray:
        """Returns what the critic says of the episodes that go on `[B]`; of no critic, NaN."""
        playing, values = self.playing, np.full(len(self._logs), np.nan)
        if self._critic is not None and self._policy is not None:
            memory = rows(self._memory, playing.running[self._asked])
            self._asked = np.flatnonzero(playing.running)
            seen, begins = playing.shown(self._policy), playing.steps == 0
            asked = seen, memory, np.full(len(self._asked), begins), likely
            values[self._asked], self._memory = self._critic(*asked)
        return values

    def episodes(self) -> tuple[Episode, ...]:
        """Returns the E episodes, once all of them are over, in the order of the environments."""
        axis, future = self._estimator.time_axis, self._estimator.future
        own = None if future.time_limit_ends else self.playing.environments.time_limit
        limits = [limit for limit in (own, self.playing.max_steps) if limit is not None]
        coins = self._chance.random((len(self._logs), axis.num_steps)) < self._epsilon  # [E, N·w]
        return tuple(
            self._episode(env, coins[env], min(limits, default=None)) for env in range(len(coins))
        )

    def _episode(self, env: int, coins: BoolArray, time_limit: int | None) -> Episode:
        """Returns the episode of an environment, of its log and of coins for past its end."""
        columns = [np.array(column) for column in zip(*self._logs[env], strict=True)]
        components, expected, probabilities, actions, rewards, *columns = columns
        life_lost, ends, terminated, random, critic = columns
        return Episode(
            decomposition=RewardDecomposition(components, self._estimator.time_axis),
            expected=np.concatenate([expected, self._last[env][None]]).astype(np.float64),
            actions=actions,
            rewards=rewards.astype(np.float64),
            life_lost=life_lost,
            ends=ends,
            terminated=bool(terminated[-1]),
            random=np.concatenate([random, coins]),
            epsilon=self._epsilon,
            time_limit=time_limit,
            states=np.array(self._states[env]) if self._states else None,
            probabilities=probabilities,
            critic=None if self._critic is None else critic,
        )


def collect(
    estimator: Estimator,
    environments: Environments,
    *,
    watch: Watch = unwatched,
    what: str = "episodes",
    **how: Any,
) -> tuple[Episode, ...]:
    """Plays one episode in each of E environments to its end, and returns them in that order.

    Args:
        estimator: whose predictions are kept.
        environments: E of them; they are reset.
        watch: told how far the episodes are, after every step.
        what: they are called then.
        how: as for `Recording`.

    Raises:
        InputError: ε is outside [0, 1), or there is not a single step.
    """
    recording = Recording(estimator, environments, **how)
    recording.play(watch=watch, what=what)
    return recording.episodes()


def distinct(episodes: Sequence[Episode]) -> tuple[Episode, ...]:
    """Returns the episodes that are not the same as one before."""
    found: dict[tuple[bytes, ...], Episode] = {}
    for e in episodes:
        found.setdefault((e.actions.tobytes(), e.rewards.tobytes(), e.expected.tobytes()), e)
    return tuple(found.values())
