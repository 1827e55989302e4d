"""What all moving pictures are drawn with: Pillow, because a figure for each frame would be slow.

A frame costs about a millisecond. Letters are those that matplotlib brings along, so the same text
has the same pixels everywhere.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from trdlab.errors import InputError
from trdlab.show.plots import style

Frame = npt.NDArray[np.uint8]
"""A picture, `[H, W, 3]`."""

PAPER = "#ffffff"
_LEAST_SIDE = 300  # pixels: lower frames are shown larger
_SHOWN = 360  # pixels: how wide a phone shows a picture
_LETTER = 8  # how high letters are to be there
_SIZES = (12, 30)  # pixels: letters are no lower and no higher


def zoom_for(frame: Frame) -> int:
    """Returns how many pixels wide each pixel of a frame is to be shown: enough to be seen."""
    height, _, _ = frame.shape
    return max(1, -(-_LEAST_SIDE // int(height)))


def letters_for(width: int) -> int:
    """Returns how high letters are, in pixels, in a picture so wide: to be read on a phone.

    >>> letters_for(300), letters_for(900), letters_for(9000)
    (12, 20, 30)
    """
    low, high = _SIZES
    return min(max(low, round(width * _LETTER / _SHOWN)), high)


def enlarged(frame: Frame, zoom: int) -> Frame:
    """Returns a frame in which each pixel is a square of pixels.

    >>> enlarged(np.zeros((2, 3, 3), dtype=np.uint8), 4).shape
    (8, 12, 3)
    """
    return frame if zoom == 1 else frame.repeat(zoom, axis=0).repeat(zoom, axis=1)


def even(size: int) -> int:
    """Returns a size, or the next one: videos have even sides.

    >>> even(6), even(7)
    (6, 8)
    """
    return size + size % 2


def evened(frame: Frame) -> Frame:
    """Returns a frame with even sides, the last row or column twice where it was odd.

    >>> evened(np.zeros((3, 4, 3), dtype=np.uint8)).shape
    (4, 4, 3)
    """
    height, width, _ = frame.shape
    return np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")


def checked_frame(frame: object) -> Frame:
    """Returns a frame.

    Raises:
        InputError: it is no picture `[H, W, 3]` of whole numbers from 0 to 255.
    """
    found = np.asarray(frame)
    if found.dtype != np.uint8 or found.ndim != 3 or found.shape[2] != 3:
        raise InputError(
            f"The environment draws {found.dtype} of shape {found.shape}.",
            "A frame is uint8 of shape (height, width, 3).",
        )
    return found


@cache
def font(size: int, *, bold: bool = False, mono: bool = False) -> ImageFont.FreeTypeFont:
    """Returns letters so many pixels high."""
    name = f"DejaVuSans{'Mono' * mono}{'-Bold' * bold}.ttf"
    file = Path(mpl.get_data_path(), "fonts", "ttf", name)
    return ImageFont.truetype(str(file), size, layout_engine=ImageFont.Layout.BASIC)


class Sheet:
    """A sheet to draw on, and the size of its letters.

    Args:
        width: in pixels.
        height: likewise.
        size: of letters, in pixels.
        under: what is on it already; by default nothing.
    """

    def __init__(self, width: int, height: int, size: int, under: Image.Image | None = None):
        self.image = Image.new("RGB", (width, height), PAPER) if under is None else under.copy()
        self.size, self.draw = size, ImageDraw.Draw(self.image)

    @property
    def line(self) -> int:
        """How many pixels a line of text takes."""
        return line_of(self.size)

    def write(
        self, x: float, y: float, text: str, colour: str = style.INK, *, at: str = "la", **how: bool
    ) -> None:
        """Writes a text; `at` says which part of it (x, y) is, as Pillow's anchors do."""
        self.draw.text((x, y), text, colour, font=font(self.size, **how), anchor=at)

    def paste(self, frame: Frame, x: int, y: int) -> None:
        """Puts a frame at a place."""
        self.image.paste(Image.fromarray(frame), (x, y))

    @property
    def frame(self) -> Frame:
        """`[H, W, 3]`."""
        return np.array(self.image)


def line_of(size: int) -> int:
    """Returns how many pixels a line takes of letters so high."""
    return round(1.35 * size)


def width_of(text: str, size: int, **how: bool) -> int:
    """Returns how many pixels wide a text is."""
    return int(np.ceil(font(size, **how).getlength(text)))


def wrapped(text: str, width: int, size: int) -> list[str]:
    """Returns the lines of a text, none wider than so many pixels unless a word is.

    >>> wrapped("one two", 1000, 12), wrapped("one two", 30, 12)
    (['one two'], ['one', 'two'])
    """
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and width_of(longer, size) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def shortened(text: str, width: int, size: int, **how: bool) -> str:
    """Returns a text, cut off at an ellipsis where it is wider than so many pixels."""
    if width_of(text, size, **how) <= width:
        return text
    while text and width_of(f"{text}…", size, **how) > width:
        text = text[:-1]
    return f"{text.rstrip()}…"


def text_frame(lines: Sequence[str], size: int = 20) -> Frame:
    """Returns a picture of lines of text, each letter as wide as any other."""
    width = max((width_of(line, size, mono=True) for line in lines), default=0) + 2 * size
    sheet = Sheet(even(width), even(len(lines) * line_of(size) + 2 * size), size)
    for row, line in enumerate(lines):
        sheet.write(size, size + row * sheet.line, line, mono=True)
    return sheet.frame
