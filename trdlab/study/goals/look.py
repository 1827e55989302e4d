"""How readers of the goal study see a map: shapes that say nothing of what they are worth."""

from trdlab.arrays import FloatArray
from trdlab.gridworld import Gridworld, icons
from trdlab.gridworld.icons import Shape, disc, polygon
from trdlab.gridworld.render import Look, frame
from trdlab.rollouts.reel import Picture

CELL_PIXELS = 40
_CIRCLE, _SQUARE, _TRIANGLE, _OTHER = "#0072b2", "#e69f00", "#009e73", "#f0e442"
_RIM = 0.84  # how much of a shape is within its rim


def _shape(outline: FloatArray, colour: str) -> list[Shape]:
    return [Shape(outline, icons.INK), Shape(outline * _RIM, colour)]


def _trace(outline: FloatArray) -> list[Shape]:
    return [Shape(outline, icons.TRACE), Shape(outline * 0.9, icons.FLOOR)]


_ROUND = disc(0.28)
_BOX = icons.box(-0.26, -0.26, 0.26, 0.26)
_TALL = polygon((-0.3, 0.0), (0.0, -0.34), (0.3, 0.0), (0.0, 0.34))
_POINTED = polygon((-0.32, -0.24), (0.32, -0.24), (0.0, 0.34))

NEUTRAL = Look(
    icons={
        "coin": lambda: _shape(_ROUND, _CIRCLE),
        "treasure": lambda: _shape(_BOX, _SQUARE),
        "hazard": lambda: _shape(_POINTED, _TRIANGLE),
        "fountain": lambda: _shape(_TALL, _OTHER),
        "exit": icons.exit_flag,
    },
    traces={"coin": lambda: _trace(_ROUND), "treasure": lambda: _trace(_BOX)},
    tells_values=False,
)
"""A circle, a square, a triangle, a rhomb and a flag; of what was taken the outline is left."""


def picture(world: Gridworld, state: int) -> Picture:
    """Returns the picture `[H, W, 3]` of a state."""
    return frame(world, state, CELL_PIXELS, NEUTRAL)
