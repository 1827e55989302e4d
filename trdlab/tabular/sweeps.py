"""Nearly optimal actions of large models: modified policy iteration over blocks of states.

Three things make it quick. States are ordered by their distance from reward, so that a block is
fed by the blocks before it, and fits into the cache; and their first values are those of heading
there. A block rests while nothing that it reads changes, so that work is done only where values
still move. And evaluating the chosen actions takes a product of S rows, repeated until it pays to
look at all S·A rows again. Changes are relative, so that far rewards decide as near ones do. See
Puterman and Shin (1978) for modified policy iteration, and Wingate and Seppi (2005) for
prioritised blocks.
"""

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from trdlab.arrays import FloatArray, IntArray
from trdlab.tabular.mdp import MDP, take_rows

if TYPE_CHECKING:
    from scipy.sparse import csr_array

BLOCK = 2_048
_NEARLY = 1e-3  # relative change of a sweep, at which values are good enough to choose by
_BURST, _EVALUATE_TO = 3, 0.1
# sweeps over a block between two looks at how much it changes, and the part of the last
# improvement's change to leave
_MAX_BURSTS = 16  # before all actions are compared again
_MAX_ROUNDS, _MAX_TURNS = 3, 4  # over all blocks, and in one: it is only a beginning
_LEAST = 1e-300


