"""What an estimator says against the law on rollouts, and against the exact model."""

from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.bellman import target
from trdlab.decomposition import RewardDecomposition
from trdlab.errors import InputError
from trdlab.policies import Who
from trdlab.tabular import MDP, WindowBuilder, Windows, exact, from_environment
from trdlab.tabular.environments import start_distribution
from trdlab.tabular.reach import reachable
from trdlab.testing.asking import SAME, Asking, near_best, probabilities
from trdlab.testing.rollout import Rollout, play

_STEPS = 256  # of the rollout that the law is held against
_EPSILON = 0.25  # so that actions are seen that the policy does not take


@dataclass(frozen=True, eq=False)
class LawAudit:
    """What was said at s_t, less what the law makes of what was said at s_(t+w).

    Args:
        mean_error: `[N+1]`, over M windows of w steps, in discounted reward; NaN if M is 0.
        largest_error: `[N+1]`, the largest of their absolute errors; NaN if M is 0.
        windows: M.
        without_chance: whether windows in which chance decides were left out, by the model. Where
            there is no model they are not: then only the mean error should be near 0.

    Source: the paper's Eq. trd-loss (see `trdlab.bellman`).
    """

    mean_error: FloatArray
    largest_error: FloatArray
    windows: int
    without_chance: bool


@dataclass(frozen=True, eq=False)
class ExactAudit:
    """What was said of every state, less what is exactly right.

    Args:
        whose: the future that it is held against.
        states: `[M]`, those in which an episode can be that is not over.
        errors: `[M, A, N+1]`, in discounted reward.
        tied: how many states have actions of the same value whose components differ: the future
            held against is that of the first of them.
    """

    whose: str
    states: IntArray
    errors: FloatArray
    tied: int

    @property
    def largest_error(self) -> FloatArray:
        """`[N+1]`: of each component."""
        return np.asarray(np.abs(self.errors).max(axis=(0, 1)))

    @property
    def largest_value_error(self) -> float:
        """Of Σ components."""
        return float(np.abs(self.errors.sum(axis=-1)).max())


def audit_law(
    asking: Asking,
    env: gym.Env[Any, Any],
    policy: Who | None,
    mdp: MDP | None,
    *,
    seed: int,
) -> LawAudit:
    """Plays by the policy, one action in four at random, and holds each window against the law.

    Of a window the first action may be any. The others must be what the policy takes for certain,
    and where there is a model, no transition may be left to chance.
    """
    rng, axis = np.random.default_rng(seed), asking.time_axis

    def act(observation: Any) -> int:
        if rng.random() < _EPSILON:
            return int(rng.integers(asking.num_actions))
        now = asking.components([observation])  # [1, A, N+1]
        chance = probabilities(policy, asking.batch([observation]), now)[0]  # [A]
        return int(rng.choice(asking.num_actions, p=chance))

    rollout = play(env, act, _STEPS, seed)
    said = asking.components(rollout.observations)  # [T, A, N+1]
    chances = probabilities(policy, asking.batch(rollout.observations), said)  # [T, A]
    certain = chances[np.arange(len(rollout)), rollout.actions] == 1.0  # [T]
    ruled = _ruled_by_law(rollout, mdp)  # [T]
    windows = _windows(rollout, axis.width, axis.gamma, certain & ruled)
    windows = windows.where(windows.tail_greedy & ruled[windows.observations])
    if not len(windows):
        nothing = np.full(axis.num_components, np.nan)
        return LawAudit(nothing, nothing, 0, mdp is not None)
    last = [rollout.following[t] for t in windows.next_observations]
    following = asking.components(last)  # [M, A, N+1]
    weights = probabilities(policy, asking.batch(last), following)  # [M, A]
    expected = np.einsum("ma,mai->mi", weights, following)  # [M, N+1]
    lawful = target(windows.rewards, windows.discounts, expected)  # [M, N+1]
    errors = said[windows.observations, windows.actions] - lawful  # [M, N+1]
    largest = np.abs(errors).max(axis=0)
    return LawAudit(errors.mean(axis=0), largest, len(windows), mdp is not None)


