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
    from scipy.sparse.linalg import SuperLU

UNIT = float(np.finfo(np.float64).eps)
ROUGH, FINE = 1e-8, 6.0 * UNIT
"""Relative changes of a pass that end a solve."""
LEAST = 1e-300
"""What is smaller has lost its digits."""

_PASSES, _TOGETHER = 5, 20  # between two looks at what changes, and to extrapolate from
_PATIENCE, _MAX_LOOKS = 40, 4_000  # looks before a factorisation is tried, and in all
_FACTORISED_ANYWAY = 2_000  # states
_TRIES = 40  # passes
_MOSTLY_OVER = 0.25  # a likeliest step below which most futures end


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
        matrix = followed(mdp, policy, gamma)
        return _Sparse(matrix if among is None else matrix[among][:, among])
    size = mdp.num_states
    weights = gamma * policy[mdp.transition_states, mdp.transition_actions] * mdp.continuation
    entries = mdp.transition_states * size + mdp.next_states
    dense = np.bincount(entries, weights, size * size).reshape(size, size)
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
    for tolerance in (ROUGH, 1e-6, 1e-9, FINE):
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


class _Sparse:
    """A large chain, by passes in the order of its flow; inside, states are numbered in it."""

    def __init__(self, matrix: "csr_array") -> None:
        from scipy.sparse import csr_array, eye_array, tril, triu

        matrix, self.terms = matrix.copy(), int(np.diff(matrix.indptr).max())
        matrix.eliminate_zeros()
        matrix.sum_duplicates()  # or the search for connected parts may never end
        size = matrix.shape[0]
        self._order, way = flow_order(matrix)
        place = np.empty(size, dtype=matrix.indices.dtype)
        place[self._order] = np.arange(size, dtype=place.dtype)
        self._way = place[way[self._order]]
        rows = take_rows(matrix, self._order)
        self._matrix = csr_array((rows.data, place[rows.indices], rows.indptr), rows.shape)
        self._back = triu(self._matrix, 1, format="csr")
        onward = eye_array(size, format="csr") - tril(self._matrix, 0, format="csr")
        self._onward = _factorised(onward, "NATURAL")

    def ahead(self, x: FloatArray) -> FloatArray:
        return self._placed(self._matrix @ x[self._order])

    def solve(
        self, right: FloatArray, start: FloatArray | None = None, tolerance: float = FINE
    ) -> FloatArray:
        b = right[self._order]
        x = np.zeros_like(b) if start is None else start[self._order]
        mixed = bool((b > 0.0).any() and (b < 0.0).any())
        least, before = np.full(len(b), LEAST), np.inf
        pause = rest = 8
        for look in range(_MAX_LOOKS):
            if mixed and look % 4 == 0:  # what cancels is not known better than what it is made of
                least = np.maximum(np.abs(b) + self._matrix @ np.abs(x), LEAST)
            if rest:
                for _ in range(_PASSES):
                    x, last = self._pass(b, x), x
            else:
                x, last = self._extrapolated(b, x, least)
            change = float((np.abs(x - last) / np.maximum(np.abs(x), least)).max())
            if change <= tolerance or 0.5 * before < change < 1e-12:  # or only rounding is left
                break
            if look == _PATIENCE and self._is_narrow:
                x = self._factor.solve(b, "T")
                break
            if not rest:
                pause = 1 if change < 0.1 * before else 2 * pause
            rest, before = (rest - 1 if rest else pause), change
        return self._placed(x)

    def _pass(self, b: FloatArray, x: FloatArray) -> FloatArray:
        return np.asarray(self._onward.solve(b + self._back @ x, "T"))

    def _extrapolated(
        self, b: FloatArray, x: FloatArray, least: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Makes many passes, and combines them so that their relative steps nearly cancel.

        This is reduced rank extrapolation (Eddy 1979, Mešina 1977), good where few modes last. A
        number that would change its sign stays as it is. Returns the last two iterates.
        """
        steps = np.empty((_TOGETHER, len(b)))
        for step in steps:
            new = self._pass(b, x)
            np.subtract(new, x, out=step)
            x = new
        size = np.maximum(np.abs(x), least)
        steps /= size
        gram = steps @ steps.T
        gram[np.diag_indices(_TOGETHER)] += 1e-14 * np.trace(gram)
        weights = np.linalg.solve(gram, np.ones(_TOGETHER))
        beyond = np.cumsum(weights / weights.sum()) - weights / weights.sum()
        found = x - size * (beyond @ steps)
        found = np.where(np.sign(found) == np.sign(x), found, x)
        return self._pass(b, found), found

    def guess_cover(self, right: FloatArray) -> FloatArray:
        b, way = right[self._order], self._way
        # if all went the likeliest way, and errors are as large as what they are errors of
        share = np.minimum(np.minimum(self._matrix @ b, b), b[way]) / b[way]
        y = b.copy()
        for _ in range(64):  # look twice as far each time
            if not share.any():
                break
            y += share * y[way]
            share *= share[way]
            way = way[way]
        y *= 1.25
        back = self._back @ y
        for _ in range(_TRIES):
            y = self._onward.solve(b + back, "T")
            back, before = self._back @ y, back
            if (back - before <= 0.5 * b).all():  # that is (I − M)·y ≥ b / 2
                break
        return self._placed(y)

    def _placed(self, x: FloatArray) -> FloatArray:
        placed = np.empty_like(x)
        placed[self._order] = x
        return placed

    @cached_property
    def _factor(self) -> "SuperLU":
        from scipy.sparse import eye_array

        return _factorised(
            eye_array(len(self._order), format="csr") - self._matrix, "MMD_AT_PLUS_A"
        )

    @cached_property
    def _is_narrow(self) -> bool:
        """Whether few states are equally far from one of them, as on a map: so few fill in."""
        from scipy.sparse.csgraph import breadth_first_order, connected_components

        _, part = connected_components(self._matrix, directed=False)
        begin = int(np.flatnonzero(part == np.bincount(part).argmax())[0])
        near, before = breadth_first_order(self._matrix, begin, directed=False)
        before[before < 0] = np.flatnonzero(before < 0)
        width = np.bincount(_depth(before)[near]).max()
        return len(near) <= _FACTORISED_ANYWAY or bool(width <= 8.0 * np.sqrt(len(near)))


def _factorised(matrix: "csr_array", order: str) -> "SuperLU":
    """Factorises the transpose, without exchanging rows: numbers of one sign are only added."""
    from scipy.sparse.linalg import splu

    try:
        return splu(
            matrix.T.tocsc(),
            permc_spec=order,
            diag_pivot_thresh=0.0,
            panel_size=1 if order == "NATURAL" else None,  # nothing fills in
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:  # the system is singular
        raise endless() from error


def endless() -> InputError:
    """Returns the error for a future too long for double precision."""
    return InputError(
        "The values are out of reach of double precision: the future is all but endless.",
        "Choose a smaller gamma.",
    )


def flow_order(matrix: "csr_array") -> tuple[IntArray, IntArray]:
    """Returns the states `[S]` in the order of their flow, its end first; and each one's next.

    Strongly connected parts lie in the order of who leads to whom. Inside of them states lie by
    how many steps of the likeliest way it takes to where most chains end, or to a cycle.
    """
    from scipy.sparse.csgraph import connected_components

    size = matrix.shape[0]
    lengths, states = np.diff(matrix.indptr), np.arange(size)
    some, most = np.flatnonzero(lengths), np.zeros(size)
    if len(some):
        most[some] = np.maximum.reduceat(matrix.data, matrix.indptr[some])
    rows = np.repeat(states, lengths)
    likeliest = np.flatnonzero(matrix.data == most[rows])[::-1]
    way = states.copy()
    way[rows[likeliest]] = matrix.indices[likeliest]
    way = np.where(most < _MOSTLY_OVER, states, way)
    _, part = connected_components(matrix, connection="strong")
    return np.lexsort((_depth(way), part)), way


def _depth(way: IntArray) -> IntArray:
    """Returns `[S]`: how many steps it is to where `way [S]` stays, or comes back."""
    states, ahead = np.arange(len(way)), way
    for _ in range(len(way).bit_length()):  # look twice as far each time
        ahead = ahead[ahead]
    depth = np.ones(len(way), dtype=np.int64)
    depth[ahead] = 0  # after so many steps there are only cycles
    ahead = np.where(depth == 0, states, way)
    while depth[ahead].any():
        depth = depth + depth[ahead]
        ahead = ahead[ahead]
    return depth
