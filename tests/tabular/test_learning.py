"""Learned tables against exact ones: of a policy, of the optimum, and of the learner's operator."""

import re
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Estimator
from trdlab.gridworld import Gridworld, load_map
from trdlab.tabular import MDP, exact, learn, operator_table
from trdlab.tabular.operator import epsilon_greedy
from trdlab.tabular.reach import reachable
from trdlab.tabular.worlds import ModelWorlds
from trdlab.wrappers import TemporalRewardDecomposition

ONE, TWO = TimeAxis(0.95, horizon=4), TimeAxis(0.95, horizon=4, width=2)
SEEDS = range(5)
BUDGET = {"agent_steps": 1_000_000, "num_envs": 1024}
LARGE = {"agent_steps": 4_000_000, "num_envs": 1024}
EPSILON = 0.1
REACH = 0.02


def lake() -> MDP:
    table = gym.make("FrozenLake-v1").unwrapped.P
    return MDP.from_transitions([[list(table[s][a]) for a in range(4)] for s in range(16)])


WORLDS = {"drone": Gridworld(load_map("drone")).mdp, "lake": lake()}
both_worlds = pytest.mark.parametrize("mdp", WORLDS.values(), ids=list(WORLDS))
five_seeds = pytest.mark.parametrize("seed", SEEDS)


def random_policy(mdp: MDP) -> np.ndarray:
    return np.random.default_rng(1).dirichlet(np.ones(mdp.num_actions), mdp.num_states)


def worst(learned: RewardDecomposition, truth: RewardDecomposition) -> float:
    """Returns the sup-norm error over all states, actions and components."""
    assert learned.time_axis == truth.time_axis
    return float(np.abs(learned.components - truth.components).max())


# -- the exact fixed point of each learner ---------------------------------------------------------


def brute_force(mdp: MDP, axis: TimeAxis, epsilon: float) -> np.ndarray:
    """Returns `[S, A, N+1]`: the operator applied 2000 times, with dense matrices."""
    size, count = mdp.num_states, mdp.num_actions
    chain = np.zeros((size * count, size))
    rows = np.repeat(np.arange(size * count), np.diff(mdp.offsets))
    np.add.at(chain, (rows, mdp.next_states), mdp.continuation)
    pays, table = mdp.expected_rewards.ravel(), np.zeros((size, count, axis.num_components))
    for _ in range(2000):
        greedy = table.sum(axis=2).argmax(axis=1)
        choose = np.zeros((size, size * count))
        for state in range(size):
            for action in range(count):
                chance = epsilon / count + (1 - epsilon) * (action == greedy[state])
                choose[state, state * count + action] = chance
        reward, reach = pays, axis.gamma * chain
        for _ in range(axis.width - 1):
            reward = pays + axis.gamma * chain @ choose @ reward
            reach = axis.gamma * chain @ choose @ reach
        n = reach @ table[np.arange(size), greedy]  # [S·A, N+1]
        new = np.concatenate([reward[:, None], n], axis=1)
        new = np.concatenate([new[:, :-2], new[:, -2:].sum(axis=1, keepdims=True)], axis=1)
        table = new.reshape(table.shape)
    return table


@both_worlds
@pytest.mark.parametrize("axis", [ONE, TWO, TimeAxis(0.9, 3, 3), TimeAxis(0.9, 0, 2)], ids=str)
def test_the_operator_table_is_the_fixed_point(mdp, axis):
    table = operator_table(mdp, axis, EPSILON)
    np.testing.assert_allclose(
        table.decomposition.components, brute_force(mdp, axis, EPSILON), atol=1e-10
    )


@both_worlds
def test_without_random_actions_inside_the_windows_there_is_no_bias(mdp):
    for axis, epsilon in ((ONE, 1.0), (TWO, 0.0), (TimeAxis(0.9, 2, 5), 0.0)):
        table = operator_table(mdp, axis, epsilon)
        assert np.abs(table.bias.components).max() < 1e-12
        assert str(table) == f"w = {axis.width}, ε = {epsilon:g}: no bias."


