"""A finite Markov decision process, stored as the list of its transitions."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError

_Item = TypeVar("_Item")
_Table = Sequence[_Item] | Mapping[int, _Item]  # by number: a list, or a dict as Gymnasium has it

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_UNIT = float(np.finfo(np.float64).eps)
_UNDERFLOW = float(np.finfo(np.float64).smallest_subnormal)
_SINGLE = float(np.finfo(np.float32).eps)
_INEXACT = 1e-9  # how far a sum of probabilities may be from 1
SMALL = 300
"""States up to which numpy alone is quicker than importing scipy."""


@dataclass(frozen=True, eq=False)
class MDP:
    """S states, A actions, K transitions; row s·A + a holds the transitions of action a in s.

    A terminated transition pays its reward and ends the episode: nothing follows from its next
    state, whatever that state's own row says.

    Args:
        offsets: `[S·A + 1]`, where each row starts among the transitions.
        next_states: `[K]`, s′.
        probabilities: `[K]`, P(s′ | s, a); each row sums to 1.
        rewards: `[K]`, E[R | s, a, s′].
        terminated: `[K]`, whether the transition ends the episode.
        num_actions: A.
        start: the state in which episodes begin.
        rounded_rows: the rows that were given in single precision; they are divided by their sum,
            where that differs from 1 by no more than such numbers do.

    Raises:
        InputError: a row is empty or does not sum to 1, a probability is negative, a number is
            not finite, a state does not exist, or the arrays do not fit together.
    """

    offsets: IntArray
    next_states: IntArray
    probabilities: FloatArray
    rewards: FloatArray
    terminated: BoolArray
    num_actions: int
    start: int = 0
    rounded_rows: int = 0

    def __repr__(self) -> str:
        return f"<MDP: {self.num_states} states, {self.num_actions} actions>"

    def __post_init__(self) -> None:
        arrays = (self.next_states, self.probabilities, self.rewards, self.terminated)
        ends = self.offsets[[0, -1]].tolist()
        if self.num_actions < 1 or (len(self.offsets) - 1) % self.num_actions:
            raise InputError(
                f"{len(self.offsets) - 1} rows do not divide among {self.num_actions} actions.",
                "Give every state the same actions.",
            )
        if any(array.shape != (ends[1],) for array in arrays) or ends[0] != 0:
            raise InputError(
                f"The offsets run from {ends[0]} to {ends[1]}, the arrays have shapes "
                f"{', '.join(str(array.shape) for array in arrays)}.",
                "Give one entry per transition.",
            )
        object.__setattr__(self, "terminated", as_flags(self.terminated))
        if not np.isfinite(self.rewards).all() or not np.isfinite(self.probabilities).all():
            raise InputError("A reward or probability is not a finite number.", "Check the model.")
        if np.any(np.diff(self.offsets) <= 0):
            row = int(np.argmax(np.diff(self.offsets) <= 0))
            raise InputError(f"{self._row_name(row)} has no transition.", "Give it at least one.")
        if np.any(self.probabilities < 0.0):
            row = self._row_of(int(np.argmax(self.probabilities < 0.0)))
            raise InputError(
                f"{self._row_name(row)} has a negative probability.", "Check the model."
            )
        self._divide_rounded_rows()
        sums = np.add.reduceat(self.probabilities, self.offsets[:-1])
        if np.any(np.abs(sums - 1.0) > _INEXACT):
            row = int(np.argmax(np.abs(sums - 1.0)))
            raise InputError(
                f"The probabilities of {self._row_name(row)} sum to {sums[row]:.12g}.",
                "They must sum to 1.",
            )
        if np.any((self.next_states < 0) | (self.next_states >= self.num_states)):
            raise InputError(
                "A transition leads to a state that does not exist.", "Check the model."
            )
        if not isinstance(self.start, int | np.integer) or not 0 <= self.start < self.num_states:
            raise InputError(
                f"The start state {self.start!r} does not exist.",
                f"States are numbers from 0 to {self.num_states - 1}.",
            )

    @classmethod
    def from_transitions(
        cls,
        transitions: "_Table[_Table[Sequence[tuple[float, int, float, bool]]]]",
        start: int = 0,
    ) -> "MDP":
        """Builds a model from `transitions[s][a]`, a list of (probability, s′, reward, terminated).

        This is the layout of the `P` table of Gymnasium's toy-text environments. Episodes begin in
        the state `start`.

        Raises:
            InputError: nothing follows an action, or not all states have the same ones.

        >>> coin = MDP.from_transitions([[[(1.0, 0, 1.0, True)], [(1.0, 0, 0.0, False)]]])
        >>> coin.num_states, coin.num_actions, coin.expected_rewards.tolist()
        (1, 2, [[1.0, 0.0]])
        """
        states = [transitions[s] for s in range(len(transitions))]
        rows = [actions[a] for actions in states for a in range(len(actions))]
        flat = [transition for row in rows for transition in row]
        if not flat:
            raise InputError("The model has no transition.", "Give each state and action one.")
        uneven = [s for s, actions in enumerate(states) if len(actions) != len(states[0])]
        if uneven:
            raise InputError(
                f"State {uneven[0]} has {len(states[uneven[0]])} actions, state 0 has "
                f"{len(states[0])}.",
                "Give every state the same actions.",
            )
        probabilities, next_states, rewards, terminated = zip(*flat, strict=True)
        return cls(
            offsets=np.cumsum([0, *map(len, rows)]),
            next_states=np.array(next_states, dtype=np.int64),
            probabilities=np.array(probabilities, dtype=np.float64),
            rewards=np.array(rewards, dtype=np.float64),
            terminated=as_flags(terminated),
            num_actions=len(states[0]),
            start=start,
        )

    @cached_property
    def num_states(self) -> int:
        """S."""
        return (len(self.offsets) - 1) // self.num_actions

    @cached_property
    def shape(self) -> tuple[int, int]:
        """S and A."""
        return self.num_states, self.num_actions

    @cached_property
    def continuation(self) -> FloatArray:
        """`[K]`: the probability of each transition, zero where the episode ends."""
        return np.where(self.terminated, 0.0, self.probabilities)

    @cached_property
    def transition_states(self) -> IntArray:
        """`[K]`: the state each transition leaves."""
        return np.repeat(np.arange(self.num_states), np.diff(self.offsets[:: self.num_actions]))

    @cached_property
    def transition_actions(self) -> IntArray:
        """`[K]`: the action of each transition."""
        rows = np.arange(self.num_states * self.num_actions)
        return np.repeat(rows % self.num_actions, np.diff(self.offsets))

    @cached_property
    def matrix(self) -> "csr_array":
        """`[S·A, S]`: the continuation as a sparse matrix, which shares its memory."""
        from scipy.sparse import csr_array

        rows = len(self.offsets) - 1
        index = np.int32 if max(len(self.next_states), rows) < 2**31 else np.int64
        columns, pointers = self.next_states.astype(index), self.offsets.astype(index)
        return csr_array((self.continuation, columns, pointers), (rows, self.num_states))

    @cached_property
    def expected_rewards(self) -> FloatArray:
        """`[S, A]`: E[R | s, a]; 0 where its parts cancel to less than rounding can tell from 0."""
        means, lost = self._summed_rewards
        return np.where(np.abs(means) <= lost, 0.0, means)

    @cached_property
    def reward_bound(self) -> FloatArray:
        """`[S, A]`: how far `expected_rewards` can be from the exact ones (proven)."""
        means, lost = self._summed_rewards
        return np.where(np.abs(means) <= lost, 2.0 * lost, lost)

    @cached_property
    def _summed_rewards(self) -> tuple[FloatArray, FloatArray]:
        """The sums `[S, A]` of probability times reward, and what rounding can take from them."""
        parts = self.probabilities * self.rewards
        means = self.per_action(parts)
        size = self.per_action(np.abs(parts)) if (parts < 0.0).any() else means
        longest = int(np.diff(self.offsets).max())
        return means, (longest + 1) * (_UNIT * size + _UNDERFLOW)

    @cached_property
    def leaves_state(self) -> BoolArray:
        """`[S, A]`: whether an action can lead anywhere but back to its own state."""
        moves = (self.next_states != self.transition_states) & (self.probabilities > 0.0)
        return self.per_action(moves.astype(np.float64)) > 0.0

    @cached_property
    def terminal_states(self) -> BoolArray:
        """`[S]`: states that no unterminated transition enters and whose rows all terminate."""
        goes_on = np.zeros(self.num_states, dtype=np.bool_)
        goes_on[self.transition_states[self.continuation > 0.0]] = True
        goes_on[self.next_states[self.continuation > 0.0]] = True
        goes_on[self.start] = True
        return ~goes_on

    def expect(self, values: FloatArray) -> FloatArray:
        """Returns `[S, A]`: the expected `values [S]` of the next state, 0 once terminated."""
        if self.num_states <= SMALL:
            return self.per_action(self.continuation * values[self.next_states])
        ahead: FloatArray = self.matrix @ values
        return ahead.reshape(self.shape)

    def per_state(self, per_transition: FloatArray) -> FloatArray:
        """Returns `[S]`: the sums of `per_transition [K]` over all actions of a state."""
        return np.asarray(np.add.reduceat(per_transition, self.offsets[: -1 : self.num_actions]))

    def with_rewards(self, rewards: FloatArray) -> "MDP":
        """Returns the same dynamics with other rewards `[K]`.

        Raises:
            InputError: a reward is not finite.
        """
        if not np.isfinite(rewards).all():
            raise InputError("A reward is not a finite number.", "Check the model.")
        other = copy(self)  # with what is derived from the dynamics, but not from the rewards
        object.__setattr__(other, "rewards", rewards)
        for name in ("_summed_rewards", "expected_rewards", "reward_bound"):
            other.__dict__.pop(name, None)
        return other

    def per_action(self, per_transition: FloatArray) -> FloatArray:
        """Returns `[S, A]`: the sums of `per_transition [K]` over the rows."""
        sums = np.add.reduceat(per_transition, self.offsets[:-1])
        return np.asarray(sums.reshape(self.num_states, self.num_actions))

    def _divide_rounded_rows(self) -> None:
        """Divides rows by their sum that single precision has kept from summing to 1."""
        sums, lengths = (
            np.add.reduceat(self.probabilities, self.offsets[:-1]),
            np.diff(self.offsets),
        )
        off = np.abs(sums - 1.0)
        rounded = (off > _INEXACT) & (off <= (lengths + 1) * _SINGLE)
        single = self.probabilities == self.probabilities.astype(np.float32)
        rounded &= np.logical_and.reduceat(single, self.offsets[:-1])
        if rounded.any():
            divided = self.probabilities / np.repeat(np.where(rounded, sums, 1.0), lengths)
            object.__setattr__(self, "probabilities", divided)
            object.__setattr__(self, "rounded_rows", self.rounded_rows + int(rounded.sum()))

    def _row_of(self, transition: int) -> int:
        return int(np.searchsorted(self.offsets, transition, side="right")) - 1

    def _row_name(self, row: int) -> str:
        return f"State {row // self.num_actions}, action {row % self.num_actions}"


def take_rows(matrix: "csr_array", rows: IntArray) -> "csr_array":
    """Returns `matrix[rows]`; where all rows hold equally many entries, in half the time.

    Args:
        matrix: `[M, S]`.
        rows: at most M of them.
    """
    from scipy.sparse import csr_array

    length = int(matrix.indptr[1])
    if not length or not (np.diff(matrix.indptr) == length).all():
        return matrix[rows]
    data, indices = (
        part.reshape(-1, length).take(rows, axis=0).ravel()
        for part in (matrix.data, matrix.indices)
    )
    return csr_array((data, indices, matrix.indptr[: len(rows) + 1]), (len(rows), matrix.shape[1]))


def as_flags(values: Any) -> BoolArray:
    """Returns true or false for each of `values`, checked.

    Raises:
        InputError: a value is neither, nor 0 or 1.
    """
    flags = np.asarray(values)
    if flags.dtype == np.bool_:
        return flags
    wrong = flags[(flags != 0) & (flags != 1)]
    if wrong.size:
        raise InputError(
            f"Whether a transition terminates is told by {wrong[0]}.", "Give True or False."
        )
    return flags.astype(np.bool_)


def as_policy(probabilities: Any, shape: tuple[int, ...]) -> FloatArray:
    """Returns a stochastic policy `[S, A]`, checked.

    Args:
        probabilities: of each action in each state.
        shape: S and A.

    Raises:
        InputError: wrong shape, or a row that is no probability distribution.
    """
    policy = np.asarray(probabilities, dtype=np.float64)
    if policy.shape != shape:
        raise InputError(f"The policy has shape {policy.shape}.", f"The model needs {shape}.")
    if not np.all(policy >= 0.0) or np.any(np.abs(policy.sum(axis=1) - 1.0) > 1e-9):
        raise InputError(
            "A row of the policy is not a probability distribution.",
            "Each state's action probabilities must be at least 0 and sum to 1.",
        )
    return policy
