"""Values of large models: modified policy iteration over blocks of neighbouring states.

Three things make it quick. States are ordered by their distance from reward, so that a block is
fed by the blocks before it, and fits into the cache. The first policy heads for the nearest reward.
And a block rests while nothing that it reads changes, so that work is done only where values still
move. Evaluating the chosen actions takes a product of S rows, and is repeated until it pays to look
at all S·A rows again. See Puterman and Shin (1978) for modified policy iteration, and Wingate and
Seppi (2005) for prioritised blocks.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP

if TYPE_CHECKING:
    from scipy.sparse import csr_array

BLOCK = 16_384
_BURST = 3  # sweeps over a block between two looks at how much it changes, if there are others
_ALONE_BURST = 8  # if it is the only one
_MAX_BURSTS = 16  # before all actions are compared again
_EVALUATE_TO = 0.1  # of the last improvement's change
_MAX_ROUNDS = 100_000
_UNIT = float(np.finfo(np.float64).eps)


@dataclass
class _Block:
    """The states `low … high−1` of the new order: all their actions, and the chosen ones."""

    low: int
    high: int
    matrix: "csr_array"  # [A·b, S], γ·C, action by action
    rewards: FloatArray  # [A, b]
    actions: IntArray  # [b]
    chain: "csr_array" = field(init=False)  # [b, S], the rows of the chosen actions
    gains: FloatArray = field(init=False)  # [b], their rewards

    def __post_init__(self) -> None:
        self.choose(self.actions)

    def choose(self, actions: IntArray) -> None:
        """Takes over a policy."""
        size = self.high - self.low
        states = np.arange(size)
        self.actions = actions
        self.chain = self.matrix[actions * size + states]
        self.gains = self.rewards[actions, states]

    def improve(self, values: FloatArray) -> float:
        """Applies the Bellman operator in place; returns the largest change."""
        best, actions = self.best(values)
        if not np.array_equal(actions, self.actions):
            self.choose(actions)
        return self._replace(values, best)

    def best(self, values: FloatArray) -> tuple[FloatArray, IntArray]:
        """Returns the best Q-value `[b]` of each state, and its action: the first of equals."""
        q_values = (self.matrix @ values).reshape(self.rewards.shape)
        q_values += self.rewards
        best, actions = q_values[0], np.zeros(self.high - self.low, dtype=np.int64)
        for action in range(1, len(q_values)):  # much quicker than argmax over a short axis
            better = q_values[action] > best
            np.copyto(best, q_values[action], where=better)
            np.copyto(actions, action, where=better)
        return best, actions

    def evaluate(self, values: FloatArray, sweeps: int) -> float:
        """Applies the chosen actions' operator some times; returns the last largest change."""
        for _ in range(sweeps - 1):
            values[self.low : self.high] = self.chain @ values + self.gains
        return self._replace(values, self.chain @ values + self.gains)

    def _replace(self, values: FloatArray, new: FloatArray) -> float:
        change = float(np.abs(new - values[self.low : self.high]).max())
        values[self.low : self.high] = new
        return change


def optimal_values(mdp: MDP, gamma: float, tolerance: float) -> tuple[FloatArray, float]:
    """Returns the optimal values `[S]` and how far they can be from the exact ones (proven).

    With T the Bellman operator, ‖T v − v*‖ ≤ γ/(1 − γ)·‖T v − v‖: the values returned are T v.

    Args:
        mdp: the model.
        gamma: the discount factor, in [0, 1).
        tolerance: the error that is allowed.

    Raises:
        InputError: the tolerance is finer than rounding allows.
    """
    order, actions = _toward_reward(mdp)
    return _solved(mdp, gamma, tolerance, order, actions, np.zeros(mdp.num_states))


def policy_values(
    mdp: MDP, policy: FloatArray, gamma: float, tolerance: float, start: FloatArray
) -> tuple[FloatArray, float]:
    """Returns the values `[S]` of a policy `[S, A]`, and how far they can be off (proven).

    Args:
        mdp: the model.
        policy: the probability of each action.
        gamma: the discount factor, in [0, 1).
        tolerance: the error that is allowed.
        start: `[S]`, values to start from.

    Raises:
        InputError: the tolerance is finer than rounding allows.
    """
    order, _ = _toward_reward(mdp)
    weights = policy[mdp.transition_states, mdp.transition_actions] * mdp.probabilities
    followed = MDP(
        offsets=mdp.offsets[:: mdp.num_actions],
        next_states=mdp.next_states,
        probabilities=weights,
        rewards=mdp.rewards,
        terminated=mdp.terminated,
        num_actions=1,
        start=mdp.start,
    )
    only = np.zeros(mdp.num_states, dtype=np.int64)
    return _solved(followed, gamma, tolerance, order, only, start)


def least_tolerance(mdp: MDP, gamma: float) -> float:
    """Returns the finest error that rounding allows, as a share of the largest value."""
    return 2.0 * _UNIT * (4 + int(np.diff(mdp.offsets).max())) / (1.0 - gamma)


