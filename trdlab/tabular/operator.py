"""What a learner of w-step windows converges to: the exact table of its own operator."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trdlab.arrays import FloatArray, IntArray
from trdlab.bellman import target
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, TrdlabError
from trdlab.tabular.mdp import MDP
from trdlab.tabular.table import exact

_TOLERANCE = 1e-13  # relative
_SAME = 1e-9  # relative; what is closer is no reason to choose another action
_MAX_SWEEPS = 1_000_000
_MAX_ROUNDS = 1_000


@dataclass(frozen=True, eq=False)
class OperatorTable:
    """The fixed point of w-step control with ε-greedy behaviour, beside the optimal table.

    Args:
        epsilon: ε of the behaviour.
        decomposition: `[S, A, N+1]`, the fixed point.
        optimal: `[S, A, N+1]`, the optimal table on the same axis.
        greedy_actions: `[S]`, those the fixed point prefers.
    """

    epsilon: float
    decomposition: RewardDecomposition
    optimal: RewardDecomposition
    greedy_actions: IntArray

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.decomposition.time_axis

    @cached_property
    def bias(self) -> RewardDecomposition:
        """`[S, A, N+1]`: what the learner converges to, less the truth."""
        return self.decomposition - self.optimal

    def __str__(self) -> str:
        setting, value = f"w = {self.time_axis.width}, ε = {self.epsilon:g}", self.bias.value
        largest = np.abs(self.bias.components).max()
        if largest <= _SAME * np.abs(self.optimal.components).max():
            return f"{setting}: no bias."
        state, action = np.unravel_index(np.abs(value).argmax(), value.shape)
        learned = self.decomposition.value[state, action]
        best = self.optimal.value[state, action]
        return (
            f"{setting}: Q is biased by up to "
            f"{abs(value[state, action]):.4g} (state {state}, action {action}: {learned:.4f}, "
            f"optimal {best:.4f}), a component by up to {largest:.4g}."
        )


def epsilon_greedy(actions: IntArray, num_actions: int, epsilon: float) -> FloatArray:
    """Returns `[S, A]`: with probability ε any action, evenly, and otherwise the greedy one.

    >>> epsilon_greedy(np.array([1]), 4, 0.1).round(3).tolist()
    [[0.025, 0.925, 0.025, 0.025]]
    """
    policy = np.full((len(actions), num_actions), epsilon / num_actions)
    policy[np.arange(len(actions)), actions] += 1.0 - epsilon
    return policy


def operator_table(mdp: MDP, time_axis: TimeAxis, epsilon: float) -> OperatorTable:
    """Solves for the fixed point of w-step control whose windows hold ε-greedy actions.

    The learner's operator is T q = E_b[ law(Σ_(i<w) γ^i R, γ^w·(1 − terminated), n) ]. The first
    action of the window is given, the others follow the ε-greedy behaviour b of q itself, and n
    are the components in s_(t+w) of its greedy action. For w = 1 or ε = 0 the fixed point is the
    optimal table. Otherwise it is not: it tells the future of an agent that is greedy at every
    w-th step and ε-greedy in between. Its greedy actions may then depend on where the search
    began; it begins at the optimal ones.

    Args:
        mdp: the model.
        time_axis: γ, N and w.
        epsilon: the probability of a random action, in [0, 1].

    Raises:
        InputError: ε is outside [0, 1].
        TrdlabError: the greedy actions never settle.

    >>> from trdlab.gridworld import Gridworld, load_map
    >>> table = operator_table(Gridworld(load_map("drone")).mdp, TimeAxis(0.95, 2, 2), 0.1)
    >>> table.decomposition.value[0, 0].round(4), table.optimal.value[0, 0].round(4)
    (np.float64(3.2278), np.float64(3.258))
    """
    check_epsilon(epsilon)
    best = exact(mdp, time_axis)
    actions = np.asarray(best.solution.policy.argmax(axis=1))
    for _ in range(_MAX_ROUNDS):
        behaviour = epsilon_greedy(actions, mdp.num_actions, epsilon)
        q_values, size = _fixed_point(mdp, time_axis, actions, behaviour)
        own = np.take_along_axis(q_values, actions[:, None], axis=1)[:, 0]
        better = q_values.max(axis=1) > own + _SAME * size
        if not better.any():
            table = _decomposed(mdp, time_axis, actions, behaviour, q_values)
            return OperatorTable(epsilon, table, best.decomposition, actions)
        actions = np.where(better, q_values.argmax(axis=1), actions)
    raise TrdlabError(
        f"The greedy actions of w = {time_axis.width}, ε = {epsilon:g} go round in circles.",
        "Choose a smaller ε.",
    )


def check_epsilon(epsilon: float) -> None:
    """Refuses an ε outside [0, 1].

    Raises:
        InputError: it is outside.
    """
    if not 0.0 <= epsilon <= 1.0:
        raise InputError(f"ε is {epsilon}.", "It must be from 0 to 1.")


def _fixed_point(
    mdp: MDP, axis: TimeAxis, actions: IntArray, behaviour: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Returns Q `[S, A]` for fixed greedy actions and behaviour, and the size `[S]` of its parts.

    The size is what the greedy actions would be worth if every reward were positive: what is
    smaller than a small part of it is rounding, in states far from any reward as well.
    """
    states, unsigned = np.arange(mdp.num_states), mdp.with_rewards(np.abs(mdp.rewards))
    rewards = _window_rewards(mdp, axis, behaviour)
    sizes = _window_rewards(unsigned, axis, behaviour)[states, actions]
    values, size = np.zeros(mdp.num_states), np.zeros(mdp.num_states)
    for _ in range(_MAX_SWEEPS):
        q_values = rewards + _window_later(mdp, axis, behaviour, values)
        larger = sizes + _window_later(mdp, axis, behaviour, size)[states, actions]
        updated = q_values[states, actions]
        change = np.maximum(np.abs(updated - values), larger - size)
        values, size = updated, larger
        if (change <= _TOLERANCE * (1.0 - axis.gamma) * size).all():
            return q_values, size
    raise TrdlabError("The values do not settle.", "Choose a smaller gamma.")