def audit_exact(
    asking: Asking,
    env: gym.Env[Any, Any],
    policy: Who | None,
    mdp: MDP,
    reference: RewardDecomposition | None,
) -> ExactAudit:
    """Holds what is said of every state against the exact future of a policy, or a reference."""
    starts = start_distribution(env)
    begin = np.arange(mdp.num_states) == mdp.start
    states = np.flatnonzero(reachable(mdp, begin if starts is None else begin | (starts > 0.0)))
    said = asking.components(list(states))  # [M, A, N+1]
    if reference is not None:
        return ExactAudit("the given reference", states, said - reference[states].components, 0)
    table = np.eye(mdp.num_actions)[np.zeros(mdp.num_states, dtype=np.int64)]  # [S, A]
    table[states] = probabilities(policy, asking.batch(list(states)), said)
    truth = exact(mdp, asking.time_axis, policy=table).decomposition[states].components
    whose = "its own greedy policy" if policy is None else "the given policy"
    return ExactAudit(whose, states, said - truth, _tied(said) if policy is None else 0)


def matching_model(env: gym.Env[Any, Any], rollout: Rollout) -> tuple[MDP | None, str]:
    """Returns the exact model of an environment; or none, and the reason."""
    try:
        mdp = from_environment(env)
    except InputError as error:
        return None, error.cause
    space = env.observation_space
    if not isinstance(space, gym.spaces.Discrete) or (space.n, space.start) != (mdp.num_states, 0):
        return None, f"The observations are not the states of the model, but {space}."
    for step in range(len(rollout)):
        if not _is_possible(mdp, rollout, step):
            return None, (
                f"The model does not know what happened: action {rollout.actions[step]} in state "
                f"{rollout.observations[step]} led to {rollout.following[step]} with reward "
                f"{rollout.rewards[step]:g}. A wrapper may have changed it."
            )
    return mdp, ""


def _is_possible(mdp: MDP, rollout: Rollout, step: int) -> bool:
    row = int(rollout.observations[step]) * mdp.num_actions + int(rollout.actions[step])
    among = slice(mdp.offsets[row], mdp.offsets[row + 1])
    fits = (mdp.next_states[among] == rollout.following[step]) & (mdp.probabilities[among] > 0.0)
    fits &= mdp.terminated[among] == rollout.terminated[step]
    return bool(np.any(fits & np.isclose(mdp.rewards[among], rollout.rewards[step])))


def _ruled_by_law(rollout: Rollout, mdp: MDP | None) -> BoolArray:
    """Returns `[T]`: whether a step could not have turned out otherwise, as far as is known."""
    if mdp is None:
        return np.ones(len(rollout), dtype=np.bool_)
    possible = mdp.per_action((mdp.probabilities > 0.0).astype(np.float64))  # [S, A]
    alone: BoolArray = possible[np.array(rollout.observations), rollout.actions] == 1.0
    return alone


def _windows(rollout: Rollout, width: int, gamma: float, sure: BoolArray) -> Windows:
    """Returns the windows of a rollout; their observations are the numbers of its steps."""
    builder = WindowBuilder(width, gamma, num_envs=1)
    steps = np.arange(len(rollout))
    columns = (steps, rollout.actions, rollout.rewards, rollout.terminated, rollout.truncated)
    parts = [
        builder.add(*(column[t : t + 1] for column in (*columns, steps)), greedy=sure[t : t + 1])
        for t in steps
    ]
    return Windows(
        *(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Windows))
    )


def _tied(components: FloatArray) -> int:
    """Returns how many observations have near-best actions `[B, A, N+1]` that pay differently."""
    near = near_best(components)[..., None]  # [B, A, 1]
    high = np.where(near, components, -np.inf).max(axis=1)  # [B, N+1]
    low = np.where(near, components, np.inf).min(axis=1)
    slack = SAME * float(np.abs(components).max(initial=0.0))
    return int(np.count_nonzero((high - low > slack).any(axis=1)))
