"""Every component against dense matrices written here, the paper's vectors, the law, and ties."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from trdlab.bellman import target
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.gridworld import Gridworld, load_map, map_names
from trdlab.tabular import MDP, ExactTable, exact, optimal

UP, DOWN, LEFT, RIGHT = range(4)
AXES = [(0, 1), (1, 1), (5, 1), (2, 2), (3, 4), (0, 3)]


@st.composite
def models(draw, max_states: int = 4) -> MDP:
    """Draws small models whose rewards and discounts often tie."""
    num_states, num_actions = draw(st.integers(1, max_states)), draw(st.integers(1, 3))

    def row() -> list[tuple[float, int, float, bool]]:
        ends, rewards = st.sampled_from([False, False, True]), st.sampled_from([0.0, 1.0, 2.0, -1])
        return [
            (p, draw(st.integers(0, num_states - 1)), draw(rewards), draw(ends))
            for p in draw(st.sampled_from([[1.0], [0.25, 0.75]]))
        ]

    return MDP.from_transitions([[row() for _ in range(num_actions)] for _ in range(num_states)])


def random_policy(mdp: MDP, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.dirichlet(np.ones(mdp.num_actions), mdp.num_states)


# ---- independent answers, from the raw transitions ---------------------------------------------


def dense(mdp: MDP) -> tuple[np.ndarray, np.ndarray]:
    """Returns P(s′ | s, a) where the episode goes on `[S, A, S]`, and E[R | s, a] `[S, A]`."""
    size, actions = mdp.num_states, mdp.num_actions
    chance, reward = np.zeros((size, actions, size)), np.zeros((size, actions))
    for row, (first, last) in enumerate(pairwise(mdp.offsets)):
        for k in range(first, last):
            s, a = divmod(row, actions)
            reward[s, a] += mdp.probabilities[k] * mdp.rewards[k]
            if not mdp.terminated[k]:
                chance[s, a, mdp.next_states[k]] += mdp.probabilities[k]
    return chance, reward


def linear_solve(mdp: MDP, policy: np.ndarray, gamma: float) -> np.ndarray:
    """Returns Q `[S, A]` of a policy, solving for all S·A of them at once."""
    chance, reward = dense(mdp)
    size = reward.size
    system = np.eye(size) - gamma * np.einsum("san,nb->sanb", chance, policy).reshape(size, size)
    return np.linalg.solve(system, reward.ravel()).reshape(reward.shape)


def power_series(mdp: MDP, policy: np.ndarray, axis: TimeAxis) -> np.ndarray:
    """Returns `[S, A, N+1]`: γ^i · P_sa · P_π^(i−1) · r_π, added up group by group."""
    chance, reward = dense(mdp)
    chain = np.einsum("sa,san->sn", policy, chance)
    state_reward = (policy * reward).sum(axis=1)
    state_value = (policy * linear_solve(mdp, policy, axis.gamma)).sum(axis=1)

    def after(steps: int, what: np.ndarray) -> np.ndarray:
        return axis.gamma**steps * chance @ (np.linalg.matrix_power(chain, steps - 1) @ what)

    components = np.zeros((*reward.shape, axis.num_components))
    for i in range(axis.horizon):
        for step in axis.steps(i):
            components[..., i] += after(step, state_reward) if step else reward
    beyond = axis.num_steps
    components[..., -1] = (
        after(beyond, state_value) if beyond else linear_solve(mdp, policy, axis.gamma)
    )
    return components


def assert_is_the_power_series(table: ExactTable) -> None:
    policy, axis = table.solution.policy, table.time_axis
    expected_q = linear_solve(table.mdp, policy, axis.gamma)
    np.testing.assert_allclose(table.decomposition.value, expected_q, rtol=1e-9, atol=1e-9)
    expected = power_series(table.mdp, policy, axis)
    np.testing.assert_allclose(table.decomposition.components, expected, rtol=1e-9, atol=1e-9)
    of_states = table.state_decomposition
    np.testing.assert_allclose(
        of_states.components, (policy[..., None] * expected).sum(axis=1), rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(
        of_states.value, (policy * expected_q).sum(axis=1), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize(("horizon", "width"), AXES)
@pytest.mark.parametrize("name", map_names())
def test_every_map_optimal(name, horizon, width):
    table = exact(Gridworld(load_map(name)).mdp, TimeAxis(0.95, horizon, width))
    assert_is_the_power_series(table)
    q = table.decomposition.value
    chance, reward = dense(table.mdp)
    optimality = reward + 0.95 * chance @ q.max(axis=1)  # no policy does better
    np.testing.assert_allclose(q, optimality, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("horizon", "width"), AXES)
@pytest.mark.parametrize("name", map_names())
def test_every_map_under_a_random_policy(name, horizon, width):
    mdp = Gridworld(load_map(name).with_slip(0.15)).mdp
    policy = random_policy(mdp, seed=horizon)
    table = exact(mdp, TimeAxis(0.9, horizon, width), policy=policy)
    np.testing.assert_array_equal(table.solution.policy, policy)
    assert table.future.policy == "the given policy"
    assert_is_the_power_series(table)


@settings(deadline=None)
@given(
    models(),
    st.sampled_from([0.0, 0.5, 0.95, 0.999]),
    st.integers(0, 4),
    st.integers(1, 3),
    st.sampled_from(["lowest", "mixed", 1, 2]),
)
def test_any_small_model(mdp, gamma, horizon, width, whose):
    axis = TimeAxis(gamma, horizon, width)
    given_policy = isinstance(whose, int)
    table = (
        exact(mdp, axis, policy=random_policy(mdp, whose))
        if given_policy
        else exact(mdp, axis, ties=whose)
    )
    assert_is_the_power_series(table)


# ---- the paper's drone -------------------------------------------------------------------------


@given(st.floats(0, 1, exclude_min=True, exclude_max=True))
@example(5e-324)
@example(0.95)
@example(float(np.nextafter(1, 0)))
def test_the_papers_vectors_for_every_gamma(gamma):
    """Down is [0, γ, γ², γ³, γ⁴] and up [0, 0, 0, 0, 4γ⁴], as far as float64 holds γ⁴.

    All floats are tried. Below 1e-75 γ⁴ itself underflows. Above 1 − 1e-12 a bump into the wall,
    which costs a factor of γ, cannot be told from going on, and is reported as a tie.
    """
    table = exact(Gridworld(load_map("drone")).mdp, TimeAxis(gamma, 4))
    up, down = table.decomposition.components[0, [UP, DOWN]]
    np.testing.assert_allclose(up, [0, 0, 0, 0, 4 * gamma**4], rtol=1e-12, atol=1e-300)
    np.testing.assert_allclose(
        down, [0, gamma, gamma**2, gamma**3, gamma**4], rtol=1e-12, atol=1e-300
    )
    if 1e-75 < gamma < 1 - 1e-12:
        assert not table.solution.tied.any()


def test_the_papers_drone_at_095():
    table = exact(Gridworld(load_map("drone")).mdp, TimeAxis(0.95, 2, 2))
    moment = table.decomposition[0]
    assert moment.components[[UP, DOWN]].round(2).tolist() == [[0, 0, 3.26], [0.95, 1.76, 0.81]]
    assert moment.value[[UP, DOWN]].round(2).tolist() == [3.26, 3.52]
    assert moment.residual[UP] == pytest.approx(4 * 0.95**4, abs=1e-12)
    assert not table.ambiguous.any()
    assert table.future.policy == "the optimal policy"


# ---- the law -----------------------------------------------------------------------------------


@settings(deadline=None)
@given(models(), st.floats(0, 0.99), st.integers(0, 4), st.sampled_from(["lowest", "mixed", 1]))
def test_the_table_is_the_fixed_point_of_the_law(mdp, gamma, horizon, whose):
    """Each entry is the expected target: the reward before what the next state expects."""
    axis = TimeAxis(gamma, horizon)
    policy = random_policy(mdp, 1) if whose == 1 else None
    table = exact(mdp, axis, policy=policy, ties="lowest" if whose == 1 else whose)
    targets = target(
        mdp.rewards,
        np.where(mdp.terminated, 0.0, gamma),
        table.state_decomposition.components[mdp.next_states],
    )
    expected = np.zeros_like(table.decomposition.components)
    np.add.at(
        expected,
        (mdp.transition_states, mdp.transition_actions),
        mdp.probabilities[:, None] * targets,
    )
    np.testing.assert_allclose(table.decomposition.components, expected, atol=1e-9)


@settings(deadline=None)
@given(models(), st.integers(0, 3), st.integers(1, 3))
def test_wide_groups_are_narrow_ones_summed(mdp, horizon, width):
    fine = exact(mdp, TimeAxis(0.9, horizon * width)).decomposition.regroup(width)
    wide = exact(mdp, TimeAxis(0.9, horizon, width)).decomposition
    np.testing.assert_allclose(wide.components, fine.components, atol=1e-12)
    assert wide.time_axis == fine.time_axis


# ---- ties --------------------------------------------------------------------------------------


def test_the_tie_map_has_two_futures_of_the_same_worth():
    mdp = Gridworld(load_map("tie")).mdp
    lowest, mixed = (exact(mdp, TimeAxis(0.95, 4), ties=ties) for ties in ("lowest", "mixed"))
    assert lowest.ambiguous.nonzero()[0].tolist() == [0]
    assert mixed.ambiguous.nonzero()[0].tolist() == [0]
    np.testing.assert_allclose(lowest.decomposition.value, mixed.decomposition.value, atol=1e-12)
    first = lowest.decomposition.components[0, [LEFT, RIGHT]].round(4)
    assert first.tolist() == [[0, 18.05, 0, 0, 0], [0, 0, 18.05, 0, 0]]
    of_start = [table.state_decomposition.components[0].round(4) for table in (lowest, mixed)]
    assert of_start[0].tolist() == [0, 18.05, 0, 0, 0]
    assert of_start[1].tolist() == [0, 9.025, 9.025, 0, 0]
    assert lowest.future.policy == "the optimal policy (of tied actions the first)"
    assert mixed.future.policy == "the optimal policy that mixes tied actions evenly"


def test_ties_that_pay_at_the_same_steps_are_not_ambiguous():
    same = (1.0, 0, 1.0, True)
    table = exact(MDP.from_transitions([[[same], [same]]]), TimeAxis(0.9, 2))
    assert table.solution.tied.tolist() == [[True, True]]
    assert not table.ambiguous.any()
    assert table.future.policy == "the optimal policy"


def test_a_tie_hidden_inside_a_group_is_ambiguous_for_earlier_states():
    """In state 1, 1 at once ties with 2 a step later. Both are the group [1, 0], but one step
    earlier they fall into different groups."""
    mdp = MDP.from_transitions(
        [
            [[(1.0, 1, 0.0, False)], [(1.0, 1, 0.0, False)]],
            [[(1.0, 1, 1.0, True)], [(1.0, 2, 0.0, False)]],
            [[(1.0, 2, 2.0, True)], [(1.0, 2, 2.0, True)]],
        ]
    )
    lowest, mixed = (exact(mdp, TimeAxis(0.5, 1, 2), ties=t) for t in ("lowest", "mixed"))
    assert lowest.decomposition.components[1].tolist() == [[1, 0], [1, 0]]
    assert lowest.decomposition.components[0, 0].tolist() == [0.5, 0]
    assert mixed.decomposition.components[0, 0].tolist() == [0.25, 0.25]
    assert lowest.ambiguous.tolist() == mixed.ambiguous.tolist() == [False, True, False]


@settings(max_examples=200, deadline=None)
@given(models(), st.integers(0, 3), st.integers(1, 3))
def test_without_ambiguous_states_there_is_one_decomposition(mdp, horizon, width):
    axis = TimeAxis(0.5, horizon, width)
    lowest, mixed = (exact(mdp, axis, ties=ties) for ties in ("lowest", "mixed"))
    np.testing.assert_allclose(lowest.decomposition.value, mixed.decomposition.value, atol=1e-12)
    assert not (lowest.ambiguous & ~lowest.solution.tied.any(axis=1)).any()
    if not lowest.ambiguous.any():
        np.testing.assert_allclose(
            lowest.decomposition.components, mixed.decomposition.components, atol=1e-12
        )


# ---- as an estimator ---------------------------------------------------------------------------


def test_it_decomposes_batches_of_states():
    table = exact(Gridworld(load_map("drone")).mdp, TimeAxis(0.95, 2, 2))
    assert isinstance(table, Estimator)
    batch = table.decompose([0, 3, 0])
    assert batch.components.shape == (3, 4, 3)
    np.testing.assert_array_equal(batch.components[2], table.decomposition.components[0])
    assert table.decompose(np.zeros(0, dtype=np.int64)).components.shape == (0, 4, 3)


@pytest.mark.parametrize(
    ("observations", "message"),
    [([0, 14], "0 to 13"), ([-1], "-1.*0 to 13"), ([0.5], "float64.*state indices")],
)
def test_what_is_no_state_is_refused(observations, message):
    table = exact(Gridworld(load_map("drone")).mdp, TimeAxis(0.95, 2))
    with pytest.raises(InputError, match=message):
        table.decompose(observations)


def test_a_table_too_large_for_memory_is_refused_with_its_size():
    with pytest.raises(InputError, match=r"N = 1000000000 takes .* GB"):
        exact(Gridworld(load_map("drone")).mdp, TimeAxis(0.95, 10**9))


def test_unknown_ties_and_types_are_refused():
    mdp = Gridworld(load_map("tie")).mdp
    for solve in (
        lambda: exact(mdp, TimeAxis(0.9, 2), ties="mixd"),
        lambda: optimal(mdp, 0.9, ties="mixd"),
    ):
        with pytest.raises(InputError, match=r"The ties are 'mixd'\. Did you mean 'mixed'"):
            solve()
    with pytest.raises(InputError, match="The dtype is int64"):
        exact(mdp, TimeAxis(0.9, 2), dtype=np.int64)
