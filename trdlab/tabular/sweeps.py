"""Nearly optimal actions of a large model: those that head for reward, and a few sweeps more.

The shortest way to reward is found by one search, and its worth by looking twice as far each time.
Far from reward these values are too small, as they count on one way only, but they fall off in the
right direction. Sweeps of value iteration then set the actions right nearly everywhere.
"""

from functools import reduce

import numpy as np

from trdlab.arrays import FloatArray, IntArray
from trdlab.tabular.mdp import MDP, SMALL

_SWEEPS, _WORK = 16, 50_000  # of value iteration; more of them where they cost next to nothing


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
    values = swept(mdp, gamma, _guess(mdp, gamma, *_toward_reward(mdp)), sweep_count(mdp))
    q_values = mdp.expected_rewards + gamma * mdp.expect(values)
    return q_values.argmax(axis=1), values


def _toward_reward(mdp: MDP) -> tuple[IntArray, FloatArray]:
    """Finds the shortest way to reward: to where something positive is paid, or else to an end.

    Returns:
        Each state's next one `[S]` on the way, S where the way ends and negative where there is
        none; and the chance `[S]` of the likeliest step there.
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
    _, ahead = breadth_first_order(backward, size)
    steps = mdp.probabilities * (targets == ahead[states])  # [K]
    chance = np.maximum.reduceat(steps, mdp.offsets[: -1 : mdp.num_actions])
    return ahead[:size].astype(np.int64), chance


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
