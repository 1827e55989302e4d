"""The conformance kit: each breach is named, each golden is right by other means."""

import json
import warnings
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import gymnasium as gym
import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import trdlab.envs
import trdlab.testing
from loading import loaded
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.gridworld.env import GridworldEnv
from trdlab.tabular import MDP, exact, from_environment, learn, operator_table
from trdlab.testing import (
    ContractError,
    EstimatorWarning,
    Golden,
    check_against_golden,
    check_estimator,
    golden,
    golden_names,
)

DOWN = 1
AXIS = TimeAxis(0.95, horizon=2, width=2)
SCHEMA = Path(trdlab.testing.__file__).parent / "golden.schema.json"


script = loaded(Path(__file__).parent / "goldens.py")


# ---- estimators that do as they should ---------------------------------------------------------


class Linear:
    """Components that are linear in a Box observation; what tests change is one step of it."""

    time_axis: Any = AXIS
    future: Any = Future("the greedy policy of a linear map")
    num_actions = 2

    def __init__(self) -> None:
        shape = (4, self.num_actions * 3)
        self.weights = np.random.default_rng(0).normal(size=shape)  # [4, A·(N+1)]

    def decompose(self, observations: Any) -> RewardDecomposition:
        return RewardDecomposition(self.components(self.checked(observations)), self.time_axis)

    def checked(self, observations: Any) -> np.ndarray:
        array = np.asarray(observations, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != 4:
            raise InputError(f"The observations have shape {array.shape}.", "Give [B, 4].")
        return array

    def components(self, observations: np.ndarray) -> np.ndarray:
        return (observations @ self.weights).reshape(len(observations), self.num_actions, 3)


class Table:
    """The components of every state of the drone's map, perhaps wrong on purpose."""

    time_axis = AXIS
    future = Future("the optimal policy")

    def __init__(self, components: np.ndarray) -> None:
        self.table = RewardDecomposition(components, AXIS)

    def decompose(self, observations: Any) -> RewardDecomposition:
        if np.min(observations) < 0:
            raise InputError("A state is negative.", "States run from 0.")
        return self.table[observations]


class ModelEnv(gym.Env):
    """A model that is stepped by drawing from its `P` table."""

    def __init__(self, mdp: MDP) -> None:
        self.mdp = mdp
        self.observation_space = gym.spaces.Discrete(mdp.num_states)
        self.action_space = gym.spaces.Discrete(mdp.num_actions)
        self.state = mdp.start

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = self.mdp.start
        return self.state, {}

    def step(self, action):
        first, end = self.mdp.offsets[self.state * self.mdp.num_actions + action :][:2]
        chances = self.mdp.probabilities[first:end]
        k = first + self.np_random.choice(end - first, p=chances / chances.sum())
        self.state = int(self.mdp.next_states[k])
        return self.state, self.mdp.rewards[k], bool(self.mdp.terminated[k]), False, {}


def cart() -> gym.Env:
    return gym.make("CartPole-v1")


@pytest.mark.parametrize("axis", [TimeAxis(0.95, 0), TimeAxis(0.95, 1), TimeAxis(0.95, 4, 3)])
@pytest.mark.parametrize(
    "env_id",
    ["trdlab/DroneGridworld-v0", "trdlab/TieGridworld-v0", "FrozenLake-v1", "CliffWalking-v1"],
)
def test_exact_tables_conform_and_are_exact(env_id, axis):
    env = gym.make(env_id)
    table = exact(from_environment(env), axis)
    report = check_estimator(table, env, tolerance=1e-9)
    assert report.time_axis == axis
    assert report.future == table.future
    assert report.suspicions == ()
    assert report.batch_difference == report.repeat_difference == 0.0
    assert report.empty_batch
    assert report.law.without_chance
    if env_id == "FrozenLake-v1":  # on ice chance is in every step
        assert report.law.windows == 0
        assert "not compared" in str(report)
    else:
        assert report.law.windows > 100
        assert report.law.largest_error.max() < 1e-12
    with pytest.raises(FrozenInstanceError):
        report.num_actions = 3


@st.composite
def models(draw) -> MDP:
    num_states, num_actions = draw(st.integers(1, 4)), draw(st.integers(1, 3))

    def row() -> list[tuple[float, int, float, bool]]:
        return [
            (p, draw(st.integers(0, num_states - 1)), draw(st.sampled_from([0.0, 1.0, -2.0])), end)
            for p, end in draw(
                st.sampled_from([[(1.0, False)], [(1.0, True)], [(0.25, True), (0.75, False)]])
            )
        ]

    return MDP.from_transitions([[row() for _ in range(num_actions)] for _ in range(num_states)])


@settings(max_examples=25, deadline=None)
@given(models(), st.integers(0, 3), st.integers(1, 3), st.booleans())
def test_what_is_exact_passes_on_any_model(mdp, horizon, width, drawn):
    """Whatever ties, terminates or is left to chance; for the optimal policy and a drawn one."""
    axis, policy = TimeAxis(0.9, horizon, width), None
    if drawn:
        policy = np.random.default_rng(width).dirichlet(np.ones(mdp.num_actions), mdp.num_states)
    table = exact(mdp, axis, policy=policy)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EstimatorWarning)  # some models really are that dull
        report = check_estimator(
            table,
            ModelEnv(mdp),
            policy=None if policy is None else lambda states: policy[states],
            tolerance=1e-9,
        )
    assert not (report.law.largest_error > 1e-9).any()