def test_the_bias_of_the_drone():
    table = operator_table(WORLDS["drone"], TimeAxis(0.95, 2, 2), EPSILON)
    assert str(table) == (
        "w = 2, ε = 0.1: Q is biased by up to 0.03022 (state 0, action 0: 3.2278, optimal 3.2580),"
        " a component by up to 0.4951."
    )
    np.testing.assert_allclose(table.decomposition.value[0, 0], 3.227801, atol=1e-6)
    np.testing.assert_allclose(table.bias.value[0, 0], 3.227801 - 4 * 0.95**4, atol=1e-6)


def test_a_drone_that_may_fly_back_onto_the_arrow_gives_the_other_published_figure():
    """3.2275: by the map's rules the cell `>` is not entered against its arrow, which gives 3.2278.

    ε-greedy means the same in both: with probability ε any of the four actions, evenly.
    """
    world = Gridworld(load_map("drone"))
    first, second, left = world.find_state("0,0"), world.find_state("0,1"), 2
    mdp = world.mdp
    row = mdp.offsets[second * 4 + left]
    assert mdp.next_states[row] == second
    following = mdp.next_states.copy()
    following[row] = first
    fields = (mdp.probabilities, mdp.rewards, mdp.terminated, mdp.num_actions)
    table = operator_table(MDP(mdp.offsets, following, *fields), TimeAxis(0.95, 2, 2), EPSILON)
    np.testing.assert_allclose(table.decomposition.value[0, 0], 3.2275, atol=5e-5)


def test_a_value_of_epsilon_that_is_no_probability_is_refused():
    for call in (
        lambda: operator_table(WORLDS["drone"], TWO, 1.5),
        lambda: learn(WORLDS["drone"], TWO, epsilon=-0.1),
    ):
        with pytest.raises(InputError, match=r"ε is .*It must be from 0 to 1"):
            call()


# -- learning from a model -------------------------------------------------------------------------


@both_worlds
@five_seeds
def test_evaluating_a_policy(mdp, seed):
    policy = random_policy(mdp)
    learned = learn(mdp, ONE, policy=policy, seed=seed, **BUDGET)
    assert worst(learned.decomposition, exact(mdp, ONE, policy=policy).decomposition) <= REACH


@both_worlds
@five_seeds
def test_control_with_single_steps_finds_the_optimum(mdp, seed):
    learned = learn(mdp, ONE, seed=seed, **BUDGET)
    assert worst(learned.decomposition, exact(mdp, ONE).decomposition) <= REACH


@both_worlds
@five_seeds
def test_control_with_wide_windows_finds_its_own_fixed_point(mdp, seed):
    learned = learn(mdp, TWO, epsilon=EPSILON, seed=seed, **LARGE)
    own = operator_table(mdp, TWO, EPSILON)
    assert worst(learned.decomposition, own.decomposition) <= REACH
    bias = learned.decomposition - own.optimal
    assert worst(bias, own.bias) <= REACH  # it is off by as much as was stated,
    assert np.abs(own.bias.components).max() > 1.5 * REACH  # and that is not nothing


def test_nearly_equal_actions_keep_their_order():
    """Over the bridge or round it: 0.05 apart in value, and 2 apart in a component."""
    mdp, axis = Gridworld(load_map("bridge")).mdp, TimeAxis(0.95, 8)
    truth = exact(mdp, axis)
    values = np.sort(truth.decomposition.value, axis=1)
    assert (values[:, -1] - values[:, -2])[~mdp.terminal_states].min() < 0.05
    learned = learn(mdp, axis, agent_steps=3_000_000, seed=0)
    assert worst(learned.decomposition, truth.decomposition) <= REACH


@both_worlds
def test_wide_windows_with_greedy_tails_find_the_optimum(mdp):
    learned = learn(mdp, TWO, tail="greedy", seed=0, **LARGE)
    assert worst(learned.decomposition, exact(mdp, TWO).decomposition) <= REACH
    assert 0.05 < learned.left_out / (learned.left_out + learned.visits.sum()) < 0.1
    assert learned.future.policy == "the greedy policy, learned from samples"


def test_greedy_tails_do_not_make_an_end_look_likelier():
    """Half the actions are random: without care, holes would seem to be everywhere."""
    learned = learn(WORLDS["lake"], TWO, tail="greedy", epsilon=0.5, seed=0, **LARGE)
    assert worst(learned.decomposition, exact(WORLDS["lake"], TWO).decomposition) <= REACH


