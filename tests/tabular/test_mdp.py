"""A model is checked when it is built, and knows its own structure."""

import gymnasium as gym
import numpy as np
import pytest

from trdlab.errors import InputError
from trdlab.tabular import MDP, evaluate

STAY = (1.0, 0, 0.0, False)
END = (1.0, 0, 2.0, True)


def test_rows_hold_the_transitions_of_each_state_and_action():
    mdp = MDP.from_transitions(
        [
            [[(0.25, 1, 4.0, False), (0.75, 0, 0.0, False)], [(1.0, 2, -1.0, True)]],
            [[(1.0, 1, 1.0, False)], [(0.5, 0, 0.0, False), (0.5, 2, 6.0, True)]],
            [[(1.0, 2, 0.0, True)], [(1.0, 2, 0.0, True)]],
        ]
    )
    assert (mdp.num_states, mdp.num_actions) == (3, 2)
    assert mdp.expected_rewards.tolist() == [[1, -1], [1, 3], [0, 0]]
    assert mdp.expect(np.array([10.0, 20.0, 40.0])).tolist() == [[12.5, 0], [20, 5], [0, 0]]
    assert mdp.transition_states.tolist() == [0, 0, 0, 1, 1, 1, 2, 2]
    assert mdp.transition_actions.tolist() == [0, 0, 1, 0, 1, 1, 0, 1]
    assert mdp.leaves_state.tolist() == [[True, True], [False, True], [False, False]]
    assert mdp.terminal_states.tolist() == [False, False, True]


def test_gymnasiums_table_is_read_as_it_is():
    """FrozenLake without slipping: the goal is six steps away, so its value is γ^5."""
    env = gym.make("FrozenLake-v1", is_slippery=False).unwrapped
    mdp = MDP.from_transitions(env.P)
    right_down = np.eye(4)[[1, 2, 1, 0, 1, 0, 1, 0, 2, 1, 1, 0, 0, 2, 2, 0]]
    assert evaluate(mdp, right_down, 0.9).state_values[0] == pytest.approx(0.9**5)
    assert mdp.terminal_states.nonzero()[0].tolist() == [5, 7, 11, 12, 15]  # holes and the goal


def test_other_rewards_leave_the_dynamics_alone():
    mdp = MDP.from_transitions([[[STAY], [END]]])
    assert mdp.expected_rewards.tolist() == [[0, 2]]
    other = mdp.with_rewards(np.array([1.0, 5.0]))
    assert other.expected_rewards.tolist() == [[1, 5]]
    assert mdp.expected_rewards.tolist() == [[0, 2]]
    with pytest.raises(InputError, match="not a finite number"):
        mdp.with_rewards(np.array([1.0, np.inf]))


@pytest.mark.parametrize(
    ("transitions", "message"),
    [
        ([], "no transition"),
        ([[]], "no transition"),
        ([[[STAY], []]], "State 0, action 1 has no transition"),
        ([[[STAY], [END]], [[STAY]]], "State 1 has 1 actions, state 0 has 2"),
        ([[[(1.0, 0, 0.0, float("nan"))]]], "terminates is told by nan. Give True or False"),
        ([[[STAY], [(0.5, 0, 0.0, False)]]], r"State 0, action 1 sum to 0\.5"),
        ([[[(1.5, 0, 0.0, False), (-0.5, 0, 0.0, True)]]], "negative probability"),
        ([[[(1.0, 1, 0.0, False)]]], "state that does not exist"),
        ([[[(1.0, -1, 0.0, False)]]], "state that does not exist"),
        ([[[(1.0, 0, np.nan, False)]]], "not a finite number"),
        ([[[(np.nan, 0, 0.0, False)]]], "not a finite number"),
    ],
)
def test_what_is_no_model_is_refused_by_place(transitions, message):
    with pytest.raises(InputError, match=message):
        MDP.from_transitions(transitions)


def test_a_start_and_arrays_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match=r"start state 1 .* 0 to 0"):
        MDP.from_transitions([[[STAY]]], start=1)
    whole = MDP.from_transitions([[[STAY], [END]]])
    parts = {
        name: getattr(whole, name)
        for name in ("offsets", "next_states", "probabilities", "rewards", "terminated")
    }
    with pytest.raises(InputError, match="2 rows do not divide among 3 actions"):
        MDP(**parts, num_actions=3)
    with pytest.raises(InputError, match="one entry per transition"):
        MDP(**parts | {"rewards": np.zeros(3)}, num_actions=2)
    with pytest.raises(InputError, match=r"told by nan. Give True or False"):
        MDP(**parts | {"terminated": np.array([0.0, np.nan])}, num_actions=2)
    counted = MDP(**parts | {"terminated": np.array([0, 1])}, num_actions=2)
    assert counted.terminal_states.tolist() == whole.terminal_states.tolist()
    assert counted.continuation.tolist() == [1.0, 0.0]


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        ([[1.0]], r"shape \(1, 1\).*\(1, 2\)"),
        ([[0.5, 0.4]], "not a probability distribution"),
        ([[1.5, -0.5]], "not a probability distribution"),
        ([[np.nan, 1.0]], "not a probability distribution"),
    ],
)
def test_what_is_no_policy_is_refused(policy, message):
    with pytest.raises(InputError, match=message):
        evaluate(MDP.from_transitions([[[STAY], [END]]]), policy, 0.9)


def test_single_precision_is_divided_by_its_sum_and_said():
    """Three times float32(1/3) is 1.0000000298."""
    third = np.float32(1 / 3)
    row = [(third, i, float(i), i == 2) for i in range(3)]
    mdp = MDP.from_transitions([[row], [[STAY]], [row]])
    assert mdp.rounded_rows == 2
    assert mdp.probabilities.tolist() == pytest.approx([1 / 3] * 3 + [1.0] + [1 / 3] * 3, abs=1e-16)
    with pytest.raises(
        InputError, match=r"sum to 1\.0000000"
    ):  # such a sum is a mistake in doubles
        MDP.from_transitions([[[(1 / 3 + 1e-8, i, 0.0, False) for i in range(3)]]] * 3)
    with pytest.raises(InputError, match=r"sum to 0\.99"):
        MDP.from_transitions([[[(np.float32(0.33), i, 0.0, False) for i in range(3)]]] * 3)


@pytest.mark.parametrize("start", ["0", 0.5, None, -1, 1])
def test_a_start_that_is_no_state_is_refused(start):
    with pytest.raises(InputError, match=f"start state {start!r} does not exist"):
        MDP.from_transitions([[[STAY]]], start=start)
