"""One state of a solved world: its exact table, and the choice that is explained there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from trdlab.decomposition import TimeAxis
from trdlab.explanations.moment.exact import exact_moment
from trdlab.explanations.moment.moment import Choice
from trdlab.gridworld import Gridworld, load_map
from trdlab.printable import Printable
from trdlab.tabular import ExactTable, Ties, exact

if TYPE_CHECKING:
    from trdlab.tabular.named import TabularWorld


@dataclass(frozen=True, eq=False, repr=False)
class SolvedState(Printable):
    """A solved world, one of its states, and the two actions that are told of there.

    Args:
        world: the model in words.
        table: its exact decomposition.
        state: the index of the state.
        choice: an action and the one it is held against.
    """

    world: "Gridworld | TabularWorld"
    table: ExactTable
    state: int
    choice: Choice

    @property
    def sum_error(self) -> float:
        """The largest difference, over all states and actions, of Σ components and Q."""
        return float(np.abs(self.table.decomposition.value - self.table.solution.q_values).max())

    @property
    def error_bound(self) -> float:
        """How far the Q-values can be from the exact ones (proven)."""
        return float(self.table.solution.error_bound.max())


def solve_gridworld(
    map_name: str,
    time_axis: TimeAxis,
    *,
    slip: float | None = None,
    treasure: float | None = None,
    state: str = "0",
    action: str | None = None,
    foil: str | None = None,
    ties: Ties = "lowest",
) -> SolvedState:
    """Loads a map, solves it, and chooses what to explain in one of its states.

    Args:
        map_name: the name of a built-in map, or a file.
        time_axis: γ, N and w.
        slip: a slip probability to use in place of the map's own.
        treasure: what treasures pay, in place of the map's own.
        state: the number of a state, or `row,column`.
        action: the action to explain, by default what the policy does.
        foil: the action to contrast it with, by default the best real alternative.
        ties: whose future is told where optimal actions tie.

    Raises:
        InputError: any of these cannot be used.
    """
    grid = load_map(map_name)
    grid = grid if slip is None else grid.with_slip(slip)
    grid = grid if treasure is None else grid.with_value("treasure", treasure)
    world = Gridworld(grid)
    index = world.find_state(state)
    table = exact(world.mdp, time_axis, ties=ties)
    return SolvedState(world, table, index, exact_moment(world, table, index).choice(action, foil))


def solve_tabular(
    env_id: str,
    time_axis: TimeAxis,
    arguments: Mapping[str, Any] | None = None,
    *,
    state: str | None = None,
    action: str | None = None,
    foil: str | None = None,
    ties: Ties = "lowest",
) -> SolvedState:
    """Makes an environment, solves its model, and chooses what to explain in one of its states.

    Args:
        env_id: the id of a Gymnasium environment that has a transition table.
        time_axis: γ, N and w.
        arguments: what to make it with.
        state: the number of a state, or its coordinates; by default the likeliest first state.
        action: the action to explain, by default what the policy does.
        foil: the action to contrast it with, by default the best real alternative.
        ties: whose future is told where optimal actions tie.

    Raises:
        InputError: any of these cannot be used.
    """
    from trdlab.tabular.toytext import make_world  # it imports Gymnasium

    world = make_world(env_id, dict(arguments or {}))
    index = world.mdp.start if state is None else world.find_state(state)
    table = exact(world.mdp, time_axis, ties=ties)
    return SolvedState(world, table, index, exact_moment(world, table, index).choice(action, foil))
