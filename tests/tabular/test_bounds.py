"""Values of any size, right to their last digits: far rewards decide, and every bound is kept."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trdlab.decomposition import TimeAxis
from trdlab.gridworld import Gridworld, parse_map
from trdlab.tabular import MDP, Solution, evaluate, exact, optimal

SIZES = st.sampled_from([40, 320])  # below and above the limit of dense solves
TEN = st.integers(-12, 12).map(lambda k: 10.0**k)


def corridor(states: int) -> MDP:
    """Left or right; the last cell pays 1 for going on to the right, and it is over."""
    end = states - 1
    return MDP.from_transitions(
        [
            [
                [(1.0, max(s - 1, 0), 0.0, False)],
                [(1.0, min(s + 1, end), float(s == end), s == end)],
            ]
            for s in range(states)
        ]
    )


def layered(layers: int, wide: int, seed: int, size: float = 1.0) -> MDP:
    """Two actions with two outcomes each, one layer further; some rewards all but cancel."""
    rng = np.random.default_rng(seed)
    states = layers * wide
    chance = rng.integers(1, 64, states * 2) / 64.0
    layer = np.arange(states) // wide
    following = np.minimum(layer + 1, layers - 1)[:, None] * wide + rng.integers(
        0, wide, (states, 4)
    )
    rewards = rng.choice([0.0, 0.0, 1.0, -1.0, 0.1], (states * 2, 2))
    cancel = rng.random(states * 2) < 0.2
    rewards[cancel] = np.stack([1.0 - chance[cancel], -chance[cancel]], 1) * 7e11
    return MDP(
        offsets=np.arange(0, states * 4 + 1, 2),
        next_states=following.ravel(),
        probabilities=np.stack([chance, 1.0 - chance], 1).ravel(),
        rewards=size * rewards.ravel(),
        terminated=np.repeat(layer == layers - 1, 4) | (rng.random(states * 4) < 0.05),
        num_actions=2,
    )


def exact_layers(mdp: MDP, gamma: float, policy: np.ndarray | None) -> list[list[Fraction]]:
    """Q by going back from the last layer, without any rounding; without a policy the best."""
    q: list[list[Fraction]] = [[] for _ in range(mdp.num_states)]
    values = [Fraction(0)] * mdp.num_states
    for s in reversed(range(mdp.num_states)):
        for a in range(mdp.num_actions):
            row = s * mdp.num_actions + a
            q[s].append(Fraction(0))
            for k in range(mdp.offsets[row], mdp.offsets[row + 1]):
                later = 0 if mdp.terminated[k] else Fraction(gamma) * values[mdp.next_states[k]]
                q[s][a] += Fraction(mdp.probabilities[k]) * (Fraction(mdp.rewards[k]) + later)
        chances = None if policy is None else [Fraction(p) for p in policy[s]]
        values[s] = max(q[s]) if chances is None else sum(map(Fraction.__mul__, chances, q[s]))
    return q


def assert_within_bound(solution: Solution, q: list[list[Fraction]]) -> None:
    for s, row in enumerate(q):
        for a, right in enumerate(row):
            error = abs(Fraction(solution.q_values[s, a]) - right)
            assert error <= Fraction(solution.error_bound[s, a])


@pytest.mark.parametrize("states", [299, 301, 2_000, 6_000])
@pytest.mark.parametrize("gamma", [0.9, 0.999])
def test_a_reward_however_far_decides(states: int, gamma: float):
    """0.9³⁰⁰ = 1.87e-14 is not 0, and 0.9⁵⁹⁹⁹ = 3e-275 is not either."""
    solution = optimal(corridor(states), gamma)
    assert solution.policy.argmax(axis=1).all()  # to the right, everywhere
    assert not solution.tied.any()
    away = np.arange(states)[::-1]
    np.testing.assert_allclose(solution.q_values[:, 1], gamma**away, rtol=1e-11)
    assert (solution.error_bound <= 1e-9 * solution.q_values).all()


def test_a_winding_way_of_336_steps_is_walked_to_its_end():
    rows = []
    for row in range(25):
        door = ".".rjust(25, "#") if row % 4 == 1 else ".".ljust(25, "#")
        rows.append("." * 25 if row % 2 == 0 else door)
    rows[0], rows[24] = "S" + rows[0][1:], rows[24][:-1] + "T"
    world = Gridworld(parse_map("T = treasure 1 terminal\n---\n" + "\n".join(rows)))
    table = exact(world.mdp, TimeAxis(0.9, 10, 34))
    assert world.mdp.num_states == 337
    components = table.decomposition.components[0, 3]  # right
    assert components[9] == pytest.approx(0.9**335, rel=1e-12)  # steps 306 … 339
    assert components.sum() == components[9]
    assert table.solution.policy[0, 3] == 1


def test_a_small_reward_near_by_does_not_hide_a_large_one_far_away():
    """From the left end 1e-9 is one step away, and 1 lies 999 steps to the right."""
    far = corridor(1_000)
    rewards, ends = far.rewards.copy(), far.terminated.copy()
    rewards[0], ends[0] = 1e-9, True
    both = MDP(far.offsets, far.next_states, far.probabilities, rewards, ends, 2)
    turns = 999 - np.log(1e-9) / np.log(0.95)  # where 0.95^(999 − s) = 1e-9 · 0.95^s
    assert (optimal(both, 0.95).policy.argmax(axis=1) == (np.arange(1_000) > turns / 2)).all()


def test_what_cancels_in_an_expected_reward_counts():
    """0.3 and 0.7 are no binary numbers: 0.3 · 7e11 − 0.7 · 3e11 is 0 or 1e-5, who knows."""
    row = [(0.3, 0, 7e11, True), (0.7, 0, -3e11, True)]
    for states in (3, 301):
        mdp = MDP.from_transitions([[row]] * states)
        solution = optimal(mdp, 0.9)
        right = sum(Fraction(p) * Fraction(r) for p, _, r, _ in row)
        assert_within_bound(solution, [[right]] * states)
        assert not solution.q_values.any()  # what cannot be told from 0 is 0
        assert solution.error_bound.max() < 1e-2


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), SIZES, st.sampled_from([0.5, 0.95, 0.999, 1 - 1e-9]))
def test_bounds_hold_below_and_above_the_dense_limit(seed: int, states: int, gamma: float):
    mdp = layered(8, states // 8, seed)
    policy = np.random.default_rng(seed).dirichlet(np.ones(2), mdp.num_states)
    assert_within_bound(optimal(mdp, gamma), exact_layers(mdp, gamma, None))
    assert_within_bound(evaluate(mdp, policy, gamma), exact_layers(mdp, gamma, policy))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), SIZES, TEN, st.sampled_from(["lowest", "mixed"]))
def test_scaled_rewards_scale_the_numbers_and_nothing_else(
    seed: int, states: int, size: float, ties: str
):
    one = optimal(layered(8, states // 8, seed), 0.9, ties=ties)
    other = optimal(layered(8, states // 8, seed, size), 0.9, ties=ties)
    np.testing.assert_array_equal(one.policy, other.policy)
    np.testing.assert_array_equal(one.tied, other.tied)
    np.testing.assert_array_equal(one.q_values == 0.0, other.q_values == 0.0)
    differ = np.abs(other.q_values / size - one.q_values)
    assert (differ <= 2.0 * (one.error_bound + other.error_bound / size)).all()


@pytest.mark.parametrize(("slip", "rows"), [(0.1, "HHH.\n#h..\nhE#S"), (0.3, "Sh.\n..E\n.hh")])
@pytest.mark.parametrize("gamma", [0.3, 0.95, 0.999])
def test_what_is_worth_nothing_is_0(slip: float, rows: str, gamma: float):
    """There is a way to keep clear of every hazard: the best action is worth exactly 0."""
    world = Gridworld(parse_map(f"slip: {slip}\n---\n{rows}"))
    for ties in ("lowest", "mixed"):
        q_values = optimal(world.mdp, gamma, ties=ties).q_values
        assert q_values[0].max() == 0.0
        assert (np.abs(q_values[q_values != 0.0]) > 1e-9).all()


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    SIZES,
    st.sampled_from(
        [TimeAxis(0.9, 7), TimeAxis(0.9, 3, 2), TimeAxis(0.5, 0), TimeAxis(0.99, 1, 3)]
    ),
)
def test_the_bound_of_every_component_holds(seed: int, states: int, axis: TimeAxis):
    mdp = layered(8, states // 8, seed)
    policy = np.random.default_rng(seed).dirichlet(np.ones(2), mdp.num_states)
    table = exact(mdp, axis, policy=policy)
    parts, gamma, chances = [], Fraction(axis.gamma), [[Fraction(p) for p in row] for row in policy]

    def ahead(values: list[list[Fraction]]) -> list[list[Fraction]]:
        mean = [sum(map(Fraction.__mul__, chances[s], values[s])) for s in range(len(values))]
        later = [[Fraction(0)] * 2 for _ in values]
        for s, a, k in zip(
            mdp.transition_states, mdp.transition_actions, range(len(mdp.rewards)), strict=True
        ):
            if not mdp.terminated[k]:
                later[s][a] += gamma * Fraction(mdp.probabilities[k]) * mean[mdp.next_states[k]]
        return later

    reward, rest = exact_layers(mdp, 0.0, policy), exact_layers(mdp, axis.gamma, policy)
    for i in range(axis.num_steps):
        if i % axis.width == 0:
            parts.append(reward)
        else:
            parts[-1] = [
                [x + y for x, y in zip(*rows, strict=True)]
                for rows in zip(parts[-1], reward, strict=True)
            ]
        reward, rest = ahead(reward), ahead(rest)
    for i, part in enumerate([*parts, rest]):
        for s, row in enumerate(part):
            for a, right in enumerate(row):
                error = abs(Fraction(table.decomposition.components[s, a, i]) - right)
                assert error <= Fraction(table.error_bound[s, a, i])


def test_components_that_pay_at_different_steps_differ_however_small_they_are():
    """Left pays 1e-12 now, right pays twice as much in the next step, at γ = 0.5."""
    for size in (1e-12, 1.0, 1e12):
        late = [[(1.0, 0, size, True)], [(1.0, 1, 0.0, False)]]
        mdp = MDP.from_transitions([late, [[(1.0, 0, 2.0 * size, True)]] * 2])
        table = exact(mdp, TimeAxis(0.5, 3))
        assert table.solution.tied[0].all()
        assert table.ambiguous.tolist() == [True, False]
