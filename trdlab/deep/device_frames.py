"""Frames in the memory of a device, where they are learned from: read by one gather."""

from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from trdlab.arrays import IntArray
from trdlab.deep.frames import FrameStore, chunk_frames, compresses

_FILLED = 4_096  # frames at most that wait to be copied
_ROOM = 1.0625
"""Of frames for each transition: where episodes begin there is one more."""


def device_nbytes(capacity: int, shape: tuple[int, ...], dtype: npt.DTypeLike) -> int:
    """Returns the bytes that the frames of so many transitions take on a device at first.

    >>> round(device_nbytes(1_000_000, (84, 84), "uint8") / 1e9, 1)
    7.5
    """
    return int(_ROOM * capacity) * prod(shape) * np.dtype(dtype).itemsize


def frame_store(
    shape: tuple[int, ...],
    dtype: npt.DTypeLike,
    num_streams: int,
    *,
    length: int,
    stack: int,
    compress: bool | None,
    device: str | None,
) -> FrameStore:
    """Returns where the frames of so many transitions of each stream are kept (see there)."""
    dtype = np.dtype(dtype)
    chunk = chunk_frames(length, prod(shape) * dtype.itemsize)
    smaller = compresses(shape, dtype) if compress is None else compress
    if device is None:
        return FrameStore(shape, dtype, num_streams, chunk, compress=smaller)
    told = shape, dtype, num_streams, chunk
    return DeviceFrames(*told, compress=smaller, length=length, stack=stack, device=device)


class DeviceFrames(FrameStore):
    """Streams of frames that are read as tensors, from one block in the memory of a device.

    They lie there as they are; checkpoints are made from a second copy, compressed, in the memory
    of the CPU. New frames wait until something is read, and are copied together then. The block
    grows where episodes are so short that their first frames do not fit.

    Args:
        shape: of a frame.
        dtype: of a frame.
        num_streams: B.
        chunk_frames: the frames in a chunk.
        compress: whether to compress what checkpoints are made from.
        length: the transitions of each stream.
        stack: k, so many frames before the oldest transition are still read.
        device: where.
    """

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: npt.DTypeLike,
        num_streams: int,
        chunk_frames: int,
        *,
        compress: bool,
        length: int,
        stack: int,
        device: str,
    ) -> None:
        super().__init__(shape, dtype, num_streams, chunk_frames, compress=compress)
        self.device = torch.device(device)
        most = 2 * length + stack + chunk_frames + 1  # a transition has two frames at most
        self._slots = np.zeros((num_streams, most), dtype=np.int64)
        """By stream, and number mod `most`: where a frame lies in the block."""
        self._oldest = np.zeros(num_streams, dtype=np.int64)
        self._waiting: dict[int, npt.NDArray[Any]] = {}  # by their slot
        self._freed: list[int] = []
        self._used = 1  # slot 0 is blank
        size = 2 + int(_ROOM * length * num_streams)
        like = torch.from_numpy(np.zeros(0, self.dtype)).dtype
        self._block = torch.zeros((size, *shape), dtype=like, device=self.device)

    def append(self, stream: int, frame: npt.NDArray[Any]) -> int:
        """Stores a frame at the end of a stream, and returns its number."""
        number = super().append(stream, frame)
        self._place(stream, number, np.array(frame))
        return number

    def forget_before(self, stream: int, number: int) -> None:
        """Forgets the frames of a stream before this one."""
        super().forget_before(stream, number)
        gone = np.arange(self._oldest[stream], number) % self._slots.shape[1]
        self._freed += self._slots[stream, gone].tolist()
        self._oldest[stream] = max(number, self._oldest[stream])

    def read(self, streams: IntArray, numbers: IntArray) -> Tensor:  # type: ignore[override]
        """Returns the frames `[..., *shape]` with `numbers [...]` in `streams [...]`."""
        slots = self._slots[streams, numbers % self._slots.shape[1]]
        self._copy()
        return self._block[torch.from_numpy(np.where(numbers < 0, 0, slots)).to(self.device)]

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Takes over what a `FrameStore` returned, on whatever device that was read."""
        super().load_state_dict(state)
        self._waiting, self._freed, self._used = {}, [], 1
        self._oldest = self._first * self.chunk_frames
        for stream in range(self.num_streams):
            for number in range(int(self._oldest[stream]), int(self.counts[stream])):
                at = np.array([number])
                self._place(stream, number, super().read(np.array([stream]), at)[0])

    def _place(self, stream: int, number: int, frame: npt.NDArray[Any]) -> None:
        if self._freed:
            slot = self._freed.pop()
        else:
            slot, self._used = self._used, self._used + 1
        self._slots[stream, number % self._slots.shape[1]] = slot
        self._waiting[slot] = frame
        if len(self._waiting) >= _FILLED:
            self._copy()

    def _copy(self) -> None:
        """Copies the frames that wait to their slots."""
        if not self._waiting:
            return
        if (more := self._used - len(self._block)) > 0:
            size = (more + len(self._block) // 8, *self.shape)
            self._block = torch.cat([self._block, self._block.new_zeros(size)])
        slots = torch.tensor(list(self._waiting), device=self.device)
        frames = torch.from_numpy(np.stack(list(self._waiting.values())))
        self._block[slots] = frames.to(self.device)
        self._waiting.clear()