def test_an_estimator_of_ones_own_without_a_model():
    report = check_estimator(Linear(), cart())
    assert report.exact is None
    assert report.no_model == (
        "CartPole-v1 has no transition table 'P', so there is no exact model of it."
    )
    assert not report.law.without_chance
    assert report.law.windows > 100
    assert len(report.checked) == 7
    lines = str(report).splitlines()
    assert lines[0] == (
        "Linear: γ = 0.95, N = 2, w = 2, 2 actions, the future of the greedy policy of a linear map"
    )
    assert "chance included: off by up to" in lines[2]
    assert lines[3].startswith("exact: not compared. CartPole-v1 has no transition table")


def test_a_network_conforms():
    from trdlab.deep.estimator import NetworkEstimator
    from trdlab.deep.networks import build_network

    env = cart()
    network = build_network(env.observation_space, 2, AXIS)
    report = check_estimator(NetworkEstimator(network, AXIS, Future("the greedy policy")), env)
    assert report.repeat_difference == 0.0
    assert report.batch_difference < 1e-5


def test_observations_of_a_nested_space():
    class Nested(gym.Env):
        observation_space = gym.spaces.Dict(
            {"a": gym.spaces.Box(-9, 9, (4,)), "b": gym.spaces.Discrete(4)}
        )
        action_space = gym.spaces.Discrete(2, start=5)

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            return self._see(), {}

        def step(self, action):
            assert self.action_space.contains(action)
            return self._see(), 0.0, False, False, {}

        def _see(self):
            return {"a": self.np_random.normal(size=4).astype(np.float32), "b": 1}

    class OfDict(Linear):
        def checked(self, observations):
            return super().checked(observations["a"])

    report = check_estimator(OfDict(), Nested())
    assert report.law.windows > 100
    assert len(report.checked) == 6  # there is no shape to get wrong


def test_it_is_the_same_each_time_and_leaves_the_global_chance_alone():
    before = np.random.get_state()[1].copy()  # noqa: NPY002  that it is untouched is the point
    one, other = (check_estimator(Linear(), cart(), seed=3) for _ in range(2))
    assert np.array_equal(before, np.random.get_state()[1])  # noqa: NPY002
    np.testing.assert_array_equal(one.law.mean_error, other.law.mean_error)
    assert str(one) == str(other)
    assert str(check_estimator(Linear(), cart(), seed=4)) != str(one)


# ---- each breach of the contract is named ------------------------------------------------------


def broken(**changes: Any) -> Linear:
    """Returns a linear estimator with some of its attributes or methods replaced."""
    return type("Broken", (Linear,), changes)()


def returns(change: Any) -> Linear:
    """Returns one whose components `[B, A, N+1]` are changed on the way out."""
    return broken(components=lambda self, x: change(Linear.components(self, x)))


