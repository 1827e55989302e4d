"""A gridworld as agents with eyes see it: a small grey picture of each state."""

from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt

from trdlab.arrays import IntArray
from trdlab.errors import InputError
from trdlab.gridworld.world import Gridworld

SIDE = 84
_LEAST_CELL = 3  # pixels: so many tell a drone from a coin, and a taken coin from the floor
_FINER = 4  # the picture is painted so many times finer than it is seen
_LUMA = (299, 587, 114)  # ITU-R BT.601, in thousandths

Picture = npt.NDArray[np.uint8]


class Pictures:
    """The pictures `[84, 84]` of a gridworld's states, each painted when it is first asked for.

    They are what people see (`trdlab.gridworld.render.frame`) in grey, each pixel the average of
    the area that it covers; the aspect ratio is kept, with black beside the map.

    Args:
        world: the gridworld.

    Raises:
        InputError: the map is too large.
    """

    def __init__(self, world: Gridworld) -> None:
        rows, columns = world.grid.shape
        longest = max(rows, columns)
        if longest * _LEAST_CELL > SIDE:
            raise InputError(
                f"The map '{world.grid.name}' is {rows} cells by {columns}, which cannot be told "
                f"apart in {SIDE} by {SIDE} pixels.",
                f"Up to {SIDE // _LEAST_CELL} by {SIDE // _LEAST_CELL} can; larger ones are seen "
                "as the index of the state.",
            )
        self.world = world
        self._painted: dict[int, Picture] = {}
        self._height, self._width = (max(1, SIDE * n // longest) for n in (rows, columns))
        self._cell_pixels = -(-_FINER * SIDE // longest)

    def __getitem__(self, state: int) -> Picture:
        """Returns the picture `[84, 84]` of a state, read-only."""
        if state not in self._painted:
            self._painted[state] = self._paint(state)
        return self._painted[state]

    def all(self) -> Picture:
        """Returns `[S, 84, 84]`."""
        return np.stack([self[state] for state in range(len(self.world.states))])

    def _paint(self, state: int) -> Picture:
        from trdlab.gridworld.render import frame  # here: matplotlib is slow to import

        painted = frame(self.world, state, self._cell_pixels) @ np.array(_LUMA)  # [H, W], ·1000
        seen = _shrunk(painted, self._height, self._width)
        top, left = (SIDE - self._height) // 2, (SIDE - self._width) // 2
        picture = np.zeros((SIDE, SIDE), dtype=np.uint8)
        picture[top : top + self._height, left : left + self._width] = seen
        picture.flags.writeable = False
        return picture


def pictures(world: Gridworld) -> Picture:
    """Returns `[S, 84, 84]`: the picture of each state, as `GridworldEnv` shows it as pixels.

    Raises:
        InputError: the map is too large.

    >>> from trdlab.gridworld.gridmap import load_map
    >>> pictures(Gridworld(load_map("tie"))).shape
    (6, 84, 84)
    """
    return pictures_of(world).all()


def pictures_of(world: Gridworld) -> Pictures:
    """Returns the pictures of a map, painted once for all worlds on that map.

    Raises:
        InputError: the map is too large.
    """
    key = repr(world.grid)
    found = _SHARED.get(key)
    if found is None:
        found = _SHARED[key] = Pictures(world)
    return found


_SHARED: "WeakValueDictionary[str, Pictures]" = WeakValueDictionary()


def _shrunk(painted: IntArray, height: int, width: int) -> Picture:
    """Returns averages over areas `[height, width]`, in whole numbers: alike on any machine."""
    rows, columns = _overlaps(painted.shape[0], height), _overlaps(painted.shape[1], width)
    total = rows @ painted @ columns.T  # [height, width], of H·W·1000 parts
    parts = painted.size * 1000
    return ((2 * total + parts) // (2 * parts)).astype(np.uint8)


def _overlaps(size: int, count: int) -> IntArray:
    """Returns `[count, size]`: how much of each pixel lies in each part, in parts of a pixel."""
    begins, edges = np.arange(count)[:, None] * size, np.arange(size) * count
    lengths = np.minimum(begins + size, edges + count) - np.maximum(begins, edges)
    return np.asarray(np.maximum(lengths, 0), dtype=np.int64)
