"""Episodes of a model: side by side, each as it would go alone."""

import numpy as np

from trdlab.tabular import MDP, ModelEnvironments


def test_environments_that_are_not_active_stay_where_they_are():
    line = [[[(1.0, state + 1, float(state), state == 3)]] for state in range(4)]
    mdp = MDP.from_transitions([*line, [[(1.0, 4, 0.0, True)]]])
    environments = ModelEnvironments(mdp, 2, seed=0, time_limit=3)
    assert environments.action_names == ("action 0",)
    assert environments.reset().tolist() == [0, 0]
    for state in (1, 2, 3):
        step = environments.step(np.array([0, 0]), active=np.array([True, False]))
        assert step.frames.tolist() == [state, 0]
        assert step.rewards.tolist() == [state - 1.0, 0.0]
        assert step.truncated.tolist() == [state == 3, False]
        assert not step.terminated.any()
    assert step.following.tolist() == [0, 0]
    assert environments.step(np.array([0, 0])).frames.tolist() == [1, 1]
