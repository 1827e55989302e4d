"""The future of a policy as a series: the reward of each step, one after another."""

from collections.abc import Callable, Iterator

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.tabular.chains import UNIT, averaging, followed
from trdlab.tabular.mdp import MDP, SMALL
from trdlab.tabular.solve import Solution

MAX_GIGABYTES = 8.0
MAX_STEPS = 1_000_000
_LOOK = 16  # steps between two looks at whether anything is left to come


def steps(mdp: MDP, solution: Solution, count: int) -> Iterator[FloatArray]:
    """Yields `[S, A]` for each of `count` steps, its expected discounted reward; then the rest.

    With C = P·(1 − terminated) and x^π(s) = Σ_a π(a|s) x(s, a), these are m_0 = E[R | s, a] and
    m_i = γ·C·m^π_(i−1); the rest is (γC)^count applied to Q. Each step takes one sparse product for
    all actions, and one for the policy's alone. Ends early when nothing is left to come.
    """
    gamma, expect = solution.gamma, mdp.expect
    average, follow = along(mdp, solution.policy, gamma)
    if count == 0:
        yield solution.q_values
        return
    reward = mdp.expected_rewards  # [S, A]
    for step in range(1, count):
        yield reward
        ahead = average(reward)  # [S]
        if step % _LOOK == 0 and not ahead.any():
            return  # nor will there be anything in any later step
        ahead *= gamma
        reward = expect(ahead)
    yield reward
    value = average(solution.q_values)  # [S]
    for _ in range(count - 1):  # not beside the rewards: so the policy's rows stay in the cache
        value = follow(value)
    yield expect(gamma * value)


def components(mdp: MDP, solution: Solution, axis: TimeAxis) -> Iterator[FloatArray]:
    """Yields the components of every state and action, `[S, A]` each, the residual last.

    This is the way to decompose a model whose whole table does not fit into memory: only a few
    arrays of S·A numbers are held at a time.

    Raises:
        InputError: N·w is more than can be followed.
    """
    if axis.num_steps > MAX_STEPS:
        raise InputError(
            f"N·w = {axis.num_steps} steps are too many.", f"At most {MAX_STEPS} can be followed."
        )
    series, nothing = steps(mdp, solution, axis.num_steps), np.zeros_like(solution.q_values)
    for _ in range(axis.horizon):
        group = next(series, nothing)
        for _ in range(axis.width - 1):
            group = group + next(series, nothing)
        yield group
    yield next(series, nothing)


def step_bounds(mdp: MDP, solution: Solution, count: int, width: int = 1) -> Iterator[FloatArray]:
    """Yields how far what `steps` yields can be from the exact values (proven), `[S, A]` each.

    Exact is the future of the solution's own policy. An error is carried on as the reward is, and
    each step adds what rounding can take, as a share of the sizes that are added up; adding up
    groups of `width` steps takes some more.
    """
    average, longest = averaging(solution.policy), int(np.diff(mdp.offsets).max())
    rounding = UNIT * (8 + longest + mdp.num_actions)

    def ahead(size: FloatArray, bound: FloatArray) -> tuple[FloatArray, FloatArray]:
        later = average(size)
        lost = average(bound) + rounding * later
        return solution.gamma * mdp.expect(later), solution.gamma * mdp.expect(lost)

    size, bound = np.abs(mdp.expected_rewards), mdp.reward_bound
    for _ in range(count):
        yield bound + (width - 1) * UNIT * size
        size, bound = ahead(size, bound)
    size, bound = np.abs(solution.q_values), solution.error_bound
    for _ in range(count):
        size, bound = ahead(size, bound)
    yield bound


def component_bounds(mdp: MDP, solution: Solution, axis: TimeAxis) -> FloatArray:
    """Returns `[S, A, N+1]`: how far each component can be from the exact one (proven)."""
    table = np.zeros((axis.num_components, *mdp.shape))
    for step, bound in enumerate(step_bounds(mdp, solution, axis.num_steps, axis.width)):
        table[step // axis.width] += bound  # the rest is that of step N·w
    return np.moveaxis(table, 0, -1)


def decompose(
    mdp: MDP, solution: Solution, axis: TimeAxis, dtype: type[np.floating] = np.float64
) -> FloatArray:
    """Returns `[S, A, N+1]`, read-only: the components of a solved policy's future.

    Args:
        mdp: the model.
        solution: the policy and its values.
        axis: γ, N and w.
        dtype: the precision to store them in; they are computed in float64.

    Raises:
        InputError: the table does not fit into memory, or N·w is more than can be followed.
    """
    gigabytes = table_gigabytes(mdp, axis, dtype)
    if gigabytes > MAX_GIGABYTES:
        raise InputError(
            f"N = {axis.horizon} takes {gigabytes:.3g} GB for {mdp.num_states} states and "
            f"{mdp.num_actions} actions.",
            "Choose a smaller N (a larger w reaches as far), or stream the components.",
        )
    # a component is written at once, so it lies together; the axes are named in another order
    shape = (axis.num_components, mdp.num_states, mdp.num_actions)
    table = np.empty(shape, dtype=dtype)
    for i, component in enumerate(components(mdp, solution, axis)):
        table[i] = component
    table.setflags(write=False)
    return np.moveaxis(table, 0, -1)


def table_gigabytes(mdp: MDP, axis: TimeAxis, dtype: type[np.floating] = np.float64) -> float:
    """Returns the memory that a table of this model takes, in 10⁹ bytes."""
    entries = mdp.num_states * mdp.num_actions * axis.num_components
    return entries * np.dtype(dtype).itemsize / 1e9


def along(
    mdp: MDP, policy: FloatArray, gamma: float
) -> tuple[Callable[[FloatArray], FloatArray], Callable[[FloatArray], FloatArray]]:
    """Returns two maps: x `[S, A]` to x^π `[S]`, and v `[S]` to γ·C^π·v, one step ahead."""
    average = averaging(policy)
    if mdp.num_states <= SMALL:
        return average, lambda v: gamma * average(mdp.expect(v))
    chain = followed(mdp, policy, gamma)
    return average, lambda v: chain @ v