@both_worlds
def test_evaluating_a_policy_with_wide_windows(mdp):
    policy = random_policy(mdp)
    learned = learn(mdp, TWO, policy=policy, seed=0, **LARGE)
    assert worst(learned.decomposition, exact(mdp, TWO, policy=policy).decomposition) <= REACH


@pytest.mark.parametrize("horizon", [0, 1, 7])
def test_any_number_of_components(horizon):
    axis = TimeAxis(0.9, horizon)
    learned = learn(WORLDS["lake"], axis, **BUDGET)
    assert worst(learned.decomposition, exact(WORLDS["lake"], axis).decomposition) <= REACH


def test_a_chain_is_solved():
    """Five steps to the right, the last one pays 1; the other action stays where it is."""
    moves = [
        [[(1.0, s, 0.0, False)], [(1.0, min(s + 1, 4), float(s == 4), s == 4)]] for s in range(5)
    ]
    chain, axis = MDP.from_transitions(moves), TimeAxis(0.5, horizon=2)
    learned = learn(chain, axis, agent_steps=200_000)
    assert worst(learned.decomposition, exact(chain, axis).decomposition) < 1e-3
    np.testing.assert_allclose(learned.decomposition[2, 1].components, [0, 0, 0.25], atol=1e-3)


def test_the_same_seed_is_the_same_run():
    first, second, other = (
        learn(WORLDS["lake"], TWO, agent_steps=20_000, seed=s) for s in (3, 3, 4)
    )
    np.testing.assert_array_equal(
        first.decomposition.components, second.decomposition.components, strict=True
    )
    assert worst(first.decomposition, other.decomposition) > 0


def test_every_reachable_state_is_visited_and_no_other():
    learned = learn(WORLDS["lake"], ONE, agent_steps=50_000)
    np.testing.assert_array_equal((learned.visits > 0).all(axis=1), reachable(WORLDS["lake"]))
    assert (learned.visits.sum(), learned.left_out, learned.dropped) == (50_176, 0, 0)


def test_samples_follow_the_model():
    """Also transitions of probability 0, first, last and in between, are never drawn."""
    chances = [[0.0, 0.2, 0.8], [0.5, 0.0, 0.5], [0.7, 0.3, 0.0]]
    moves = [
        [[(p, s, 10.0 * row + s, False) for s, p in enumerate(chances[row])]] for row in (0, 1)
    ]
    moves.append([[(p, s, 20.0 + s, s == 1) for s, p in enumerate(chances[2])]])
    worlds = ModelWorlds(MDP.from_transitions(moves), 5000, 4, np.random.default_rng(0))
    counts = np.zeros((3, 3))
    for _ in range(40):
        here = worlds.observations
        step = worlds.step(np.zeros(5000, dtype=np.int64))
        np.testing.assert_array_equal(step.rewards, 10 * here + step.next_observations)
        np.testing.assert_array_equal(step.terminated, step.rewards == 21)
        assert not np.any(step.terminated & step.truncated)
        np.add.at(counts, (here, step.next_observations), 1)
    drawn = counts / counts.sum(axis=1, keepdims=True)
    assert not drawn[np.array(chances) == 0].any()
    assert np.abs(drawn - chances).max() < 0.02


# -- the loss on the sum ---------------------------------------------------------------------------


@both_worlds
@five_seeds
def test_the_loss_on_the_sum_learns_q_and_nothing_else(mdp, seed):
    initial = np.random.default_rng(seed).normal(size=(mdp.num_states, mdp.num_actions, 5))
    learned = learn(mdp, ONE, loss="sum", initial=initial, seed=seed, **BUDGET)
    truth, visited = exact(mdp, ONE).decomposition, learned.visits > 0
    found = learned.decomposition
    assert np.abs(found.value - truth.value)[visited].max() <= REACH
    off = np.abs(found.components - truth.components)[visited]
    assert off.max() > 1.0
    assert np.median(off) > 0.3
    # Where it ends is where it began: the components keep their distances from each other.
    ends, begins = found.components[visited], initial[visited]
    np.testing.assert_allclose(ends - ends[:, :1], begins - begins[:, :1], atol=1e-9)
    assert "the components mean nothing" in learned.future.policy


