"""What is noted of episodes that are played beside each other, put in order in the end."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from trdlab.arrays import IntArray


class EpisodeLog:
    """What episodes beside each other bring, a row of some of them at a time.

    Args:
        num_envs: B.

    Attributes:
        episodes: `[B]`, the number of the one that each environment plays.
        held: how many bytes it holds.

    >>> log = EpisodeLog(2)
    >>> log.add(np.array([0, 1]), np.array([1.0, 2.0]))
    >>> log.add(np.array([0, 1]), np.array([3.0, 4.0]))
    >>> log.end(np.array([0, 1]), coins=np.array([5, 6]), begun=np.array([], dtype=np.int64))
    >>> columns, lengths, coins = log.in_order()
    >>> columns[0].tolist(), lengths.tolist(), coins.tolist()
    ([1.0, 3.0, 2.0, 4.0], [2, 2], [5, 6])
    """

    def __init__(self, num_envs: int) -> None:
        self.episodes, self.held = np.arange(num_envs), 0
        self._columns: list[list[NDArray[Any]]] = []
        self._coins: dict[int, int] = {}
        self._begun = num_envs

    def add(self, which: IntArray, *columns: NDArray[Any]) -> None:
        """Adds a row of each of the environments `which [R]`."""
        rows = (self.episodes[which], *columns)
        self._columns = self._columns or [[] for _ in rows]
        for column, added in zip(self._columns, rows, strict=True):
            column.append(added)
            self.held += added.nbytes

    def end(self, over: IntArray, coins: IntArray, begun: IntArray) -> None:
        """Ends the episodes of some environments.

        Args:
            over: which ones.
            coins: of each of them, the step at which the next action would have been forced.
            begun: the environments in which others have begun.
        """
        self._coins |= zip(self.episodes[over].tolist(), coins.tolist(), strict=True)
        self.episodes[begun] = self._begun + np.arange(len(begun))
        self._begun += len(begun)

    def in_order(self) -> tuple[list[NDArray[Any]], IntArray, IntArray]:
        """Returns the columns `[M, ...]`, episode by episode, their lengths `[E]` and coins `[E]`.

        The log is empty afterwards: of what fills the memory there are two copies and never three.
        """
        episode = np.concatenate(self._columns.pop(0))
        order, columns = np.argsort(episode, kind="stable"), list[NDArray[Any]]()
        while self._columns:
            together = np.concatenate(self._columns.pop(0))
            columns.append(together[order])
        coins = np.array([self._coins[number] for number in range(self._begun)])
        return columns, np.bincount(episode), coins
