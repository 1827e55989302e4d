"""Episodes: what an agent predicted at every step, and what then happened."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import Environments, Step
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError
from trdlab.estimator import Estimator

Policy = Callable[[Any], FloatArray]
"""From observations `[B, ...]` to action probabilities `[B, A]`."""


@dataclass(frozen=True)
class Counting:
    """Which rewards an estimator counts, and what ends its future; its `Future` says so in words.

    Args:
        clip_rewards: whether it counts the sign of each reward.
        life_loss_ends: whether its future ends where a life is lost.
    """

    clip_rewards: bool = False
    life_loss_ends: bool = False

    def count(self, rewards: FloatArray) -> FloatArray:
        """Returns rewards as they are counted."""
        return np.sign(rewards) if self.clip_rewards else rewards

    def ends(self, step: Step) -> BoolArray:
        """Returns `[B]`: where nothing is left to come after a step."""
        lost = step.life_lost & self.life_loss_ends
        return np.asarray(step.terminated | lost)


AS_PAID = Counting()
"""Rewards as the environment pays them, until the episode terminates."""


@dataclass(frozen=True, eq=False)
class Episode:
    """One episode of T steps, with what was predicted at each of them.

    Args:
        decomposition: `[T, A, N+1]`, of every action.
        expected: `[T+1, N+1]`, the components of the described policy's own action (their mean,
            where it draws), at every observation from the first one to the true last one.
        actions: `[T]`.
        rewards: `[T]`, as the estimator counts them.
        life_lost: `[T]`, whether a life was lost and the episode went on.
        ends: `[T]`, whether nothing is left to come after a step: the episode terminated, or a
            life was lost and that counts as an end.
        terminated: whether the episode ended for good; otherwise it was truncated.
        random: `[T + N·w]`, whether the action was a random one instead of the policy's. It goes
            on past the end as if there were more steps, so that what is left out because of it
            does not depend on how long the episode was.
        epsilon: the chance of a random action.
        time_limit: the steps after which every such episode is truncated, if that is known.
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


@dataclass(frozen=True, eq=False)
class Decision:
    """What an agent expects at B observations, and how likely it takes each action.

    Args:
        decomposition: `[B, A, N+1]`.
        probabilities: `[B, A]`.
    """

    decomposition: RewardDecomposition
    probabilities: FloatArray

    @property
    def expected(self) -> FloatArray:
        """`[B, N+1]`: the mean over the policy's actions."""
        weights = self.probabilities[:, None]  # [B, 1, A]
        return np.asarray((weights @ self.decomposition.components)[:, 0])

    def draw(self, rng: np.random.Generator) -> IntArray:
        """Returns `[B]`: an action of the policy each."""
        cumulative = self.probabilities.cumsum(axis=1)
        level = rng.random(len(cumulative)) * cumulative[:, -1]  # the last may not be quite 1
        return np.asarray((cumulative <= level[:, None]).sum(axis=1))


def decide(estimator: Estimator, observations: Any, policy: Policy | None = None) -> Decision:
    """Returns what an estimator expects, and what the policy it describes does.

    Args:
        estimator: whatever decomposes.
        observations: `[B, ...]`.
        policy: the given policy that the estimator describes; without one, the action of largest
            Σ components, of equals the first.
    """
    decomposition = estimator.decompose(observations)  # [B, A, N+1]
    if policy is not None:
        return Decision(decomposition, policy(observations))
    value = decomposition.value  # [B, A]
    greedy = value.argmax(axis=1)[:, None] == np.arange(value.shape[1])
    return Decision(decomposition, greedy.astype(value.dtype))


def collect(
    estimator: Estimator,
    environments: Environments,
    *,
    policy: Policy | None = None,
    counting: Counting = AS_PAID,
    epsilon: float = 0.0,
    seed: int = 0,
    on_episode: Callable[[int], None] = lambda finished: None,
) -> tuple[Episode, ...]:
    """Plays one episode in each environment, by the policy that the estimator describes.

    Args:
        estimator: whose predictions are kept.
        environments: E of them; they are reset.
        policy: what the estimator describes, where that is not its own greedy policy.
        counting: which rewards it counts, and what ends its future.
        epsilon: the chance of a random action instead. Random actions lead to more states; what
            follows one is not held against what was predicted before it.
        seed: of the actions; those of the policy are drawn as `play_to` draws them, so that with
            ε = 0 a lone episode is the same there.
        on_episode: called with the number of finished episodes whenever some finish.

    Returns:
        E episodes, in the order of the environments.

    Raises:
        InputError: ε is outside [0, 1).
    """
    if not 0.0 <= epsilon < 1.0:
        raise InputError(f"ε is {epsilon}.", "It must be at least 0 and less than 1.")
    rng, chance = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    count = environments.num_envs
    logs: list[list[tuple[Any, ...]]] = [[] for _ in range(count)]
    last, terminated = [np.zeros(0)] * count, np.zeros(count, dtype=np.bool_)
    stack = FrameStack(environments.reset(), environments.stack, environments.padding)
    running = np.ones(count, dtype=np.bool_)
    while running.any():
        decision = decide(estimator, stack.observations[running], policy)
        actions = np.zeros(count, dtype=np.int64)
        actions[running] = decision.draw(rng)
        random = running & (chance.random(count) < epsilon)
        actions[random] = chance.integers(environments.num_actions, size=int(random.sum()))
        step = environments.step(actions)
        happened = (actions, counting.count(step.rewards), step.life_lost, counting.ends(step))
        seen = zip(decision.decomposition.components, decision.expected, strict=True)
        for env, expectations in zip(np.flatnonzero(running), seen, strict=True):
            logs[env].append((*expectations, *(part[env] for part in happened), random[env]))
        finish = running & step.ended
        if finish.any():
            final = decide(estimator, last_observations(stack, step, finish), policy).expected
            for env, expected in zip(np.flatnonzero(finish), final, strict=True):
                last[env] = expected
            terminated |= finish & step.terminated
        stack.push(step.following, step.ended)
        running &= ~step.ended
        if finish.any():
            on_episode(int(count - running.sum()))
    coins = chance.random((count, estimator.time_axis.num_steps)) < epsilon  # [E, N·w]
    return tuple(
        _episode(
            log,
            last[env],
            coins[env],
            time_axis=estimator.time_axis,
            terminated=bool(terminated[env]),
            epsilon=epsilon,
            time_limit=environments.time_limit,
        )
        for env, log in enumerate(logs)
    )


def last_observations(stack: FrameStack, step: Step, where: BoolArray) -> Any:
    """Returns `[≤ B, ...]`: the true last observations of the episodes that end `where [B]`.

    Args:
        stack: what was seen before the step.
        step: what it led to.
        where: `[B]`.
    """
    frames = step.frames[where]
    if stack.size is None:
        return frames
    return np.concatenate([stack.frames[where, 1:], frames[:, None]], axis=1)


def _episode(
    log: list[tuple[Any, ...]],
    last: FloatArray,
    coins: BoolArray,
    *,
    time_axis: TimeAxis,
    **rest: Any,
) -> Episode:
    """Returns the episode of a log, of the last expectation `[N+1]` and coins for past its end."""
    columns = [np.stack(column) for column in zip(*log, strict=True)]
    components, expected, actions, rewards, life_lost, ends, random = columns
    return Episode(
        decomposition=RewardDecomposition(components, time_axis),
        expected=np.concatenate([expected, last[None]]).astype(np.float64),
        actions=actions,
        rewards=rewards.astype(np.float64),
        life_lost=life_lost,
        ends=ends,
        random=np.concatenate([random, coins]),
        **rest,
    )