class _Block:
    """The states of `span` in the new order: all their actions, and the chosen ones.

    Args:
        span: which states, b of them.
        matrix: `[b·A, S]`, γ·C.
        rewards: `[b·A]`.
    """

    def __init__(self, span: slice, matrix: "csr_array", rewards: FloatArray) -> None:
        self.span, self.matrix, self.rewards = span, matrix, rewards
        size = span.stop - span.start
        self._first_rows = np.arange(0, len(rewards), len(rewards) // size)  # [b], of each state
        lengths = np.diff(matrix.indptr)
        self._length = int(lengths[0]) if (lengths == lengths[0]).all() else None  # of every row
        self._rows = np.full(size, -1)  # [b], of the chosen actions: none yet
        self._chain, self._gains = matrix, rewards  # [b, S] and [b]: those rows, their rewards

    @property
    def actions(self) -> IntArray:
        """`[b]`: the chosen ones."""
        return self._rows - self._first_rows

    def settle(self, values: FloatArray) -> float:
        """Improves and evaluates until little changes; returns the largest change of a sweep."""
        change = most = self.improve(values)
        for _ in range(_MAX_TURNS):
            if change <= _NEARLY:
                break
            aim = max(_EVALUATE_TO * change, _NEARLY)
            for _ in range(_MAX_BURSTS):
                if self.evaluate(values, _BURST) <= aim:
                    break
            change = self.improve(values)
        return most

    def improve(self, values: FloatArray) -> float:
        """Applies the Bellman operator, chooses the best actions; returns the largest change."""
        q_values = self.matrix @ values
        q_values += self.rewards
        rows = q_values.reshape(len(self._rows), -1).argmax(axis=1)  # the first of equals
        rows += self._first_rows
        if not np.array_equal(rows, self._rows):
            self._choose(rows)
        return self._replace(values, q_values[rows])

    def evaluate(self, values: FloatArray, sweeps: int) -> float:
        """Applies the chosen actions' operator some times; returns the last largest change."""
        own = values[self.span]
        for _ in range(sweeps - 1):
            np.add(self._chain @ values, self._gains, out=own)
        return self._replace(values, self._chain @ values + self._gains)

    def _choose(self, rows: IntArray) -> None:
        begins = self._rows[0] < 0
        self._rows, self._gains = rows, self.rewards[rows]
        if begins or self._length is None:
            self._chain = take_rows(self.matrix, rows)
            return
        for name in ("data", "indices"):  # rows of one length take the places of those before
            new = getattr(self.matrix, name).reshape(-1, self._length)
            old = getattr(self._chain, name).reshape(-1, self._length)
            new.take(rows, axis=0, out=old, mode="clip")  # with mode='raise' numpy copies twice

    def _replace(self, values: FloatArray, new: FloatArray) -> float:
        own = values[self.span]
        size = np.maximum(np.maximum(np.abs(new), np.abs(own)), _LEAST)
        change = float((np.abs(new - own) / size).max())
        own[:] = new
        return change


def first_actions(mdp: MDP, gamma: float) -> tuple[IntArray, FloatArray]:
    """Returns nearly optimal actions `[S]` of a large model, and about what they are worth `[S]`.

    Args:
        mdp: the model.
        gamma: the discount factor, in [0, 1).
    """
    order, ahead, chance = _toward_reward(mdp)
    start = _guess(mdp, gamma, ahead, chance)
    order = order if mdp.num_states > BLOCK else np.arange(mdp.num_states)
    blocks, readers = _blocks(mdp, gamma, order)
    values, dirty = start[order], set(range(len(blocks)))
    for _ in range(_MAX_ROUNDS):
        moved = [b for b in sorted(dirty) if blocks[b].settle(values) > _NEARLY]
        dirty = set().union(*(readers[b] for b in moved))
        if not dirty:
            break
    actions, found = np.empty(mdp.num_states, dtype=np.int64), np.empty(mdp.num_states)
    found[order] = values
    actions[order] = np.concatenate([block.actions for block in blocks])
    return actions, found


def _blocks(mdp: MDP, gamma: float, order: IntArray) -> tuple[list[_Block], list[set[int]]]:
    """Returns the blocks of the new order, and of each those that read it, itself among them."""
    from scipy.sparse import csr_array

    size, num_actions = mdp.num_states, mdp.num_actions
    if size <= BLOCK:
        rewards, whole = mdp.expected_rewards.ravel(), mdp.matrix
        matrix = csr_array((gamma * whole.data, whole.indices, whole.indptr), whole.shape)
        return [_Block(slice(0, size), matrix, rewards)], [{0}]
    place = np.empty(size, dtype=np.int32)
    place[order] = np.arange(size, dtype=np.int32)
    blocks: list[_Block] = []
    readers: list[set[int]] = [{b} for b in range(-(-size // BLOCK))]
    for b in range(len(readers)):
        span = slice(b * BLOCK, min((b + 1) * BLOCK, size))
        states = order[span]
        numbers = (states[:, None] * num_actions + np.arange(num_actions)).ravel()
        rows = take_rows(mdp.matrix, numbers)
        columns = place[rows.indices]
        matrix = csr_array((gamma * rows.data, columns, rows.indptr), rows.shape)
        blocks.append(_Block(span, matrix, mdp.expected_rewards[states].ravel()))
        for read in np.flatnonzero(np.bincount(columns // BLOCK)):
            readers[read].add(b)
    return blocks, readers


def _toward_reward(mdp: MDP) -> tuple[IntArray, IntArray, FloatArray]:
    """Finds the shortest way to reward: to where something positive is paid, or else to an end.

    Returns:
        The states `[S]` by their distance; each one's next state `[S]` on the way, S where the way
        ends and negative where there is none; and the chance `[S]` of the likeliest step there.
    """
    from scipy.sparse import csc_array
    from scipy.sparse.csgraph import breadth_first_order

    size, states, targets = mdp.num_states, mdp.transition_states, mdp.matrix.indices.copy()
    over = np.flatnonzero(mdp.continuation == 0.0)
    targets[over] = states[over]
    goal = (mdp.rewards > 0.0) & (mdp.probabilities > 0.0)
    targets[goal if goal.any() else mdp.terminated] = size
    ends = np.append(mdp.offsets[:: mdp.num_actions], len(targets)).astype(targets.dtype)
    backward = csc_array((mdp.probabilities, targets, ends), (size + 1, size + 1))
    found, ahead = breadth_first_order(backward, size)
    order = np.concatenate([found[1:], np.flatnonzero(ahead[:size] < 0)])
    steps = mdp.probabilities * (targets == ahead[states])  # [K]
    chance = np.maximum.reduceat(steps, mdp.offsets[: -1 : mdp.num_actions])
    return order, ahead[:size].astype(np.int64), chance


def _guess(mdp: MDP, gamma: float, ahead: IntArray, chance: FloatArray) -> FloatArray:
    """Returns the values `[S]` of heading for reward, if all else that happens led nowhere.

    To get ahead with chance p, or else to stay, gives v = (r + γ·p·v(ahead)) / (1 − γ·(1 − p)).
    """
    lasting = 1.0 - gamma * (1.0 - chance)
    reward = reduce(np.maximum, mdp.expected_rewards.T)  # quicker than along a short axis
    values = np.asarray(reward / lasting)
    within = (ahead >= 0) & (ahead < mdp.num_states)
    share = np.where(within, gamma * chance, 0.0) / lasting
    way = np.where(within, ahead, 0)
    while share.any():  # look twice as far each time
        values += share * values[way]
        share *= share[way]
        way = way[way]
    return values
