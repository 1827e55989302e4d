"""Models too large for a dense solve: values by passes, the decomposition as a stream."""

import numpy as np
import pytest

from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.tabular import MDP, evaluate, exact, optimal
from trdlab.tabular.series import components, decompose


def random_mdp(states: int, actions: int, successors: int, seed: int) -> MDP:
    """A sparse random model; a fifth of the transitions pay, some of them negative, some end."""
    rng = np.random.default_rng(seed)
    rows = states * actions
    probabilities = rng.dirichlet(np.ones(successors), size=rows).ravel()
    count = rows * successors
    return MDP(
        offsets=np.arange(0, count + 1, successors),
        next_states=rng.integers(0, states, count),
        probabilities=probabilities,
        rewards=np.where(rng.random(count) < 0.2, rng.normal(size=count), 0.0),
        terminated=rng.random(count) < 0.05,
        num_actions=actions,
    )


def slippery_field(side: int, goals: int = 1, slip: float = 0.2) -> MDP:
    """A square without walls; entering a goal pays 1 and ends the episode."""
    rng = np.random.default_rng(side)
    size = side * side
    row, column = np.divmod(np.arange(size), side)
    moves = [(-1, 0), (1, 0), (0, -1), (0, 1)]
    to = [np.clip(row + i, 0, side - 1) * side + np.clip(column + j, 0, side - 1) for i, j in moves]
    aside = [(2, 3), (2, 3), (0, 1), (0, 1)]
    next_states = np.stack(
        [np.stack([to[a], to[b], to[c]], -1) for a, (b, c) in enumerate(aside)], 1
    )
    goal = np.zeros(size, dtype=bool)
    goal[rng.choice(size, goals, replace=False)] = True
    over = goal[:, None, None]
    ends = goal[next_states] | over
    return MDP(
        offsets=np.arange(0, size * 12 + 1, 3),
        next_states=next_states.ravel(),
        probabilities=np.tile([1 - slip, slip / 2, slip / 2], size * 4),
        rewards=(goal[next_states] & ~over).ravel().astype(float),
        terminated=ends.ravel(),
        num_actions=4,
    )


