"""Optimal values, their proven bound, ties, and totals without discount."""

from fractions import Fraction

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from trdlab.errors import InputError
from trdlab.gridworld import Gridworld, load_map, parse_map
from trdlab.tabular import MDP, Solution, evaluate, optimal, solve, undiscounted_totals

UP, DOWN, LEFT, RIGHT = range(4)
REWARDS = st.sampled_from([0.0, 0.0, 1.0, -1.0, 0.1, 1 / 3, -2.5, 1e-5, 1e5])


@st.composite
def models(draw, max_states: int = 3, rewards: st.SearchStrategy = REWARDS) -> MDP:
    """Draws small models, with terminations and probabilities that are no round numbers."""
    num_states, num_actions = draw(st.integers(1, max_states)), draw(st.integers(1, 3))

    def row() -> list[tuple[float, int, float, bool]]:
        weights = draw(st.lists(st.integers(1, 7), min_size=1, max_size=2))
        ends = st.sampled_from([False, False, False, True])
        return [
            (w / sum(weights), draw(st.integers(0, num_states - 1)), draw(rewards), draw(ends))
            for w in weights
        ]

    return MDP.from_transitions([[row() for _ in range(num_actions)] for _ in range(num_states)])


# ---- an independent solver in exact fractions --------------------------------------------------


def exact_q(mdp: MDP, policy: np.ndarray, gamma: float) -> list[list[Fraction]]:
    """Solves for Q by Gaussian elimination, without any rounding."""
    states, actions = range(mdp.num_states), range(mdp.num_actions)
    reward = [[Fraction(0) for _ in actions] for _ in states]
    chance = [[[Fraction(0) for _ in states] for _ in actions] for _ in states]
    for k in range(len(mdp.rewards)):
        s, a = mdp.transition_states[k], mdp.transition_actions[k]
        probability = Fraction(mdp.probabilities[k])
        reward[s][a] += probability * Fraction(mdp.rewards[k])
        if not mdp.terminated[k]:
            chance[s][a][mdp.next_states[k]] += Fraction(gamma) * probability
    pi = [[Fraction(p) for p in row] for row in policy]
    rows = [
        [Fraction(s == n) - sum(pi[s][a] * chance[s][a][n] for a in actions) for n in states]
        + [sum(pi[s][a] * reward[s][a] for a in actions)]
        for s in states
    ]
    for i in states:
        pivot = next(k for k in states if k >= i and rows[k][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for k in states:
            if k != i and rows[k][i]:
                rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i], strict=True)]
    values = [row[-1] for row in rows]
    return [
        [reward[s][a] + sum(chance[s][a][n] * values[n] for n in states) for a in actions]
        for s in states
    ]


def exact_optimal_q(mdp: MDP, gamma: float) -> list[list[Fraction]]:
    """Policy iteration without any rounding."""
    actions = [0] * mdp.num_states
    while True:
        q = exact_q(mdp, np.eye(mdp.num_actions)[actions], gamma)
        best = [max(range(mdp.num_actions), key=row.__getitem__) for row in q]
        better = [q[s][best[s]] > q[s][actions[s]] for s in range(mdp.num_states)]
        if not any(better):
            return q
        actions = [
            b if is_better else a for a, b, is_better in zip(actions, best, better, strict=True)
        ]


def assert_within_bound(solution: Solution, q: list[list[Fraction]]) -> None:
    for s, row in enumerate(q):
        for a, exact in enumerate(row):
            error = abs(Fraction(solution.q_values[s, a]) - exact)
            assert error <= Fraction(solution.error_bound[s, a])


GAMMAS = st.sampled_from([0.0, 0.5, 0.9, 0.95, 0.99, 1 - 1e-6, 1 - 1e-9, 1 - 1e-12]) | st.floats(
    0, 0.999
)


@settings(max_examples=150, deadline=None)
@given(models(), GAMMAS, st.sampled_from(["lowest", "mixed"]))
def test_optimal_values_lie_within_their_bound(mdp, gamma, ties):
    assert_within_bound(optimal(mdp, gamma, ties=ties), exact_optimal_q(mdp, gamma))


