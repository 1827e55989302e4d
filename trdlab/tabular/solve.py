"""Exact values: the optimal ones and those of a given policy, each with a proven error bound."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError, TrdlabError, closest
from trdlab.tabular.chains import LEAST, UNIT, Chain, averaging, chain_of, cover
from trdlab.tabular.mdp import MDP, SMALL, as_policy
from trdlab.tabular.sweeps import first_actions, sweep_count, swept

Ties = Literal["lowest", "mixed"]

_UNDERFLOW = float(np.finfo(np.float64).tiny)  # above what underflowing operations lose together
_LARGEST_VALUE = 1e140  # leaves room for variances and bounds
_GAIN = 1e-12  # relative, below which an action is not changed unless it is proven better
_MAX_SWEEPS = 2_000
_MAX_IMPROVEMENTS = 10_000
_MAX_ROUNDS, _MOST_DOUBLED, _MAX_COVERS = 60, 10, 8


@dataclass(frozen=True, eq=False)
class Solution:
    """The values of one policy, and how far they can be from the truth.

    Args:
        gamma: the discount factor they were solved for.
        policy: `[S, A]`, the action probabilities whose future it is.
        q_values: `[S, A]`.
        error_bound: `[S, A]`, proven: no Q-value is further than this from the exact one of its
            policy, and for an optimal policy from the exact optimal one. A bound is as small as
            its value is: values of far rewards are as certain as those of near ones. What cannot
            be told from 0 is 0.
        tied: `[S, A]`, the optimal actions of each state where several cannot be told apart
            within their bounds. All false where the best action is unique, in terminal states,
            and for a given policy.
        is_optimal: whether the policy was solved for, not given.
    """

    gamma: float
    policy: FloatArray
    q_values: FloatArray
    error_bound: FloatArray
    tied: BoolArray
    is_optimal: bool = False

    def __repr__(self) -> str:
        kind = "an optimal policy" if self.is_optimal else "a given policy"
        return f"<Solution: {len(self.policy)} states · γ = {self.gamma} · {kind}>"

    @property
    def state_values(self) -> FloatArray:
        """`[S]`: Σ_a π(a|s) Q(s, a)."""
        return np.asarray((self.policy * self.q_values).sum(axis=1))


def optimal(mdp: MDP, gamma: float, *, ties: Ties = "lowest") -> Solution:
    """Solves for the optimal values: policy iteration, until no action can be proven better.

    Where optimal actions tie, Q is unique but the future is not. `ties` says whose it is:
    `lowest` takes the tied action with the lowest index, `mixed` all of them evenly.

    Args:
        mdp: the model.
        gamma: the discount factor, in [0, 1).
        ties: how to choose among tied optimal actions.

    Raises:
        InputError: γ is outside [0, 1), `ties` is neither, or the values are out of reach of
            double precision.
    """
    _check(mdp, gamma)
    if ties not in get_args(Ties):
        raise InputError(f"The ties are {ties!r}.", closest(str(ties), get_args(Ties)))
    best = _surely_improved(mdp, gamma, _nearly_optimal(mdp, gamma))
    bound = best.solution.error_bound + gamma * mdp.expect(_excess(mdp, gamma, best) - best.error)
    q_values = best.solution.q_values
    near = q_values + bound >= (q_values - bound).max(axis=1, keepdims=True)
    several = (near.sum(axis=1) > 1) & ~mdp.terminal_states
    policy = near / near.sum(axis=1, keepdims=True) if ties == "mixed" else _lowest(near)
    chosen = _chosen_without_loss(mdp, gamma, best, policy).solution
    return replace(
        chosen,
        error_bound=np.maximum(chosen.error_bound, np.abs(chosen.q_values - q_values) + bound),
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
    return _evaluated(mdp, gamma, policy, chain_of(mdp, policy, gamma)).solution


def improved(
    mdp: MDP, gamma: float, actions: IntArray, chain: Chain | None = None
) -> tuple[IntArray, FloatArray, Chain]:
    """Policy iteration from given actions, as far as gains stand out from rounding.

    It is the quick way to follow an optimum while the model changes a little; it proves nothing.

    Args:
        mdp: the model.
        gamma: the discount factor, in [0, 1).
        actions: `[S]`, a deterministic policy to start from.
        chain: its chain, where that is known: it does not depend on rewards.

    Returns:
        Optimal actions `[S]`, their Q-values `[S, A]`, and their chain.
    """
    found = _improved(mdp, gamma, actions, np.zeros(mdp.num_states), chain)
    q_values = mdp.expected_rewards + gamma * mdp.expect(found.values)
    return found.actions, q_values, found.chain


# ---- policy iteration ----------------------------------------------------------------------------


class _Candidate(NamedTuple):
    """Actions `[S]`, their chain, and about what they are worth `[S]`."""

    actions: IntArray
    chain: Chain
    values: FloatArray


def _nearly_optimal(mdp: MDP, gamma: float) -> _Candidate:
    """Returns actions that are nearly always optimal."""
    if mdp.num_states <= SMALL:
        return _improved(mdp, gamma, *_greedy_after_sweeps(mdp, gamma))
    return _improved(mdp, gamma, *first_actions(mdp, gamma))


def _greedy_after_sweeps(mdp: MDP, gamma: float) -> tuple[IntArray, FloatArray]:
    """Returns the actions `[S]` that are greedy after cheap sweeps, and the values of those."""
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
    return actions, values


def _improved(
    mdp: MDP, gamma: float, actions: IntArray, values: FloatArray, chain: Chain | None = None
) -> _Candidate:
    """Policy iteration with sweeps of value iteration between the evaluations.

    A change of action spreads by one step in each improvement. So sweeps go on until the actions
    stay, or for twice as long as in the round before. The gain that counts grows, so that noise
    comes to an end.
    """
    states, sweeps, margin = np.arange(mdp.num_states), sweep_count(mdp), _GAIN
    chain = _deterministic(mdp, gamma, actions) if chain is None else chain
    for turn in range(_MAX_ROUNDS):
        values = chain.solve(mdp.expected_rewards[states, actions], values)
        better = _better(mdp, gamma, values, actions, margin)
        if np.array_equal(better, actions) or turn == _MAX_ROUNDS - 1:
            break
        for _ in range(2 ** min(turn, _MOST_DOUBLED)):
            values = swept(mdp, gamma, values, sweeps)
            before, better = better, _better(mdp, gamma, values, better, margin)
            if np.array_equal(better, before):
                break
        actions, margin, chain = better, 1.2 * margin, _deterministic(mdp, gamma, better)
    return _Candidate(actions, chain, values)


def _better(
    mdp: MDP, gamma: float, values: FloatArray, actions: IntArray, margin: float
) -> IntArray:
    """Returns the best actions `[S]` where they win by a relative margin, else those given."""
    q_values, size = _q_and_size(mdp, gamma, values)
    states, best = np.arange(mdp.num_states), q_values.argmax(axis=1)
    gain = q_values[states, best] - q_values[states, actions]
    size = np.maximum(np.maximum(size[states, best], size[states, actions]), LEAST)
    return np.where(gain > margin * size, best, actions)


def _surely_improved(mdp: MDP, gamma: float, begin: _Candidate) -> "_Evaluation":
    """Policy iteration that changes an action only where it is proven better, so it must end."""
    actions, chain, values = begin.actions, begin.chain, begin.values
    for _ in range(_MAX_IMPROVEMENTS):
        found = _evaluated(mdp, gamma, _one_hot(actions, mdp.num_actions), chain, values)
        gain = _sure_gains(found.solution)
        better = gain.max(axis=1) > 0.0
        if not better.any():
            return found
        actions = np.where(better, gain.argmax(axis=1), actions)
        chain, values = _deterministic(mdp, gamma, actions), found.values
    raise TrdlabError(
        f"Policy iteration did not end in {_MAX_IMPROVEMENTS} rounds.", "Report this model."
    )


def _sure_gains(solution: Solution) -> FloatArray:
    """Returns `[S, A]`: the least that an action is better than the policy's."""
    average = averaging(solution.policy)
    own = average(solution.q_values + solution.error_bound)
    return np.asarray(solution.q_values - solution.error_bound - own[:, None])