def test_the_loss_on_the_components_forgets_where_it_began():
    initial = np.random.default_rng(0).normal(size=(16, 4, 5))
    initial[~reachable(WORLDS["lake"])] = 0.0
    learned = learn(WORLDS["lake"], ONE, initial=initial, **BUDGET)
    assert worst(learned.decomposition, exact(WORLDS["lake"], ONE).decomposition) <= REACH


# -- learning from Gymnasium -----------------------------------------------------------------------


def test_learning_from_an_environment():
    env = gym.make("trdlab.envs:trdlab/DroneGridworld-v0")
    learned = learn(env, TimeAxis(0.9, 3), epsilon=0.5, agent_steps=20_000)
    truth = exact(WORLDS["drone"], TimeAxis(0.9, 3)).decomposition
    known = learned.visits >= 200
    assert known.sum() > 20
    assert np.abs(learned.decomposition.components - truth.components)[known].max() <= REACH
    assert learned.dropped == 0


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_learning_from_a_vector_environment(mode):
    """Cut off after 7 steps, of which the last ones begin no window of three."""
    envs = gym.make_vec(
        "FrozenLake-v1",
        num_envs=64,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        max_episode_steps=7,
    )
    axis, policy = TimeAxis(0.9, 2, 3), random_policy(WORLDS["lake"])
    learned = learn(envs, axis, policy=policy, agent_steps=120_000)
    truth = exact(WORLDS["lake"], axis, policy=policy).decomposition
    known = learned.visits >= 500
    assert known.sum() > 8
    assert np.abs(learned.decomposition.components - truth.components)[known].max() <= 0.05
    assert learned.dropped > 0


def test_an_episode_too_short_for_any_window_is_refused_before_learning():
    env = gym.make("FrozenLake-v1", max_episode_steps=2)
    with pytest.raises(InputError, match=r"end after 2 steps, so no window of 3 steps fits in"):
        learn(env, TimeAxis(0.9, 2, 3))


class Short(gym.Env):
    """Is cut off after two steps, without announcing it."""

    observation_space, action_space = gym.spaces.Discrete(3), gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = 0
        return np.int64(0), {}

    def step(self, action):
        self.at += 1
        return np.int64(self.at), 1.0, False, self.at == 2, {}


def test_learning_refuses_when_every_window_was_dropped():  # errata C3
    message = (
        "All 66 windows of 3 steps were dropped: every episode was truncated, or learning ended, "
        "before it had as many. Choose a smaller width, a longer time limit, or more steps."
    )
    with pytest.raises(TrdlabError, match=re.escape(message)):
        learn(Short(), TimeAxis(0.9, 2, 3), agent_steps=100)
    assert learn(Short(), TimeAxis(0.9, 2, 2), agent_steps=100).dropped == 33


def test_learning_refuses_when_no_tail_was_greedy():
    with pytest.raises(TrdlabError, match=r"None of \d+ windows of 20 steps followed the policy"):
        learn(
            WORLDS["lake"],
            TimeAxis(0.9, 2, 20),
            tail="greedy",
            epsilon=1.0,
            agent_steps=200,
            num_envs=10,
        )


# -- what comes out, and what does not go in -------------------------------------------------------


def test_a_learned_table_works_wherever_an_exact_one_does():
    world = Gridworld(load_map("drone"))
    learned = learn(world.mdp, ONE, **BUDGET)
    assert isinstance(learned, Estimator)
    assert learned.decompose(np.array([0, 3])).components.shape == (2, 4, 5)
    env = TemporalRewardDecomposition(gym.make("trdlab.envs:trdlab/DroneGridworld-v0"), learned)
    _, info = env.reset()
    np.testing.assert_array_equal(info["reward_decomposition"], learned.decomposition.components[0])


