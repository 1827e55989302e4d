"""Models from tables and arrays, against dense algebra on the raw `P` table; and refusals."""

from functools import cache
from types import SimpleNamespace
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import pytest
import scipy.sparse as sp
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv

from moments import told
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.explanations import check, tabular_moment
from trdlab.explanations.moment.moment import CHOICES
from trdlab.tabular import (
    MDP,
    exact,
    from_arrays,
    from_environment,
    make_world,
    tabular_world,
)
from trdlab.tabular.models import part_after
from trdlab.tabular.toytext import toy_text_ids
from trdlab.wrappers import ALL_ACTIONS, CHOSEN, TemporalRewardDecomposition

CLIFF, TAXI = (
    next(name for name in toy_text_ids() if name.startswith(start)) for start in ("Cliff", "Taxi")
)
WORLDS: dict[str, tuple[str, dict[str, Any]]] = {
    "4x4": ("FrozenLake-v1", {"is_slippery": False}),
    "4x4 slippery": ("FrozenLake-v1", {}),
    "8x8": ("FrozenLake-v1", {"map_name": "8x8", "is_slippery": False}),
    "8x8 slippery": ("FrozenLake8x8-v1", {}),
    "cliff": (CLIFF, {}),
    "taxi": (TAXI, {}),
}
AXES = [(0, 1), (0, 3), (1, 1), (6, 1), (3, 4)]
GAMMA = 0.95

Raw = tuple[np.ndarray, np.ndarray]


# ---- independent answers ------------------------------------------------------------------------


@cache
def model(name: str) -> tuple[Raw, MDP]:
    env_id, arguments = WORLDS[name]
    env = gym.make(env_id, **arguments)
    return raw(env.unwrapped.P), from_environment(env)


def raw(table: Any) -> Raw:
    """Returns P(s′ | s, a) where the episode goes on `[S, A, S]`, and E[R | s, a] `[S, A]`."""
    shape = (len(table), len(table[0]))
    chance, reward = np.zeros((*shape, shape[0])), np.zeros(shape)
    for s, actions in table.items():
        for a, outcomes in actions.items():
            for probability, following, paid, ended in outcomes:
                reward[s, a] += probability * paid
                if not ended:
                    chance[s, a, following] += probability
    return chance, reward


def q_values(chance: np.ndarray, reward: np.ndarray, policy: np.ndarray) -> np.ndarray:
    moves = np.einsum("sa,sat->st", policy, chance)
    paid = (policy * reward).sum(axis=1)
    values = np.linalg.solve(np.eye(len(moves)) - GAMMA * moves, paid)
    return reward + GAMMA * chance @ values


def optimal_q_values(chance: np.ndarray, reward: np.ndarray) -> np.ndarray:
    """Policy iteration with dense solves, ended by a gain that rounding could explain."""
    policy = np.full(reward.shape, 1.0 / reward.shape[1])
    while True:
        q = q_values(chance, reward, policy)
        better = np.eye(reward.shape[1])[q.argmax(axis=1)]
        if (q_values(chance, reward, better) - q).max() < 1e-11:
            return q
        policy = better


