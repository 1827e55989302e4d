"""Large chains, solved by passes in the order in which the future flows."""

from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.tabular.chains import FINE, LEAST, Chain, endless
from trdlab.tabular.mdp import take_rows

if TYPE_CHECKING:
    from scipy.sparse import csr_array
    from scipy.sparse.linalg import SuperLU

_PASSES, _TOGETHER = 5, 20  # between two looks at what changes, and to extrapolate from
_PATIENCE, _MAX_LOOKS = 40, 4_000  # looks before a factorisation is tried, and in all
_FACTORISED_ANYWAY = 2_000  # states
_TRIES = 40  # passes
_MOSTLY_OVER = 0.25  # a likeliest step below which most futures end


class Sparse(Chain):
    """A large chain, by passes in the order of its flow; inside, states are numbered in it."""

    def __init__(self, matrix: "csr_array") -> None:
        from scipy.sparse import csr_array, eye_array

        matrix, self.terms = matrix.copy(), int(np.diff(matrix.indptr).max())
        matrix.eliminate_zeros()
        matrix.sum_duplicates()  # or the search for connected parts may never end
        size = matrix.shape[0]
        self._order, way = flow_order(matrix)
        place = np.empty(size, dtype=matrix.indices.dtype)
        place[self._order] = np.arange(size, dtype=place.dtype)
        self._way = place[way[self._order]]
        taken = take_rows(matrix, self._order)
        columns = place[taken.indices]
        self._matrix = csr_array((taken.data, columns, taken.indptr), taken.shape)
        back = columns > np.repeat(np.arange(size), np.diff(taken.indptr))
        self._back, onward = _masked(self._matrix, back), _masked(self._matrix, ~back)
        self._onward = _factorised(eye_array(size, format="csr") - onward, "NATURAL")

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
                x = _solved(self._factor, b)
                break
            if not rest:
                pause = 1 if change < 0.1 * before else 2 * pause
            rest, before = (rest - 1 if rest else pause), change
        return self._placed(x)

    def _pass(self, b: FloatArray, x: FloatArray) -> FloatArray:
        return _solved(self._onward, b + self._back @ x)

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
            y = _solved(self._onward, b + back)
            back, before = self._back @ y, back
            if (back - before <= 0.5 * b).all():  # that is (I − M)·y ≥ b / 2
                break
        return self._placed(y)

    def _placed(self, x: FloatArray) -> FloatArray:
        placed = np.empty_like(x)
        placed[self._order] = x
        return placed

    @cached_property
    def _factor(self) -> "SuperLU[Any]":
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
        toward = np.where(before < 0, np.arange(len(before)), before)
        width = np.bincount(_depth(toward)[near]).max()
        return len(near) <= _FACTORISED_ANYWAY or bool(width <= 8.0 * np.sqrt(len(near)))


def _solved(factor: "SuperLU[Any]", right: Any) -> FloatArray:
    """Returns the solution of the system whose transpose was factorised."""
    solution: FloatArray = factor.solve(right, "T")  # type: ignore[call-overload]  # is not in stubs
    return solution


def _masked(matrix: "csr_array", mask: BoolArray) -> "csr_array":
    """Returns a matrix with those entries only that `mask [K]` selects."""
    from scipy.sparse import csr_array

    pointers = np.concatenate(([0], np.cumsum(mask)))[matrix.indptr].astype(matrix.indptr.dtype)
    return csr_array((matrix.data[mask], matrix.indices[mask], pointers), matrix.shape)


def _factorised(matrix: "csr_array", order: Literal["NATURAL", "MMD_AT_PLUS_A"]) -> "SuperLU[Any]":
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
