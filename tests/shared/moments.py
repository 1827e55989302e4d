"""Moments that tests write down, and what is told of them."""

from typing import Any

import numpy as np

from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.calibration.calibration import Trust
from trdlab.explanations.moment.exact import gridworld_moment
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.explanations.moment.telling import sections
from trdlab.explanations.rules import Claim
from trdlab.gridworld import Gridworld, load_map
from trdlab.tabular import exact

GAMMA = 0.95


def moment(rows: list[list[float]], width: int = 1, gamma: float = GAMMA, **known: Any) -> Moment:
    """A moment of actions a, b, c … with components `rows [A, N+1]`."""
    axis = TimeAxis(gamma, len(rows[0]) - 1, width)
    parts = RewardDecomposition(np.array(rows, dtype=np.float64), axis)
    return Moment(parts, tuple("abcd"[: len(rows)]), Future("the optimal policy"), **known)


def trusted(axis: TimeAxis, components: int, residual: bool = False) -> Trust:
    """How far such forecasts can be trusted: so many explicit components, and the residual."""
    bad = axis.horizon - components
    status = (*("good",) * components, *("bad",) * bad, "good" if residual else "bad")
    return Trust(axis, status)  # type: ignore[arg-type]


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