def power_series(raw: Raw, policy: np.ndarray, axis: TimeAxis) -> np.ndarray:
    """Returns `[S, A, N+1]`, each step's discounted reward added up until nothing is left."""
    chance, reward = raw
    moves = np.einsum("sa,sat->st", policy, chance)
    ahead = (policy * reward).sum(axis=1)  # the reward of the policy i - 1 steps after arriving
    components = np.zeros((*reward.shape, axis.num_components))
    components[..., 0] = reward
    for i in range(1, 900):
        group = min(i // axis.width, axis.horizon)
        components[..., group] += GAMMA**i * (chance @ ahead)
        ahead = moves @ ahead
    return components


def a_policy(shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng(7).dirichlet(np.ones(shape[1]), shape[0])


# ---- environments --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", WORLDS)
def test_optimal_values_equal_dense_policy_iteration(name: str):
    dense, mdp = model(name)
    table = exact(mdp, TimeAxis(GAMMA, 3))
    np.testing.assert_allclose(table.solution.q_values, optimal_q_values(*dense), atol=1e-9)
    np.testing.assert_allclose(
        table.decomposition.value, q_values(*dense, table.solution.policy), atol=1e-9
    )


@pytest.mark.parametrize(("horizon", "width"), AXES)
@pytest.mark.parametrize("name", WORLDS)
def test_components_equal_a_power_series(name: str, horizon: int, width: int):
    dense, mdp = model(name)
    axis, mine = TimeAxis(GAMMA, horizon, width), a_policy(dense[1].shape)
    for table in (exact(mdp, axis), exact(mdp, axis, policy=mine), exact(mdp, axis, ties="mixed")):
        policy = table.solution.policy
        expected = power_series(dense, policy, axis)
        np.testing.assert_allclose(table.decomposition.components, expected, atol=1e-9)
        np.testing.assert_allclose(
            table.decomposition.value, q_values(*dense, policy), rtol=1e-11, atol=1e-9
        )
        state_values = np.einsum("sa,sai->si", policy, expected)
        np.testing.assert_allclose(table.state_decomposition.components, state_values, atol=1e-9)


def test_the_start_is_the_likeliest_state_of_equals_the_lowest():
    assert model("4x4")[1].start == 0
    assert model("cliff")[1].start == 36
    assert model("taxi")[1].start == 1  # in state 0 the passenger is where he wants to be
    base = gym.make("FrozenLake-v1").unwrapped
    base.initial_state_distrib = np.eye(16)[9]
    assert from_environment(base).start == 9


def test_other_environments_with_a_model():
    drone = gym.make("trdlab.envs:trdlab/DroneGridworld-v0")
    assert from_environment(drone) is drone.unwrapped.mdp
    assert tabular_world(drone).action_names == ("up", "down", "left", "right")
    table = [[[(1.0, 1, 2.0, False)]], [[(1.0, 1, 0.0, True)]]]
    listed = SimpleNamespace(P=table, isd=[0.2, 0.8])
    assert from_environment(listed).start == 1
    assert from_environment(SimpleNamespace(P=table)).start == 0


def tabled(table: Any, **attributes: Any) -> Any:
    return type("Odd", (), {"P": table, **attributes})()


def rows(*row: tuple[float, int, float, bool]) -> Any:
    return {0: {0: [(1.0, 0, 0.0, False)], 1: list(row)}}


@pytest.mark.parametrize(
    ("env", "message"),
    [
        (gym.make("Blackjack-v1"), "Blackjack-v1 has no transition table 'P', so there is no"),
        (object(), "object has no transition table 'P'"),
        (tabled(rows((0.5, 0, 1.0, False))), "State 0, action 1 sum to 0.5. They must sum to 1"),
        (
            tabled(rows((1.5, 0, 1.0, False), (-0.5, 0, 1.0, False))),
            "State 0, action 1 has a negative probability",
        ),
        (tabled(rows((np.nan, 0, 1.0, False))), "A probability of state 0, action 1 is nan"),
        (tabled(rows((1.0, 0, np.inf, False))), "A reward of state 0, action 1 is inf"),
        (tabled(rows()), "State 0, action 1 has no transition"),
        (tabled(rows((1.0, 3, 1.0, False))), "State 0, action 1 leads to a state 3 that does"),
        (tabled(rows((1.0, -1, 1.0, False))), "leads to a state -1 that does not exist"),
        (tabled(rows((1.0, 0.5, 1.0, False))), "leads to a state 0.5 that does not exist"),
        (tabled({0: {0: [(1.0, 0, 0.0)]}}), "The table 'P' of Odd cannot be read (ValueError"),
        (tabled({1: {0: [(1.0, 0, 0.0, False)]}}), "cannot be read (KeyError: 0)"),
        (tabled(3), "The table 'P' of Odd cannot be read (TypeError"),
        (tabled({}), "The model has no transition"),
        (
            tabled({0: {0: [(1.0, 0, 0.0, False)]}, 1: {}}),
            "State 1 has 0 actions, state 0 has 1",
        ),
        (
            tabled(rows((1.0, 0, 1.0, False)), action_space=gym.spaces.Discrete(3)),
            "The table 'P' of Odd has 2 entries where its action_space has 3",
        ),
        (
            tabled(rows((1.0, 0, 1.0, False)), isd=[0.5, 0.5]),
            "Odd does not say where its episodes start",
        ),
        (tabled(rows((1.0, 0, 1.0, False)), isd=[np.nan]), "does not say where its episodes"),
        (
            gym.make(TAXI, fickle_passenger=True),
            "leaves out that the passenger is fickle. Make it with fickle_passenger=False",
        ),
    ],
)
def test_environments_without_a_sound_table_are_refused(env: Any, message: str):
    with pytest.raises(InputError) as error:
        from_environment(env)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


# ---- arrays --------------------------------------------------------------------------------------


def random_arrays(
    num_states: int, num_actions: int, successors: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns dense P, E[R | s, a, s′] and terminated `[S, A, S]`, with few successors a row."""
    rng = np.random.default_rng(seed)
    shape = (num_states, num_actions, num_states)
    chance = np.zeros(shape)
    following = rng.integers(0, num_states, (num_states, num_actions, successors))
    np.put_along_axis(chance, following, rng.random(following.shape), axis=2)
    chance /= chance.sum(axis=2, keepdims=True)
    return chance, rng.normal(size=shape), rng.random(shape) < 0.1


def sparsely(dense: np.ndarray, kind: Any = sp.csr_array) -> Any:
    return kind(dense.reshape(-1, dense.shape[2]))


def by_action(dense: np.ndarray) -> list[Any]:
    return [sp.csc_matrix(dense[:, a]) for a in range(dense.shape[1])]


def assert_equal_models(one: MDP, other: MDP) -> None:
    for field in ("offsets", "next_states", "probabilities", "rewards", "terminated"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))
    assert (one.num_actions, one.start) == (other.num_actions, other.start)


def test_random_models_of_2000_states_dense_and_sparse():
    chance, reward, ended = random_arrays(2_000, 3, 5, seed=1)
    mdp = from_arrays(chance, reward, ended, start=4)
    assert (mdp.num_states, mdp.num_actions, mdp.start) == (2_000, 3, 4)
    # impossible transitions are stored in the rewards, and possible ones of reward 0 are not
    assert_equal_models(mdp, from_arrays(*map(sparsely, (chance, reward, ended)), start=4))
    going_on = np.where(ended, 0.0, chance)
    dense = going_on, (chance * reward).sum(axis=2)
    for policy in (None, a_policy(dense[1].shape)):
        for horizon, width in ((0, 1), (4, 2)):
            axis = TimeAxis(GAMMA, horizon, width)
            table = exact(mdp, axis, policy=policy)
            followed = table.solution.policy
            expected = q_values(*dense, followed)
            np.testing.assert_allclose(table.decomposition.value, expected, atol=1e-9)
            assert (reward_to_come(dense, table) < 1e-9).all()
        if policy is None:
            assert (followed == np.eye(3)[expected.argmax(axis=1)]).all()


def reward_to_come(dense: Raw, table: Any) -> np.ndarray:
    """Returns `[N+1]`: how far each component is from the power series, by sparse products."""
    chance, reward = sparsely(dense[0]), dense[1]
    axis, policy = table.time_axis, table.solution.policy
    step, components = reward, np.zeros_like(table.decomposition.components)
    for i in range(700):
        components[..., min(i // axis.width, axis.horizon)] += GAMMA**i * step
        step = (chance @ (policy * step).sum(axis=1)).reshape(reward.shape)
    return np.abs(components - table.decomposition.components).max(axis=(0, 1))


@pytest.mark.parametrize("seed", range(8))
def test_every_layout_gives_the_same_model(seed: int):
    rng = np.random.default_rng(seed)
    chance, reward, ended = random_arrays(
        int(rng.integers(1, 9)), int(rng.integers(1, 5)), int(rng.integers(1, 4)), seed
    )
    reward *= rng.random(reward.shape) < 0.5  # zeros, which a sparse matrix does not store
    mdp = from_arrays(chance, reward, ended)
    kinds = (sp.csr_array, sp.csr_matrix, sp.csc_array, sp.coo_array, sp.lil_matrix)
    for kind in kinds:
        assert_equal_models(mdp, from_arrays(*(sparsely(x, kind) for x in (chance, reward, ended))))
    assert_equal_models(mdp, from_arrays(*map(by_action, (chance, reward, ended))))
    assert_equal_models(mdp, from_arrays(sparsely(chance), reward, by_action(ended)))
    assert_equal_models(mdp, from_arrays(chance.tolist(), sparsely(reward), ended))
    expected = (chance * reward).sum(axis=2)
    np.testing.assert_allclose(mdp.expected_rewards, expected, atol=1e-15)
    averaged = from_arrays(sparsely(chance), expected)
    np.testing.assert_allclose(averaged.expected_rewards, expected, atol=1e-15)
    assert not averaged.terminated.any()
    entered = rng.random(len(chance)) < 0.5
    ends = from_arrays(chance, reward, entered)
    np.testing.assert_array_equal(ends.terminated, entered[ends.next_states])


def test_disorder_repetition_and_zeros_in_sparse_matrices():
    transitions = sp.coo_array(
        ([0.5, 0.25, 0.25, 1.0, 0.0], ([0, 0, 0, 1, 1], [1, 0, 1, 0, 1])), shape=(2, 2)
    )
    shuffled = sp.csr_array(([0.75, 0.25, 1.0, 0.0], [1, 0, 0, 1], [0, 2, 4]), shape=(2, 2))
    for matrix in (transitions, shuffled):
        before = matrix.copy()
        mdp = from_arrays(matrix, [[1.0], [2.0]])
        assert mdp.next_states.tolist() == [0, 1, 0]
        assert mdp.probabilities.tolist() == [0.25, 0.75, 1.0]
        assert (matrix.data == before.data).all()
        matrix.data[:] = 9.0  # the model has its own numbers
        assert mdp.probabilities.tolist() == [0.25, 0.75, 1.0]


def test_a_large_sparse_model_is_built_without_a_loop():
    size, rng = 60_000, np.random.default_rng(0)
    columns = rng.integers(0, size, (4 * size, 3))
    pointers = np.arange(0, columns.size + 1, 3)
    chances = sp.csr_array((rng.dirichlet(np.ones(3), 4 * size).ravel(), columns.ravel(), pointers))
    mdp = from_arrays(chances, np.ones((size, 4)))
    assert mdp.num_states == size
    assert mdp.num_actions == 4


GOOD = np.full((2, 3, 2), 0.5)


def spoilt(value: float) -> np.ndarray:
    array = GOOD.copy()
    array[1, 2, 0] = value
    return array


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((spoilt(0.6), GOOD), "State 1, action 2 sum to 1.1. They must sum to 1"),
        ((spoilt(-0.5), GOOD), "State 1, action 2 has a negative probability"),
        ((spoilt(np.nan), GOOD), "A probability of state 1, action 2 is nan"),
        ((sparsely(spoilt(np.inf)), GOOD), "A probability of state 1, action 2 is inf"),
        ((GOOD, spoilt(np.nan)), "A reward of state 1, action 2 is nan"),
        ((sparsely(GOOD), sparsely(spoilt(-np.inf))), "A reward of state 1, action 2 is -inf"),
        ((GOOD * [[[1], [0], [1]]], GOOD), "State 0, action 1 has no transition"),
        ((sparsely(GOOD * [[[1], [1], [0]]]), GOOD), "State 0, action 2 has no transition"),
        ((np.swapaxes(GOOD, 0, 1), GOOD), "shape (3, 2, 2). Put the states first"),
        ((GOOD.reshape(6, 2), GOOD), "The transitions have shape (6, 2). Give [S, A, S], a"),
        ((sp.csr_array((5, 2)), GOOD), "The transitions have shape (5, 2). Give [S, A, S], a"),
        ((sp.csr_array((0, 2)), GOOD), "The transitions have shape (0, 2)"),
        ((np.zeros((0, 2, 0)), GOOD), "The transitions have shape (0, 2, 0)"),
        (([sp.eye_array(2), sp.eye_array(3)], GOOD), "sparse matrices of shapes (2, 2), (3, 3)"),
        ((GOOD, GOOD[0]), "The rewards have shape (3, 2), the transitions are of 2 states and 3"),
        ((GOOD, GOOD[..., 0], GOOD[0]), "The terminated have shape (3, 2)"),
        ((GOOD, sp.csr_array((2, 3))), "The rewards have shape (2, 3)"),
        ((GOOD, 1.0), "The rewards have shape ()"),
        (([["x"]], GOOD), "The transitions are no array of numbers: could not convert"),
        (([[0.5], [0.5, 0.5]], GOOD), "The transitions are no array of numbers"),
    ],
)
def test_bad_arrays_are_refused(arguments: tuple[Any, ...], message: str):
    with pytest.raises(InputError) as error:
        from_arrays(*arguments)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_start_that_does_not_exist():
    with pytest.raises(InputError, match="The start state 2 does not exist"):
        from_arrays(GOOD, GOOD, start=2)


@pytest.mark.parametrize("name", ["4x4 slippery", "cliff", "taxi"])
def test_the_part_after_a_state_has_its_values(name: str):
    _, mdp = model(name)
    q = exact(mdp, TimeAxis(GAMMA, 0)).solution.q_values
    for state in range(0, mdp.num_states, 1 + mdp.num_states // 12):
        part = part_after(mdp, state)
        values = exact(part, TimeAxis(GAMMA, 0)).solution.q_values[part.start]
        np.testing.assert_allclose(values, q[state], atol=1e-9)
    if name == "taxi":
        assert part.num_states < 150  # the destination stays


# ---- names, coordinates, maps --------------------------------------------------------------------


def test_coordinates_and_numbers_name_the_same_states():
    for name in WORLDS:
        env_id, arguments = WORLDS[name]
        world = make_world(env_id, arguments)
        places = [world.place(s) for s in range(world.mdp.num_states)]
        assert len(set(places)) == len(places)
        for state, place in enumerate(places):
            assert world.find_state(",".join(map(str, place))) == state
            assert world.find_state(str(state)) == state


def test_taxi_coordinates_are_the_environments_own():
    env = gym.make(TAXI)
    world = tabular_world(env)
    for state in range(world.mdp.num_states):
        assert world.place(state) == tuple(env.unwrapped.decode(state))
    assert world.describe(328) == "row 3, column 1, passenger at Y, destination at R"
    assert world.find_state("3, 1, y, R") == 328
    assert world.find_state("0,4,taxi,G") == env.unwrapped.encode(0, 4, 4, 1)
    assert [world.draw(328).split("\n")[i] for i in (0, 4)] == ["+---------+", "| |@: | : |"]


def test_action_names_move_where_they_say():
    moves = {"left": (0, -1), "right": (0, 1), "up": (-1, 0), "down": (1, 0)}
    moves |= {"west": (0, -1), "east": (0, 1), "north": (-1, 0), "south": (1, 0)}
    for env_id, here in (("FrozenLake-v1", "2,1"), (CLIFF, "1,5"), (TAXI, "2,2,0,1")):
        arguments = {"is_slippery": False} if env_id == "FrozenLake-v1" else {}
        world = make_world(env_id, arguments)
        state = world.find_state(here)
        for action, name in enumerate(world.action_names):
            if name in moves:
                (following,) = world.mdp.next_states[
                    slice(*world.mdp.offsets[state * world.mdp.num_actions + action :][:2])
                ]
                step = np.subtract(world.place(following)[:2], world.place(state)[:2])
                assert tuple(step) == moves[name], (env_id, name)


def test_maps_show_the_agent_where_it_is():
    lake = make_world("FrozenLake-v1")
    assert lake.draw(14) == "SFFF\nFHFH\nFFFH\nHF@G"
    assert "G goal 1 (ends)" in lake.legend
    assert "H hole (ends)" in lake.legend
    cliff = make_world(CLIFF)
    assert cliff.draw(0) == "@...........\n............\n............\nSCCCCCCCCCCG"
    assert "C cliff -100, back to S" in cliff.legend


def test_visited_states():
    lake = make_world("FrozenLake-v1")
    assert np.flatnonzero(~lake.visited).tolist() == [5, 7, 11, 12, 15]  # holes, and the goal
    cliff = make_world(CLIFF)
    assert np.flatnonzero(~cliff.visited).tolist() == list(range(37, 48))
    taxi = make_world(TAXI)
    at_goal = [s for s in range(500) if taxi.place(s)[2] == taxi.place(s)[3]]
    assert np.flatnonzero(~taxi.visited).tolist() == at_goal  # the documentation's 400


def test_an_unknown_environment_has_numbers():
    class Plain(gym.Env):
        P: ClassVar[Any] = [[[(1.0, 1, 2.0, False)]], [[(1.0, 1, 0.0, True)]]]

    world = tabular_world(Plain())
    assert (world.name, world.time_limit, world.arguments) == ("Plain", None, {})
    assert world.action_names == ("action 0",)
    assert (world.describe(1), world.draw(1), world.legend) == ("", "", ())
    assert world.find_state("1") == 1
    with pytest.raises(InputError, match=r"The state is '0,0'\. Give its number\."):
        world.find_state("0,0")


def test_descendants_of_a_known_environment_keep_its_names_if_they_fit():
    class Twin(FrozenLakeEnv):
        pass

    class Larger(FrozenLakeEnv):
        def __init__(self) -> None:
            super().__init__()
            stay = {a: [(1.0, 16, 0.0, False)] for a in range(4)}
            self.P = {**self.P, 16: stay}
            self.initial_state_distrib = np.eye(17)[16]
            self.observation_space = gym.spaces.Discrete(17)

    assert tabular_world(Twin()).action_names == ("left", "down", "right", "up")
    assert tabular_world(Larger()).action_names == ("action 0", "action 1", "action 2", "action 3")
    assert tabular_world(Larger()).coordinates == ()


# ---- an Estimator like any other -----------------------------------------------------------------


def test_the_table_works_in_the_wrapper_and_in_explanations():
    env = gym.make("FrozenLake-v1")
    world = tabular_world(env)
    table = exact(world.mdp, TimeAxis(GAMMA, 6))
    wrapped = TemporalRewardDecomposition(env, table)
    rng = np.random.default_rng(0)
    state, info = wrapped.reset(seed=0)
    for _ in range(200):
        np.testing.assert_array_equal(info[ALL_ACTIONS], table.decomposition.components[state])
        before, action = state, int(rng.integers(4))
        state, _, terminated, truncated, info = wrapped.step(action)
        np.testing.assert_array_equal(info[CHOSEN], table.decomposition.components[before, action])
        if terminated or truncated:
            state, info = wrapped.reset()
    for state in range(16):
        choice = tabular_moment(table, state, world.action_names).choice()
        said = [claim.sentence for claim in told(choice)]
        assert len(check(" ".join(said), [(CHOICES, choice)])) == len(said) > 0


def test_a_table_in_single_precision_is_accepted_and_said():
    class Thirds(gym.Env):
        P: ClassVar[Any] = [[[(np.float32(1 / 3), i, float(i), i == 2) for i in range(3)]]] * 3

    world = tabular_world(Thirds())
    (note,) = world.notes
    assert note == "Probabilities come in single precision: 3 rows were divided by their sum."
    assert exact(world.mdp, TimeAxis(0.5, 1)).solution.q_values[0, 0] == pytest.approx(1.5)
    assert tabular_world(gym.make("Taxi-v4")).notes == ()