def _solved(
    mdp: MDP,
    gamma: float,
    tolerance: float,
    order: IntArray,
    actions: IntArray,
    start: FloatArray,
) -> tuple[FloatArray, float]:
    """Iterates until the bound is proven; `order` and `actions` say where and how to begin."""
    blocks, reads = _blocks(mdp, gamma, order, actions)
    values = start[order]
    rounding = least_tolerance(mdp, gamma)
    allowed = 0.5 * tolerance * (1.0 - gamma)
    for _ in range(20):
        _iterate(blocks, reads, values, allowed)
        largest = max(float(np.abs(b.rewards).max()) for b in blocks) + float(np.abs(values).max())
        before = values.copy()
        change = max([_applied(block, before, values) for block in blocks])
        bound = gamma * change / (1.0 - gamma) + rounding * largest
        if bound <= tolerance:
            result = np.empty_like(values)
            result[order] = values
            return result, bound
        allowed /= 4.0
    raise InputError(
        f"An error of {tolerance:.0e} is finer than rounding allows: {bound:.0e} was reached.",
        "Allow a larger error, or choose a smaller gamma.",
    )


def _applied(block: _Block, before: FloatArray, after: FloatArray) -> float:
    """Applies the Bellman operator to all of `before`; returns the largest change."""
    span = slice(block.low, block.high)
    after[span] = block.best(before)[0]
    return float(np.abs(after[span] - before[span]).max())


def _iterate(blocks: list[_Block], reads: BoolArray, values: FloatArray, allowed: float) -> None:
    """Improves and evaluates, in place, until no block changes by more than `allowed`."""
    dirty = np.ones(len(blocks), dtype=np.bool_)
    _evaluate(blocks, reads, values, dirty, target=1e-2 * max(1.0, float(np.abs(values).max())))
    for _ in range(_MAX_ROUNDS):
        changes = np.zeros(len(blocks))
        for b in np.flatnonzero(dirty):
            changes[b] = blocks[b].improve(values)
        moved = changes > allowed
        if not moved.any():
            return
        target = max(_EVALUATE_TO * float(changes.max()), 0.3 * allowed)
        moved |= _evaluate(blocks, reads, values, moved, target) > allowed
        dirty = reads[:, moved].any(axis=1) | moved


def _evaluate(
    blocks: list[_Block], reads: BoolArray, values: FloatArray, todo: BoolArray, target: float
) -> FloatArray:
    """Evaluates blocks, and those that read them, until they change little; returns the most."""
    most = np.zeros(len(blocks))
    sweeps = _ALONE_BURST if len(blocks) == 1 else _BURST
    for _ in range(_MAX_BURSTS):
        active = np.zeros_like(todo)
        for b in np.flatnonzero(todo):
            change = blocks[b].evaluate(values, sweeps)
            most[b] = max(most[b], change)
            if change > target:
                active |= reads[:, b]
                active[b] = True
        todo = active
        if not todo.any():
            break
    return most


def _blocks(
    mdp: MDP, gamma: float, order: IntArray, actions: IntArray
) -> tuple[list[_Block], BoolArray]:
    """Returns the blocks of the new order, and `reads [b, c]`: whether b's rows look at c."""
    from scipy.sparse import csr_array

    num_states, num_actions = mdp.num_states, mdp.num_actions
    place = np.empty(num_states, dtype=np.int32)
    place[order] = np.arange(num_states, dtype=np.int32)
    blocks, count = [], -(-num_states // BLOCK)
    reads = np.zeros((count, count), dtype=np.bool_)
    for b in range(count):
        low, high = b * BLOCK, min((b + 1) * BLOCK, num_states)
        states = order[low:high]
        rows = mdp.matrix[(states * num_actions + np.arange(num_actions)[:, None]).ravel()]
        columns = place[rows.indices]
        part = csr_array((gamma * rows.data, columns, rows.indptr), rows.shape)
        rewards = np.ascontiguousarray(mdp.expected_rewards[states].T)
        blocks.append(_Block(low, high, part, rewards, actions[states]))
        reads[b, np.flatnonzero(np.bincount(columns // BLOCK))] = True
    return blocks, reads


def _toward_reward(mdp: MDP) -> tuple[IntArray, IntArray]:
    """Returns the states `[S]` by their distance from reward, and actions that lead there.

    Reward is where something positive is paid; if nothing is, where the episode ends.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order

    size, possible = mdp.num_states, mdp.continuation > 0.0
    goal = (mdp.rewards > 0.0) & (mdp.probabilities > 0.0)
    goal = goal if goal.any() else mdp.terminated
    last = np.flatnonzero(mdp.per_state(goal.astype(np.float64)) > 0.0)
    sources = np.concatenate([mdp.next_states[possible], np.full(len(last), size)])
    targets = np.concatenate([mdp.transition_states[possible], last])
    backward = csr_array(
        (np.ones(len(sources), dtype=np.int8), (sources, targets)), (size + 1, size + 1)
    )
    found, toward = breadth_first_order(backward, size, directed=True)
    unreached = np.ones(size + 1, dtype=np.bool_)
    unreached[found] = False
    order = np.concatenate([found[1:], np.flatnonzero(unreached)]).astype(np.int64)
    heads = mdp.continuation * (mdp.next_states == toward[mdp.transition_states])
    score = mdp.per_action(heads)
    score[last] = mdp.expected_rewards[last]
    return order, score.argmax(axis=1)
