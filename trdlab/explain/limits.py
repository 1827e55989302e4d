"""Limits: what of a moment's forecasts lies beyond the range that can be trusted."""

from dataclasses import dataclass

import numpy as np

from trdlab.explain.finding import Finding
from trdlab.explain.moment import Moment


def limits(moment: Moment) -> tuple[Finding, ...]:
    """Returns what is not to be trusted of a moment; nothing where that has not been judged."""
    doubtful = np.flatnonzero(_doubtful(moment))
    first = int(doubtful[0]) if doubtful.size else 0
    residual = moment.time_axis.horizon
    claims = (
        TrustedWhole(),
        NowhereTrusted(),
        NotTrustedAt(residual),
        NotTrustedFrom(first),
        NotTrustedBetween(first, residual),
    )
    return next(((claim,) for claim in claims if claim.holds(moment)), ())


@dataclass(eq=False, repr=False)
class TrustedWhole(Finding):
    """Every component is trusted, the residual too."""

    def holds(self, moment: Moment) -> bool:
        return moment.trust is not None and not any(_doubtful(moment))


@dataclass(eq=False, repr=False)
class NowhereTrusted(Finding):
    """No component is trusted, nor is the residual."""

    def holds(self, moment: Moment) -> bool:
        return moment.trust is not None and all(_doubtful(moment))


@dataclass(eq=False, repr=False)
class NotTrustedAt(Finding):
    """The residual alone is not trusted."""

    component: int

    def holds(self, moment: Moment) -> bool:
        *explicit, residual = _doubtful(moment) or [False]
        return residual and not any(explicit) and self.component == len(explicit) > 0


@dataclass(eq=False, repr=False)
class NotTrustedFrom(Finding):
    """An explicit component is the first that is not trusted, and nothing after it is."""

    component: int

    def holds(self, moment: Moment) -> bool:
        *explicit, residual = _doubtful(moment) or [False]
        return residual and any(explicit) and explicit.index(True) == self.component > 0


@dataclass(eq=False, repr=False)
class NotTrustedBetween(Finding):
    """An explicit component is the first that is not trusted, yet the residual is."""

    component: int
    residual: int

    def holds(self, moment: Moment) -> bool:
        *explicit, residual = _doubtful(moment) or [False]
        begins = any(explicit) and explicit.index(True) == self.component
        return begins and not residual and self.residual == len(explicit)


def _doubtful(moment: Moment) -> list[bool]:
    """Returns whether each component is not to be trusted; nothing where that was not judged."""
    return [] if moment.trust is None else moment.trust.doubtful.tolist()