@settings(max_examples=100, deadline=None)
@given(models(), GAMMAS, st.integers(0, 2**32 - 1))
def test_a_policys_values_lie_within_their_bound(mdp, gamma, seed):
    shape = (mdp.num_states, mdp.num_actions)
    policy = np.random.default_rng(seed).dirichlet(np.ones(shape[1]), shape[0])
    solution = evaluate(mdp, policy, gamma)
    assert_within_bound(solution, exact_q(mdp, policy, gamma))
    assert not solution.is_optimal
    assert not solution.tied.any()


@given(st.floats(0.5, 1 - 1e-12), st.floats(1e-16, 1e-2), st.sampled_from(["lowest", "mixed"]))
@example(1 - 1e-6, 6e-3, "lowest")
@example(1 - 1e-6, 6e-3, "mixed")
def test_an_action_that_is_hardly_worse_for_ever_stays_within_the_bound(gamma, gap, ties):
    """The tied action with the lowest index loses `gap` at every step, and that adds up."""
    mdp = MDP.from_transitions([[[(1.0, 0, 1.0 - gap, False)], [(1.0, 0, 1.0, False)]]])
    assert_within_bound(optimal(mdp, gamma, ties=ties), exact_optimal_q(mdp, gamma))


def test_the_bound_holds_where_values_underflow():
    mdp = MDP.from_transitions([[[(1.0, 1, 0.0, False)]], [[(1.0, 0, 3e-200, True)]]])
    for gamma in (1e-100, 1e-120, 1e-124, 1e-200):  # 3e-324 rounds to 5e-324, and less to 0
        assert_within_bound(optimal(mdp, gamma), exact_q(mdp, np.ones((2, 1)), gamma))


def test_the_bound_is_tight_enough_to_tell_actions_apart():
    for name in ("drone", "corridor", "bridge", "windy", "patience"):
        solution = optimal(Gridworld(load_map(name)).mdp, 0.95)
        assert solution.error_bound.max() < 1e-9


# ---- ties --------------------------------------------------------------------------------------


def test_the_drone_has_no_ties():
    solution = optimal(Gridworld(load_map("drone")).mdp, 0.95)
    assert not solution.tied.any()
    assert solution.is_optimal
    assert solution.q_values[0].round(4).tolist() == [3.258, 3.5244, 3.3482, 3.3482]


def test_the_tie_map_ties_at_the_gamma_it_names():
    mdp = Gridworld(load_map("tie")).mdp
    lowest, mixed = optimal(mdp, 0.95), optimal(mdp, 0.95, ties="mixed")
    assert lowest.tied[0].tolist() == [False, False, True, True]  # 19·γ now, or 20·γ² later
    assert lowest.tied.sum() == 2
    assert lowest.policy[0].tolist() == [0, 0, 1, 0]
    assert mixed.policy[0].tolist() == [0, 0, 0.5, 0.5]
    np.testing.assert_allclose(lowest.q_values, mixed.q_values, atol=1e-12)
    for gamma, best in ((0.9499, LEFT), (0.9501, RIGHT)):
        solution = optimal(mdp, gamma)
        assert not solution.tied.any()
        assert solution.policy[0].argmax() == best


def test_terminal_states_do_not_count_as_ties():
    world = Gridworld(parse_map("SC"))
    solution = optimal(world.mdp, 0.9)
    assert world.is_terminal(1)
    assert not solution.tied.any()


@settings(max_examples=60, deadline=None)
@given(models(5, st.sampled_from([0.0, 1.0, 2.0])), st.sampled_from([0.0, 0.5]))
def test_however_ties_are_broken_q_is_the_same(mdp, gamma):
    lowest, mixed = (optimal(mdp, gamma, ties=ties) for ties in ("lowest", "mixed"))
    np.testing.assert_allclose(lowest.q_values, mixed.q_values, atol=1e-12)
    np.testing.assert_array_equal(lowest.tied, mixed.tied)
    for s in range(mdp.num_states):
        options = lowest.tied[s].nonzero()[0].tolist() or [int(lowest.q_values[s].argmax())]
        if not mdp.terminal_states[s]:
            assert lowest.policy[s, options[0]] == 1
            np.testing.assert_allclose(mixed.policy[s, options], 1 / len(options))


