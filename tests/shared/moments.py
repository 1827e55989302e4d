"""Moments that tests write down, and what is told of them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import Calibration, Reliability, Status
from trdlab.explanations.moment.exact import gridworld_moment
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.explanations.moment.telling import sections
from trdlab.explanations.rules import Claim
from trdlab.gridworld import Gridworld, load_map
from trdlab.statistics import Estimates
from trdlab.tabular import exact

GAMMA = 0.95


def moment(rows: list[list[float]], width: int = 1, gamma: float = GAMMA, **known: Any) -> Moment:
    """A moment of actions a, b, c … with components `rows [A, N+1]`."""
    axis = TimeAxis(gamma, len(rows[0]) - 1, width)
    parts = RewardDecomposition(np.array(rows, dtype=np.float64), axis)
    return Moment(parts, tuple("abcd"[: len(rows)]), Future("the optimal policy"), **known)


def trusted(axis: TimeAxis, components: int, residual: bool = False, **known: Any) -> Calibration:
    """Forecasts of which so many explicit components are good, and the residual."""
    explicit = ("good",) * components + ("bad",) * (axis.horizon - components)
    return calibrated(axis, (*explicit, "good" if residual else "bad"), **known)


def calibrated(
    axis: TimeAxis,
    status: tuple[Status, ...] | None = None,
    off_by: Sequence[float] | FloatArray | None = None,
    only_reward: float | None = None,
) -> Calibration:
    """What is known of forecasts, by default that they are good, and not what they are off by."""
    size = axis.num_components
    unknown, none = np.full(size, np.nan), np.zeros(0)
    error = unknown if off_by is None else np.square(off_by)
    return Calibration(
        time_axis=axis,
        status=("good",) * size if status is None else status,
        constant=np.zeros(size, dtype=np.bool_),
        num_samples=np.full(size, 500),
        num_episodes=np.full(size, 50),
        enough=(None,) * size,
        bias=Estimates(unknown, unknown, unknown),
        error=Estimates(error, error, error),
        mean=unknown,
        variance=unknown,
        skill=Estimates(unknown, unknown, unknown),
        predicted_range=np.zeros((2, size + 1)),
        observed_range=np.zeros((2, size + 1)),
        reliability=None
        if only_reward is None
        else Reliability(only_reward, none.astype(np.int64), none, none),
    )


def choice(
    world: Gridworld | str = "drone", axis: TimeAxis | None = None, state: int = 0, **options: Any
) -> Choice:
    """The choice at a state of a map that is solved exactly."""
    world = Gridworld(load_map(world)) if isinstance(world, str) else world
    table = exact(world.mdp, axis or TimeAxis(GAMMA, 4), ties=options.pop("ties", "lowest"))
    return gridworld_moment(world, table, state).choice(**options)


def told(of: Choice) -> list[Claim]:
    """All that is told of a choice."""
    return [claim for section in sections(of) for claim in section.claims]


def of_kind(of: Choice, kind: str) -> list[Claim]:
    """All that is told of a choice and is of one kind."""
    return [claim for claim in told(of) if claim.kind == kind]


def said(of: Choice, kind: str) -> list[str]:
    """The same in words."""
    return [claim.sentence for claim in of_kind(of, kind)]
