"""Episodes and estimators that tests write down, and what can be solved exactly of tables."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.rollouts.episodes import Episode
from trdlab.tabular import ExactTable


@dataclass(frozen=True, eq=False)
class Given:
    """A table `[S, A, N+1]` of whatever components, as an Estimator."""

    components: FloatArray
    time_axis: TimeAxis
    future: Future

    def decompose(self, observations: Any) -> RewardDecomposition:
        return RewardDecomposition(self.components[observations], self.time_axis)


def episode(
    rewards: Sequence[float],
    axis: TimeAxis,
    expected: ArrayLike | None = None,
    **changes: Any,
) -> Episode:
    """An episode of one action: rewards `[T]`, and what each observation expected `[T+1, N+1]`.

    It has ended, unless `terminated` is changed.
    """
    total = len(rewards)
    rows = np.zeros((total + 1, axis.num_components)) if expected is None else np.array(expected)
    ends = np.zeros(total, dtype=np.bool_)
    ends[-1] = changes.get("terminated", True)
    known = Episode(
        decomposition=RewardDecomposition(rows[:total, None], axis),
        expected=rows,
        actions=np.zeros(total, dtype=np.int64),
        rewards=np.array(rewards),
        life_lost=np.zeros(total, dtype=np.bool_),
        ends=ends,
        terminated=True,
        random=np.zeros(total + axis.num_steps, dtype=np.bool_),
    )
    return replace(known, **changes)


def occupancy(table: ExactTable) -> FloatArray:
    """Returns `[S, A]`: how often an episode takes each action in each state."""
    mdp, policy = table.mdp, table.solution.policy
    follow = policy[mdp.transition_states, mdp.transition_actions] * mdp.continuation
    chain = np.zeros((mdp.num_states, mdp.num_states))
    np.add.at(chain, (mdp.next_states, mdp.transition_states), follow)
    begin = np.eye(mdp.num_states)[mdp.start]
    states: FloatArray = np.linalg.solve(np.eye(mdp.num_states) - chain, begin)
    return states[:, None] * policy
