"""Exact values: the optimal ones and those of a given policy, each with a proven error bound."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import TrdlabError
from trdlab.tabular.mdp import MDP, as_policy

Ties = Literal["lowest", "mixed"]

_UNIT = float(np.finfo(np.float64).eps)
_DENSE_STATES = 500  # up to here a dense solve is done before scipy could be imported
_QUICK_GAIN = 1e-13  # relative
_MAX_SWEEPS = 2_000
_MAX_IMPROVEMENTS = 10_000


@dataclass(frozen=True, eq=False)
class Solution:
    """The values of one policy, and how far they can be from the truth.

    Args:
        gamma: the discount factor they were solved for.
        policy: `[S, A]`, the action probabilities whose future it is.
        q_values: `[S, A]`.
        error_bound: `[S, A]`, proven: no Q-value is further than this from the exact one.
        tied: `[S, A]`, the optimal actions of each state where several cannot be told apart
            within twice the bound. All false where the best action is unique, in terminal
            states, and for a given policy.
        is_optimal: whether the policy was solved for, not given.
    """

    gamma: float
    policy: FloatArray
    q_values: FloatArray
    error_bound: FloatArray
    tied: BoolArray
    is_optimal: bool = False

    @property
    def state_values(self) -> FloatArray:
        """`[S]`: Σ_a π(a|s) Q(s, a)."""
        return np.asarray((self.policy * self.q_values).sum(axis=1))


def optimal(mdp: MDP, gamma: float, *, ties: Ties = "lowest") -> Solution:
    """Solves for the optimal values: value-iteration sweeps, then policy iteration to the end.

    Where optimal actions tie, Q is unique but the future is not. `ties` says whose it is:
    `lowest` takes the tied action with the lowest index, `mixed` all of them evenly.

    Args:
        mdp: the model.
        gamma: the discount factor, in [0, 1).
        ties: how to choose among tied optimal actions.

    Raises:
        InputError: γ is outside [0, 1).
    """
    TimeAxis(gamma, 0)
    actions, _ = improved(mdp, gamma, _greedy_after_sweeps(mdp, gamma))
    solution = _surely_improved(mdp, gamma, actions)
    bound = _optimality_bound(solution)
    near = solution.q_values + bound >= (solution.q_values - bound).max(axis=1, keepdims=True)
    policy = near / near.sum(axis=1, keepdims=True) if ties == "mixed" else _lowest(near)
    if not np.array_equal(policy, solution.policy):
        solution = _evaluated(mdp, gamma, policy)
    several = (near.sum(axis=1) > 1) & ~mdp.terminal_states
    return Solution(
        gamma=gamma,
        policy=policy,
        q_values=solution.q_values,
        error_bound=np.maximum(bound, solution.error_bound),
        tied=near & several[:, None],
        is_optimal=True,
    )


def evaluate(mdp: MDP, policy: FloatArray, gamma: float) -> Solution:
    """Solves for the values of a given stochastic policy `[S, A]`.

    Raises:
        InputError: γ is outside [0, 1), or a row of `policy` is no distribution.
    """
    TimeAxis(gamma, 0)
    return _evaluated(mdp, gamma, as_policy(policy, mdp))


def undiscounted_totals(mdp: MDP, policy: FloatArray) -> FloatArray:
    """Returns `[S, A]`: the expected total reward with γ = 1, NaN where no total exists.

    It is the total of the given policy, as that was chosen under γ < 1 (errata P9). A total
    exists where the policy, with probability 1, ends the episode or comes to where it is no
    longer paid.
    """
    weights = _transition_weights(mdp, as_policy(policy, mdp))
    rewards = mdp.per_state(weights * mdp.rewards)
    edge = (weights > 0.0) & ~mdp.terminated
    sources, targets = mdp.transition_states[edge], mdp.next_states[edge]
    terminates = mdp.per_state(weights * mdp.terminated) > 0.0
    paid = _can_reach(rewards != 0.0, sources, targets)
    comes_to_an_end = _can_reach(terminates | ~paid, sources, targets)
    endless = _can_reach(~comes_to_an_end, sources, targets)
    values = np.where(endless, np.nan, 0.0)
    active = paid & ~endless
    if active.any():
        values[active] = _solve_chain(mdp, weights * ~mdp.terminated, rewards, active)
    follows = np.where(mdp.continuation > 0.0, mdp.continuation * values[mdp.next_states], 0.0)
    return mdp.expected_rewards + mdp.per_action(follows)


def _greedy_after_sweeps(mdp: MDP, gamma: float) -> IntArray:
    """Returns the actions `[S]` that are greedy after cheap sweeps: nearly always the optimum."""
    values, unchanged = np.zeros(mdp.num_states), 0
    last_actions = actions = np.zeros(mdp.num_states, dtype=np.int64)
    for _ in range(_MAX_SWEEPS):
        q_values = mdp.expected_rewards + gamma * mdp.expect(values)
        actions, updated = q_values.argmax(axis=1), q_values.max(axis=1)
        if np.array_equal(updated, values):
            break
        values = updated
        unchanged = unchanged + 1 if np.array_equal(actions, last_actions) else 0
        if unchanged > 30:
            break
        last_actions = actions
    return actions


def improved(mdp: MDP, gamma: float, actions: IntArray) -> tuple[IntArray, FloatArray]:
    """Policy iteration from given actions, as far as gains stand out from rounding.

    It is the quick way to follow an optimum while the model changes a little; it proves nothing.

    Args:
        mdp: the model.
        gamma: the discount factor, in [0, 1).
        actions: `[S]`, a deterministic policy to start from.

    Returns:
        Optimal actions `[S]` and their Q-values `[S, A]`.
    """
    states = np.arange(mdp.num_states)
    for _ in range(_MAX_IMPROVEMENTS):
        taken = actions[mdp.transition_states] == mdp.transition_actions
        rewards = mdp.expected_rewards[states, actions]
        values = _solve_chain(mdp, gamma * mdp.continuation * taken, rewards)
        q_values = mdp.expected_rewards + gamma * mdp.expect(values)
        own = q_values[states, actions]
        best = q_values.argmax(axis=1)
        better = q_values[states, best] > own + _QUICK_GAIN * np.abs(own)
        if not better.any():
            break
        actions = np.where(better, best, actions)
    return actions, q_values


def _surely_improved(mdp: MDP, gamma: float, actions: IntArray) -> Solution:
    """Policy iteration that changes an action only where it is proven better, so it must end."""
    for _ in range(_MAX_IMPROVEMENTS):
        policy = np.zeros((mdp.num_states, mdp.num_actions))
        policy[np.arange(mdp.num_states), actions] = 1.0
        solution = _evaluated(mdp, gamma, policy)
        gain = _gains(solution, pessimistic=True)
        better = gain.max(axis=1) > 0.0
        if not better.any():
            return solution
        actions = np.where(better, gain.argmax(axis=1), actions)
    raise TrdlabError(
        f"Policy iteration did not end in {_MAX_IMPROVEMENTS} rounds.", "Report this model."
    )


def _gains(solution: Solution, *, pessimistic: bool) -> FloatArray:
    """Returns `[S, A]`: the least (or most) that an action can be better than the policy's."""
    own = (solution.policy * solution.q_values).sum(axis=1, keepdims=True)
    slack = solution.error_bound + (solution.policy * solution.error_bound).sum(1, keepdims=True)
    return np.asarray(solution.q_values - own + (-slack if pessimistic else slack))