def dense(mdp: MDP, policy: np.ndarray, gamma: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns Q `[S, A]` and C `[S, A, S]` by a dense solve, from the raw transitions."""
    shape = (mdp.num_states * mdp.num_actions, mdp.num_states)
    chain, rewards = np.zeros(shape), np.zeros(shape[0])
    row = np.repeat(np.arange(shape[0]), np.diff(mdp.offsets))
    np.add.at(chain, (row, mdp.next_states), mdp.probabilities * ~mdp.terminated)
    np.add.at(rewards, row, mdp.probabilities * mdp.rewards)
    chain = chain.reshape(*policy.shape, -1)
    rewards = rewards.reshape(policy.shape)
    under = np.einsum("sa,sat->st", policy, chain)
    values = np.linalg.solve(np.eye(len(under)) - gamma * under, (policy * rewards).sum(1))
    return rewards + gamma * chain @ values, chain


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("axis", [TimeAxis(0.95, 5), TimeAxis(0.9, 3, 4), TimeAxis(0.95, 0)])
def test_random_models_of_2000_states_match_a_dense_solve_and_a_power_series(
    seed: int, axis: TimeAxis
):
    mdp = random_mdp(2_000, 3, 4, seed)
    rng = np.random.default_rng(seed)
    stochastic = rng.dirichlet(np.ones(3), size=mdp.num_states)
    for table in (exact(mdp, axis), exact(mdp, axis, policy=stochastic)):
        policy, gamma = table.solution.policy, axis.gamma
        q_values, chain = dense(mdp, policy, gamma)
        np.testing.assert_allclose(table.decomposition.value, q_values, atol=1e-9)
        state_values = (policy * q_values).sum(1)
        np.testing.assert_allclose(table.state_decomposition.value, state_values, atol=1e-9)
        part = mdp.expected_rewards
        for i in range(axis.horizon):
            group = np.zeros_like(part)
            for _ in range(axis.width):
                group += part
                part = gamma * chain @ (policy * part).sum(1)
            np.testing.assert_allclose(table.decomposition.components[..., i], group, atol=1e-12)
        assert np.abs(q_values - table.solution.q_values).max() <= table.solution.error_bound.max()


@pytest.mark.parametrize("seed", [0, 1])
def test_optimal_values_are_optimal(seed: int):
    mdp = random_mdp(1_500, 4, 3, seed)
    solution = optimal(mdp, 0.95)
    values = solution.state_values
    bellman = (mdp.expected_rewards + 0.95 * mdp.expect(values)).max(axis=1)
    # ‖v − v*‖ ≤ ‖T v − v‖ / (1 − γ)
    assert np.abs(bellman - values).max() / 0.05 < 1e-8
    worst = solution.error_bound.max()
    for other in (evaluate(mdp, np.eye(4)[np.full(1_500, a)], 0.95) for a in range(4)):
        assert (other.q_values <= solution.q_values + worst + other.error_bound.max()).all()


def test_a_field_agrees_with_plain_value_iteration():
    mdp = slippery_field(100, goals=3)
    values = np.zeros(mdp.num_states)
    for _ in range(600):  # 0.9⁶⁰⁰ is nothing
        values = (mdp.expected_rewards + 0.9 * mdp.expect(values)).max(axis=1)
    solution = optimal(mdp, 0.9)
    error = (solution.policy * solution.error_bound).sum(axis=1)
    assert (np.abs(solution.state_values - values) <= error + 1e-14).all()
    np.testing.assert_array_less(error, 1e-10 * values + 1e-300)  # as small as the values are


def test_costs_alone_are_solved_too():
    """Each step costs 1 until the goal: there is no positive reward to begin from."""
    mdp = slippery_field(40)
    costly = mdp.with_rewards(np.where(mdp.terminated, 0.0, -1.0))
    solution = optimal(costly, 0.95)
    found = solution.state_values
    bellman = (costly.expected_rewards + 0.95 * costly.expect(found)).max(axis=1)
    assert np.abs(bellman - found).max() <= 1e-12
    assert solution.error_bound.max() <= 1e-11
    assert found.min() > -20.0  # what it costs to wander for ever


def test_close_to_1_gamma_has_the_same_answer():
    mdp = slippery_field(30)
    direct = optimal(mdp, 0.999)
    assert direct.error_bound.max() < 1e-9
    values = direct.state_values
    bellman = (mdp.expected_rewards + 0.999 * mdp.expect(values)).max(axis=1)
    assert np.abs(bellman - values).max() < 1e-12


def test_streamed_components_are_those_of_the_table():
    mdp, axis = random_mdp(900, 3, 4, 0), TimeAxis(0.95, 4, 3)
    solution = optimal(mdp, 0.95)
    table = decompose(mdp, solution, axis)
    for i, component in enumerate(components(mdp, solution, axis)):
        np.testing.assert_array_equal(component, table[..., i])
    assert i == axis.horizon
    assert not table.flags.writeable


def test_float32_halves_the_table():
    mdp = random_mdp(900, 3, 4, 0)
    single = exact(mdp, TimeAxis(0.95, 4), dtype=np.float32).decomposition.components
    double = exact(mdp, TimeAxis(0.95, 4)).decomposition.components
    assert single.dtype == np.float32
    assert single.nbytes * 2 == double.nbytes
    np.testing.assert_allclose(single, double, atol=1e-6)


def test_a_table_that_does_not_fit_is_refused_with_the_cure():
    mdp = random_mdp(900, 3, 4, 0)
    with pytest.raises(InputError, match=r"takes .* GB for 900 states and 3 actions.*stream"):
        exact(mdp, TimeAxis(0.95, 10_000_000))
    with pytest.raises(InputError, match="steps are too many"):
        exact(mdp, TimeAxis(0.95, 1, 10_000_000))
