"""Frames, each stored once: losslessly compressed, in chunks that never change once full."""

from collections.abc import Callable, Mapping
from importlib import import_module
from itertools import accumulate, pairwise
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.arrays import IntArray
from trdlab.errors import InputError, TrdlabError

Compress = Callable[[Any, Any], bytes]
"""From a frame, and the reference that it may refer to."""
Decompress = Callable[[Any, int, bool, Any], Any]
"""From that, the size of a frame, False (lz4 is to return bytes), and the reference."""

BLANK = -1
"""The number of a frame that is not there: it is read as zeros."""
OVERHEAD = 48
"""Bytes that a chunk's entry, or a frame of an open chunk, takes beside its contents; roughly."""
_LEVEL = 3
"""Of lz4's thorough mode, its lowest. Against the quick mode a frame takes 25 µs more to store, two
thirds of the space, and three quarters of the time to read. (A step of an emulator takes 500 µs.)
"""


def compresses(shape: tuple[int, ...], dtype: npt.DTypeLike) -> bool:
    """Returns whether frames like these gain from compression: images of bytes do."""
    return np.dtype(dtype) == np.uint8 and len(shape) >= 2


def chunk_frames(length: int, frame_nbytes: int) -> int:
    """Returns how many frames to put into a chunk, if a stream is to hold `length` of them.

    Few enough that the oldest chunk, most of it forgotten, wastes little memory; enough that a
    million frames make some hundreds of chunks.
    """
    return max(1, min(length // 32, 4096, 2**31 // max(1, frame_nbytes)))


class Sealed:
    """A full chunk of n frames in one block of bytes: n + 2 offsets, its reference, its frames.

    Args:
        blob: what `seal` made; bytes, or anything that can be read like them (a mapped file).
        num_frames: n.

    Raises:
        InputError: the block is torn.
    """

    __slots__ = ("blob", "offsets", "reference")

    def __init__(self, blob: Any, num_frames: int) -> None:
        self.blob = bytes(blob)  # itself, if bytes it is: they are the quickest to cut
        view, start = memoryview(self.blob), 4 * (num_frames + 2)
        whole = start <= view.nbytes
        offsets = view[: start if whole else 0].cast("I")
        if not whole or offsets[-1] != view.nbytes:
            raise InputError(
                f"A chunk of {view.nbytes} bytes does not hold the {num_frames} frames it should.",
                "The file is torn: go back to an earlier checkpoint.",
            )
        self.reference: Any = view[start : offsets[1]]
        self.offsets = offsets[1:]
        """Where each frame begins in the block, and where the last one ends."""

    @property
    def nbytes(self) -> int:
        """The memory that it takes."""
        return len(self.blob) + OVERHEAD


def seal(parts: list[bytes]) -> bytes:
    """Returns one block of bytes with a reference and the frames after it, for `Sealed`."""
    start = 4 * (len(parts) + 1)
    offsets = np.fromiter(accumulate(map(len, parts), initial=start), dtype=np.uint32)
    return b"".join([offsets.tobytes(), *parts])


class FrameStore:
    """Streams of frames; a stream's frames are numbered 0, 1, 2, … and forgotten from its front.

    Compression is lossless, with lz4's block format. Each frame is compressed on its own, and may
    refer to the first one of its chunk, which is kept as it is: a random frame is read without its
    neighbours, in about a millionth of a second, and what never changes on a screen is stored once.
    (That makes the frames of Atari games two and a half times as small as without a reference.)

    Args:
        shape: of a frame.
        dtype: of a frame.
        num_streams: how many streams, one for each environment.
        chunk_frames: the frames in a chunk. A chunk is forgotten as a whole.
        compress: whether to compress; vectors are too short for it.

    Raises:
        TrdlabError: lz4 is needed and not installed.
    """

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: npt.DTypeLike,
        num_streams: int,
        chunk_frames: int,
        *,
        compress: bool,
    ) -> None:
        self.shape, self.dtype = shape, np.dtype(dtype)
        self.num_streams, self.chunk_frames = num_streams, chunk_frames
        self.frame_nbytes = prod(shape) * self.dtype.itemsize
        """The bytes of a frame before compression."""
        self.counts = np.zeros(num_streams, dtype=np.int64)
        """`[B]`: the frames that each stream has been given so far."""
        self._first = np.zeros(num_streams, dtype=np.int64)  # [B], the oldest chunk of each stream
        self._sealed: dict[int, Sealed] = {}  # by chunk number · B + stream
        self._open: dict[int, list[bytes]] = {}  # likewise: a reference, and the frames so far
        self._compress: Compress = _as_bytes
        self._decompress: Decompress = _as_it_is
        self._compresses = compress
        if compress:
            self._compress, self._decompress = _lz4()
        self._sealed_nbytes = self._open_nbytes = 0

    @property
    def settings(self) -> dict[str, Any]:
        """What must be the same for a state to be loaded, as plain values."""
        return {
            "shape": list(self.shape),
            "dtype": self.dtype.str,
            "compress": self._compresses,
            "chunk_frames": self.chunk_frames,
        }

    @property
    def nbytes(self) -> int:
        """The memory that the frames take."""
        return self._sealed_nbytes + self._open_nbytes

    @property
    def num_frames(self) -> int:
        """How many frames are held."""
        return int((self.counts - self._first * self.chunk_frames).sum())

    def append(self, stream: int, frame: npt.NDArray[Any]) -> int:
        """Stores a frame at the end of a stream, and returns its number."""
        number = int(self.counts[stream])
        key = number // self.chunk_frames * self.num_streams + stream
        pixels = np.ascontiguousarray(frame).data
        parts = self._open.get(key)
        if parts is None:
            parts = self._open[key] = [pixels.tobytes() if self._compresses else b""]
            self._open_nbytes += len(parts[0]) + OVERHEAD
        parts.append(self._compress(pixels, parts[0]))
        self._open_nbytes += len(parts[-1]) + OVERHEAD
        self.counts[stream] += 1
        if len(parts) > self.chunk_frames:
            self._open_nbytes -= _nbytes(parts)
            self._keep(key, Sealed(seal(self._open.pop(key)), self.chunk_frames))
        return number

    def forget_before(self, stream: int, number: int) -> None:
        """Forgets the chunks of a stream that hold only frames before this one."""
        for chunk in range(int(self._first[stream]), number // self.chunk_frames):
            gone = self._sealed.pop(chunk * self.num_streams + stream)
            self._sealed_nbytes -= gone.nbytes
            self._first[stream] = chunk + 1

    def read(self, streams: IntArray, numbers: IntArray) -> npt.NDArray[Any]:
        """Returns the frames `[..., *shape]` with `numbers [...]` in `streams [...]`."""
        frames = np.empty((*numbers.shape, *self.shape), dtype=self.dtype)
        size, filled = self.frame_nbytes, frames.reshape(-1).view(np.uint8).data
        sealed, still_open, decompress = self._sealed, self._open, self._decompress
        chunks, places = np.divmod(numbers, self.chunk_frames)
        keys = chunks * self.num_streams + streams
        each, end = zip(keys.ravel().tolist(), places.ravel().tolist(), strict=True), 0
        # A plain loop, because each frame must be unpacked on its own; it is kept short, because
        # it takes as long as the unpacking.
        for key, place in each:
            start, end = end, end + size
            chunk = sealed.get(key)
            if chunk is not None:
                offsets, reference = chunk.offsets, chunk.reference
                data = chunk.blob[offsets[place] : offsets[place + 1]]
            elif key < 0:
                filled[start:end] = bytes(size)
                continue
            else:
                parts = still_open[key]
                reference, data = parts[0], parts[place + 1]
            filled[start:end] = decompress(data, size, False, reference)
        return frames

    def state_dict(self) -> dict[str, Any]:
        """Returns everything as plain arrays and bytes.

        `sealed` holds, by name, chunks that never change again: one that has been saved under its
        name need not be saved another time. `open` holds the few that still grow.
        """
        return {
            "counts": self.counts.copy(),
            "first": self._first.copy(),
            "sealed": {self._name(key): chunk.blob for key, chunk in self._sealed.items()},
            "open": {self._name(key): seal(frames) for key, frames in self._open.items()},
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Takes over what `state_dict` returned; blocks of bytes may be arrays or mapped files.

        Raises:
            InputError: a chunk is torn or missing.
        """
        self.counts = np.array(state["counts"], dtype=np.int64)
        self._first = np.array(state["first"], dtype=np.int64)
        self._sealed, self._open = {}, {}
        self._sealed_nbytes = self._open_nbytes = 0
        for stream in range(self.num_streams):
            full, rest = divmod(int(self.counts[stream]), self.chunk_frames)
            for chunk in range(int(self._first[stream]), full):
                key = chunk * self.num_streams + stream
                self._keep(key, Sealed(_found(state["sealed"], self._name(key)), self.chunk_frames))
            if rest:
                key = full * self.num_streams + stream
                blob = Sealed(_found(state["open"], self._name(key)), rest)
                parts = [bytes(blob.reference)]
                parts += [blob.blob[i:j] for i, j in pairwise(blob.offsets)]
                self._open[key] = parts
                self._open_nbytes += _nbytes(parts)

    def _keep(self, key: int, chunk: Sealed) -> None:
        self._sealed[key] = chunk
        self._sealed_nbytes += chunk.nbytes

    def _name(self, key: int) -> str:
        chunk, stream = divmod(key, self.num_streams)
        return f"{stream}-{chunk:06d}"


def _found(chunks: Mapping[str, Any], name: str) -> Any:
    if name not in chunks:
        raise InputError(
            f"The chunk '{name}' of the replay memory is missing.",
            "Go back to an earlier checkpoint.",
        )
    return chunks[name]


def _nbytes(parts: list[bytes]) -> int:
    return sum(map(len, parts)) + OVERHEAD * len(parts)


def _as_bytes(frame: Any, _reference: Any) -> bytes:
    return bytes(frame)


def _as_it_is(data: Any, _size: int, _writable: bool, _reference: Any) -> Any:
    return data


def _lz4() -> tuple[Compress, Decompress]:
    """Returns what compresses a frame, and what decompresses one to a given size."""
    try:
        block = import_module("lz4.block")
    except ImportError as error:
        raise TrdlabError(
            "To compress frames, lz4 is needed.", "Install it: pip install lz4"
        ) from error

    def compress(frame: Any, reference: Any) -> bytes:
        return bytes(
            block.compress(
                frame, "high_compression", compression=_LEVEL, store_size=False, dict=reference
            )
        )

    return compress, block.decompress