@given(st.floats(0, 1, exclude_min=True, exclude_max=True))
@example(5e-324)
@example(float(np.nextafter(1, 0)))
@example(1 - 1e-14)
def test_the_drone_reaches_the_treasure_for_every_gamma(gamma):
    """A bump into the wall costs a factor γ only, so next to 1 it ties with going on; a choice of
    bumps for ever must still not be taken."""
    solution = optimal(Gridworld(load_map("drone")).mdp, gamma)
    down = gamma + gamma**2 + gamma**3 + gamma**4
    np.testing.assert_allclose(
        solution.q_values[0, [UP, DOWN]], [4 * gamma**4, down], rtol=1e-12, atol=1e-300
    )


# ---- totals without discount -------------------------------------------------------------------


def test_both_routes_of_the_drone_pay_4_in_total():
    mdp = Gridworld(load_map("drone")).mdp
    totals = undiscounted_totals(mdp, optimal(mdp, 0.95).policy)
    np.testing.assert_allclose(totals[0, [UP, DOWN]], 4, atol=1e-12)


def test_a_loop_that_pays_has_no_total():
    world = Gridworld(load_map("loop"))
    assert np.isnan(undiscounted_totals(world.mdp, optimal(world.mdp, 0.95).policy)).all()
    idle = np.eye(4)[np.full(world.mdp.num_states, LEFT)]  # not paid where it bumps for ever
    totals = undiscounted_totals(world.mdp, idle)
    assert totals[world.find_state("0,1")].tolist() == [0, 0, 0, 0]
    above = world.find_state("2,4")
    assert totals[above, DOWN] == 1  # the fountain once, and then left, and left again


def test_a_game_of_plus_and_minus_one_for_ever_has_no_total():
    fair = MDP.from_transitions([[[(0.5, 0, 1.0, False), (0.5, 0, -1.0, False)]]])
    assert np.isnan(undiscounted_totals(fair, np.ones((1, 1)))).all()


def test_what_ends_too_late_for_double_precision_has_no_total():
    for chance in (1e-20, 1e-15):  # the first makes a singular system
        late = MDP.from_transitions([[[(1.0 - chance, 0, 1.0, False), (chance, 0, 0.0, True)]]])
        assert np.isnan(undiscounted_totals(late, np.ones((1, 1)))).all()
    soon = MDP.from_transitions([[[(0.999, 0, 1.0, False), (0.001, 0, 0.0, True)]]])
    assert undiscounted_totals(soon, np.ones((1, 1))) == pytest.approx(999)


def test_frozen_lakes_total_is_the_chance_to_reach_the_goal():
    """Its only reward is 1 at the goal, so the chance follows from a solve of its own."""
    env = gym.make("FrozenLake-v1").unwrapped
    chain, goal = np.zeros((16, 16)), np.zeros(16)
    for s, actions in env.P.items():
        for row in actions.values():
            for probability, following, reward, terminated in row:
                goal[s] += reward * probability / 4
                chain[s, following] += 0.0 if terminated else probability / 4
    chance = np.linalg.solve(np.eye(16) - chain, goal)
    mdp, even = MDP.from_transitions(env.P), np.full((16, 4), 0.25)
    totals = undiscounted_totals(mdp, even)
    np.testing.assert_allclose((totals * even).sum(axis=1), chance, atol=1e-12)
    np.testing.assert_allclose(evaluate(mdp, even, 1 - 1e-10).q_values, totals, atol=1e-7)


@settings(max_examples=60, deadline=None)
@given(models(5, st.sampled_from([0.0, 1.0, -2.0])), st.integers(0, 2**32 - 1))
def test_totals_are_the_limit_of_discounted_values(mdp, seed):
    """Where a total exists γ → 1 approaches it; where none does, some reward comes for ever."""
    shape = (mdp.num_states, mdp.num_actions)
    policy = np.random.default_rng(seed).dirichlet(np.ones(shape[1]), shape[0])
    totals, nearly = undiscounted_totals(mdp, policy), evaluate(mdp, policy, 1 - 1e-9).q_values
    exists = ~np.isnan(totals)
    np.testing.assert_allclose(nearly[exists], totals[exists], rtol=1e-4, atol=1e-4)
    size = mdp.with_rewards(np.abs(mdp.rewards))
    paid_for_ever = evaluate(size, policy, 1 - 1e-9).q_values > 1e5
    np.testing.assert_array_equal(paid_for_ever, ~exists)


