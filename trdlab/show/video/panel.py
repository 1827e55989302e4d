"""The panel beside a frame: bars of what is expected of a few actions, quick to draw."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import count
from typing import NamedTuple

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.errors import InputError
from trdlab.formatting import decimals_for, plain
from trdlab.show.plots import style
from trdlab.show.video.canvas import Frame, Sheet, even, line_of, shortened, width_of
from trdlab.time_axis import TimeAxis

_PITCH = 7  # pixels from a bar to the next, where there is room
_LEAST_PITCH, _MOST_PITCH = 2, 48
_MOST_WIDTH = 700  # pixels of all bars, where that can be
_LETTERS = 24  # times the size of letters: how wide a panel is at least
_MATTERS = 0.01  # of the residual: explicit components that add up to less do not set the scale
_ROOM = 1.25  # times the largest explicit component: of a larger residual no more is seen
_HATCH = 3  # pixels between the lines of the residual
_NEWS = 10  # frames for which it is told that the scale has changed
_PALE = 0.35  # of its colour is left to a bar that is not to be trusted
ABOUT = "expected discounted reward; t: now"
_NICE = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


class Span(NamedTuple):
    """What the axes of bars show, and for how many more frames it is told that this is new.

    It only grows. Both ends are round numbers, with zero between them.
    """

    low: float = 0.0
    high: float = 0.0
    news: int = 0

    def over(self, rows: FloatArray) -> "Span":
        """Returns what also shows more rows `[R, N+1]` of bars; a large residual is cut off.

        Raises:
            InputError: a bar has no finite height.
        """
        if not np.isfinite(rows).all():
            raise InputError(
                f"A component is {rows[~np.isfinite(rows)][0]}.", "Only finite ones can be drawn."
            )
        sizes = np.abs(rows)
        matters = sizes[:, :-1].sum(axis=1).max() > _MATTERS * sizes[:, -1].max()
        room = _ROOM * float(sizes[:, :-1].max(initial=0.0)) if matters else np.inf
        bars = np.clip(rows, -room, room)
        low, high = min(0.0, float(bars.min())), max(0.0, float(bars.max()))
        if self.low <= low and high <= self.high:
            return self._replace(news=max(0, self.news - 1))
        is_first = self.low == self.high
        grown = min(self.low, -_rounded(-low)), max(self.high, _rounded(high))
        return Span(*grown, news=0 if is_first else _NEWS)


def _rounded(value: float) -> float:
    """Returns the next round number."""
    if value <= 0.0:
        return 0.0
    unit = 10.0 ** math.floor(math.log10(value))
    return float(next(unit * nice for nice in _NICE if unit * nice >= value * (1.0 - 1e-9)))


class Row(NamedTuple):
    """One action's bars.

    Args:
        name: of the action.
        components: `[N+1]`.
        said: what stands before its name.
        doubtful: `[N+1]`, which are not to be trusted, and so are pale; None for none.
        lit: the component that is spoken of, if any.
    """

    name: str
    components: FloatArray
    said: str = ""
    doubtful: BoolArray | None = None
    lit: int | None = None


@dataclass(frozen=True)
class Panel:
    """Where things stand on a panel, which looks the same for a whole episode.

    Args:
        axis: what the components mean.
        action_names: A names.
        height: in pixels.
        size: of its letters, in pixels.
        rows: how many actions it has room for.
        about: what the bars are, in a line below them.
    """

    axis: TimeAxis
    action_names: tuple[str, ...]
    height: int
    size: int
    rows: int = 2
    about: str = ABOUT

    @cached_property
    def pitch(self) -> int:
        """The pixels from one bar to the next."""
        places = self.axis.num_components + 1  # the residual is apart
        room = (_LETTERS * self.size - self.left - self.size) // places
        return min(_MOST_PITCH, max(room, min(_PITCH, max(_LEAST_PITCH, _MOST_WIDTH // places))))

    @cached_property
    def left(self) -> int:
        """The pixels left of the bars, where the scale stands."""
        return width_of("−0.005 ", self.size)

    @cached_property
    def width(self) -> int:
        """In pixels."""
        bars = self.left + (self.axis.num_components + 1) * self.pitch
        most = bars + width_of(self.labels[-1][1], self.size) // 2 + self.size // 2
        return even(max(_LETTERS * self.size, most))

    @cached_property
    def bars_height(self) -> int:
        """The pixels that the bars of one action can be high."""
        line = line_of(self.size)
        return max(4, (self.height - 3 * line) // self.rows - line - self.size // 2)

    def place(self, component: int) -> tuple[int, int]:
        """Returns the first and the last column of a component's bar; the residual is apart."""
        shift = component + (component == self.axis.horizon > 0)
        first = self.left + shift * self.pitch
        return first, first + max(0, self.pitch - 2)

    def top(self, row: int) -> int:
        """Returns the line at which the bars of a row can end at the top."""
        line = line_of(self.size)
        return line + row * (line + self.size // 2 + self.bars_height) + line

    def line_of(self, row: int, span: Span, value: float) -> int:
        """Returns the line of pixels at which a value of a row stands; its bar ends there."""
        share = (span.high - value) / ((span.high - span.low) or 1.0)
        return self.top(row) + round(share * (self.bars_height - 1))

    @cached_property
    def colours(self) -> dict[str, str]:
        """The colour of each action, as in all pictures."""
        return style.action_colours(self.action_names)

    def draw(self, rows: Sequence[Row], span: Span, heading: str = "") -> Frame:
        """Returns the picture `[height, width, 3]` of some actions, one below the other."""
        sheet = Sheet(
            self.width,
            self.height,
            self.size,
            _ground(self, span._replace(news=min(span.news, 1))).image,
        )
        sheet.write(self.size // 2, 0, shortened(heading, self.width - self.size, self.size))
        for at, row in enumerate(rows[: self.rows]):
            self._title(sheet, at, row)
            self._bars(sheet, at, row, span)
        return sheet.frame

    @cached_property
    def labels(self) -> list[tuple[int, str]]:
        """The components whose steps are written, as many as have room, and what is written."""
        last = self.axis.horizon
        names = ["t" if not i else f"t+{self.axis.start(i)}" for i in range(last)]
        names.append(f"t+{self.axis.start(last)}…" if last else "t…")
        widest = max(width_of(name, self.size) for name in names) + self.size // 2
        every = _every(-(-widest // self.pitch))
        edge = sum(self.place(last)) / 2 - widest
        shown = [i for i in range(0, last, every) if sum(self.place(i)) / 2 <= edge]
        return [(i, names[i]) for i in [*shown, last]]

    def _title(self, sheet: Sheet, at: int, row: Row) -> None:
        y, half = self.top(at) - sheet.line, self.size // 2
        box = (half, y + half // 2, half + self.size - 2, y + half // 2 + self.size - 2)
        sheet.draw.rectangle(box, self.colours[row.name])
        value = style.told(float(row.components.sum()), decimals_for([row.components.sum()]))
        room = self.width - 3 * self.size - width_of(f" {value}", self.size, bold=True)
        name = shortened(f"{row.said}{row.name}", room, self.size, bold=True)
        sheet.write(box[2] + half, y, f"{name}  {value}", bold=True)

    def _bars(self, sheet: Sheet, at: int, row: Row, span: Span) -> None:
        zero, heights = self.line_of(at, span, 0.0), np.clip(row.components, span.low, span.high)
        for i, height in enumerate(heights.tolist()):
            if height == 0.0:
                continue
            (left, right), end = self.place(i), self.line_of(at, span, height)
            top, bottom = (end, zero - 1) if height > 0.0 else (zero + 1, end)
            if bottom < top:
                continue
            pale = row.doubtful is not None and bool(row.doubtful[i])
            colour = _mixed(self.colours[row.name], _PALE if pale else 1.0)
            is_residual = i == self.axis.horizon
            _bar(sheet, (left, top, right, bottom), colour, hatched=is_residual)
            if height != row.components[i]:
                value = float(row.components[i])
                _arrow(sheet, (left + right) / 2, end, up=height > 0.0, size=self.size // 3)
                text = style.told(value, decimals_for([value]))
                sheet.write(left - self.size // 2, end, text, at="ra" if value > 0.0 else "rd")
        if row.lit is not None:
            left, right = self.place(row.lit)
            ends = self.top(at) - 2, self.top(at) + self.bars_height + 1
            sheet.draw.rectangle(
                (left - 2, ends[0], right + 2, ends[1]), outline=style.INK, width=2
            )


@lru_cache(maxsize=16)
def _ground(panel: Panel, span: Span) -> Sheet:
    """Returns what many frames share: the scales, the steps below them, and what the bars are."""
    sheet = Sheet(panel.width, panel.height, panel.size)
    line, foot = sheet.line, panel.height - 2 * sheet.line
    for row in range(panel.rows):
        _scale(sheet, panel, row, span)
    for component, label in panel.labels:
        middle = sum(panel.place(component)) / 2
        sheet.draw.line((middle, foot - 3, middle, foot), style.MUTED)
        sheet.write(middle, foot, label, style.MUTED, at="ma")
    about = shortened(panel.about, panel.width - panel.size, panel.size)
    sheet.write(panel.size // 2, foot + line, about, style.MUTED)
    return sheet


def _scale(sheet: Sheet, panel: Panel, row: int, span: Span) -> None:
    """Writes the scale of a row; where it has just changed, on a dark ground."""
    zero, right = panel.line_of(row, span, 0.0), panel.place(panel.axis.horizon)[1]
    sheet.draw.line((panel.left - 2, zero, right, zero), style.MUTED)
    half, ends = panel.size // 2, (panel.top(row), panel.top(row) + panel.bars_height - 1)
    for value in (0.0, *filter(None, (span.low, span.high))):
        stands, text = panel.line_of(row, span, value), plain(value).replace("-", "−")
        if not value and zero not in ends and min(abs(zero - end) for end in ends) < 2 * half:
            continue  # there is no room for it beside another
        x, y = panel.left - 6, min(max(stands, ends[0] + half), ends[1] - half)
        is_new = span.news > 0 and value != 0.0
        if is_new:
            box = (x - width_of(text, panel.size) - 2, y - half - 1, x + 2, y + half + 2)
            sheet.draw.rectangle(box, style.INK)
        sheet.write(x, y, text, "#ffffff" if is_new else style.MUTED, at="rm")


def _bar(sheet: Sheet, box: tuple[int, int, int, int], colour: str, *, hatched: bool) -> None:
    if not hatched:
        sheet.draw.rectangle(box, colour)
        return
    sheet.draw.rectangle(box, "#ffffff", colour)
    left, top, right, bottom = box
    for y in range(bottom - _HATCH, top, -_HATCH):
        sheet.draw.line((left, y, right, y), colour)


def _arrow(sheet: Sheet, x: float, y: float, *, up: bool, size: int) -> None:
    """Marks that a bar goes on beyond the scale."""
    tip = y - size if up else y + size
    sheet.draw.polygon([(x - size, y), (x + size, y), (x, tip)], style.INK)


def _mixed(colour: str, share: float) -> str:
    """Returns a colour of which only a share is left, over white."""
    parts = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(255 + (part - 255) * share):02x}" for part in parts)


def _every(least: int) -> int:
    """Returns 1, 2, 5, 10, …: the first that is no smaller."""
    numbers = (int(first * 10**zeros) for zeros in count() for first in (1, 2, 5))
    return next(number for number in numbers if number >= least)


def best(components: FloatArray, names: Sequence[str], most: int) -> list[Row]:
    """Returns the rows of the actions that are worth most, the best first.

    Args:
        components: `[A, N+1]`, of every action.
        names: A names.
        most: how many.
    """
    order = np.argsort(-components.sum(axis=1), kind="stable")[:most].tolist()
    said = ["best: ", *["next: "] * most]
    return [Row(names[a], components[a], say) for a, say in zip(order, said, strict=False)]
