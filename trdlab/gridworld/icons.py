"""What stands on a map, drawn as filled polygons; numpy only, so that any canvas can paint them.

Coordinates are those of one cell: the origin is its centre, x grows to the right, y grows up,
and the cell reaches from −½ to ½. Later shapes cover earlier ones. Every kind has an outline of
its own, so that a map reads the same in grey or to a colour-blind reader.
"""

from typing import NamedTuple

import numpy as np

from trdlab.arrays import FloatArray

INK = "#22303f"
FLOOR = "#fbfaf6"
GRID = "#dcd8cf"
MORTAR = "#5d6775"
BRICK = "#6d7786"
ARROW = "#93a0b0"
TRACE = "#bdb9b0"  # what is only a trace: the start, emptied items
WIND = "#a9cbe6"
GOLD, GOLD_RIM = "#f4bd2b", "#8f5f00"
WOOD, WOOD_DARK = "#b0713a", "#4e2c12"
WARNING, WATER, LIGHT_WATER = "#d55e00", "#0072b2", "#6cbcec"

_LINE = 1 / 64  # half the width of a line: sharp where a cell has 64 pixels or a multiple
_HALF = 0.5 - _LINE


class Shape(NamedTuple):
    """A filled polygon.

    Args:
        outline: `[n, 2]`, its corners.
        colour: as `#rrggbb`.
    """

    outline: FloatArray
    colour: str


def moved(shapes: list[Shape], x: float = 0.0, y: float = 0.0, scale: float = 1.0) -> list[Shape]:
    """Returns the shapes scaled about the origin, then moved."""
    return [Shape(shape.outline * scale + (x, y), shape.colour) for shape in shapes]


def turned(shapes: list[Shape], degrees: float) -> list[Shape]:
    """Returns the shapes turned anticlockwise about the origin."""
    angle = np.radians(degrees)
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return [Shape(shape.outline @ rotation, shape.colour) for shape in shapes]


def polygon(*corners: tuple[float, float]) -> FloatArray:
    """Returns `[n, 2]`: the corners as an outline."""
    return np.array(corners, dtype=np.float64)


def box(left: float, bottom: float, right: float, top: float) -> FloatArray:
    """Returns the outline of a rectangle."""
    return polygon((left, bottom), (right, bottom), (right, top), (left, top))


def ellipse(
    x: float, y: float, width: float, height: float, start: float = 0.0, end: float = 360.0
) -> FloatArray:
    """Returns the outline of an ellipse, or of the part between two angles in degrees."""
    angles = np.radians(np.linspace(start, end, 41))
    return np.stack([x + width / 2 * np.cos(angles), y + height / 2 * np.sin(angles)], axis=1)


def disc(radius: float, x: float = 0.0, y: float = 0.0) -> FloatArray:
    """Returns the outline of a disc."""
    return ellipse(x, y, 2 * radius, 2 * radius)


def rounded(half_width: float, half_height: float, radius: float) -> FloatArray:
    """Returns the outline of a rectangle with round corners, about the origin."""
    x, y, side = half_width - radius, half_height - radius, 2 * radius
    corners = [(x, y, 0.0), (-x, y, 90.0), (-x, -y, 180.0), (x, -y, 270.0)]
    return np.concatenate([ellipse(a, b, side, side, s, s + 90.0)[::5] for a, b, s in corners])


def floor() -> list[Shape]:
    """A tile; it leaves room for the line of the grid around it."""
    return [Shape(box(-_HALF, -_HALF, _HALF, _HALF), FLOOR)]


def wall() -> list[Shape]:
    """Mortar, which reaches over the lines of the grid, so that neighbours join without a seam."""
    reach = 0.5 + _LINE
    return [Shape(box(-reach, -reach, reach, reach), MORTAR)]


def bricks() -> list[Shape]:
    """Bricks, to be laid on the mortar once all of it is there."""
    two = ((-0.5 + _LINE, -_LINE), (_LINE, 0.5 - _LINE))
    three = ((-0.5, -0.25 - _LINE), (-0.25 + _LINE, 0.25 - _LINE), (0.25 + _LINE, 0.5))
    return [
        Shape(box(left, bottom + _LINE, right, bottom + 0.25 - _LINE), BRICK)
        for bottom, course in ((-0.5, three), (-0.25, two), (0.0, three), (0.25, two))
        for left, right in course
    ]


