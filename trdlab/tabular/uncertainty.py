"""What an exact model knows beyond the mean: how uncertain a reward is, and who is still alive.

The reward of a transition counts as certain once its next state is known: what varies inside
E[R | s, a, s′] is not in a model.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.tabular.chains import averaging
from trdlab.tabular.mdp import MDP
from trdlab.tabular.solve import Solution, evaluate
from trdlab.tabular.table import ExactTable

_ROUNDING = 1e-24  # of a square: what is below comes from rounding


class Spread(NamedTuple):
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
    """Returns the spread and survival of an exact table, along the same chain as its means.

    With C = P·(1 − terminated) and x^π(s) = Σ_a π(a|s) x(s, a), the variance of a sum that goes on
    with mean μ and variance σ² at the next state is that of what is known one step later, plus
    what is still unknown then: E[(R + γ(1 − terminated)μ^π(s′) − mean)²] + γ²·C·σ²^π, where σ²^π
    contains the variance of μ under the policy. Applied w times from nothing it gives a group,
    without R it looks one step further ahead, and the whole return solves it with γ² for γ.
    Nothing is taken as a difference of second moment and squared mean, so rounding stays small
    beside the variance itself. Survival is p_0 = 1, p_i = C·p^π_(i−1).

    Args:
        table: the exact table; its policy is followed after the first action.

    >>> from trdlab.decomposition import TimeAxis
    >>> from trdlab.tabular.table import exact
    >>> coin = MDP.from_transitions([[[(0.5, 0, 4.0, True), (0.5, 0, 0.0, True)]]])
    >>> fair = spread(exact(coin, TimeAxis(0.9, horizon=2)))
    >>> fair.variance[0, 0].tolist(), fair.survival[0, 0].tolist()
    ([4.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    """
    mdp, axis, solution = table.mdp, table.time_axis, table.solution
    chain = _Chain(mdp, solution.policy, axis.gamma)
    return_variance = _return_variance(chain, solution)
    groups = chain.ahead(*chain.group(axis.width))
    rest = chain.ahead(solution.q_values, return_variance)
    alive = chain.survival()
    variance = np.empty(table.decomposition.components.shape)
    survival = np.empty(table.decomposition.components.shape)
    for i in range(axis.num_components):  # each of these is i·w steps ahead
        group, residual, running = next(groups), next(rest), next(alive)
        variance[..., i] = group if i < axis.horizon else residual
        survival[..., i] = running
        for _ in range(axis.width - 1 if i < axis.horizon else 0):
            next(groups), next(rest), next(alive)
    return Spread(variance, return_variance, survival)


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
        if over > 1e-12:
            step[0.0] = step.get(0.0, 0.0) + over
        result.append(dict(sorted(step.items())))
        going_on = np.where(mdp.terminated, 0.0, mass)
        arrived = np.bincount(mdp.next_states, going_on, mdp.num_states)  # [S]
        mass = arrived[mdp.transition_states] * follow
    return result


class _Chain:
    """One step of a policy after another, with means and variances `[S, A]`."""

    def __init__(self, mdp: MDP, policy: FloatArray, gamma: float) -> None:
        self.mdp, self.policy, self.gamma = mdp, policy, gamma
        self.average = averaging(policy)
        rows = np.arange(len(mdp.offsets) - 1)
        self.rows = np.repeat(rows, np.diff(mdp.offsets))  # [K], s·A + a of each transition

    def before(
        self, mean: FloatArray, variance: FloatArray, *, rewards: FloatArray | float
    ) -> tuple[FloatArray, FloatArray]:
        """Returns mean and variance one step earlier, with `rewards [K]` paid on the way."""
        mdp, gamma = self.mdp, self.gamma
        mean_of_state = self.average(mean)  # [S]
        doubt = self.average(variance + (mean - mean_of_state[:, None]) ** 2)  # [S]
        known = rewards + gamma * ~mdp.terminated * mean_of_state[mdp.next_states]  # [K]
        earlier = mdp.per_action(mdp.probabilities * known)
        news = mdp.per_action(mdp.probabilities * (known - earlier.ravel()[self.rows]) ** 2)
        return earlier, news + gamma**2 * mdp.expect(doubt)

    def group(self, width: int) -> tuple[FloatArray, FloatArray]:
        """Returns mean and variance of the discounted reward of the next `width` steps."""
        mean: FloatArray = np.zeros(self.policy.shape)
        variance = mean
        for _ in range(width):
            mean, variance = self.before(mean, variance, rewards=self.mdp.rewards)
        return mean, variance

    def ahead(self, mean: FloatArray, variance: FloatArray) -> Iterator[FloatArray]:
        """Yields the variance of a sum that begins now, one step ahead, two, without an end."""
        while True:
            yield variance
            mean, variance = self.before(mean, variance, rewards=0.0)

    def survival(self) -> Iterator[FloatArray]:
        """Yields the probability that the episode still runs, now, in one step, without an end."""
        running: FloatArray = np.ones(self.policy.shape)
        while True:
            yield running
            running = self.mdp.expect(self.average(running))


def _return_variance(chain: _Chain, solution: Solution) -> FloatArray:
    """Returns `[S, A]`: the variance of the return, a value with γ² whose reward is the news."""
    mdp, gamma, q_values = chain.mdp, chain.gamma, solution.q_values
    values = chain.average(q_values)
    doubt = chain.average((q_values - values[:, None]) ** 2)  # [S], of the policy's own choice
    known = mdp.rewards + gamma * ~mdp.terminated * values[mdp.next_states]
    news = (known - q_values.ravel()[chain.rows]) ** 2
    news = news + gamma**2 * ~mdp.terminated * doubt[mdp.next_states]
    news = np.where(news > _ROUNDING * np.maximum(known**2, 1e-300), news, 0.0)
    return np.maximum(evaluate(mdp.with_rewards(news), chain.policy, gamma**2).q_values, 0.0)
