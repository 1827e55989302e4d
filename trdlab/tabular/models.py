"""Models from arrays and sparse matrices."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.arrays import FloatArray, IntArray
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP, as_flags
from trdlab.tabular.reach import reachable

_LAYOUTS = (
    "Give [S, A, S], a scipy sparse matrix [S·A, S] with row s·A + a, or A sparse matrices [S, S]."
)


def from_arrays(transitions: Any, rewards: Any, terminated: Any = None, *, start: int = 0) -> MDP:
    """Builds a model from arrays or sparse matrices.

    Three layouts are understood, and each argument may have its own:

    - a dense array `[S, A, S]`, indexed by state, action, next state;
    - a scipy sparse matrix or array `[S·A, S]`, whose row s·A + a holds action a in state s;
    - a sequence of A scipy sparse matrices `[S, S]`, one for each action.

    Impossible transitions are left out, whatever `rewards` and `terminated` hold for them.

    Args:
        transitions: P(s′ | s, a).
        rewards: E[R | s, a, s′]; or a dense `[S, A]`, E[R | s, a]. With the latter, the variance
            of the reward counts only what depends on the next state: none at all.
        terminated: whether a transition ends the episode; or `[S]`, the states whose entry ends
            it. By default none does.
        start: the state in which episodes begin.

    Raises:
        InputError: the shapes do not fit together, a row does not sum to 1 or is empty, a
            probability is negative, a number is not finite, `terminated` holds anything but
            true and false, or there is no state `start`.

    >>> stay, go = [1.0, 0.0], [0.0, 1.0]
    >>> chain = from_arrays([[stay, go], [stay, go]], [[0.0, 1.0], [0.0, 2.0]])
    >>> chain.next_states.tolist(), chain.rewards.tolist()
    ([0, 1, 0, 1], [0.0, 1.0, 0.0, 2.0])
    """
    chances = _layout(transitions, "transitions")
    shape = _states_and_actions(chances)
    rows, columns, probabilities = _entries(chances)
    offsets = np.searchsorted(rows, np.arange(shape[0] * shape[1] + 1))
    per_transition = _rewards(rewards, shape, rows, columns)
    check_finite(probabilities, per_transition, lambda k: divmod(int(rows[k]), shape[1]))
    ends = None if terminated is None else _ends(terminated, shape, rows, columns)
    return MDP(
        offsets=offsets.astype(np.int64),
        next_states=columns,
        probabilities=probabilities,
        rewards=per_transition,
        terminated=np.zeros(len(rows), dtype=np.bool_) if ends is None else ends,
        num_actions=shape[1],
        start=start,
    )


def part_after(mdp: MDP, state: int) -> MDP:
    """Returns the model of a state and of what can follow it; in its order, with it as `start`.

    The state's Q-values are the same in it, however much smaller it is.

    >>> move = [[(1.0, 2, 1.0, False)]], [[(1.0, 0, 5.0, False)]], [[(1.0, 1, 2.0, True)]]
    >>> part = part_after(MDP.from_transitions(move), 0)
    >>> part.num_states, part.start, part.rewards.tolist()
    (2, 0, [1.0, 2.0])
    """
    kept = reachable(mdp, np.arange(mdp.num_states) == state)
    transitions, index = kept[mdp.transition_states], np.cumsum(kept) - 1
    following = mdp.next_states[transitions]
    lengths = np.diff(mdp.offsets)[np.repeat(kept, mdp.num_actions)]
    return MDP(
        offsets=np.concatenate(([0], np.cumsum(lengths))),
        next_states=np.where(kept[following], index[following], index[state]),  # else it is over
        probabilities=mdp.probabilities[transitions],
        rewards=mdp.rewards[transitions],
        terminated=mdp.terminated[transitions],
        num_actions=mdp.num_actions,
        start=int(index[state]),
    )


# ---- reading arrays of any layout ----------------------------------------------------------------


def _layout(given: Any, name: str) -> Any:
    """Returns a dense array of float64, or a CSR matrix `[S·A, S]`."""
    if hasattr(given, "tocsr"):
        return _canonical(given)
    if isinstance(given, (list, tuple)) and given and all(hasattr(m, "tocsr") for m in given):
        return _interleaved(given, name)
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"The {name} are no array of numbers: {error}.", _LAYOUTS) from error


def _canonical(matrix: Any) -> Any:
    """Returns a sparse matrix as CSR, its entries in order and each one once."""
    rows = matrix.tocsr()
    if not rows.has_canonical_format:
        rows = rows.copy()
        rows.sum_duplicates()
    return rows


def _interleaved(matrices: Any, name: str) -> Any:
    """Returns `[S·A, S]` from A sparse matrices `[S, S]`."""
    from scipy.sparse import vstack

    num_states = matrices[0].shape[1]
    if any(matrix.shape != (num_states, num_states) for matrix in matrices):
        shapes = ", ".join(str(matrix.shape) for matrix in matrices)
        raise InputError(f"The {name} are sparse matrices of shapes {shapes}.", _LAYOUTS)
    order = np.arange(len(matrices) * num_states).reshape(len(matrices), num_states)
    return _canonical(vstack(matrices, format="csr")[order.T.ravel()])


def _states_and_actions(chances: Any) -> tuple[int, int]:
    shape = chances.shape
    if chances.ndim == 3 and shape[0] == shape[2] > 0 < shape[1]:
        return int(shape[0]), int(shape[1])
    sparse = hasattr(chances, "tocsr") and chances.ndim == 2
    if sparse and shape[1] > 0 < shape[0] and shape[0] % shape[1] == 0:
        return int(shape[1]), int(shape[0] // shape[1])
    turned = chances.ndim == 3 and shape[1] == shape[2]
    cure = "Put the states first: numpy.swapaxes(transitions, 0, 1)." if turned else _LAYOUTS
    raise InputError(f"The transitions have shape {shape}.", cure)


def _entries(chances: Any) -> tuple[IntArray, IntArray, FloatArray]:
    """Returns row, column and value of everything that is not zero (NaN included), row by row."""
    if not hasattr(chances, "tocsr"):
        flat = chances.reshape(-1, chances.shape[2])
        rows, columns = np.nonzero(flat)
        return rows, columns, flat[rows, columns]
    rows = np.repeat(np.arange(chances.shape[0]), np.diff(chances.indptr))
    columns, values = chances.indices.astype(np.int64), chances.data.astype(np.float64)
    if values.all():
        return rows, columns, values
    kept = values != 0.0
    return rows[kept], columns[kept], values[kept]


def _rewards(
    given: Any, shape: tuple[int, int], rows: IntArray, columns: IntArray
) -> npt.NDArray[np.float64]:
    rewards = _layout(given, "rewards")
    if rewards.shape == shape and not hasattr(rewards, "tocsr"):
        return np.asarray(rewards.ravel()[rows])
    return _at(rewards, shape, rows, columns, "rewards", f"{shape} for E[R | s, a], ")


def _ends(given: Any, shape: tuple[int, int], rows: IntArray, columns: IntArray) -> Any:
    ends = _layout(given, "terminated")
    if ends.shape == shape[:1]:
        return as_flags(ends)[columns]
    return as_flags(_at(ends, shape, rows, columns, "terminated", f"{shape[:1]} for states, "))


def _at(
    array: Any, shape: tuple[int, int], rows: IntArray, columns: IntArray, name: str, also: str
) -> npt.NDArray[np.float64]:
    """Returns `[K]`: the entries of an array of any layout at the transitions."""
    num_states, num_actions = shape
    flat = (num_states * num_actions, num_states)
    if hasattr(array, "tocsr") and array.shape == flat:
        return np.asarray(array[rows, columns], dtype=np.float64).ravel()
    if array.shape == (num_states, num_actions, num_states):
        return np.asarray(array.reshape(flat)[rows, columns])
    raise InputError(
        f"The {name} have shape {array.shape}, the transitions are of {num_states} states and "
        f"{num_actions} actions.",
        f"Give {also}or one of the layouts of the transitions.",
    )


def check_finite(
    probabilities: FloatArray, rewards: FloatArray, place: Callable[[int], tuple[int, int]]
) -> None:
    """Refuses numbers that are not finite; `place` tells a transition's state and action.

    Raises:
        InputError: there are some; the message names the first.
    """
    for what, values in (("probability", probabilities), ("reward", rewards)):
        if not np.isfinite(values).all():
            bad = int(np.argmin(np.isfinite(values)))
            state, action = place(bad)
            raise InputError(
                f"A {what} of state {state}, action {action} is {values[bad]}.",
                "It must be a finite number.",
            )