def _optimality_bound(solution: Solution) -> FloatArray:
    """Returns `[S, A]`: how far the Q-values of a policy can be from the optimal ones.

    If no other action can be better, the policy is optimal and only its evaluation errs. What
    cannot be excluded, a gain of η a step, adds up to η / (1 − γ) at the most.
    """
    others = np.where(solution.policy > 0.0, 0.0, _gains(solution, pessimistic=False))
    unexcluded = max(float(others.max()), 0.0)
    return solution.error_bound + unexcluded / (1.0 - solution.gamma)


def _evaluated(mdp: MDP, gamma: float, policy: FloatArray) -> Solution:
    """Evaluates a policy; the bound is a forward error analysis, state by state.

    The computed v misses its own equation v = r + γCv by a residual that is known up to
    rounding; its error is that residual carried along the chain, (I − γC)⁻¹·|residual|.
    """
    weights = _transition_weights(mdp, policy)
    chain = gamma * weights * ~mdp.terminated
    rewards = mdp.per_state(weights * mdp.rewards)
    values = _solve_chain(mdp, chain, rewards)
    next_values = values[mdp.next_states]
    rounding = _UNIT * (8 + int(np.diff(mdp.offsets).max()) * mdp.num_actions)
    size = mdp.per_state(np.abs(weights * mdp.rewards) + chain * np.abs(next_values)) + np.abs(
        values
    )
    residual = np.abs(rewards + mdp.per_state(chain * next_values) - values) + rounding * size
    carried = 1.01 * np.abs(_solve_chain(mdp, chain, residual))
    size_of_q = mdp.per_action(np.abs(mdp.probabilities * mdp.rewards)) + gamma * mdp.expect(
        np.abs(values)
    )
    return Solution(
        gamma=gamma,
        policy=policy,
        q_values=mdp.expected_rewards + gamma * mdp.expect(values),
        error_bound=gamma * mdp.expect(carried) + rounding * size_of_q,
        tied=np.zeros((mdp.num_states, mdp.num_actions), dtype=np.bool_),
    )


def _transition_weights(mdp: MDP, policy: FloatArray) -> FloatArray:
    """Returns `[K]`: π(a|s)·P(s′|s, a)."""
    return np.asarray(policy[mdp.transition_states, mdp.transition_actions] * mdp.probabilities)


def _solve_chain(
    mdp: MDP, chain: FloatArray, right: FloatArray, among: BoolArray | None = None
) -> FloatArray:
    """Solves x = right + chain·x, for all states or for those in `among` with 0 outside."""
    size, keep = mdp.num_states, chain != 0.0
    sources, targets, weights = mdp.transition_states[keep], mdp.next_states[keep], chain[keep]
    if size <= _DENSE_STATES:
        matrix = np.bincount(sources * size + targets, weights, size * size).reshape(size, size)
        system = np.eye(size) - matrix
        if among is not None:
            return np.linalg.solve(system[np.ix_(among, among)], right[among])
        return np.linalg.solve(system, right)
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import spsolve

    sparse = eye_array(size, format="csc") - csc_array((weights, (sources, targets)), (size, size))
    if among is not None:
        return np.asarray(spsolve(sparse[among][:, among], right[among]))
    return np.asarray(spsolve(sparse, right))


def _can_reach(goal: BoolArray, sources: IntArray, targets: IntArray) -> BoolArray:
    """Returns `[S]`: the states from which some path of edges leads into `goal`."""
    reached, size = goal.copy(), -1
    while reached.sum() != size:
        size = int(reached.sum())
        reached[sources[reached[targets]]] = True
    return reached


def _lowest(mask: BoolArray) -> FloatArray:
    """Returns `[S, A]`: all probability on the first true entry of each row."""
    policy = np.zeros(mask.shape)
    policy[np.arange(len(mask)), mask.argmax(axis=1)] = 1.0
    return policy
