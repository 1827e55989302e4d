"""Spread and survival against Monte Carlo, against each other, and by hand."""

import numpy as np
import pytest

from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.gridworld import Gridworld, load_map, map_names, parse_map
from trdlab.tabular import MDP, exact
from trdlab.tabular.uncertainty import outcomes, spread

SLIPPERY = "T = treasure 4 terminal\nH = hazard -2 terminal\nslip: 0.3\nstep_cost: 0.1\n---\n"
WORLD = Gridworld(parse_map(SLIPPERY + "..c.T\n.#.#H\nS.c..\n"))
RETURNS = 200_000


def sampled(
    mdp: MDP, policy: np.ndarray, state: int, action: int, steps: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Returns rewards and running flags `[returns, steps]`, sampled from the raw transitions."""
    rewards, running = np.zeros((RETURNS, steps)), np.zeros((RETURNS, steps), dtype=bool)
    states, alive = np.full(RETURNS, state), np.ones(RETURNS, dtype=bool)
    actions = np.full(RETURNS, action)
    cumulated = np.cumsum(mdp.probabilities)
    before = np.concatenate([[0.0], cumulated])
    for t in range(steps):
        if not alive.any():
            break
        running[:, t] = alive
        row = states * mdp.num_actions + actions
        low, high = mdp.offsets[row], mdp.offsets[row + 1] - 1
        taken = np.searchsorted(cumulated, before[low] + rng.random(RETURNS), side="right")
        taken = np.clip(taken, low, high)
        rewards[:, t] = np.where(alive, mdp.rewards[taken], 0.0)
        alive &= ~mdp.terminated[taken]
        states = mdp.next_states[taken]
        actions = (policy[states].cumsum(1) > rng.random(RETURNS)[:, None]).argmax(1)
    return rewards, running


@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.parametrize("which", ["optimal", "random"])
def test_monte_carlo_agrees(width: int, which: str):
    mdp, axis, rng = WORLD.mdp, TimeAxis(0.9, 4, width), np.random.default_rng(width)
    random = rng.dirichlet(np.ones(4), size=mdp.num_states)
    table = exact(mdp, axis, policy=None if which == "optimal" else random)
    known, policy = spread(table), table.solution.policy
    for action in (0, 3):
        rewards, running = sampled(mdp, policy, 0, action, 110, rng)  # 0.9¹¹⁰ is 1e-5
        discounted = rewards * 0.9 ** np.arange(110)
        parts = [discounted[:, i * width : (i + 1) * width].sum(1) for i in range(4)]
        parts += [discounted[:, 4 * width :].sum(1), discounted.sum(1)]
        means = [*table.decomposition.components[0, action], table.solution.q_values[0, action]]
        variances = [*known.variance[0, action], known.return_variance[0, action]]
        for part, mean, variance in zip(parts, means, variances, strict=True):
            assert abs(z(part, mean)) < 5
            assert abs(z((part - mean) ** 2, variance)) < 5
        for i in range(5):
            assert abs(z(running[:, i * width], known.survival[0, action, i])) < 5


def z(samples: np.ndarray, expected: float) -> float:
    error, gap = samples.std() / np.sqrt(len(samples)), float(samples.mean() - expected)
    return gap / error if error > 1e-12 else 1e9 * gap * (abs(gap) > 1e-9)


@pytest.mark.parametrize("name", map_names())
def test_the_backward_chain_and_the_forward_one_agree(name: str):
    mdp, axis = Gridworld(load_map(name)).mdp, TimeAxis(0.95, 6)
    table = exact(mdp, axis)
    known = spread(table)
    for state in range(0, mdp.num_states, 1 + mdp.num_states // 5):
        for action in range(4):
            steps = outcomes(mdp, table.solution.policy, state, action, 6)
            for i, step in enumerate(steps):
                values, chances = np.array(list(step)), np.array(list(step.values()))
                assert chances.sum() == pytest.approx(1.0)
                mean = values @ chances
                variance = (values - mean) ** 2 @ chances
                discount = 0.95**i
                component = table.decomposition.components[state, action, i]
                assert discount * mean == pytest.approx(component, abs=1e-12)
                found = known.variance[state, action, i]
                assert discount**2 * variance == pytest.approx(found, abs=1e-10)


def test_nothing_is_uncertain_where_nothing_slips():
    table = exact(Gridworld(load_map("drone")).mdp, TimeAxis(0.95, 4, 2))
    known = spread(table)
    assert not known.variance.any()
    assert not known.return_variance.any()
    assert known.survival[0, 1].tolist() == [1.0, 1.0, 1.0, 0.0, 0.0]  # four coins, five steps


def test_a_fair_coin_by_hand():
    """Heads pays 4 and ends, tails pays nothing and goes on."""
    coin = MDP.from_transitions([[[(0.5, 0, 4.0, True), (0.5, 0, 0.0, False)]]])
    known = spread(exact(coin, TimeAxis(0.5, 2, 1)))
    # the second throw happens with chance 1/2 and then pays 4 with chance 1/2, discounted by 1/2
    assert known.variance[0, 0, :2].tolist() == [16 / 2 - 4, 4 / 4 - 0.25]
    assert known.survival[0, 0].tolist() == [1.0, 0.5, 0.25]
    grouped = spread(exact(coin, TimeAxis(0.5, 1, 2)))
    # 4 with 1/2, 2 with 1/4, else nothing
    assert grouped.variance[0, 0, 0] == pytest.approx(16 / 2 + 4 / 4 - (4 / 2 + 2 / 4) ** 2)


def test_rewards_that_depend_on_the_next_state_only_vary_with_it():
    certain = MDP.from_transitions([[[(0.5, 0, 1.0, True), (0.5, 0, 1.0, False)]]])
    assert spread(exact(certain, TimeAxis(0.5, 1))).variance[0, 0, 0] == 0.0


def test_an_unknown_state_is_refused():
    with pytest.raises(InputError, match="There is no state 99 with action 0"):
        outcomes(WORLD.mdp, np.ones((WORLD.mdp.num_states, 4)) / 4, 99, 0, 1)


@pytest.mark.parametrize("offset", [0.0, 1e6])
def test_a_small_spread_around_a_large_reward_is_not_lost(offset: float):
    rewards = [(0.5, 0, offset, True), (0.5, 0, offset + 0.5, True)]
    known = spread(exact(MDP.from_transitions([[rewards]]), TimeAxis(0.9, 1)))
    assert known.variance[0, 0, 0] == pytest.approx(0.0625, rel=1e-9)
    assert known.return_variance[0, 0] == pytest.approx(0.0625, rel=1e-9)


def test_a_circle_without_chance_has_no_spread_however_long_it_is_followed():
    circle = [[[(1.0, (s + 1) % 5, float(s) / 3, False)]] for s in range(5)]
    known = spread(exact(MDP.from_transitions(circle), TimeAxis(1 - 1e-6, 3, 2)))
    assert known.deviation.max() < 1e-9
    assert np.sqrt(known.return_variance.max()) < 1e-3  # beside returns of a million
