"""A gridworld as text."""

from trdlab.gridworld.world import Gridworld

DRONE = "@"


def ansi(world: Gridworld, state: int) -> str:
    """Returns the map with the drone as `@`, and floor where it has collected something.

    >>> from trdlab.gridworld.gridmap import load_map
    >>> print(ansi(Gridworld(load_map("drone")), 0))
    >...T
    @####
    >cccC
    """
    here = world.states[state]
    emptied = here.collected | {world.grid.start}
    return "\n".join(
        "".join(
            DRONE if (i, j) == here.place else "." if (i, j) in emptied else symbol
            for j, symbol in enumerate(row)
        )
        for i, row in enumerate(world.grid.rows)
    )
