"""How far into the future a forecast can be trusted: one figure, by a stated rule."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import BoolArray
from trdlab.decomposition import TimeAxis
from trdlab.explanations.calibration.calibration import Calibration

SLACK = 0.1
"""How wrong a forecast may be where the reward was always the same, as a share of it."""


@dataclass(frozen=True)
class Trust:
    """How far a forecast can be trusted.

    A component is trusted if the lower end of its skill interval is above zero. So is one with
    nothing to predict, unless its forecast is wrong: by more than a tenth of the reward that always
    came, and by more (in mean square, undiscounted) than a constant guess is at the steps where
    there is something to predict. The forecast can be trusted as far as all components up to there
    are trusted.

    Args:
        time_axis: what the components mean.
        components: how many explicit components in a row, from the first on, are trusted.
        at_most: how many could be, for all that the intervals say: up to the first whose upper end
            is not above zero, or that is wrong with nothing to predict.
        tested: how many of the trusted ones had something to predict.
        residual: whether the residual is trusted, by the same rule.
    """

    time_axis: TimeAxis
    components: int
    at_most: int
    tested: int
    residual: bool

    @property
    def last_step(self) -> int | None:
        """The k of `trustworthy to t+k`; None where nothing is, or nothing was tested."""
        return self.components * self.time_axis.width - 1 if self.tested else None

    @property
    def is_whole(self) -> bool:
        """Whether all explicit components are trusted."""
        return self.components == self.time_axis.horizon > 0 and self.tested > 0

    @property
    def doubtful(self) -> BoolArray:
        """`[N+1]`: the components that are not to be trusted in any one forecast.

        Of the explicit ones these are those beyond the trusted range, or all of them where nothing
        in that range was tested and it is not the whole; the residual is judged by itself.
        """
        beyond = np.arange(self.time_axis.num_components) >= self.components
        beyond |= not self.tested and self.components < self.time_axis.horizon
        beyond[-1] = not self.residual
        return beyond


def trust(calibration: Calibration) -> Trust:
    """Returns how far a calibrated forecast can be trusted."""
    axis, sure = calibration.time_axis, trusted(calibration)
    wrong = np.where(
        calibration.is_("nothing to predict"),
        is_wrong(calibration),
        calibration.skill.high <= 0.0,  # NaN, so not wrong, where there is no interval
    )
    components = _leading(sure[:-1])
    return Trust(
        time_axis=axis,
        components=components,
        at_most=_leading(~wrong[:-1]),
        tested=int(calibration.is_("judged")[:components].sum()),
        residual=bool(sure[-1]),
    )


def trusted(calibration: Calibration) -> BoolArray:
    """Returns `[N+1]`: the components that are trusted, each by itself."""
    nothing = calibration.is_("nothing to predict") & ~is_wrong(calibration)
    return nothing | (calibration.skill.low > 0.0)  # NaN, so false, where there is no interval


def is_wrong(calibration: Calibration) -> BoolArray:
    """Returns `[N+1]`: what would be wrong of a component with nothing to predict (see `Trust`)."""
    scale = np.maximum(calibration.time_axis.discounts, np.finfo(np.float64).tiny) ** 2
    guess = (calibration.variance / scale)[calibration.is_("judged")]
    usual = scale * (guess.mean() if guess.size else 0.0)
    allowed = np.maximum(usual, (SLACK * calibration.mean) ** 2)
    return np.asarray(calibration.error.value > allowed + 1e-12 * scale)


def _leading(flags: BoolArray) -> int:
    """Returns how many flags in a row are true, from the first on."""
    return int(np.append(flags, False).argmin())
