"""A frame of an environment, and beside it what is expected there."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError
from trdlab.formatting import said
from trdlab.show.video.canvas import (
    Frame,
    checked_frame,
    enlarged,
    even,
    letters_for,
    zoom_for,
)
from trdlab.show.video.panel import ABOUT, Panel, Span, best
from trdlab.time_axis import TimeAxis

_GUESS = 400  # pixels: how wide a panel is, as far as the size of its letters is concerned


class Told(NamedTuple):
    """What a frame tells of its episode beside the forecast.

    Args:
        step: how many steps have been taken.
        taken: the action that the last of them took; None at the first observation.
        reward: that it was paid.
        over: whether the episode is over, so that nothing is expected any more.
        span: the scale of the bars.
    """

    step: int = 0
    taken: int | None = None
    reward: float = 0.0
    over: bool = False
    span: Span = Span()

    def after(self, taken: int, reward: float, over: bool) -> "Told":
        """Returns what is told one step later."""
        return self._replace(step=self.step + 1, taken=taken, reward=reward, over=bool(over))


class Beside:
    """Draws forecasts beside the frames of an environment, all of one size.

    Args:
        axis: what the components mean.
        action_names: A names.
        rows: how many actions are drawn.
        zoom: how many pixels wide each pixel of a frame becomes; None for enough to be seen.

    Raises:
        InputError: there is not a single row, or the zoom is no whole number of at least 1.
    """

    def __init__(
        self, axis: TimeAxis, action_names: Sequence[str], *, rows: int, zoom: int | None
    ) -> None:
        for name, value in (("rows", rows), ("zoom", 1 if zoom is None else zoom)):
            if value != int(value) or value < 1:
                raise InputError(f"The value of {name} is {value}.", "It is at least 1.")
        self._axis, self._names = axis, tuple(action_names)
        self._rows, self._zoom = min(rows, len(self._names)), zoom
        self._shape: tuple[int, ...] | None = None
        self._panel: Panel | None = None

    def grown(self, told: Told, components: FloatArray) -> Told:
        """Returns what is told with the scale on which the forecast `[A, N+1]` can be seen."""
        if told.over:
            return told
        drawn = [row.components for row in best(components, self._names, self._rows)]
        return told._replace(span=told.span.over(np.stack(drawn)))

    def draw(self, frame: Any, components: FloatArray, told: Told) -> Frame:
        """Returns `[H, W, 3]`, both sides even.

        Args:
            frame: `[h, w, 3]`, which stands at the left, at the top.
            components: `[A, N+1]`, of every action.
            told: what else there is to tell.

        Raises:
            InputError: this is no frame, or it has another size than the first one.
        """
        seen = checked_frame(frame)
        panel = self._panel_for(seen)
        larger = enlarged(seen, self._zoom or zoom_for(seen))
        height, width, _ = larger.shape
        rows = [] if told.over else best(components, self._names, self._rows)
        drawn = panel.draw(rows, told.span, self._heading(told))
        whole = np.full((panel.height, even(width) + panel.width, 3), 255, dtype=np.uint8)
        whole[:height, :width] = larger
        whole[:, even(width) :] = drawn
        return whole

    def _panel_for(self, frame: Frame) -> Panel:
        if self._shape not in (None, frame.shape):
            raise InputError(
                f"The environment's frames were {self._shape} and are now {frame.shape}.",
                "A video has frames of one size: draw all of them alike.",
            )
        if self._panel is None:
            zoom = self._zoom or zoom_for(frame)
            size = letters_for(frame.shape[1] * zoom + _GUESS)
            self._panel = panel_for(
                self._axis, self._names, frame.shape[0] * zoom, size, self._rows
            )
            self._shape = frame.shape
        return self._panel

    def _heading(self, told: Told) -> str:
        parts = [f"step {told.step:,}"]
        if told.taken is not None:
            parts += [f"took {self._names[told.taken]}", f"reward {said(told.reward, 3)}"]
        return " · ".join([*parts, *["over"] * told.over])


def panel_for(
    axis: TimeAxis,
    names: tuple[str, ...],
    height: int,
    size: int,
    rows: int,
    about: str = ABOUT,
) -> Panel:
    """Returns a panel as high as it has to be, and no lower than so many pixels."""
    return Panel(axis, names, max(even(height), least_height(size, rows)), size, rows, about)


def least_height(size: int, rows: int) -> int:
    """Returns how high a panel has to be so that its bars can be seen."""
    return even(4 * size + rows * 6 * size)
