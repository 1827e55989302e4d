"""Episodes: what an agent predicted at every step, and what then happened."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.environments import Environments, Step
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.rollouts.playing import Playing, Policy, Progress, Watch, unwatched


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


def collect(
    estimator: Estimator,
    environments: Environments,
    *,
    policy: Policy | None = None,
    counting: Counting = AS_PAID,
    epsilon: float = 0.0,
    max_steps: int | None = None,
    seed: int = 0,
    watch: Watch = unwatched,
    what: str = "episodes",
) -> tuple[Episode, ...]:
    """Plays one episode in each environment, by the policy that the estimator describes.

    Args:
        estimator: whose predictions are kept.
        environments: E of them; they are reset.
        policy: what the estimator describes, where that is not its own greedy policy.
        counting: which rewards it counts, and what ends its future.
        epsilon: the chance of a random action instead. Random actions lead to more states; what
            follows one is not held against what was predicted before it.
        max_steps: after which an episode is truncated, if the environment has not ended it before;
            it is a `time_limit` like that of an environment.
        seed: of the actions; those of the policy are drawn as `play_to` draws them, so that with
            ε = 0 a lone episode is the same there.
        watch: told how far the episodes are, after every step.
        what: they are called then.

    Returns:
        E episodes, in the order of the environments.

    Raises:
        InputError: ε is outside [0, 1), or there is not a single step.
    """
    if not 0.0 <= epsilon < 1.0:
        raise InputError(f"ε is {epsilon}.", "It must be at least 0 and less than 1.")
    if max_steps is not None and max_steps < 1:
        raise InputError(f"Episodes have {max_steps} steps.", "Ask for at least 1.")
    rng, chance = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    count = environments.num_envs
    logs: list[list[tuple[Any, ...]]] = [[] for _ in range(count)]
    last, terminated = [np.zeros(0)] * count, np.zeros(count, dtype=np.bool_)
    playing = Playing(estimator, environments, rng, policy=policy, max_steps=max_steps)
    while playing.running.any():
        running = playing.running
        decision, actions = playing.decide()
        random = running & (chance.random(count) < epsilon)
        actions[random] = chance.integers(environments.num_actions, size=int(random.sum()))
        step = playing.take(actions)
        happened = (actions, counting.count(step.rewards), step.life_lost, counting.ends(step))
        seen = zip(decision.decomposition.components, decision.expected, strict=True)
        for env, expectations in zip(np.flatnonzero(running), seen, strict=True):
            logs[env].append((*expectations, *(part[env] for part in happened), random[env]))
        if playing.finished.any():
            final = playing.at_last().expected
            for env, expected in zip(np.flatnonzero(playing.finished), final, strict=True):
                last[env] = expected
            terminated |= playing.finished & step.terminated
        watch(Progress(what, int(count - playing.running.sum()), count, playing.steps))
    coins = chance.random((count, estimator.time_axis.num_steps)) < epsilon  # [E, N·w]
    limits = [x for x in (environments.time_limit, max_steps) if x is not None]
    return tuple(
        _episode(
            log,
            last[env],
            coins[env],
            time_axis=estimator.time_axis,
            terminated=bool(terminated[env]),
            epsilon=epsilon,
            time_limit=min(limits, default=None),
        )
        for env, log in enumerate(logs)
    )


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
