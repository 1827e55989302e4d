"""A gridworld as text."""

from trdlab.formatting import plain
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


def legend(world: Gridworld) -> tuple[str, ...]:
    """Returns what each symbol on the map means, and how the wind blows.

    >>> from trdlab.gridworld.gridmap import load_map
    >>> legend(Gridworld(load_map("ledge")))[1:]
    ('C coin 1 (ends)', 'H hazard -1 (ends)')
    """
    grid = world.grid
    entries = [f"{DRONE} the drone"]
    for symbol in dict.fromkeys("".join(grid.rows)):
        cell = grid.legend[symbol]
        if symbol == "S" or cell.kind == "floor":
            continue
        words: list[str] = [cell.kind]
        if cell.kind not in ("wall", "one-way"):
            words += [plain(cell.value)] * bool(cell.value)
            words += ["each time"] * (cell.kind in ("hazard", "fountain") and not cell.terminal)
            words += ["(ends)"] * cell.terminal
        entries.append(f"{symbol} {' '.join(words)}")
    if grid.wind is not None:
        blows = world.action_names[grid.wind.direction]
        entries.append(f"wind {blows}: {' '.join(map(str, grid.wind.strengths))}")
    return tuple(entries)
