"""Sweeps of value iteration, and nearly optimal actions of a large model by blocks of states.

Three things make the blocks quick. States are ordered by their distance from reward, so that a
block is fed by the blocks before it, and fits into the cache; and their first values are those of
heading there. A block rests while nothing that it reads changes, so that work is done only where
values still move. And evaluating the chosen actions takes a product of S rows, repeated until it
pays to look at all S·A rows again. It ends once no action changes any more: what follows is exact
(see `trdlab.tabular.solve`). See Puterman and Shin (1978) for modified policy iteration, and
Wingate and Seppi (2005) for prioritised blocks.
"""

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from trdlab.arrays import FloatArray, IntArray
from trdlab.tabular.mdp import MDP, SMALL, take_rows

if TYPE_CHECKING:
    from scipy.sparse import csr_array

BLOCK = 16_384
_BURST, _EVALUATE_TO = 3, 0.1
# sweeps over a block between two looks at how much it changes, and the part of the last
# improvement's change to leave, if there are several blocks
_ALONE_BURST, _ALONE_EVALUATE_TO = 8, 1.0  # if there is only one: calls take most of the time
_MAX_BURSTS = 16  # before all actions are compared again
_MAX_ROUNDS = 100
_NEARLY = 1e-8  # of the largest value: a change that moves no action near by
_SWEEPS, _WORK = 16, 50_000  # of value iteration; more where they cost next to nothing


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

    def improve(self, values: FloatArray) -> tuple[float, bool]:
        """Applies the Bellman operator in place, and chooses the best actions.

        Returns:
            The largest change, and whether an action changed.
        """
        q_values = self.matrix @ values
        q_values += self.rewards
        rows = q_values.reshape(len(self._rows), -1).argmax(axis=1)  # the first of equals
        rows += self._first_rows
        other = not np.array_equal(rows, self._rows)
        if other:
            self._choose(rows)
        return self._replace(values, q_values[rows]), other

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
        change = float(np.abs(new - own).max())
        own[:] = new
        return change


def sweep_count(mdp: MDP) -> int:
    """Returns how many sweeps of value iteration take about as long as evaluating a policy."""
    return _SWEEPS if mdp.num_states <= SMALL else max(_SWEEPS, _WORK // mdp.num_states)


def swept(mdp: MDP, gamma: float, values: FloatArray, count: int) -> FloatArray:
    """Returns the values `[S]` after some sweeps of value iteration."""
    for _ in range(count):
        q_values = mdp.expected_rewards + gamma * mdp.expect(values)
        values = reduce(np.maximum, q_values.T)  # quicker than along a short axis
    return values


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
    part = _ALONE_EVALUATE_TO if len(blocks) == 1 else _EVALUATE_TO
    for _ in range(_MAX_ROUNDS):
        changes, settled = _improve(blocks, values, dirty)
        allowed = _NEARLY * float(np.abs(values).max())
        moved = {b for b, change in changes.items() if change > allowed}
        if settled or not moved:
            break
        target = max(part * max(changes.values()), allowed)
        moved |= _evaluate(blocks, readers, values, moved, target, allowed)
        dirty = set().union(*(readers[b] for b in moved))
    actions, found = np.empty(mdp.num_states, dtype=np.int64), np.empty(mdp.num_states)
    found[order] = values
    actions[order] = np.concatenate([block.actions for block in blocks])
    return actions, found


def _improve(
    blocks: list[_Block], values: FloatArray, todo: set[int]
) -> tuple[dict[int, float], bool]:
    """Improves blocks, in place; returns their largest changes, and whether all actions stayed."""
    changes, settled = {}, True
    for b in sorted(todo):
        changes[b], other = blocks[b].improve(values)
        settled = settled and not other
    return changes, settled


def _evaluate(
    blocks: list[_Block],
    readers: list[set[int]],
    values: FloatArray,
    todo: set[int],
    target: float,
    allowed: float,
) -> set[int]:
    """Evaluates blocks, and those that read them, until none changes by more than the target.

    Returns:
        The blocks that changed by more than `allowed`.
    """
    moved: set[int] = set()
    sweeps = _ALONE_BURST if len(blocks) == 1 else _BURST
    for _ in range(_MAX_BURSTS):
        active: set[int] = set()
        for b in sorted(todo):
            change = blocks[b].evaluate(values, sweeps)
            if change > allowed:
                moved.add(b)
            if change > target:
                active |= readers[b]
        todo = active
        if not todo:
            break
    return moved


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
