"""The linear equations of a policy's future, x = b + M·x with M = γ·C^π, to the last digits.

No entry of M is negative, and everything here keeps it that way: numbers of one sign are only
added. So the digits of a value that is 10⁻³⁰⁰ of the largest are as right as the largest's own.
Small chains are inverted. In large ones the future flows: states are put in the order in which
their likeliest next states lie, and a pass through that order (Gauss–Seidel) is nearly the answer,
or the answer itself where nothing goes back.
"""

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP, SMALL, take_rows

if TYPE_CHECKING:
    from scipy.sparse import csr_array

UNIT = float(np.finfo(np.float64).eps)
FINE = 6.0 * UNIT
"""The relative change of a pass that ends a solve."""
LEAST = 1e-300
"""What is smaller has lost its digits."""


class Chain(Protocol):
    """A policy's M `[S, S]`, ready to be solved with."""

    terms: int
    """The most numbers that are added up for one state."""

    def ahead(self, x: FloatArray) -> FloatArray:
        """Returns M·x `[S]`."""

    def solve(
        self, right: FloatArray, start: FloatArray | None = None, tolerance: float = FINE
    ) -> FloatArray:
        """Returns x `[S]` with x = right + M·x, from a start."""

    def guess_cover(self, right: FloatArray) -> FloatArray:
        """Returns about what (I − M)⁻¹·right is, quickly."""


def chain_of(mdp: MDP, policy: FloatArray, gamma: float, among: BoolArray | None = None) -> Chain:
    """Returns the chain of a policy `[S, A]`; of the states `among [S]` only, if that is given."""
    if mdp.num_states > SMALL:
        from trdlab.tabular.passes import Sparse

        matrix = followed(mdp, policy, gamma)
        return Sparse(matrix if among is None else matrix[among][:, among])
    size = mdp.num_states
    weights = gamma * policy[mdp.transition_states, mdp.transition_actions] * mdp.continuation
    entries = mdp.transition_states * size + mdp.next_states
    dense = np.asarray(np.bincount(entries, weights, size * size), dtype=np.float64)
    dense = dense.reshape(size, size)
    terms = int(np.bincount(mdp.transition_states[weights > 0.0], minlength=1).max())
    return _Dense(dense if among is None else dense[np.ix_(among, among)], terms)


def followed(mdp: MDP, policy: FloatArray, gamma: float) -> "csr_array":
    """Returns M `[S, S]` of a policy `[S, A]` as a sparse matrix."""
    from scipy.sparse import csr_array

    rows = _single_rows(policy)
    if rows is not None:
        chain = take_rows(mdp.matrix, rows)
        chain.data *= gamma
        return chain
    weights = gamma * policy[mdp.transition_states, mdp.transition_actions] * mdp.continuation
    columns, pointers = mdp.matrix.indices, mdp.offsets[:: mdp.num_actions]
    shape = (mdp.num_states, mdp.num_states)
    return csr_array((weights, columns, pointers.astype(columns.dtype)), shape)


def averaging(policy: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Returns the map from x `[S, A]` to x^π `[S]`, Σ_a π(a|s) x(s, a)."""
    rows = _single_rows(policy)
    if rows is None:
        return lambda x: np.asarray((policy * x).sum(axis=1))
    return lambda x: x.ravel().take(rows)


def _single_rows(policy: FloatArray) -> IntArray | None:
    """Returns `[S]`, s·A + a of the one action that is taken in each state, if it is one."""
    rows = np.flatnonzero(policy)  # at least one in each state: its probabilities sum to 1
    single = len(rows) == len(policy) and bool((policy.ravel().take(rows) == 1.0).all())
    return rows if single else None


def cover(chain: Chain, right: FloatArray, gamma: float) -> FloatArray:
    """Returns y `[S]`, proven to be at least (I − M)⁻¹·right, and not much more.

    y ≥ (I − M)⁻¹·x holds wherever y − M·y ≥ x does. A y that is short of it by a factor is
    enlarged; one that is short of it by σ in some state, because rounding decides there, gets
    σ / (1 − γ) added everywhere.

    Args:
        chain: M.
        right: `[S]`, not negative.
        gamma: the largest sum of a row of M, less than 1.
    """
    y = chain.guess_cover(right)
    for tolerance in (1e-3, 1e-6, 1e-9, FINE):
        proven = _proven(chain, y)
        if (proven * 4.0 >= right).all():
            enlarged = right > proven
            factor = float((right[enlarged] / proven[enlarged]).max()) if enlarged.any() else 1.0
            return np.asarray(1.01 * factor * y)
        y = np.abs(chain.solve(right, y, tolerance))
    y *= 1.01
    return np.asarray(y + 1.01 * max(float((right - _proven(chain, y)).max()), 0.0) / (1.0 - gamma))


def _proven(chain: Chain, y: FloatArray) -> FloatArray:
    """Returns at most y − M·y `[S]`, whatever was lost to rounding."""
    return np.asarray(y - chain.ahead(y) - 2.0 * (4 + chain.terms) * UNIT * y)


class _Dense:
    """A small chain, by its inverse.

    The transposed system is inverted: its largest entry of each column is on the diagonal, so
    that no rows are exchanged, and numbers of one sign are only added.
    """

    def __init__(self, matrix: FloatArray, terms: int) -> None:
        self._matrix, self.terms = matrix, terms

    @cached_property
    def _inverse(self) -> FloatArray:
        try:
            return np.linalg.inv(np.eye(len(self._matrix)) - self._matrix.T).T
        except np.linalg.LinAlgError as error:
            raise endless() from error

    def ahead(self, x: FloatArray) -> FloatArray:
        return np.asarray(self._matrix @ x)

    def solve(
        self, right: FloatArray, start: FloatArray | None = None, tolerance: float = FINE
    ) -> FloatArray:
        return np.asarray(self._inverse @ right)

    def guess_cover(self, right: FloatArray) -> FloatArray:
        return np.abs(self._inverse @ right)


def endless() -> InputError:
    """Returns the error for a future too long for double precision."""
    return InputError(
        "The values are out of reach of double precision: the future is all but endless.",
        "Choose a smaller gamma.",
    )