class Forgetful(RewardDecomposition):
    """A decomposition that is no longer read-only."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.components.setflags(write=True)


def with_nan(components: np.ndarray) -> np.ndarray:
    components[-1, 1, 2] = np.nan
    return components


def overwrites() -> Linear:
    """Returns one that hands out its own memory, and computes into it again."""
    memory = np.zeros((1000, 2, 3))

    def decompose(self: Linear, observations: Any) -> RewardDecomposition:
        components = self.components(self.checked(observations))
        memory.setflags(write=True)
        memory[: len(components)] = components
        memory.setflags(write=False)
        return RewardDecomposition(memory[: len(components)], AXIS)

    return broken(decompose=decompose)


BREACHES = [
    (broken(time_axis=(0.95, 2, 2)), r"time_axis is \(0.95, 2, 2\).*must be a trdlab.TimeAxis"),
    (broken(future="greedy"), r"future is 'greedy'.*must be a trdlab.Future"),
    (broken(future=Future(" ")), r"The policy of its future is ' '.*Say in words"),
    (
        broken(decompose=lambda self, x: self.components(self.checked(x))),
        r"returned a ndarray.*Return a trdlab.RewardDecomposition",
    ),
    (
        broken(decompose=lambda self, x: RewardDecomposition([0, 0, 0], TimeAxis(0.9, 2))),
        r"answered on TimeAxis\(gamma=0.9.*time_axis is TimeAxis\(gamma=0.95.*must be equal",
    ),
    (
        returns(lambda c: c[:, 0]),
        r"answered 16 observations with shape \(16, 3\).*2 actions.*must be \[B, A, N\+1\] = "
        r"\(16, 2, 3\)",
    ),
    (broken(num_actions=3), r"shape \(16, 3, 3\).*The environment has 2 actions"),
    (returns(with_nan), r"Component 2 of action 1 at observation 15 of 16 is nan.*finite"),
    (
        broken(
            decompose=lambda self, x: Forgetful(self.components(self.checked(x)), self.time_axis)
        ),
        r"type float64 and can be written to.*read-only",
    ),
    (
        broken(checked=lambda self, x: np.subtract(x, 1, out=x)),
        r"changed the observations that it was given.*Copy them",
    ),
    (
        broken(components=lambda self, x: Linear.components(self, x[:, :3])),
        r"raised ValueError for 16 observations of Box.*must take a batch",
    ),
    (
        broken(components=lambda self, x: np.random.default_rng().normal(size=(len(x), 2, 3))),
        r"gave other components when asked about again: \S+ of the largest.*not depend on chance",
    ),
    (overwrites(), r"answer changed when decompose was called again.*Do not write"),
    (
        broken(components=lambda self, x: Linear.components(self, x - x.mean(axis=0))),
        r"Asked alone, observations give other.*than in a batch of 16.*normalisation",
    ),
    (
        returns(lambda c: c + 1e-3 * np.arange(len(c))[:, None, None] * (len(c) > 2)),
        r"Asked alone, observations give other components",
    ),
    (
        returns(lambda c: c if len(c) != 2 else c[::-1]),
        r"Asked in a batch of two, observations give other components",
    ),
    (
        returns(lambda c: c if len(c) else np.zeros((1, 2, 3))),
        r"no observation was answered with shape \(1, 2, 3\).*Answer \(0, 2, 3\), or refuse",
    ),
    (
        broken(checked=lambda self, x: np.atleast_2d(x)),
        r"without the batch axis, of shape \(4,\) instead of \(16, 4\), were answered.*\(1, 2, 3\)",
    ),
    (
        broken(checked=lambda self, x: np.reshape(x, (-1, 4)) if np.ndim(x) > 1 else 1 / 0),
        r"with a second batch axis, of shape \(1, 16, 4\).*answered with shape \(16, 2, 3\)",
    ),
    (
        broken(checked=lambda self, x: Linear.checked(self, np.asarray(x)[:, :4])),
        r"one entry too long, of shape \(16, 5\).*Refuse what is no batch",
    ),
]


@pytest.mark.parametrize(("estimator", "message"), BREACHES)
def test_a_breach_is_named(estimator, message):
    with pytest.raises(ContractError, match=f"(?s){message}"):
        check_estimator(estimator, cart())


def test_rows_may_depend_on_their_batch_as_far_as_is_allowed():
    loose = returns(lambda c: c + 1e-3 * (len(c) > 2))
    report = check_estimator(loose, cart(), precision=0.01)
    assert 1e-5 < report.batch_difference < 0.01


def test_a_batch_of_nothing_may_be_refused():
    def checked(self: Linear, observations: Any) -> np.ndarray:
        if not len(observations):
            raise InputError("There is no observation.", "Give one.")
        return Linear.checked(self, observations)

    assert not check_estimator(broken(checked=checked), cart()).empty_batch


@pytest.mark.parametrize(
    ("estimator", "message"),
    [
        (returns(lambda c: 0 * c + [[1], [2]]), "the same of 16 different observations"),
        (returns(lambda c: c[:, :1].repeat(2, axis=1)), "the same of all 2 actions"),
        (returns(lambda c: c.astype(np.float16)), "float16"),
        (
            returns(lambda c: c * (1 + 1e-9 * np.random.default_rng().random())),
            r"Asked again, it is \S+ of the largest component off",
        ),
    ],
)
def test_what_is_suspicious_is_warned_about(estimator, message):
    with pytest.warns(EstimatorWarning, match=message) as caught:
        report = check_estimator(estimator, cart())
    assert caught[0].filename == __file__
    assert any(f"suspicious: {text}" in str(report) for text in report.suspicions)


def test_a_negative_state_that_counts_from_the_end_is_warned_about():
    class Wraps(Table):
        def decompose(self, observations):
            return self.table[observations]

    env = GridworldEnv("drone")
    with pytest.warns(EstimatorWarning, match=r"for the observation -1, which Discrete\(14\)"):
        check_estimator(Wraps(exact(env.mdp, AXIS).decomposition.components), env)


def test_what_cannot_be_checked_is_refused():
    with pytest.raises(InputError, match=r"A str is no gymnasium.Env.*gymnasium.make"):
        check_estimator(Linear(), "CartPole-v1")
    with pytest.raises(InputError, match=r"action space is Box.*Discrete"):
        check_estimator(Linear(), gym.make("Pendulum-v1"))
    with pytest.raises(ContractError, match=r"A dict is no Estimator.*time_axis, future"):
        check_estimator({}, cart())
    with pytest.raises(InputError, match=r"nothing exact to compare.*no transition table"):
        check_estimator(Linear(), cart(), tolerance=0.1)
    env = GridworldEnv("drone")
    table, other = exact(env.mdp, AXIS), exact(env.mdp, TimeAxis(0.95, 2))
    with pytest.raises(InputError, match=r"The tolerance is -1.*at least 0"):
        check_estimator(table, env, tolerance=-1)
    with pytest.raises(InputError, match=r"reference is on TimeAxis.*width=1.*Solve it"):
        check_estimator(table, env, reference=other.decomposition)
    with pytest.raises(InputError, match=r"shape \(4,\), the model has 14 states and 4 actions"):
        check_estimator(table, env, reference=table.decomposition[0])
    with pytest.raises(InputError, match=r"policy has shape \(1, 2\)"):
        check_estimator(table, env, policy=lambda states: np.ones((len(states), 2)) / 2)


# ---- the audits find faults of known size ------------------------------------------------------


def test_a_wrong_component_is_told_to_the_digit():
    env = GridworldEnv("drone")
    components = exact(env.mdp, AXIS).decomposition.components.copy()
    components[0, DOWN] += [0.0, -0.25, 0.125]
    report = check_estimator(Table(components), env)
    assert report.exact is not None
    assert report.exact.largest_error.round(12).tolist() == [0.0, 0.25, 0.125]
    assert round(report.exact.largest_value_error, 12) == 0.125
    with pytest.raises(
        ContractError,
        match=r"Component 1 of action 1 in state 0 is 0\.25 too low, against its own greedy policy",
    ):
        check_estimator(Table(components), env, tolerance=0.2)
    assert check_estimator(Table(components), env, tolerance=0.26).law.largest_error[1] > 0.2


def test_rewards_one_component_late_are_seen_by_the_law():
    """Column 0 says what column 1 should: the mean and largest errors are off from row 0 on."""
    axis = TimeAxis(0.95, horizon=3)
    env = GridworldEnv("drone")
    right = exact(env.mdp, axis).decomposition.components
    late = np.concatenate([np.zeros_like(right[..., :1]), right[..., :-1]], axis=-1)

    class Late(Table):
        time_axis = axis

        def __init__(self) -> None:
            self.table = RewardDecomposition(late, axis)

    report = check_estimator(Late(), env)
    assert report.law.largest_error[0] == 4.0  # the treasure, and it is expected one step late
    assert report.law.mean_error[0] < 0.0


def test_a_wrong_power_of_gamma_is_seen_by_the_law():
    """γ for γ^w: each component further ahead is too large."""
    env = GridworldEnv("drone")
    right = exact(env.mdp, AXIS)
    wrong = Table(right.decomposition.components * 0.95 ** -np.arange(3))
    law = check_estimator(wrong, env, policy=lambda states: right.solution.policy[states]).law
    # Largest where the treasure of 4 is two steps away: γ²·4 / γ was said, and γ²·4 is right.
    np.testing.assert_allclose(law.largest_error[:2], [0.0, 0.95 * 4 - 0.95**2 * 4], atol=1e-12)
    assert law.mean_error[1] > 0.0
    # Of its own, it would rather wait for ever: what is put off by a group gains 1/γ.
    assert check_estimator(wrong, env).law.largest_error[1] > 1.0


def test_an_ending_that_is_ignored_is_seen_by_the_model():
    """The golden case `ending` with its terminations forgotten: state 0, action 0 says too much."""
    case = golden("ending")
    endless = MDP(
        case.mdp.offsets,
        case.mdp.next_states,
        case.mdp.probabilities,
        case.mdp.rewards,
        np.zeros_like(case.mdp.terminated),
        num_actions=2,
    )
    table = exact(endless, case.time_axis, policy=case.policy)
    env = ModelEnv(case.mdp)
    report = check_estimator(table, env, policy=lambda states: case.policy[states])
    assert report.exact is not None
    assert report.exact.whose == "the given policy"
    # From state 0, action 0 should end with [1, 0, 0]. Without the end, state 1 costs 1 a step,
    # half the time leading to state 0, which costs nothing: −γ, then −γ²/2.
    assert report.exact.errors[0, 0].round(12)[:2].tolist() == [0.0, -0.5]


def test_whose_future_decides_what_is_right():
    env = GridworldEnv("drone")
    policy = np.full((14, 4), 0.25)
    table = exact(env.mdp, AXIS, policy=policy)
    held_against_greedy = check_estimator(table, env).exact
    assert held_against_greedy is not None
    assert held_against_greedy.largest_error.max() > 1.0
    report = check_estimator(table, env, policy=lambda states: policy[states], tolerance=1e-12)
    assert report.law.windows < 10  # of two steps, for the second is drawn: only what ends at once


def test_a_learner_is_held_against_its_own_operator():
    env = GridworldEnv("drone", slip=0.1)
    learned = learn(env.mdp, AXIS, epsilon=0.3, agent_steps=400_000)
    own = operator_table(env.mdp, AXIS, 0.3).decomposition
    report = check_estimator(learned, env, reference=own)
    optimal = check_estimator(learned, env)
    assert report.exact is not None
    assert optimal.exact is not None
    assert report.exact.largest_value_error < 0.3 * optimal.exact.largest_value_error


def test_ties_are_counted():
    env = GridworldEnv("tie")
    table = exact(env.mdp, TimeAxis(0.95, 4))
    assert "of tied actions the first" in table.future.policy
    report = check_estimator(table, env, tolerance=1e-12)
    assert report.exact is not None
    assert report.exact.tied == 1  # at the start
    even = exact(env.mdp, TimeAxis(0.95, 4), ties="mixed")
    exact_audit = check_estimator(even, env).exact
    assert exact_audit is not None
    assert exact_audit.largest_value_error < 1e-12  # Q is the same
    assert exact_audit.largest_error.max() > 1.0  # the components are not


def test_a_wrapper_that_changes_rewards_leaves_no_model():
    env = gym.wrappers.TransformReward(GridworldEnv("windy"), lambda reward: 2 * reward)
    table = exact(env.unwrapped.mdp, AXIS)
    report = check_estimator(table, env)
    assert report.exact is None
    assert "with reward -0.2. A wrapper may have changed it." in report.no_model
    env = gym.wrappers.TransformObservation(
        GridworldEnv("drone"), lambda s: np.eye(14)[s], gym.spaces.Box(0, 1, (14,), np.float64)
    )

    class OneHot(Linear):
        num_actions = 4

        def __init__(self) -> None:
            self.weights = np.random.default_rng(0).normal(size=(14, 12))

        def checked(self, observations):
            if np.shape(observations)[1:] != (14,):
                raise InputError("No batch of states.", "Give [B, 14].")
            return observations

    assert "are not the states of the model" in check_estimator(OneHot(), env).no_model


# ---- golden decompositions ---------------------------------------------------------------------


def raw(name: str) -> dict[str, Any]:
    return json.loads((SCHEMA.parent / "goldens" / f"{name}.json").read_bytes())


def dense_answer(data: dict[str, Any]) -> np.ndarray:
    """Returns `[S, A, N+1]` by matrix powers and one linear solve, from the raw file alone."""
    model, axis = data["model"], data["decomposition"]
    states, actions, gamma = model["num_states"], model["num_actions"], axis["gamma"]
    chance, reward = np.zeros((states, actions, states)), np.zeros((states, actions))
    for s, a, after, p, r, ends in zip(*model["transitions"].values(), strict=True):
        reward[s, a] += p * r
        chance[s, a, after] += 0.0 if ends else p
    policy = np.array(data["policy"])
    chain, pay = np.einsum("sa,san->sn", policy, chance), (policy * reward).sum(axis=1)
    value = np.linalg.solve(np.eye(states) - gamma * chain, pay)

    def after_steps(count: int, what: np.ndarray) -> np.ndarray:
        return gamma**count * chance @ np.linalg.matrix_power(chain, count - 1) @ what

    width, horizon = axis["w"], axis["N"]
    groups = [range(i * width, (i + 1) * width) for i in range(horizon)]
    parts = [sum(after_steps(k, pay) if k else reward for k in group) for group in groups]
    total = horizon * width
    rest = after_steps(total, value) if total else reward + gamma * chance @ value
    return np.stack([*parts, rest], axis=-1)


@pytest.mark.parametrize("name", golden_names())
def test_a_golden_decomposition_is_right_by_dense_algebra(name):
    data = raw(name)
    expected = dense_answer(data)[data["states"]]
    np.testing.assert_allclose(data["decomposition"]["components"], expected, rtol=0, atol=1e-12)
    if "optimal" in data["future"]["policy"]:
        values = dense_answer(data).sum(axis=-1)
        taken = np.array(data["policy"]) > 0.0
        best = values >= values.max(axis=1, keepdims=True) - 1e-9
        assert not (taken & ~best).any()


@pytest.mark.parametrize("name", golden_names())
def test_a_golden_file_follows_its_schema_and_survives_a_round_trip(name):
    data = raw(name)
    jsonschema.validate(data, json.loads(SCHEMA.read_bytes()))
    case = golden(name)
    assert case.to_dict() == data
    assert data["name"] == name
    columns = data["model"]["transitions"]
    backwards = {key: column[::-1] for key, column in columns.items()}
    turned = Golden.from_dict({**data, "model": {**data["model"], "transitions": backwards}})
    again = exact(turned.mdp, case.time_axis, policy=case.policy).decomposition
    np.testing.assert_allclose(again.components, case.decomposition.components, atol=1e-12)


def test_the_files_are_what_the_script_makes_and_what_the_environments_are():
    """To 1e-12; the models are built again from the environments on the way."""
    made = script.goldens()
    assert tuple(sorted(case.name for case in made)) == golden_names()
    for case in made:
        assert script.same(json.loads(script.text_of(case)), raw(case.name)), case.name
    wrong = raw("drone")
    wrong["decomposition"]["components"][0][1][1] += 1e-11
    assert not script.same(wrong, raw("drone"))


def test_goldens_by_hand():
    assert golden("drone").decomposition[0, DOWN].components.round(2).tolist() == [0.95, 1.76, 0.81]
    steps = [0, 0.95, 0.95**2, 0.95**3, 0.95**4]
    np.testing.assert_allclose(golden("drone-n4").decomposition[0, DOWN].components, steps)
    np.testing.assert_allclose(golden("drone-n0").decomposition[0, DOWN].components, [sum(steps)])
    np.testing.assert_allclose(
        golden("drone-n1").decomposition[0, DOWN].components, [0.0, sum(steps)]
    )
    chain = golden("chain").decomposition[:, 0].components  # [6, 4]
    for s in range(6):
        pays = [0.9**i * (s + i + 1) if s + i <= 5 else 0.0 for i in range(6)]
        np.testing.assert_allclose(chain[s], [*pays[:3], sum(pays[3:])], atol=1e-12)
    survival = golden("survival").decomposition[0, 0].components
    np.testing.assert_allclose(survival, [0.6**i for i in range(5)] + [0.6**5 / 0.4])
    assert golden("ending").decomposition[0, 0].components.tolist() == [1.0, 0.0, 0.0]
    first, even = golden("tie-first"), golden("tie-even")
    np.testing.assert_allclose(first.decomposition.value, even.decomposition.value, atol=1e-12)
    assert first.policy[0].tolist() == [0, 0, 1, 0]  # left
    assert even.policy[0].tolist() == [0, 0, 0.5, 0.5]
    up = first.decomposition[0, 0].components  # into the wall, and then left: 19 after two more
    np.testing.assert_allclose(up, [0, 0, 0.95**2 * 19, 0, 0])
    up = even.decomposition[0, 0].components  # or right: 20 after three more
    np.testing.assert_allclose(up, [0, 0, 0.95**2 * 9.5, 0.95**3 * 10, 0])


def test_an_implementation_is_held_against_a_golden():
    for name in golden_names():
        case = golden(name)
        mine = dense_answer(case.to_dict())
        assert check_against_golden(lambda states, mine=mine: mine[states], name).max() < 1e-12
    with pytest.raises(InputError, match=r"no golden decomposition 'dron'.*mean 'drone'"):
        check_against_golden(lambda states: states, "dron")
    with pytest.raises(ContractError, match=r"shape \(14,\).*\[M, A, N\+1\] = \(14, 4, 3\)"):
        check_against_golden(lambda states: states, "drone")
    case = golden("drone")
    other = exact(case.mdp, TimeAxis(0.95, 2))
    with pytest.raises(ContractError, match=r"answered on TimeAxis.*width=1.*needs.*width=2"):
        check_against_golden(other.decompose, "drone")
    wrong = case.decomposition.components.copy()
    wrong[0, DOWN, 1] = 1.76
    with pytest.raises(
        ContractError,
        match=r"'drone', state 0, action 1: component 1 is 1\.76, and should be 1\.75987\d*\. "
        r"It is the future of the optimal policy",
    ):
        check_against_golden(lambda states: wrong[states], "drone")
    assert check_against_golden(lambda states: wrong[states], "drone", tolerance=0.01)[1] > 1e-4
    wrong[0, DOWN, 1] = np.nan
    with pytest.raises(ContractError, match=r"component 1 is nan"):
        check_against_golden(lambda states: wrong[states], "drone")


def test_another_schema_is_refused():
    data = raw("drone")
    with pytest.raises(InputError, match=r"schema is 'trdlab.Golden/2'.*reads 'trdlab.Golden/1'"):
        Golden.from_dict({**data, "schema": "trdlab.Golden/2"})
    with pytest.raises(InputError, match=r"shape \(14, 4\), for 2 states and 4 actions"):
        Golden.from_dict({**data, "states": [0, 1]})
    with pytest.raises(InputError, match=r"something else than it should.*'zero'"):
        Golden.from_dict({**data, "states": ["zero"]})
    del data["policy"]
    with pytest.raises(InputError, match=r"The field 'policy' is missing"):
        Golden.from_dict(data)