def _chosen_without_loss(
    mdp: MDP, gamma: float, best: "_Evaluation", policy: FloatArray
) -> "_Evaluation":
    """Evaluates the choice among tied actions, undone in states where it proves to lose.

    Close to γ = 1 an action can be too little worse than the best to be told apart, and yet cost
    much when it is taken again and again.
    """
    while not np.array_equal(policy, best.solution.policy):
        chosen = _evaluated(mdp, gamma, policy, chain_of(mdp, policy, gamma), best.values)
        other = (policy != best.solution.policy).any(axis=1)
        loses = other & (chosen.values + chosen.error < best.values - best.error)
        if not loses.any():
            return chosen
        policy = np.where(loses[:, None], best.solution.policy, policy)
    return best


# ---- values with a proven bound ------------------------------------------------------------------


class _Evaluation(NamedTuple):
    """A solution, and what it was made of: values `[S]`, their residual and their bound `[S]`."""

    solution: Solution
    values: FloatArray
    residual: FloatArray
    error: FloatArray


def _evaluated(
    mdp: MDP, gamma: float, policy: FloatArray, chain: Chain, start: FloatArray | None = None
) -> _Evaluation:
    """Evaluates a policy; the bound is a forward error analysis, state by state.

    The computed v misses its own equation v = r + Mv by a residual that is known up to rounding;
    its error is that residual carried along the chain, (I − M)⁻¹·|residual|, or less.
    """
    average = averaging(policy)
    rewards = average(mdp.expected_rewards)
    values = chain.solve(rewards, start)
    q_values, size_of_q = _q_and_size(mdp, gamma, values)
    rounding = UNIT * (8 + mdp.num_actions + chain.terms)
    size = average(size_of_q) + np.abs(values)
    residual = np.abs(rewards + chain.ahead(values) - values) + rounding * size
    residual += average(mdp.reward_bound) + _UNDERFLOW
    error = cover(chain, residual, gamma)
    bound = gamma * mdp.expect(error) * (1.0 + rounding) + _lost(mdp, size_of_q)
    zero = np.abs(q_values) <= bound
    solution = Solution(
        gamma=gamma,
        policy=policy,
        q_values=np.where(zero, 0.0, q_values),
        error_bound=np.where(zero, 2.0 * bound, bound),
        tied=np.zeros(mdp.shape, dtype=np.bool_),
    )
    return _Evaluation(solution, values, residual, error)