def test_totals_of_a_large_random_graph_take_a_moment():
    """Each step pays 1 and ends one episode in ten, so every total is 10; also of 10⁵ states."""
    rng, states = np.random.default_rng(0), 100_000
    mdp = MDP(
        offsets=np.arange(0, 4 * states + 1, 4),
        next_states=rng.integers(0, states, 4 * states),
        probabilities=np.tile([0.3, 0.3, 0.3, 0.1], states),
        rewards=np.ones(4 * states),
        terminated=np.tile([False, False, False, True], states),
        num_actions=1,
    )
    totals = undiscounted_totals(mdp, np.ones((states, 1)))
    np.testing.assert_allclose(totals, 10.0, rtol=1e-12)


# ---- limits ------------------------------------------------------------------------------------


@pytest.mark.parametrize("gamma", [0.99, 0.995])  # by sweeps, and by a sparse factorisation
def test_the_sparse_solvers_agree_with_the_dense_one(monkeypatch, gamma):
    worlds = [Gridworld(load_map("bridge").with_slip(0.2)), Gridworld(load_map("loop"))]
    dense = [optimal(world.mdp, gamma) for world in worlds]
    totals = [undiscounted_totals(w.mdp, s.policy) for w, s in zip(worlds, dense, strict=True)]
    monkeypatch.setattr(solve, "SMALL", 0)
    for world, known, total in zip(worlds, dense, totals, strict=True):
        sparse = optimal(world.mdp, gamma)
        assert (np.abs(sparse.q_values - known.q_values) <= sparse.error_bound).all()
        np.testing.assert_allclose(sparse.q_values, known.q_values, atol=1e-10)
        np.testing.assert_array_equal(sparse.tied, known.tied)
        np.testing.assert_allclose(undiscounted_totals(world.mdp, known.policy), total, atol=1e-12)
    late = MDP.from_transitions([[[(1.0, 0, 1.0, False), (1e-20, 0, 0.0, True)]]])
    assert np.isnan(undiscounted_totals(late, np.ones((1, 1)))).all()  # singular here as well


def test_an_open_field_larger_than_the_dense_limit():
    """The exit pays 1 on the last of the 48 steps: V = γ^47, with ties nearly everywhere."""
    rows = ["S" + "." * 24] + ["." * 25] * 23 + ["." * 24 + "T"]
    world = Gridworld(parse_map("T = treasure 1 terminal\n---\n" + "\n".join(rows)))
    assert world.mdp.num_states == 625
    solution = optimal(world.mdp, 0.95)
    assert solution.state_values[0] == pytest.approx(0.95**47, abs=1e-12)
    assert solution.tied[0].tolist() == [False, True, False, True]  # down and right


@pytest.mark.parametrize("gamma", [-0.1, 1.0, np.nan])
def test_gamma_outside_its_range_is_refused(gamma):
    mdp = Gridworld(load_map("tie")).mdp
    for ask in (optimal, lambda mdp, gamma: evaluate(mdp, np.full((6, 4), 0.25), gamma)):
        with pytest.raises(InputError, match="less than 1"):
            ask(mdp, gamma)


def test_what_double_precision_cannot_hold_is_refused():
    for huge in (1e308, -1e160):  # the square of which is not finite
        with pytest.raises(InputError, match=r"beyond double precision. Give smaller rewards"):
            optimal(MDP.from_transitions([[[(1.0, 0, huge, False)]]]), 0.99)
    thirds = MDP.from_transitions([[[(1 / 3, 0, 1.0, False)] * 3]])
    assert optimal(thirds, 1 - 1e-9).q_values[0, 0] == pytest.approx(1e9)
    with pytest.raises(InputError, match=r"too close to 1.*smaller gamma"):
        optimal(thirds, float(np.nextafter(1, 0)))


def test_gamma_0_sees_the_next_reward_only():
    mdp = Gridworld(load_map("drone")).mdp
    np.testing.assert_array_equal(optimal(mdp, 0.0).q_values, mdp.expected_rewards)
