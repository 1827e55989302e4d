"""A table that was learned, not solved for."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.tabular.table import as_states

_SHOWN = 8


@dataclass(frozen=True, eq=False)
class LearnedTable:
    """A decomposition `[S, A, N+1]` learned from samples; an Estimator.

    Args:
        decomposition: `[S, A, N+1]`.
        future: whose future it tells.
        visits: `[S, A]`, the windows learned from; where it is 0, the components are still those
            that learning began with.
        left_out: the windows left out because their tail did not follow the policy.
        dropped: the windows lost to truncation.
    """

    decomposition: RewardDecomposition
    future: Future
    visits: IntArray
    left_out: int
    dropped: int

    @property
    def unlearned(self) -> BoolArray:
        """`[S, A]`: what no window began with, so that nothing was learned of it.

        That is all of a state in which every episode is over.
        """
        return np.asarray(self.visits == 0)

    def __str__(self) -> str:
        axis, windows = self.time_axis, int(self.visits.sum())
        told = f"The future of {self.future.policy}: {windows} windows of {axis.width} steps."
        never = np.asarray(self.unlearned.all(axis=1))
        if never.any():
            told += f" No window began in {_listed('state', np.flatnonzero(never).tolist())}."
        seldom = np.argwhere(self.unlearned & ~never[:, None]).tolist()
        if seldom:
            pairs = _listed("state and action", [tuple(pair) for pair in seldom])
            told += f" {'Nor' if never.any() else 'No window began'} with {pairs}."
        return told + " Nothing was learned of them." * bool(self.unlearned.any())

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


def _listed(name: str, items: list[Any]) -> str:
    """Returns the first few items, and how many there are."""
    shown = ", ".join(map(str, items[:_SHOWN]))
    more = f" and {len(items) - _SHOWN} more" if len(items) > _SHOWN else ""
    return f"{name} {shown}{more}"
