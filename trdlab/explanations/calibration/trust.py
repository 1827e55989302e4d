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
        return next((i for i, x in enumerate(self.status[:-1]) if x != "good"), self._horizon)

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
        return self.components == self._horizon > 0

    @property
    def doubtful(self) -> BoolArray:
        """`[N+1]`: the components that are not to be trusted in any one forecast.

        Of the explicit ones these are all from the first on that is not good.
        """
        beyond = np.arange(self.time_axis.num_components) >= self.components
        beyond[-1] = not self.residual
        return beyond

    @property
    def _horizon(self) -> int:
        return self.time_axis.horizon


def trust(calibration: Calibration) -> Trust:
    """Returns how far a calibrated forecast can be trusted."""
    return Trust(calibration.time_axis, calibration.status)
