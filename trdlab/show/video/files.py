"""Writing moving pictures, frame by frame: mp4 with the extra, animated WebP and GIF without."""

from collections.abc import Callable, Iterator
from importlib.util import find_spec
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
from PIL import GifImagePlugin, Image

from trdlab.errors import InputError
from trdlab.files import check_output, write_whole
from trdlab.show.video.canvas import Frame

SUFFIXES = (".mp4", ".webp", ".gif")
_QUALITY = 8  # of 10
_COLOURS = 256  # of a frame of a GIF


def check_video(path: Path, *, overwrite: bool = False) -> None:
    """Checks that a video can be written to a path, before any work is done for it.

    Raises:
        InputError: an mp4 needs what is not installed.
        OutputError: unknown ending, no such folder, not writable, or the file exists.
    """
    check_output(path, SUFFIXES, overwrite=overwrite)
    if path.suffix.lower() == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise InputError(
            "An mp4 needs imageio-ffmpeg, which is not installed.",
            "Run: pip install 'trdlab[video]', or write a .webp or a .gif.",
        )


def write_video(path: Path, frames: Iterator[Frame], count: int, rate: float) -> None:
    """Writes frames as a video, whole or not at all, never more than two of them in memory.

    Args:
        path: whose ending says in which form.
        frames: `[H, W, 3]` each, of one size, with even sides.
        count: how many there are.
        rate: how many are shown in a second.

    Raises:
        OutputError: it cannot be written.
    """
    write = _WRITERS[path.suffix.lower()]
    write_whole(path, lambda at: write(at, frames, count, rate))


def _mp4(path: Path, frames: Iterator[Frame], count: int, rate: float) -> None:
    from imageio_ffmpeg import write_frames

    first = next(frames)
    height, width, _ = first.shape
    how = {"fps": rate, "quality": _QUALITY, "macro_block_size": 2, "ffmpeg_log_level": "error"}
    writer = write_frames(str(path), (width, height), **how)
    writer.send(None)
    try:
        for frame in chain([first], frames):
            writer.send(np.ascontiguousarray(frame))
    finally:
        writer.close()


def _webp(path: Path, frames: Iterator[Frame], count: int, rate: float) -> None:
    how = {"quality": _QUALITY * 10 + 10, "method": 0}
    _Reel(frames, count).save(
        path, "WEBP", save_all=True, duration=_lengths(count, rate, 1000), loop=0, **how
    )


def _gif(path: Path, frames: Iterator[Frame], count: int, rate: float) -> None:
    """Writes only what has changed since the frame before, with colours of its own."""
    before: Frame | None = None
    with path.open("wb") as file:
        for frame, hundredths in zip(frames, _lengths(count, rate, 100), strict=True):
            top, bottom, left, right = _changed(before, frame)
            cut = Image.fromarray(np.ascontiguousarray(frame[top:bottom, left:right]))
            image = cut.quantize(_COLOURS, dither=Image.Dither.NONE)
            if before is None:
                header, _ = GifImagePlugin.getheader(image, info={"loop": 0})
                file.writelines(header)
            how = {"duration": 10 * hundredths, "disposal": 1, "include_color_table": True}
            file.writelines(GifImagePlugin.getdata(image, (left, top), **how))
            before = frame
        file.write(b";")


_WRITERS: dict[str, Callable[[Path, Iterator[Frame], int, float], None]] = {
    ".mp4": _mp4,
    ".webp": _webp,
    ".gif": _gif,
}


class _Reel(Image.Image):
    """Frames as Pillow reads a picture of many: the next one when it is asked for."""

    def __init__(self, frames: Iterator[Frame], count: int) -> None:
        super().__init__()
        self._frames, self.n_frames, self._at = frames, count, 0
        self._show(next(frames))

    def seek(self, frame: int) -> None:
        if frame > self._at:
            self._at = frame
            self._show(next(self._frames))

    def tell(self) -> int:
        return self._at

    def _show(self, frame: Frame) -> None:
        image = Image.fromarray(np.ascontiguousarray(frame))
        self.im, self._mode, self._size = image.im, image.mode, image.size


def _changed(before: Frame | None, frame: Frame) -> tuple[int, int, int, int]:
    """Returns top, bottom, left and right of what differs; a pixel, where nothing does."""
    height, width, _ = frame.shape
    if before is None:
        return 0, height, 0, width
    differs = (before != frame).any(axis=2)
    rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))
    if not rows.size:
        return 0, 1, 0, 1
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


def _lengths(count: int, rate: float, parts: int) -> list[int]:
    """Returns how long each frame is shown, in parts of a second that add up to the whole.

    >>> _lengths(4, 15.0, 100)
    [7, 6, 7, 7]
    """
    ends = [round(parts * i / rate) for i in range(count + 1)]
    return [end - start for start, end in pairwise(ends)]