@pytest.mark.parametrize(
    ("options", "policy"),
    [
        ({"policy": np.full((16, 4), 0.25)}, "the given policy"),
        ({}, "the greedy policy"),
        ({"width": 2, "tail": "greedy"}, "the greedy policy"),
        ({"width": 2, "epsilon": 0.0}, "the greedy policy"),
        (
            {"width": 3},
            "a policy that acts greedily once every 3 steps and ε-greedily in between (ε = 0.1)",
        ),
    ],
)
def test_it_says_whose_future_it_tells(options, policy):
    axis = TimeAxis(0.9, 2, options.pop("width", 1))
    learned = learn(WORLDS["lake"], axis, agent_steps=2_000, **options)
    assert learned.future.policy == f"{policy}, learned from samples"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tail": "greedyy"}, r"The tail is 'greedyy'\. Did you mean 'greedy'\?"),
        ({"loss": "mean"}, r"The loss is 'mean'\. Known: components, sum\."),
        ({"agent_steps": 0}, r"The number of agent steps is 0\. It must be at least 1\."),
        ({"num_envs": 0}, r"The number of environments is 0\. It must be at least 1\."),
        ({"policy": np.ones((2, 4))}, r"shape \(2, 4\)\. The model needs \(16, 4\)"),
        ({"policy": np.ones((16, 4))}, "not a probability distribution"),
        ({"initial": np.zeros((16, 4, 4))}, r"shape \(16, 4, 4\).*of shape \(16, 4, 5\)"),
        ({"initial": np.full((16, 4, 5), np.nan)}, "an entry that is not finite"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        learn(WORLDS["lake"], ONE, **options)


def test_observations_that_are_no_states_are_refused():
    learned = learn(WORLDS["lake"], ONE, agent_steps=600)
    with pytest.raises(InputError, match=r"have type float64\. A table takes state indices"):
        learned.decompose(np.array([0.5]))
    with pytest.raises(InputError, match=r"run from 3 to 16\. States run from 0 to 15"):
        learned.decompose([3, 16])


def test_epsilon_greedy_is_a_distribution():
    policy = epsilon_greedy(np.array([2, 0]), 3, 0.3)
    np.testing.assert_allclose(policy, [[0.1, 0.1, 0.8], [0.8, 0.1, 0.1]])


class Period(gym.Env):
    """State 0 leads to 1 and 1 to 0, for ever; action 1 pays 1 in state 0 and 3 in state 1."""

    observation_space, action_space = gym.spaces.Discrete(3), gym.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = 0
        return np.int64(0), {}

    def step(self, action):
        paid, self.at = action * (1.0 + 2.0 * self.at), 1 - self.at
        return np.int64(self.at), paid, False, False, {}


@pytest.mark.parametrize("width", [1, 2, 4])
def test_windows_begin_at_every_step_whatever_the_period(width):
    rows = [[[(1.0, 1 - s, a * (1.0 + 2.0 * s), False)] for a in (0, 1)] for s in (0, 1)]
    mdp, policy = MDP.from_transitions(rows), np.array([[0.5, 0.5], [0.0, 1.0]])
    axis = TimeAxis(0.5, 2, width)
    padded = np.concatenate([policy, [[1.0, 0.0]]])
    learned = learn(Period(), axis, policy=padded, agent_steps=20_000)
    truth = exact(mdp, axis, policy=policy).decomposition.components
    assert (learned.visits[:2] > 500).all()
    np.testing.assert_allclose(learned.decomposition.components[:2], truth, atol=0.1)


def test_what_was_never_learned_is_told():
    """State 2 does not exist, and the policy of state 1 never takes action 0."""
    policy = np.array([[0.5, 0.5], [0.0, 1.0], [1.0, 0.0]])
    learned = learn(Period(), TimeAxis(0.5, 2), policy=policy, agent_steps=500)
    assert learned.unlearned.tolist() == [[False, False], [False, False], [True, True]]
    told = "No window began in state 2. Nothing was learned of them."
    assert str(learned).endswith(told)
    assert "500 windows of 1 steps" in str(learned)
    visits = np.array([[5, 0], [3, 2], [0, 0]])
    partly = str(replace(learned, visits=visits))
    assert "No window began in state 2. Nor with state and action (0, 1)." in partly
    only = str(replace(learned, visits=np.maximum(visits, [[0, 0], [0, 0], [1, 1]])))
    assert "steps. No window began with state and action (0, 1). Nothing" in only
    assert str(replace(learned, visits=visits + 1)).endswith("windows of 1 steps.")
