"""Pictures in a page: shrunk where they are large, many in one sheet, as data URIs."""

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from typing import NamedTuple

import numpy as np
from PIL import Image, features

from trdlab.rollouts.reel import Picture, Reel

MOST_PIXELS = 420  # of the longer side
_ON_A_SHEET = 60
_QUALITY = 80  # of what has too many colours to be kept exactly
_COLOURS = 256  # of a palette
_DRAWN = 8_192  # colours at most of what is drawn, and kept exactly; photographs have more


class Sheet(NamedTuple):
    """Pictures of one size beside and below each other.

    Args:
        uri: of the sheet.
        width: of each picture, in pixels.
        height: likewise.
        columns: how many stand beside each other.
        numbers: of the pictures, row by row.
    """

    uri: str
    width: int
    height: int
    columns: int
    numbers: tuple[int, ...]


def shrunk(picture: Picture) -> Picture:
    """Returns a picture `[H, W, 3]` whose longer side has `MOST_PIXELS` at most.

    >>> shrunk(np.zeros((840, 600, 3), dtype=np.uint8)).shape
    (420, 300, 3)
    """
    longest = max(picture.shape[:2])
    if longest <= MOST_PIXELS:
        return picture
    height, width = (max(1, round(side * MOST_PIXELS / longest)) for side in picture.shape[:2])
    return np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.BOX))


def sheets(reel: Reel, numbers: Sequence[int]) -> list[Sheet]:
    """Returns sheets with some pictures of a reel, each once."""
    by_shape: dict[tuple[int, ...], list[int]] = {}
    for number in dict.fromkeys(numbers):
        by_shape.setdefault(reel[number].shape, []).append(number)
    return [
        _sheet(reel, same[first : first + _ON_A_SHEET])
        for same in by_shape.values()
        for first in range(0, len(same), _ON_A_SHEET)
    ]


def _sheet(reel: Reel, numbers: Sequence[int]) -> Sheet:
    height, width, _ = reel[numbers[0]].shape
    columns = min(len(numbers), max(1, round((len(numbers) * height / width) ** 0.5)))
    rows = -(-len(numbers) // columns)
    sheet = np.zeros((rows * height, columns * width, 3), dtype=np.uint8)
    for at, number in enumerate(numbers):
        top, left = at // columns * height, at % columns * width
        sheet[top : top + height, left : left + width] = reel[number]
    return Sheet(data_uri(sheet), width, height, columns, tuple(numbers))


def data_uri(picture: Picture) -> str:
    """Returns a picture `[H, W, 3]` as a data URI: exactly, unless it has very many colours."""
    image, file, has_webp = Image.fromarray(picture), BytesIO(), features.check("webp")
    colours = image.getcolors(_DRAWN)
    is_drawn = colours is not None
    if colours is not None and len(colours) <= _COLOURS:
        kind = "png"
        _with_palette(picture, np.array([of for _, of in colours])).save(file, "PNG", optimize=True)
    elif has_webp:
        kind = "webp"
        image.save(file, "WEBP", lossless=is_drawn, quality=_QUALITY)
    else:
        kind = "png" if is_drawn else "jpeg"
        image.save(file, kind.upper(), quality=_QUALITY)
    return f"data:image/{kind};base64,{b64encode(file.getvalue()).decode()}"


def _with_palette(picture: Picture, colours: Picture) -> Image.Image:
    """Returns an image that holds, of each pixel, the number of its colour."""
    weights = np.array([1 << 16, 1 << 8, 1])
    table = np.zeros(1 << 24, dtype=np.uint8)
    table[colours @ weights] = np.arange(len(colours))
    height, width = picture.shape[:2]
    image = Image.frombytes("P", (width, height), table[picture @ weights].tobytes())
    image.putpalette(colours.astype(np.uint8).tobytes())
    return image
