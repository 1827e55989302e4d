"""The contract of everything that decomposes: an exact table, a learned one, a network."""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from trdlab.decomposition import RewardDecomposition, TimeAxis


@dataclass(frozen=True)
class Future:
    """Whose future a decomposition speaks of, in which reward, and what ends it.

    Args:
        policy: who acts after the first action, for example `the optimal policy`.
        reward: the reward it counts, for example `reward as the environment pays it`.
        ending: what ends it, for example `terminal states`.
    """

    policy: str
    reward: str = "reward as the environment pays it"
    ending: str = "terminal states"


@runtime_checkable
class Estimator(Protocol):
    """Decomposes the future of a batch of observations."""

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""

    @property
    def future(self) -> Future:
        """Whose future it is."""

    def decompose(self, observations: Any) -> RewardDecomposition:
        """Returns the components `[B, A, N+1]` of a batch of B observations."""