def terminal_frame() -> list[Shape]:
    """A frame inside a tile: entering it ends the episode."""
    return [Shape(rounded(0.445, 0.445, 0.09), INK), Shape(rounded(0.415, 0.415, 0.065), FLOOR)]


def start_pad() -> list[Shape]:
    """The landing pad the drone starts from: an H, and corners that show beside the drone."""
    corner = polygon((0.3, 0.46), (0.46, 0.46), (0.46, 0.3), (0.43, 0.3), (0.43, 0.43), (0.3, 0.43))
    letter = [
        box(-0.13, -0.17, -0.07, 0.17),
        box(0.07, -0.17, 0.13, 0.17),
        box(-0.08, -0.03, 0.08, 0.03),
    ]
    corners = [
        shape for turn in (0, 90, 180, 270) for shape in turned([Shape(corner, TRACE)], turn)
    ]
    return [*corners, *(Shape(bar, TRACE) for bar in letter)]


def one_way() -> list[Shape]:
    """An arrow to the right."""
    shaft = box(-0.3, -0.075, 0.06, 0.075)
    head = polygon((0.04, -0.21), (0.32, 0.0), (0.04, 0.21))
    return [Shape(shaft, ARROW), Shape(head, ARROW)]


def wind(strength: int) -> list[Shape]:
    """As many chevrons to the right as the wind is strong."""
    pitch = min(0.2, 0.8 / max(strength, 1))
    arm, thick = 0.17, 0.055
    chevron = polygon(
        (0, 0), (-arm, arm), (-arm - thick, arm), (-thick, 0), (-arm - thick, -arm), (-arm, -arm)
    )
    middle = (arm + thick) / 2 - pitch * (strength - 1) / 2
    return [
        shape
        for i in range(strength)
        for shape in moved([Shape(chevron, WIND)], x=middle + pitch * i)
    ]


def coin() -> list[Shape]:
    """A coin with a milled rim."""
    return [
        Shape(disc(0.27), GOLD_RIM),
        Shape(disc(0.235), GOLD),
        Shape(disc(0.185), "#d1940f"),
        Shape(disc(0.165), GOLD),
    ]


def coin_taken() -> list[Shape]:
    """The trace of a coin: an empty ring."""
    return [Shape(disc(0.2), TRACE), Shape(disc(0.175), FLOOR)]


def chest() -> list[Shape]:
    """A treasure chest with a round lid."""
    lid = ellipse(0, 0.04, 0.56, 0.44, 0, 180)
    return [
        Shape(box(-0.31, -0.24, 0.31, 0.05), WOOD_DARK),
        Shape(ellipse(0, 0.04, 0.62, 0.5, 0, 180), WOOD_DARK),
        Shape(box(-0.28, -0.21, 0.28, 0.0), WOOD),
        Shape(lid, WOOD),
        *(Shape(box(x - 0.03, -0.21, x + 0.03, 0.0), GOLD) for x in (-0.19, 0.19)),
        *(Shape(box(x - 0.03, 0.04, x + 0.03, 0.2), GOLD) for x in (-0.19, 0.19)),
        Shape(box(-0.31, -0.005, 0.31, 0.045), WOOD_DARK),
        Shape(rounded(0.085, 0.085, 0.03), WOOD_DARK),
        Shape(rounded(0.06, 0.06, 0.02), GOLD),
        Shape(disc(0.025, 0, 0.012), WOOD_DARK),
    ]


def chest_taken() -> list[Shape]:
    """The trace of a treasure chest: open and empty."""
    return [
        Shape(polygon((-0.28, 0.02), (0.28, 0.02), (0.24, 0.27), (-0.24, 0.27)), TRACE),
        Shape(polygon((-0.245, 0.045), (0.245, 0.045), (0.215, 0.245), (-0.215, 0.245)), FLOOR),
        Shape(box(-0.29, -0.24, 0.29, 0.04), TRACE),
        Shape(box(-0.26, -0.21, 0.26, -0.02), FLOOR),
    ]


