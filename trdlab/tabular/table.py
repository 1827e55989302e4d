"""Decompositions of every state and action of a model, as an Estimator."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, closest
from trdlab.estimator import Future
from trdlab.tabular.mdp import MDP, as_policy
from trdlab.tabular.series import component_bounds, decompose, step_bounds, steps
from trdlab.tabular.solve import Solution, Ties, evaluate, optimal

_MANY = 50_000  # states from which on ties are said without asking whether they matter

_TIED_POLICIES = {
    "lowest": "the optimal policy",
    "mixed": "the optimal policy that mixes tied actions evenly",
}


@dataclass(frozen=True, eq=False)
class ExactTable:
    """The exact decomposition `[S, A, N+1]` of a model's future under one policy; an Estimator.

    Args:
        mdp: the model.
        solution: the policy, its values, their error bound and the ties.
        decomposition: `[S, A, N+1]`.
        future: whose future it is.
    """

    mdp: MDP
    solution: Solution
    decomposition: RewardDecomposition
    future: Future

    def __repr__(self) -> str:
        return f"<ExactTable: {self.mdp} · {self.time_axis} · {self.future.policy}>"

    def _repr_html_(self) -> str:
        from html import escape

        begins = f"{self}, where episodes begin (state {self.mdp.start}), an action in each row:"
        return f"<p>{escape(begins)}</p>{self.decomposition[self.mdp.start]._repr_html_()}"

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.decomposition.time_axis

    def decompose(self, observations: Any) -> RewardDecomposition:
        """Returns `[B, A, N+1]` for a batch `[B]` of state indices.

        Raises:
            InputError: an observation is not the index of a state.
        """
        return self.decomposition[as_states(observations, self.mdp.num_states)]

    @cached_property
    def state_decomposition(self) -> RewardDecomposition:
        """`[S, N+1]`: the decomposition of the state values (paper, Appendix A)."""
        weighted = self.solution.policy[..., None] * self.decomposition.components
        return RewardDecomposition(weighted.sum(axis=1), self.time_axis)

    @cached_property
    def error_bound(self) -> FloatArray:
        """`[S, A, N+1]`, proven: no component is further than this from the exact one.

        Exact is the future of the solution's policy. A component that is smaller than its bound
        cannot be told from 0, nor can two be told apart that differ by less than both bounds.
        """
        return component_bounds(self.mdp, self.solution, self.time_axis)

    @cached_property
    def ambiguous(self) -> BoolArray:
        """`[S]`: states where optimal actions tie and surely pay at different steps.

        Where no state is ambiguous, every tied optimal policy has the same decomposition: the
        vectors then obey one linear equation, whichever of the tied actions is taken. For w > 1
        single steps are compared: what differs inside a group here can fall into two groups as
        seen from an earlier state.
        """
        tied, differ = self.solution.tied, np.zeros(self.mdp.num_states, dtype=np.bool_)
        if tied.any():
            count = self.time_axis.num_steps
            single = steps(self.mdp, self.solution, count)
            bounds = step_bounds(self.mdp, self.solution, count)
            for part, bound in zip(single, bounds, strict=False):  # the steps can end early
                least = np.where(tied, part - bound, -np.inf).max(axis=1)  # of the one that pays
                differ |= least > np.where(tied, part + bound, np.inf).min(axis=1)
        return differ


def exact(
    mdp: MDP,
    time_axis: TimeAxis,
    *,
    policy: FloatArray | None = None,
    ties: Ties = "lowest",
    dtype: type[np.floating[Any]] = np.float64,
) -> ExactTable:
    """Solves a model and decomposes the Q-value of every state and action exactly.

    With C = P·(1 − terminated) and x^π(s) = Σ_a π(a|s) x(s, a), the expected discounted rewards of
    single steps are m_0 = E[R | s, a] and m_i = γ·C·m^π_(i−1). Groups are sums of them, and the
    residual is (γC)^(N·w) applied to Q: it is not taken as a difference, so that the components
    summing to Q is a check and not a tautology.

    Args:
        mdp: the model.
        time_axis: γ, N and w.
        policy: `[S, A]`, a policy to evaluate; without one, the optimal policy is solved for.
        ties: whose future is told where optimal actions tie.
        dtype: the precision in which the table is stored; float32 halves its memory.

    Raises:
        InputError: `policy` is no policy of this model, `ties` or `dtype` is unknown, or N is too
            large for the model.

    Source: the paper's Eqs. trd-array and trd-binned-array, and Appendix A.

    >>> coin = MDP.from_transitions([[[(1.0, 0, 0.0, False)], [(1.0, 0, 2.0, True)]]])
    >>> exact(coin, TimeAxis(0.5, horizon=2)).decomposition.components[0].tolist()
    [[0.0, 1.0, 0.0], [2.0, 0.0, 0.0]]
    """
    gamma = time_axis.gamma
    if ties not in _TIED_POLICIES:
        raise InputError(f"The ties are {ties!r}.", closest(str(ties), _TIED_POLICIES))
    if not np.issubdtype(dtype, np.floating):
        raise InputError(f"The dtype is {np.dtype(dtype)}.", "Store components as floats.")
    if policy is None:
        solution, whose = optimal(mdp, gamma, ties=ties), _TIED_POLICIES[ties]
    else:
        solution, whose = evaluate(mdp, as_policy(policy, mdp.shape), gamma), "the given policy"
    components = RewardDecomposition(decompose(mdp, solution, time_axis, dtype), time_axis)
    table = ExactTable(mdp, solution, components, Future(whose))
    tied = solution.tied.any() if mdp.num_states > _MANY else table.ambiguous.any()
    if ties == "lowest" and tied:
        return replace(table, future=Future(f"{whose} (of tied actions the first)"))
    return table


def as_states(observations: Any, num_states: int) -> IntArray:
    """Returns observations as state indices, checked.

    Raises:
        InputError: an observation is not the index of a state.
    """
    states = np.asarray(observations)
    if states.dtype.kind not in "iu":
        raise InputError(
            f"The observations have type {states.dtype}.", "A table takes state indices."
        )
    if states.size and not 0 <= states.min() <= states.max() < num_states:
        raise InputError(
            f"The observations run from {states.min()} to {states.max()}.",
            f"States run from 0 to {num_states - 1}.",
        )
    return states
