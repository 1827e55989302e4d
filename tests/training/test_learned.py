"""A small world is solved, through the same doors as large ones, and matches the exact table."""

from pathlib import Path

import numpy as np
import pytest

from trdlab.decomposition import TimeAxis
from trdlab.deep.settings import TrainSettings
from trdlab.gridworld.env import GridworldEnv
from trdlab.tabular import exact
from trdlab.tabular.reach import reachable
from trdlab.training.loading import evaluate_run, load
from trdlab.training.run import begin, carry_on

CORRIDOR = "h = hazard -1\n---\nhS.cT\n"
GAMMA = 0.9


@pytest.mark.parametrize("horizon", [0, 1, 4])
def test_a_corridor_is_solved_and_its_components_are_exact(tmp_path, horizon):
    (tmp_path / "corridor.txt").write_text(CORRIDOR)
    world = str(tmp_path / "corridor.txt")
    settings = TrainSettings("gym", "trdlab/DroneGridworld-v0", (f"map={world}",)).changed(
        {
            "agent_steps": 12_000,
            "num_envs": 8,
            "gamma": GAMMA,
            "N": horizon,
            "hidden": [64],
            "epsilon_end": 1.0,  # every action is taken everywhere
            "learning_starts": 100,
            "update_every": 8,
            "learning_rate": 3e-3,
            "learning_rate_end": 1e-4,
            "target_sync_updates": 40,
            "evaluate_episodes": 4,
        }
    )
    with begin(settings, tmp_path / "run") as run:
        assert carry_on(run)
    env = GridworldEnv(Path(world))
    truth = exact(env.mdp, TimeAxis(GAMMA, horizon)).decomposition.components  # [S, A, N+1]
    states = np.flatnonzero(reachable(env.mdp))
    learned = load(tmp_path / "run").decompose(states).components
    error = np.abs(learned - truth[states]).max(axis=(0, 1))  # [N+1]
    assert error.max() <= 0.05, error
    evaluation, _ = evaluate_run(tmp_path / "run")
    assert evaluation.returns.tolist() == [5.0] * 4
    assert evaluation.lengths.tolist() == [3] * 4