def _q_and_size(mdp: MDP, gamma: float, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns E[R] + γ·C·values `[S, A]`, and the sum of the sizes of its parts."""
    later = gamma * mdp.expect(values)
    larger = later if (values >= 0.0).all() else gamma * mdp.expect(np.abs(values))
    return mdp.expected_rewards + later, np.abs(mdp.expected_rewards) + larger


def _lost(mdp: MDP, size: FloatArray) -> FloatArray:
    """Returns `[S, A]`: what rounding can take from a Q-value of parts of this size."""
    rounding = UNIT * (8 + int(np.diff(mdp.offsets).max()))
    return mdp.reward_bound + rounding * size + _UNDERFLOW


def _excess(mdp: MDP, gamma: float, best: _Evaluation) -> FloatArray:
    """Returns z `[S]`, proven: no policy's value is greater than that of the best one by more.

    v + z is at least the optimum wherever it is not increased by the Bellman operator, that is
    where z(s) ≥ gain(s, a) + γ·C·z for all actions. The error of the evaluation is nearly always
    enough; where a tied action asks for more, it is followed.
    """
    values, states = best.values, np.arange(mdp.num_states)
    q_values, size = _q_and_size(mdp, gamma, values)
    gains = q_values - values[:, None]
    gains += _lost(mdp, size) + UNIT * np.abs(values)[:, None]
    actions, z = best.solution.policy.argmax(axis=1), best.error
    for turn in range(_MAX_COVERS + 1):
        needed = gains + (1.0 + 64 * UNIT) * gamma * mdp.expect(z)
        short = needed.max(axis=1) - z
        if turn == _MAX_COVERS or short.max() <= LEAST:
            break
        actions = np.where(short > 0.0, needed.argmax(axis=1), actions)
        right = np.maximum(1.5 * gains[states, actions], best.residual)
        z = np.maximum(z, cover(_deterministic(mdp, gamma, actions), right, gamma))
    return z + 1.01 * max(float(short.max()), 0.0) / (1.0 - gamma)


def _deterministic(mdp: MDP, gamma: float, actions: IntArray) -> Chain:
    return chain_of(mdp, _one_hot(actions, mdp.num_actions), gamma)


def _one_hot(actions: IntArray, num_actions: int) -> FloatArray:
    policy = np.zeros((len(actions), num_actions))
    policy[np.arange(len(actions)), actions] = 1.0
    return policy


def _check(mdp: MDP, gamma: float) -> None:
    TimeAxis(gamma, 0)
    inexact = float(mdp.per_action(mdp.probabilities).max()) - 1.0
    inexact += UNIT if np.any(mdp.probabilities % 1.0) else 0.0
    if inexact > 0.005 * (1.0 - gamma):
        raise InputError(
            f"gamma = {gamma!r} is too close to 1 for a model whose probabilities sum to 1 only "
            f"within {inexact:.1g}.",
            "Choose a smaller gamma.",
        )
    largest = float(np.abs(mdp.rewards).max())
    if largest > _LARGEST_VALUE * (1.0 - gamma):
        raise InputError(
            f"Rewards of {largest:.3g} at gamma = {gamma!r} can add up to {_LARGEST_VALUE:.0e} or "
            "more, whose square is beyond double precision.",
            "Give smaller rewards.",
        )


def _lowest(mask: BoolArray) -> FloatArray:
    """Returns `[S, A]`: all probability on the first true entry of each row."""
    return _one_hot(mask.argmax(axis=1), mask.shape[1])
