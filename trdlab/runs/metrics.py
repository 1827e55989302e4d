"""Metrics: a file with one JSON object a line, growing while the run goes on."""

import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from trdlab.errors import InputError, OutputError, TrdlabError

Row = Mapping[str, str | float | bool | None]
NON_FINITE = "non_finite"
"""Where a line names the numbers that JSON cannot hold, and that are null there."""
TAIL_NBYTES = 65536


class MetricsFile:
    """Appends lines of metrics, each on its way to the disk before `append` returns.

    They are a record, and nothing depends on them: lines may be missing, or the whole file.

    Args:
        path: the file; it is made if it is not there.
        after: the step to go on after, that of a checkpoint. What an interrupted run wrote of later
            ones is cut off, because it will be written again. Without it, only a line
            that was not finished is.

    Raises:
        OutputError: it cannot be written.
    """

    def __init__(self, path: Path, after: int | None = None) -> None:
        self.path = path
        try:
            self._file = path.open("ab", buffering=0)
            self._length = _length_until(path.read_bytes(), after)
            self._file.truncate(self._length)
        except OSError as error:
            raise self._cannot_write(error) from error

    def append(self, row: Row) -> None:
        """Writes one line.

        Raises:
            InputError: a value is not a number, a text, true, false or None.
            OutputError: the disk is full. What was written before is whole.
        """
        line = memoryview(_line(row).encode())
        try:
            written = 0
            while written < len(line):  # a disk that is just full takes a part first
                written += self._file.write(line[written:])
        except OSError as error:
            with suppress(OSError):
                self._file.truncate(self._length)
            raise self._cannot_write(error) from error
        self._length += len(line)

    def sync(self) -> None:
        """Waits until all lines are on the disk."""
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise self._cannot_write(error) from error

    def close(self) -> None:
        """Ends writing."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _cannot_write(self, error: OSError) -> OutputError:
        return OutputError(
            f"Cannot write '{self.path}': {error.strerror or error}.",
            "When it can be written again, resume the run.",
        )


def step_of(row: Mapping[str, Any]) -> int:
    """Returns where a run stood at a line of metrics: by its clock, where it does more than act.

    >>> step_of({"agent_steps": 8}), step_of({"agent_steps": 0, "clock": 30})
    (8, 30)
    """
    step: int = row["clock"] if "clock" in row else row["agent_steps"]
    return step


def read_metrics(path: Path) -> list[dict[str, Any]]:
    """Returns the lines of a metrics file; one that is still being written is left out.

    Raises:
        TrdlabError: it cannot be read, or a line in the middle is torn.
    """
    lines = _lines(path, 0)
    return [_row(line, f"'{path}', line {number},") for number, line in enumerate(lines, 1)]


def last_metrics(path: Path) -> dict[str, Any]:
    """Returns the last whole line of a metrics file, without reading all of it; empty if none.

    Raises:
        TrdlabError: it cannot be read, or that line is torn.
    """
    lines = _lines(path, TAIL_NBYTES)
    return _row(lines[-1], f"'{path}', the last line,") if lines else {}


def _line(row: Row) -> str:
    """Returns one line of JSON.

    >>> _line({"agent_steps": 8, "loss": math.nan}).strip()
    '{"agent_steps": 8, "loss": null, "non_finite": {"loss": "nan"}}'
    """
    plain: dict[str, Any] = {}
    non_finite = {}
    for name, value in row.items():
        if not isinstance(value, str | int | float | None) or name == NON_FINITE:
            raise InputError(
                f"The metric '{name}' is {value!r}.", "Metrics are plain numbers and texts."
            )
        plain[name] = value
        if isinstance(value, float) and not math.isfinite(value):
            plain[name], non_finite[name] = None, repr(float(value))
    if non_finite:
        plain[NON_FINITE] = non_finite
    return json.dumps(plain, allow_nan=False) + "\n"


def _length_until(data: bytes, steps: int | None) -> int:
    r"""Returns the bytes of the whole lines before the first one of more agent steps than these.

    >>> _length_until(b'{"agent_steps": 8}\ntorn\n{"agent_steps": 16}\n{"agent_', 8)
    24
    """
    length = 0
    for line in data.split(b"\n")[:-1]:
        if steps is not None and _step(line) > steps:
            break
        length += len(line) + 1
    return length


def _step(line: bytes) -> float:
    """Returns where the run stood at a line; of one that is torn or was not ours, the beginning."""
    try:
        return float(step_of(json.loads(line)))
    except (ValueError, TypeError, LookupError, RecursionError):
        return 0.0


def _lines(path: Path, tail: int) -> list[bytes]:
    """Returns the whole lines, or those that begin in the last `tail` bytes."""
    try:
        with path.open("rb") as file:
            start = max(0, os.fstat(file.fileno()).st_size - tail) if tail else 0
            file.seek(start)
            lines = file.read().split(b"\n")[:-1]  # without a line's end, it is not whole
    except OSError as error:
        reason = error.strerror or error
        raise TrdlabError(f"'{path}' cannot be read: {reason}.") from error
    return lines[1:] if start else lines


def _row(line: bytes, where: str) -> dict[str, Any]:
    try:
        row = dict(json.loads(line))
        for name, value in row.pop(NON_FINITE, {}).items():
            row[name] = float(value)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise TrdlabError(f"{where} is torn.", "Delete that line.") from error
    return row
