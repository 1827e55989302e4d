"""Pictures of episodes in little memory, each one once."""

import zlib
from hashlib import blake2b

import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]


class Reel:
    """Pictures by their numbers; the same picture has one number, however often it was seen.

    >>> reel, black = Reel(), np.zeros((4, 4, 3), dtype=np.uint8)
    >>> reel.add(black), reel.add(black + 1), reel.add(black), len(reel)
    (0, 1, 0, 2)
    """

    def __init__(self) -> None:
        self._numbers: dict[bytes, int] = {}
        self._packed: list[tuple[tuple[int, ...], bytes]] = []

    def __len__(self) -> int:
        return len(self._packed)

    def __getitem__(self, number: int) -> Picture:
        """Returns a picture `[H, W, 3]`."""
        shape, packed = self._packed[number]
        return np.frombuffer(zlib.decompress(packed), dtype=np.uint8).reshape(shape)

    def add(self, picture: Picture) -> int:
        """Returns the number of a picture, which is kept if it is a new one."""
        content = np.ascontiguousarray(picture).tobytes()
        key = blake2b(content, digest_size=16, salt=str(picture.shape).encode()[:16]).digest()
        if key not in self._numbers:
            self._numbers[key] = len(self._packed)
            self._packed.append((picture.shape, zlib.compress(content, 1)))
        return self._numbers[key]
