"""Pictures of a gridworld: on any matplotlib axes, or as an array of pixels.

Everything is a filled polygon in data units (numbers too), so a map looks the same at any size.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path
from matplotlib.textpath import TextPath

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.formatting import plain
from trdlab.gridworld import icons
from trdlab.gridworld.gridmap import Cell, GridMap
from trdlab.gridworld.icons import Shape
from trdlab.gridworld.world import Gridworld, Place, State

_DEGREES = (90.0, 270.0, 180.0, 0.0)  # of up, down, left and right, anticlockwise from the right
_UNSAID = {"coin": 1.0, "fountain": 1.0, "exit": 0.0}  # the values that go without saying

ABOVE_ROUTES = 5.0
"""The zorder of what stands on the ground of a map: coins, treasures, hazards, the drone."""


class Look(NamedTuple):
    """How things on a map are drawn.

    Args:
        icons: by the kind of a cell.
        traces: what is left of those that pay once, when they are taken.
        tells_values: whether what they pay is written on them, where that does not go without
            saying.
    """

    icons: Mapping[str, Callable[[], list[Shape]]]
    traces: Mapping[str, Callable[[], list[Shape]]]
    tells_values: bool = True


USUAL = Look(
    icons={
        "coin": icons.coin,
        "treasure": icons.chest,
        "hazard": icons.hazard,
        "fountain": icons.fountain,
        "exit": icons.exit_flag,
    },
    traces={"coin": icons.coin_taken, "treasure": icons.chest_taken},
)


class Paint(NamedTuple):
    """A filled outline on the map.

    Args:
        path: the outline, in the coordinates of the map.
        colour: as `#rrggbb`.
    """

    path: Path
    colour: str


def draw_map(ax: Axes, world: Gridworld, state: int, look: Look = USUAL) -> Axes:
    """Draws a state of a gridworld: the map, what is left on it, and the drone.

    One cell is one unit; the centre of row r, column c lies at (c + ½, r + ½), and rows grow
    downwards. A frame inside a cell says that entering it ends the episode. What is drawn with a
    zorder between 1 and `ABOVE_ROUTES` lies on the ground, and hides nothing that stands on it.

    Args:
        ax: the axes to draw on; they lose their ticks and frame.
        world: the gridworld.
        state: the index of one of its states.
        look: how things are drawn.

    Returns:
        `ax`.

    Raises:
        InputError: there is no such state.
    """
    rows, columns = world.grid.shape
    for paints, zorder in zip(_scene(world, state, look), (1.0, ABOVE_ROUTES), strict=True):
        paths, colours = zip(*paints, strict=True)
        scene = PathCollection(
            paths, facecolors=colours, linewidths=0, antialiaseds=True, zorder=zorder
        )
        scene.set_snap(False)  # else thin lines vanish where cells are small
        ax.add_collection(scene, autolim=False)
    ax.set(xlim=(0, columns), ylim=(rows, 0), aspect="equal")
    ax.set_axis_off()
    return ax


def frame(
    world: Gridworld, state: int, cell_pixels: int = 64, look: Look = USUAL
) -> npt.NDArray[np.uint8]:
    """Returns a picture `[rows · cell_pixels, columns · cell_pixels, 3]` of a state, no margin.

    Raises:
        InputError: there is no such state, or `cell_pixels` is no whole number of at least 1.
    """
    if cell_pixels < 1 or cell_pixels != int(cell_pixels):
        raise InputError(
            f"The cells are {cell_pixels} pixels wide.", "Choose a whole number, for example 64."
        )
    rows, columns = world.grid.shape
    figure = Figure(figsize=(columns, rows), dpi=cell_pixels)  # an inch is a cell
    figure.set_layout_engine("none")  # whatever the user's settings say
    canvas = FigureCanvasAgg(figure)
    draw_map(figure.add_axes((0.0, 0.0, 1.0, 1.0)), world, state, look)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    return np.array(pixels[..., :3], order="C")


def _state(world: Gridworld, state: int) -> State:
    if not 0 <= state < len(world.states):
        raise InputError(
            f"There is no state {state}.", f"States run from 0 to {len(world.states) - 1}."
        )
    return world.states[state]


def _scene(world: Gridworld, state: int, look: Look) -> tuple[list[Paint], list[Paint]]:
    """Returns the ground, and what stands on it, each from back to front."""
    grid, at = world.grid, _state(world, state)
    rows, columns = grid.shape
    places = list(product(range(rows), range(columns)))
    ground = [Paint(Path(icons.box(0.0, 0.0, columns, rows)), icons.GRID)]
    things: list[Paint] = []
    walls = {place for place in places if grid.cell(*place).kind == "wall"}
    for shapes in (icons.wall(), icons.bricks()):  # first of all: they reach under their neighbours
        ground += [paint for place in sorted(walls) for paint in _placed(shapes, place)]
    for place in (place for place in places if place not in walls):
        ground += _ground(grid, place)
        if place not in at.collected:
            things += _item(grid.cell(*place), place, look)
        elif place != at.place:  # the drone hides the traces of what it has just taken
            things += _placed(look.traces[grid.cell(*place).kind](), place)
    return ground, [*things, *_placed(icons.drone(), at.place)]


def _ground(grid: GridMap, place: Place) -> list[Paint]:
    """Returns the floor, and what is drawn on it: the end of an episode, the wind, the start."""
    cell, shapes = grid.cell(*place), icons.floor()
    if cell.terminal:
        shapes += icons.terminal_frame()
    elif grid.wind is not None:  # it acts on leaving a cell, and a terminal one is never left
        strength = grid.wind.strengths[place[1] if grid.wind.direction in (0, 1) else place[0]]
        chevrons = icons.turned(icons.wind(strength), _DEGREES[grid.wind.direction])
        if cell.kind != "floor":  # into a corner, beside what is there
            chevrons = icons.moved(chevrons, x=-0.32, y=0.33, scale=0.5)
        shapes += chevrons
    if place == grid.start:
        shapes += icons.start_pad()
    if cell.arrow is not None:
        shapes += icons.turned(icons.one_way(), _DEGREES[cell.arrow])
    return _placed(shapes, place)


def _item(cell: Cell, place: Place, look: Look) -> list[Paint]:
    """Returns the coin, treasure, hazard, fountain or exit in a cell, with what it pays."""
    if cell.kind not in look.icons:
        return []
    shapes = look.icons[cell.kind]()
    if not look.tells_values or cell.value == _UNSAID.get(cell.kind):
        return _placed(shapes, place)
    if cell.kind == "coin":
        return [*_placed(shapes, place), *_number(cell.value, place, width=0.3, height=0.19)]
    number = _number(cell.value, place, y=-0.3, width=0.7, height=0.17)
    return [*_placed(icons.moved(shapes, y=0.105, scale=0.92), place), *number]


def _number(
    value: float, place: Place, *, y: float = 0.0, width: float, height: float
) -> list[Paint]:
    """Returns a number centred at y in a cell, as tall as `height` unless that is too wide."""
    text = _text(plain(value).replace("-", "−"))
    left, bottom, right, top = text.get_extents().extents
    scale = min(height / (top - bottom), width / (right - left))
    centre = np.array([left + right, bottom + top]) / 2
    outline = (np.asarray(text.vertices) - centre) * scale + (0.0, y)
    return [Paint(Path(_on_map(outline, place), text.codes), icons.INK)]


@lru_cache(maxsize=256)
def _text(text: str) -> Path:
    # matplotlib brings this font along, so the same text has the same shape everywhere
    return TextPath(
        (0.0, 0.0), text, size=1.0, prop=FontProperties(family="DejaVu Sans", weight="bold")
    )


def _placed(shapes: list[Shape], place: Place) -> list[Paint]:
    return [Paint(Path(_on_map(shape.outline, place)), shape.colour) for shape in shapes]


def _on_map(outline: FloatArray, place: Place) -> FloatArray:
    """Returns an outline given in the coordinates of a cell, in those of the map."""
    row, column = place
    return outline * (1.0, -1.0) + (column + 0.5, row + 0.5)
