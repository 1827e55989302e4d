"""What docs/why/theorem.md proves, and no other test holds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trdlab.bellman import target
from trdlab.decomposition import TimeAxis
from trdlab.tabular import MDP, exact, spread

NUMBERS = st.floats(-100, 100, width=32)


def random_model(seed: int, num_states: int = 5, num_actions: int = 2) -> MDP:
    """Returns a model in which each action leads to two states, and one move in six ends it."""
    rng = np.random.default_rng(seed)

    def row() -> list[tuple[float, int, float, bool]]:
        states, p = rng.integers(num_states, size=2), rng.uniform(0.1, 0.9)
        rewards, ends = rng.uniform(-1, 1, size=2), rng.random(2) < 1 / 6
        return [
            (chance, int(s), float(r), bool(e))
            for chance, s, r, e in zip((p, 1 - p), states, rewards, ends, strict=True)
        ]

    return MDP.from_transitions([[row() for _ in range(num_actions)] for _ in range(num_states)])


def sweep(mdp: MDP, policy: np.ndarray, table: np.ndarray, gamma: float) -> np.ndarray:
    """Returns `[S, A, N+1]`: the expected target of each entry, by the law."""
    following = np.einsum("sa,san->sn", policy, table)[mdp.next_states]  # [K, N+1]
    goals = target(mdp.rewards, np.where(mdp.terminated, 0.0, gamma), following)
    result = np.zeros_like(table)
    where = (mdp.transition_states, mdp.transition_actions)
    np.add.at(result, where, mdp.probabilities[:, None] * goals)
    return result


# ---- what is left out shrinks ----------------------------------------------------------------


@settings(deadline=None)
@given(st.integers(0, 50), st.floats(0, 0.99), st.integers(0, 6), st.integers(1, 3))
def test_a_component_is_no_larger_than_its_steps_can_pay(seed, gamma, horizon, width):
    """So the residual goes to 0 as N grows: γ^(N·w)·M/(1 − γ), with rewards of at most M."""
    mdp, axis = random_model(seed), TimeAxis(gamma, horizon, width)
    most = np.abs(mdp.rewards).max() * axis.discounts / (1 - gamma)
    most[:-1] *= 1 - gamma**width
    assert (np.abs(exact(mdp, axis).decomposition.components) <= most + 1e-12).all()


# ---- the law brings tables nearer to each other ----------------------------------------------


@given(st.integers(0, 5), st.floats(0, 1), st.data())
def test_the_law_shrinks_the_summed_distance(horizon, discount, data):
    one, other = (data.draw(arrays(np.float64, horizon + 1, elements=NUMBERS)) for _ in range(2))
    moved = target(0.0, discount, one) - target(0.0, discount, other)
    assert np.abs(moved).sum() <= discount * np.abs(one - other).sum() + 1e-9


def test_the_law_may_grow_the_largest_distance():
    """The fold adds two differences up, so the plain maximum over entries does not shrink."""
    assert target(0.0, 0.9, np.ones(3)).max() == 1.8


@given(st.integers(1, 5), st.floats(0.01, 0.99), st.floats(0.01, 0.99), st.data())
def test_the_law_shrinks_a_weighted_largest_distance(horizon, discount, part, data):
    """As proofs of learning ask for: each explicit component is weighed by one over β/d − 1."""
    beta = discount + part * (1 - discount)
    weights = np.append(np.full(horizon, beta / discount - 1), 1.0)
    apart = data.draw(arrays(np.float64, horizon + 1, elements=NUMBERS))
    moved = target(0.0, discount, apart)
    before, after = (np.abs(of / weights).max() for of in (apart, moved))
    assert after <= beta * before * (1 + 1e-9) + 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_each_sweep_makes_one_more_component_right(seed):
    mdp, axis, rng = random_model(seed), TimeAxis(0.9, 4), np.random.default_rng(seed)
    policy = rng.dirichlet(np.ones(mdp.num_actions), mdp.num_states)
    truth = exact(mdp, axis, policy=policy).decomposition.components
    table = rng.normal(size=truth.shape)
    begun = np.abs(table - truth).sum(axis=-1).max()
    for sweeps in range(1, 30):
        table = sweep(mdp, policy, table, axis.gamma)
        off = np.abs(table - truth)
        right = min(sweeps, axis.horizon)
        assert off[..., :right].max() < 1e-12
        assert off.sum(axis=-1).max() <= axis.gamma**sweeps * begun + 1e-12
        if sweeps < axis.horizon:
            assert off[..., right].max() > 1e-3


# ---- a variance that does not follow the law -------------------------------------------------


def two_payments(after_one: int, after_none: int) -> MDP:
    """State 0 leads to 1, which pays 1 or 0 evenly; 2 then pays 1, 3 pays 0, and 4 either."""
    return MDP.from_transitions(
        [
            [[(1.0, 1, 0.0, False)]],
            [[(0.5, after_one, 1.0, False), (0.5, after_none, 0.0, False)]],
            [[(1.0, 2, 1.0, True)]],
            [[(1.0, 3, 0.0, True)]],
            [[(0.5, 4, 1.0, True), (0.5, 4, 0.0, True)]],
        ]
    )


def test_the_variance_of_a_residual_needs_more_than_the_variances_behind_it():
    """Paid both or none, each by itself, or just one: alike in state 1, and not in state 0."""
    worlds = {"together": (2, 3), "apart": (4, 4), "one": (3, 2)}
    known = {
        name: spread(exact(two_payments(*to), TimeAxis(0.9, 1))) for name, to in worlds.items()
    }
    for of in known.values():
        np.testing.assert_allclose(of.variance[1, 0], [0.25, 0.81 * 0.25])
    found = [known[name].variance[0, 0, 1] for name in worlds]
    np.testing.assert_allclose(
        found, [0.81 * 0.25 * of for of in ((1 + 0.9) ** 2, 1 + 0.9**2, (1 - 0.9) ** 2)]
    )


# ---- the paper's settings --------------------------------------------------------------------


def test_the_target_network_is_copied_as_often_as_in_the_paper():  # errata C6
    from trdlab.deep.presets import preset

    paper = preset("atari", "Breakout", "paper")
    assert paper.target_sync_updates * paper.update_every == 1_000
