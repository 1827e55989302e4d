"""One state of a solved world: its exact table, and the choice that is explained there."""

from dataclasses import dataclass

import numpy as np

from trdlab.decomposition import TimeAxis
from trdlab.explanations.moment.exact import exact_moment
from trdlab.explanations.moment.moment import Choice
from trdlab.gridworld import Gridworld
from trdlab.printable import Printable
from trdlab.tabular import ExactTable, Ties, exact
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

    world: Gridworld | TabularWorld
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


def solve_state(
    world: Gridworld | TabularWorld,
    time_axis: TimeAxis,
    *,
    state: str | None = None,
    action: str | None = None,
    foil: str | None = None,
    ties: Ties = "lowest",
) -> SolvedState:
    """Solves a world, and chooses what to explain in one of its states.

    Args:
        world: a gridworld, or another model in words.
        time_axis: γ, N and w.
        state: the number of a state, or its coordinates; by default the likeliest first state.
        action: the action to explain, by default what the policy does.
        foil: the action to contrast it with, by default the best real alternative.
        ties: whose future is told where optimal actions tie.

    Raises:
        InputError: there is no such state or action, or both actions are the same.
    """
    index = world.mdp.start if state is None else world.find_state(state)
    table = exact(world.mdp, time_axis, ties=ties)
    return SolvedState(world, table, index, exact_moment(world, table, index).choice(action, foil))
