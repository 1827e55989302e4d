"""Exact values: the optimal ones and those of a given policy, each with a proven error bound."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError, TrdlabError
from trdlab.tabular.mdp import MDP, SMALL, as_policy

Ties = Literal["lowest", "mixed"]

_UNIT = float(np.finfo(np.float64).eps)
_UNDERFLOW = float(np.finfo(np.float64).tiny)  # above what underflowing operations lose together
_LARGEST_VALUE = 1e290  # leaves room for the bounds
_MOST_DISCOUNT = 0.99  # up to here sweeps converge sooner than a sparse factorisation is done
_MOST_FACTORISED = 50_000  # states; beyond, a factorisation does not fit into memory
_TOLERANCE = 1e-12  # of the largest reward's perpetual value, for models solved by sweeps
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
        error_bound: `[S, A]`, proven: no Q-value is further than this from the exact one of its
            policy, and for an optimal policy from the exact optimal one.
        tied: `[S, A]`, the optimal actions of each state where several cannot be told apart
            within twice the bound of their evaluation. All false where the best action is
            unique, in terminal states, and for a given policy.
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


def optimal(
    mdp: MDP, gamma: float, *, ties: Ties = "lowest", tolerance: float | None = None
) -> Solution:
    """Solves for the optimal values: policy iteration to the end, or by blocks in large models.

    Where optimal actions tie, Q is unique but the future is not. `ties` says whose it is:
    `lowest` takes the tied action with the lowest index, `mixed` all of them evenly.

    Args:
        mdp: the model.
        gamma: the discount factor, in [0, 1).
        ties: how to choose among tied optimal actions.
        tolerance: the error that is allowed in large models; by default 10⁻¹² of what the
            largest reward would be worth if it were paid for ever. Small ones are solved to
            rounding.

    Raises:
        InputError: γ is outside [0, 1), or the values are out of reach of double precision.
    """
    _check(mdp, gamma)
    if _is_large(mdp, gamma):
        # what ties are allowed to lose at each step adds up to 1 / (1 − γ) times as much
        asked = None if tolerance is None else 0.1 * tolerance * (1.0 - gamma)
        return _optimal_by_sweeps(mdp, gamma, ties, asked or _default_tolerance(mdp, gamma))
    actions, _ = improved(mdp, gamma, _greedy_after_sweeps(mdp, gamma))
    best = _surely_improved(mdp, gamma, actions)
    most, least = best.q_values + best.error_bound, best.q_values - best.error_bound
    near = most >= least.max(axis=1, keepdims=True)
    policy = near / near.sum(axis=1, keepdims=True) if ties == "mixed" else _lowest(near)
    chosen = _chosen_without_loss(mdp, best, policy)
    several = (near.sum(axis=1) > 1) & ~mdp.terminal_states
    return replace(
        chosen,
        error_bound=_optimality_bound(chosen),
        tied=near & several[:, None],
        is_optimal=True,
    )


def evaluate(mdp: MDP, policy: FloatArray, gamma: float) -> Solution:
    """Solves for the values of a given stochastic policy `[S, A]`.

    Raises:
        InputError: γ is outside [0, 1), a row of `policy` is no distribution, or the values are
            out of reach of double precision.
    """
    _check(mdp, gamma)
    policy = as_policy(policy, mdp.shape)
    if _is_large(mdp, gamma):
        start = np.zeros(mdp.num_states)
        return _evaluated_by_sweeps(mdp, gamma, policy, _default_tolerance(mdp, gamma), start)
    return _evaluated(mdp, gamma, policy)


def _is_large(mdp: MDP, gamma: float) -> bool:
    if mdp.num_states <= SMALL:
        return False
    return gamma <= _MOST_DISCOUNT or mdp.num_states > _MOST_FACTORISED


def _default_tolerance(mdp: MDP, gamma: float) -> float:
    from trdlab.tabular import sweeps

    perpetual = max(float(np.abs(mdp.expected_rewards).max()), 1e-300) / (1.0 - gamma)
    return max(_TOLERANCE, 2.0 * sweeps.least_tolerance(mdp, gamma)) * perpetual


def _optimal_by_sweeps(mdp: MDP, gamma: float, ties: Ties, tolerance: float) -> Solution:
    """Solves a large model: the bound is that of the values, carried over to Q."""
    from trdlab.tabular import sweeps

    values, error = sweeps.optimal_values(mdp, gamma, tolerance)
    q_values = mdp.expected_rewards + gamma * mdp.expect(values)
    slack = gamma * error + 4 * _UNIT * np.abs(q_values)
    near = q_values + slack >= (q_values - slack).max(axis=1, keepdims=True)
    policy = near / near.sum(axis=1, keepdims=True) if ties == "mixed" else _lowest(near)
    chosen = _evaluated_by_sweeps(mdp, gamma, policy, tolerance, values)
    several = (near.sum(axis=1) > 1) & ~mdp.terminal_states
    return replace(
        chosen,
        error_bound=_optimality_bound(chosen),
        tied=near & several[:, None],
        is_optimal=True,
    )


def _evaluated_by_sweeps(
    mdp: MDP, gamma: float, policy: FloatArray, tolerance: float, start: FloatArray
) -> Solution:
    from trdlab.tabular import sweeps

    values, error = sweeps.policy_values(mdp, policy, gamma, tolerance, start)
    q_values = mdp.expected_rewards + gamma * mdp.expect(values)
    return Solution(
        gamma=gamma,
        policy=policy,
        q_values=q_values,
        error_bound=gamma * error + 4 * _UNIT * np.abs(q_values),
        tied=np.zeros(q_values.shape, dtype=np.bool_),
    )


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
        values = solve_chain(mdp, gamma * mdp.continuation * taken, rewards)
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


def _chosen_without_loss(mdp: MDP, best: Solution, policy: FloatArray) -> Solution:
    """Evaluates the choice among tied actions, undone in states where it proves to lose.

    Close to γ = 1 an action can be too little worse than the best to be told apart, and yet cost
    much when it is taken again and again.
    """
    best_values = best.state_values
    best_bound = (best.policy * best.error_bound).sum(axis=1)
    while not np.array_equal(policy, best.policy):
        chosen = _evaluated(mdp, best.gamma, policy)
        bound = best_bound + (policy * chosen.error_bound).sum(axis=1)
        loses = (chosen.state_values + bound < best_values) & (policy != best.policy).any(axis=1)
        if not loses.any():
            return chosen
        policy = np.where(loses[:, None], best.policy, policy)
    return best


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
    others = np.where(solution.policy == 1.0, 0.0, _gains(solution, pessimistic=False))
    unexcluded = max(float(others.max()), 0.0)
    return solution.error_bound + 1.01 * unexcluded / (1.0 - solution.gamma)


def _evaluated(mdp: MDP, gamma: float, policy: FloatArray) -> Solution:
    """Evaluates a policy; the bound is a forward error analysis, state by state.

    The computed v misses its own equation v = r + γCv by a residual that is known up to
    rounding; its error is that residual carried along the chain, (I − γC)⁻¹·|residual|. That in
    turn is computed, enlarged, and checked: y ≥ (I − γC)⁻¹·x holds wherever y − γCy ≥ x does,
    and where x is missed by σ, adding 1.01·σ / (1 − γ) makes up for it.
    """
    weights = transition_weights(mdp, policy)
    chain = gamma * weights * ~mdp.terminated
    rewards = mdp.per_state(weights * mdp.rewards)
    values = solve_chain(mdp, chain, rewards)
    next_values = values[mdp.next_states]
    rounding = _UNIT * (8 + int(np.diff(mdp.offsets).max()) * mdp.num_actions)
    size = mdp.per_state(np.abs(weights * mdp.rewards) + chain * np.abs(next_values)) + np.abs(
        values
    )
    residual = np.abs(rewards + mdp.per_state(chain * next_values) - values)
    residual += rounding * size + _UNDERFLOW
    carried = 1.01 * np.abs(solve_chain(mdp, chain, residual))
    proven = carried - mdp.per_state(chain * carried[mdp.next_states]) - 2 * rounding * carried
    carried += 1.01 * max(float((residual - proven).max()), 0.0) / (1.0 - gamma)
    size_of_q = mdp.per_action(np.abs(mdp.probabilities * mdp.rewards)) + gamma * mdp.expect(
        np.abs(values)
    )
    return Solution(
        gamma=gamma,
        policy=policy,
        q_values=mdp.expected_rewards + gamma * mdp.expect(values),
        error_bound=gamma * mdp.expect(carried) + rounding * size_of_q + _UNDERFLOW,
        tied=np.zeros((mdp.num_states, mdp.num_actions), dtype=np.bool_),
    )


def _check(mdp: MDP, gamma: float) -> None:
    TimeAxis(gamma, 0)
    inexact = float(mdp.per_action(mdp.probabilities).max()) - 1.0
    inexact += _UNIT if np.any(mdp.probabilities % 1.0) else 0.0
    if inexact > 0.005 * (1.0 - gamma):
        raise InputError(
            f"gamma = {gamma!r} is too close to 1 for a model whose probabilities sum to 1 only "
            f"within {inexact:.1g}.",
            "Choose a smaller gamma.",
        )
    largest = float(np.abs(mdp.rewards).max())
    if largest > _LARGEST_VALUE * (1.0 - gamma):
        raise InputError(
            f"Rewards of {largest:.3g} at gamma = {gamma!r} can add up beyond double precision.",
            "Give smaller rewards.",
        )


def transition_weights(mdp: MDP, policy: FloatArray) -> FloatArray:
    """Returns `[K]`: π(a|s)·P(s′|s, a)."""
    return np.asarray(policy[mdp.transition_states, mdp.transition_actions] * mdp.probabilities)


def solve_chain(
    mdp: MDP, chain: FloatArray, right: FloatArray, among: BoolArray | None = None
) -> FloatArray:
    """Solves x = right + chain·x, for all states or for those in `among` with 0 outside."""
    size, keep = mdp.num_states, chain != 0.0
    sources, targets, weights = mdp.transition_states[keep], mdp.next_states[keep], chain[keep]
    among = np.ones(size, dtype=np.bool_) if among is None else among
    try:
        if size <= SMALL:
            matrix = np.bincount(sources * size + targets, weights, size * size)
            system = np.eye(size) - matrix.reshape(size, size)
            return np.linalg.solve(system[np.ix_(among, among)], right[among])
        from scipy.sparse import csc_array, eye_array
        from scipy.sparse.linalg import splu

        entries = csc_array((weights, (sources, targets)), (size, size))
        sparse = (eye_array(size, format="csc") - entries)[among][:, among]
        return np.asarray(splu(sparse.tocsc()).solve(right[among]))
    except (np.linalg.LinAlgError, RuntimeError) as error:  # the system is singular
        raise InputError(
            "The values are out of reach of double precision: the future is all but endless.",
            "Choose a smaller gamma.",
        ) from error


def _lowest(mask: BoolArray) -> FloatArray:
    """Returns `[S, A]`: all probability on the first true entry of each row."""
    policy = np.zeros(mask.shape)
    policy[np.arange(len(mask)), mask.argmax(axis=1)] = 1.0
    return policy