def _decomposed(
    mdp: MDP, axis: TimeAxis, actions: IntArray, behaviour: FloatArray, q_values: FloatArray
) -> RewardDecomposition:
    """Returns `[S, A, N+1]`: N sweeps of the law shift the values into their components."""
    rewards, states = _window_rewards(mdp, axis, behaviour), np.arange(mdp.num_states)
    components = np.zeros((*rewards.shape, axis.num_components))
    components[..., -1] = q_values  # right as a sum; each sweep splits one component off
    for _ in range(axis.horizon):
        following = components[states, actions]  # [S, N+1]
        later = [_window_later(mdp, axis, behaviour, part) for part in following.T]
        components = target(rewards, 1.0, np.stack(later, axis=-1))  # γ^w is in `later`
    return RewardDecomposition(components, axis)


def _window_rewards(mdp: MDP, axis: TimeAxis, behaviour: FloatArray) -> FloatArray:
    """Returns `[S, A]`: the expected discounted reward of w steps."""
    rewards = mdp.expected_rewards
    for _ in range(axis.width - 1):
        rewards = mdp.expected_rewards + axis.gamma * mdp.expect((behaviour * rewards).sum(axis=1))
    return rewards


def _window_later(
    mdp: MDP, axis: TimeAxis, behaviour: FloatArray, values: FloatArray
) -> FloatArray:
    """Returns `[S, A]`: γ^w times the expected `values [S]` of s_(t+w)."""
    later = axis.gamma * mdp.expect(values)
    for _ in range(axis.width - 1):
        later = axis.gamma * mdp.expect((behaviour * later).sum(axis=1))
    return later
