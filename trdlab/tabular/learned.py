"""A table that was learned, not solved for."""

from dataclasses import dataclass
from typing import Any

from trdlab.arrays import IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.tabular.table import as_states


@dataclass(frozen=True, eq=False)
class LearnedTable:
    """A decomposition `[S, A, N+1]` learned from samples; an Estimator.

    Args:
        decomposition: `[S, A, N+1]`.
        future: whose future it tells.
        visits: `[S, A]`, the windows learned from; where it is 0, the components are still those
            that learning began with.
        left_out: the windows left out because their tail was not greedy.
        dropped: the windows lost to truncation.
    """

    decomposition: RewardDecomposition
    future: Future
    visits: IntArray
    left_out: int
    dropped: int

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.decomposition.time_axis

    def decompose(self, observations: Any) -> RewardDecomposition:
        """Returns `[B, A, N+1]` for a batch `[B]` of state indices.

        Raises:
            InputError: an observation is not the index of a state.
        """
        return self.decomposition[as_states(observations, len(self.decomposition))]
