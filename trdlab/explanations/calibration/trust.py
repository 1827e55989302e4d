"""How far into the future a forecast can be trusted: one figure, by a stated rule."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import BoolArray
from trdlab.decomposition import TimeAxis
from trdlab.explanations.calibration.calibration import Calibration, Status


@dataclass(frozen=True)
class Trust:
    """How far a forecast can be trusted: as far as all components up to there are good.

    Args:
        time_axis: what the components mean.
        status: N+1 of them, as a `Calibration` has found each; the residual is judged by itself.
    """

    time_axis: TimeAxis
    status: tuple[Status, ...]

    @property
    def components(self) -> int:
        """How many explicit components in a row, from the first on, are good."""
        explicit = self.status[:-1]
        return next((i for i, own in enumerate(explicit) if own != "good"), len(explicit))

    @property
    def residual(self) -> bool:
        """Whether the residual is good."""
        return self.status[-1] == "good"

    @property
    def last_step(self) -> int | None:
        """The k of `trustworthy to t+k`; None where no step is."""
        return self.components * self.time_axis.width - 1 if self.components else None

    @property
    def is_whole(self) -> bool:
        """Whether all explicit components are good."""
        return self.components == self.time_axis.horizon > 0

    @property
    def doubtful(self) -> BoolArray:
        """`[N+1]`: the components not to be trusted: from the first on that is not good."""
        explicit = np.arange(self.time_axis.horizon) >= self.components
        return np.append(explicit, not self.residual)


def trust(calibration: Calibration) -> Trust:
    """Returns how far a calibrated forecast can be trusted."""
    return Trust(calibration.time_axis, calibration.status)