def hazard() -> list[Shape]:
    """A warning triangle."""
    triangle = np.concatenate(
        [disc(0.05, x, y) for x, y in ((-0.25, -0.16), (0.25, -0.16), (0.0, 0.27))]
    )
    return [
        Shape(_hull(triangle), "#5a2400"),
        Shape(_hull(triangle * 0.84), WARNING),
        Shape(polygon((-0.035, 0.14), (0.035, 0.14), (0.02, -0.03), (-0.02, -0.03)), "#ffffff"),
        Shape(disc(0.034, 0, -0.095), "#ffffff"),
    ]


def fountain() -> list[Shape]:
    """A bowl on a foot, with three jets of water."""
    drop = np.concatenate([polygon((0, 0.12)), ellipse(0, 0, 0.1, 0.1, 150, 390)])
    jets = [(0.0, 0.21, 0.0, 1.15), (-0.15, 0.13, 25.0, 0.9), (0.15, 0.13, -25.0, 0.9)]
    falling = [
        shape
        for x, y, lean, size in jets
        for shape in moved(turned([Shape(drop, LIGHT_WATER)], lean), x, y, size)
    ]
    return [
        *falling,
        Shape(polygon((-0.05, -0.1), (0.05, -0.1), (0.14, -0.28), (-0.14, -0.28)), INK),
        Shape(ellipse(0, 0.03, 0.66, 0.4, 180, 360), INK),
        Shape(ellipse(0, 0.03, 0.66, 0.13), INK),
        Shape(ellipse(0, 0.03, 0.57, 0.08), WATER),
    ]


def exit_flag() -> list[Shape]:
    """A chequered flag."""
    squares = [
        Shape(box(x, y, x + 0.11, y + 0.11), INK if (i + j) % 2 == 0 else "#ffffff")
        for i, x in enumerate((-0.17, -0.06, 0.05, 0.16))
        for j, y in enumerate((0.17, 0.06, -0.05))
    ]
    return [
        Shape(box(-0.23, -0.31, -0.17, 0.31), INK),
        Shape(box(-0.2, -0.08, 0.3, 0.31), INK),
        *squares,
    ]


def drone() -> list[Shape]:
    """A quadcopter seen from above; a light outline sets it off from what it hovers over."""
    return moved([*_drone_silhouette(0.045), *_drone_body()], scale=0.92)  # inside a frame


def _drone_silhouette(margin: float) -> list[Shape]:
    arms = [Shape(box(-0.27, -0.04 - margin, 0.27, 0.04 + margin), FLOOR)]
    rotors = [Shape(disc(0.15 + margin, x, y), FLOOR) for x, y in _ROTORS]
    body = [Shape(rounded(0.12 + margin, 0.16 + margin, 0.08), FLOOR)]
    return [*turned(arms, 45), *turned(arms, 135), *rotors, *body]


def _drone_body() -> list[Shape]:
    arm = [Shape(box(-0.33, -0.035, 0.33, 0.035), INK)]
    rotors = [
        shape
        for number, (x, y) in enumerate(_ROTORS)
        for shape in moved(_rotor(30.0 if number % 2 else 120.0), x, y)
    ]
    return [
        *turned(arm, 45),
        *turned(arm, 135),
        *rotors,
        Shape(rounded(0.12, 0.16, 0.07), INK),
        Shape(rounded(0.085, 0.125, 0.05), WATER),
        Shape(disc(0.058, 0.0, 0.05), "#ffffff"),
        Shape(disc(0.036, 0.0, 0.05), INK),
    ]


_ROTORS = ((0.235, 0.235), (-0.235, 0.235), (-0.235, -0.235), (0.235, -0.235))


def _rotor(degrees: float) -> list[Shape]:
    blade = np.concatenate([ellipse(0.06, 0, 0.14, 0.05), ellipse(-0.06, 0, 0.14, 0.05)])
    return [
        Shape(disc(0.15), INK),
        Shape(disc(0.122), "#dfe8f1"),
        *turned([Shape(_hull(blade), INK)], degrees),
    ]


def _hull(points: FloatArray) -> FloatArray:
    """Returns the outline of the smallest convex polygon round the points (Andrew's chain)."""
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    return np.array(_half_hull(ordered) + _half_hull(ordered[::-1]))


def _half_hull(points: FloatArray) -> list[FloatArray]:
    chain: list[FloatArray] = []
    for point in points:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain[:-1]


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    """Returns a positive number where a → b → c turns anticlockwise."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
