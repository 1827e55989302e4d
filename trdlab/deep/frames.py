"""Frames, each stored once: losslessly compressed, in chunks that never change once full."""

from collections.abc import Callable, Mapping
from importlib import import_module
from itertools import accumulate
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.arrays import IntArray
from trdlab.errors import InputError, TrdlabError

Compress = Callable[[Any], bytes]
Decompress = Callable[[Any, int], Any]

BLANK = -1
"""The number of a frame that is not there: it is read as zeros."""
OVERHEAD = 48
"""Bytes that a chunk's entry, or a frame of an open chunk, takes beside its contents; roughly."""


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
    """A full chunk of n frames in one block of bytes: n + 1 offsets, then the frames.

    Args:
        blob: what `seal` made; bytes, or anything that can be read like them (a mapped file).
        num_frames: n.

    Raises:
        InputError: the block is torn.
    """

    def __init__(self, blob: Any, num_frames: int) -> None:
        self.blob = blob
        view, start = memoryview(blob).cast("B"), 4 * (num_frames + 1)
        self.nbytes = view.nbytes + OVERHEAD
        whole = start <= view.nbytes
        self._offsets = view[: start if whole else 0].cast("I")
        if not whole or self._offsets[num_frames] != view.nbytes - start:
            raise InputError(
                f"A chunk of {view.nbytes} bytes does not hold the {num_frames} frames it should.",
                "The file is torn: go back to an earlier checkpoint.",
            )
        self._frames = view[start:]

    def __getitem__(self, place: int) -> memoryview:
        return self._frames[self._offsets[place] : self._offsets[place + 1]]


def seal(frames: list[bytes]) -> bytes:
    """Returns one block of bytes with all the frames, for `Sealed`."""
    offsets = np.fromiter(accumulate(map(len, frames), initial=0), dtype=np.uint32)
    return b"".join([offsets.tobytes(), *frames])


class FrameStore:
    """Streams of frames; a stream's frames are numbered 0, 1, 2, … and forgotten from its front.

    Compression is lossless and frame by frame, with lz4's block format: a random frame can be read
    without its neighbours, in one to three millionths of a second. (zlib makes the frames of
    Atari games a fifth smaller, and takes five times as long to read one.)

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
        self._open: dict[int, list[bytes]] = {}
        self._compress: Compress = bytes
        self._decompress: Decompress = _as_it_is
        if compress:
            self._compress, self._decompress = _lz4()
        self._sealed_nbytes = self._open_nbytes = 0

    @property
    def settings(self) -> dict[str, Any]:
        """What must be the same for a state to be loaded, as plain values."""
        return {
            "shape": list(self.shape),
            "dtype": self.dtype.str,
            "compress": self._decompress is not _as_it_is,
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
        chunk = self._open.setdefault(key, [])
        data = self._compress(np.ascontiguousarray(frame).data)
        chunk.append(data)
        self._open_nbytes += len(data) + OVERHEAD
        self.counts[stream] += 1
        if len(chunk) == self.chunk_frames:
            self._open_nbytes -= sum(map(len, chunk)) + OVERHEAD * len(chunk)
            self._keep(key, Sealed(seal(self._open.pop(key)), self.chunk_frames))
        return number

    def forget_before(self, stream: int, number: int) -> None:
        """Forgets the chunks of a stream that hold only frames before this one."""
        for chunk in range(int(self._first[stream]), number // self.chunk_frames):
            gone = self._sealed.pop(chunk * self.num_streams + stream)
            self._sealed_nbytes -= gone.nbytes
            self._first[stream] = chunk + 1

    def read(self, streams: IntArray, numbers: IntArray) -> npt.NDArray[Any]:
        """Returns the frames `[K, *shape]` with these `numbers [K]` of these `streams [K]`."""
        frames = np.empty((len(numbers), *self.shape), dtype=self.dtype)
        size, filled = self.frame_nbytes, frames.reshape(-1).view(np.uint8).data
        sealed, still_open, decompress = self._sealed, self._open, self._decompress
        keys = numbers // self.chunk_frames * self.num_streams + streams
        places = numbers % self.chunk_frames
        blank, end = bytes(size), 0
        begins: dict[tuple[int, int], int] = {}  # where a frame that was read before stands
        # A plain loop, because a frame must be unpacked on its own anyway.
        for key, place in zip(keys.tolist(), places.tolist(), strict=True):
            start, end = end, end + size
            before = begins.setdefault((key, place), start)
            if before != start:
                filled[start:end] = filled[before : before + size]
            elif key < 0:
                filled[start:end] = blank
            else:
                chunk = sealed.get(key)
                data = still_open[key][place] if chunk is None else chunk[place]
                filled[start:end] = decompress(data, size)
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
                self._open[key] = [bytes(blob[place]) for place in range(rest)]
                self._open_nbytes += sum(map(len, self._open[key])) + OVERHEAD * rest

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


def _as_it_is(data: Any, _size: int) -> Any:
    return data


def _lz4() -> tuple[Compress, Decompress]:
    """Returns what compresses a frame, and what decompresses one to a given size."""
    try:
        block = import_module("lz4.block")
    except ImportError as error:
        raise TrdlabError(
            "To compress frames, lz4 is needed.", "Install it: pip install lz4"
        ) from error

    def compress(frame: Any) -> bytes:
        return bytes(block.compress(frame, store_size=False))

    return compress, block.decompress
