"""How long work is watched: a bar on a terminal or in a notebook, a line now and then elsewhere."""

import time
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from trdlab.deep.fit_settings import FitProgress

_LINE_SECONDS = 10.0
_BAR_SECONDS = 0.1


class FitWatch:
    """Shows a fit: the steps that are played, and then how the held-out error falls.

    Args:
        steps: that are to be played.
        console: where to; a bar if it is a terminal or a notebook, else a line now and then.
    """

    def __init__(self, steps: int, console: Console | None = None) -> None:
        self._console, self._steps = console or Console(stderr=True, highlight=False), steps
        self._shown, self._bar = time.monotonic(), None
        if self._console.is_terminal or self._console.is_jupyter:
            self._bar = Progress(
                TextColumn("{task.description}", markup=False),
                BarColumn(bar_width=None),
                TimeRemainingColumn(compact=True),
                console=self._console,
                expand=True,
                transient=True,
            )
            self._task = self._bar.add_task("Playing", total=steps)

    def __enter__(self) -> "FitWatch":
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def tell(self, now: "int | FitProgress") -> None:
        """Shows how far it is, if it is time to."""
        if time.monotonic() - self._shown < (_LINE_SECONDS if self._bar is None else _BAR_SECONDS):
            return
        self._shown = time.monotonic()
        line, done = self._line(now)
        if self._bar is None:
            self._console.print(line, soft_wrap=True, markup=False)
        else:
            self._bar.update(self._task, description=line, **done)

    def _line(self, now: "int | FitProgress") -> tuple[str, dict[str, Any]]:
        if isinstance(now, int):
            return f"{now:,} of {self._steps:,} steps played", {"completed": now}
        line = (
            f"{now.updates:,} updates, held-out error {now.error:.3g} of a constant guess's "
            f"(least {now.best:.3g})"
        )
        return line, {"completed": now.share, "total": 1.0}
