"""Metrics for TensorBoard, beside the file that holds them anyway."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from trdlab.errors import InputError


class Board:
    """Writes metrics where `tensorboard --logdir` finds them.

    Args:
        writer: PyTorch's `SummaryWriter`; without one, nothing is written.
    """

    def __init__(self, writer: Any = None) -> None:
        self._writer = writer

    def write(self, row: Mapping[str, Any], step: int) -> None:
        """Writes a line of metrics at a step; what is no number is left out."""
        if self._writer is None:
            return
        for name, value in row.items():
            if isinstance(value, int | float) and name not in ("agent_steps", "clock"):
                self._writer.add_scalar(name, value, step)
        self._writer.flush()


@contextmanager
def board(folder: Path, step: int, *, wanted: bool) -> Iterator[Board]:
    """Opens a board, and closes it again.

    Args:
        folder: where its files go.
        step: where the run stands: what a killed process has written of later is hidden.
        wanted: whether anything should be written.
    """
    if not wanted:
        yield Board()
        return
    writer = _tensorboard().SummaryWriter(str(folder), purge_step=step + 1)
    try:
        yield Board(writer)
    finally:
        writer.close()


def check_board(*, wanted: bool) -> None:
    """Refuses, before anything is done, a board that cannot be written.

    Raises:
        InputError: TensorBoard is wanted and not installed.
    """
    if wanted:
        _tensorboard()


def _tensorboard() -> Any:
    try:
        return import_module("torch.utils.tensorboard")
    except ImportError as error:
        raise InputError(
            "TensorBoard is not installed.", "Run: pip install 'trdlab[tensorboard]'"
        ) from error
