"""What an exact model knows beyond the mean: how uncertain a reward is, and who is still alive.

The reward of a transition counts as certain once its next state is known: what varies inside
E[R | s, a, s′] is not in a model.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP
from trdlab.tabular.series import averaging
from trdlab.tabular.solve import evaluate
from trdlab.tabular.table import ExactTable

_ROUNDING = 1e-12  # of the second moment: a variance below is zero


@dataclass(frozen=True, eq=False)
class Spread:
    """The spread of each component of a table, and the survival of its episodes.

    Args:
        variance: `[S, A, N+1]`, of each component's discounted reward; the residual last.
        return_variance: `[S, A]`, of all of it together.
        survival: `[S, A, N+1]`, the probability that the episode is still running at the first
            step of each component; 1 for component 0, whose first step is the action taken now.
    """

    variance: FloatArray
    return_variance: FloatArray
    survival: FloatArray

    @property
    def deviation(self) -> FloatArray:
        """`[S, A, N+1]`: the standard deviation of each component."""
        return np.sqrt(self.variance)


def spread(table: ExactTable) -> Spread:
    """Returns the spread and survival of an exact table, by the same chain as its means.

    With C = P·(1 − terminated), the second moment of a group of w steps is M_w, where
    M_1 = E[R²], M_k = E[R²] + 2γ·ΣC·R·μ^π_(k−1) + γ²·C·M^π_(k−1), and μ_k is the mean of k steps.
    Seen i·w steps ahead it is (γ²C)^(i·w) applied to M_w, and variance is second moment − mean².
    The residual has M_∞, which solves its own equation with γ² for γ. Survival is p_0 = 1,
    p_i = C·p^π_(i−1).

    Args:
        table: the exact table; its policy is followed after the first action.

    >>> from trdlab.decomposition import TimeAxis
    >>> from trdlab.tabular.table import exact
    >>> coin = MDP.from_transitions([[[(0.5, 0, 4.0, True), (0.5, 0, 0.0, True)]]])
    >>> fair = spread(exact(coin, TimeAxis(0.9, horizon=2)))
    >>> fair.variance[0, 0].tolist(), fair.survival[0, 0].tolist()
    ([4.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    """
    mdp, policy, axis = table.mdp, table.solution.policy, table.time_axis
    gamma, means = axis.gamma, table.decomposition.components
    average = averaging(policy)
    group = _group_second_moment(mdp, policy, gamma, axis.width)
    whole = _return_second_moment(mdp, policy, gamma, average(table.solution.q_values))
    variance, survival = np.empty(means.shape), np.empty(means.shape)
    moments = _ahead(mdp, policy, group, gamma**2)
    rest = _ahead(mdp, policy, whole, gamma**2)
    running = _ahead(mdp, policy, np.ones(policy.shape), 1.0)
    for i in range(axis.num_components):
        explicit, beyond, alive = next(moments), next(rest), next(running)  # [S, A], i·w steps on
        second = explicit if i < axis.horizon else beyond
        variance[..., i] = _variance(second, means[..., i])
        survival[..., i] = alive
        for _ in range(axis.width - 1 if i < axis.horizon else 0):
            next(moments), next(rest), next(running)
    return Spread(variance, _variance(whole, table.solution.q_values), survival)


def outcomes(
    mdp: MDP, policy: FloatArray, state: int, action: int, count: int
) -> list[dict[float, float]]:
    """Returns, for each of `count` steps, the probability of each reward: the whole distribution.

    A step after the end of the episode pays 0. It follows one state and action forward, where
    `spread` looks backward from all of them.

    Args:
        mdp: the model.
        policy: `[S, A]`, followed after the first action.
        state: the index of a state.
        action: the index of the action taken there.
        count: how many steps to follow.

    Raises:
        InputError: there is no such state or action.

    >>> coin = MDP.from_transitions([[[(0.5, 0, 4.0, False), (0.5, 0, 0.0, True)]]])
    >>> outcomes(coin, np.ones((1, 1)), 0, 0, 2)
    [{0.0: 0.5, 4.0: 0.5}, {0.0: 0.75, 4.0: 0.25}]
    """
    if not (0 <= state < mdp.num_states and 0 <= action < mdp.num_actions):
        raise InputError(
            f"There is no state {state} with action {action}.",
            f"States run to {mdp.num_states - 1}, actions to {mdp.num_actions - 1}.",
        )
    follow = policy[mdp.transition_states, mdp.transition_actions] * mdp.probabilities  # [K]
    row = state * mdp.num_actions + action
    mass = np.zeros(len(mdp.rewards))  # [K], the probability that a transition is the next one
    mass[mdp.offsets[row] : mdp.offsets[row + 1]] = mdp.probabilities[
        mdp.offsets[row] : mdp.offsets[row + 1]
    ]
    result = []
    for _ in range(count):
        taken = mass > 0.0
        rewards, which = np.unique(mdp.rewards[taken], return_inverse=True)
        chances = np.bincount(which, mass[taken], len(rewards))
        step = dict(zip(rewards.tolist(), chances.tolist(), strict=True))
        over = 1.0 - float(mass.sum())
        if over > _ROUNDING:
            step[0.0] = step.get(0.0, 0.0) + over
        result.append(dict(sorted(step.items())))
        going_on = np.where(mdp.terminated, 0.0, mass)
        arrived = np.bincount(mdp.next_states, going_on, mdp.num_states)  # [S]
        mass = arrived[mdp.transition_states] * follow
    return result


def _ahead(mdp: MDP, policy: FloatArray, first: FloatArray, factor: float) -> Iterator[FloatArray]:
    """Yields x_0 = `first` `[S, A]`, then x_i = factor·C·x^π_(i−1), without an end."""
    average, ahead = averaging(policy), first
    while True:
        yield ahead
        ahead = factor * mdp.expect(average(ahead))


def _group_second_moment(mdp: MDP, policy: FloatArray, gamma: float, width: int) -> FloatArray:
    """Returns `[S, A]`: E[(Σ_(k<w) γ^k R_k)²], from the group's own start."""
    average = averaging(policy)
    mean, second = mdp.expected_rewards, _second_moment(mdp, np.zeros(mdp.num_states), gamma)
    for _ in range(width - 1):
        follows = average(mean)  # [S]
        second = _second_moment(mdp, follows, gamma) + gamma**2 * mdp.expect(average(second))
        mean = mdp.expected_rewards + gamma * mdp.expect(follows)
    return second


def _return_second_moment(
    mdp: MDP, policy: FloatArray, gamma: float, values: FloatArray
) -> FloatArray:
    """Returns `[S, A]`: the second moment of the return, a value with γ² and its own reward."""
    squares = mdp.rewards**2 + 2.0 * gamma * ~mdp.terminated * mdp.rewards * values[mdp.next_states]
    return evaluate(mdp.with_rewards(squares), policy, gamma**2).q_values


def _second_moment(mdp: MDP, follows: FloatArray, gamma: float) -> FloatArray:
    """Returns `[S, A]`: E[R² + 2γ·(1 − terminated)·R·follows(s′)]."""
    cross = 2.0 * gamma * mdp.continuation * mdp.rewards * follows[mdp.next_states]
    return mdp.per_action(mdp.probabilities * mdp.rewards**2 + cross)


def _variance(second: FloatArray, mean: FloatArray) -> FloatArray:
    variance = second - mean**2
    return np.where(variance > _ROUNDING * np.abs(second), variance, 0.0)
