"""How long work is watched: a bar on a terminal or in a notebook, a line now and then elsewhere."""

import time
from typing import TYPE_CHECKING, Any, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)

if TYPE_CHECKING:
    from trdlab.deep.fit_settings import FitProgress

LINE_SECONDS = 10.0
_BAR_SECONDS = 0.1


class Bar:
    """A bar on a terminal or in a notebook; elsewhere there is none, and lines are printed.

    Args:
        console: where to.
        columns: of the bar.
        task: what it shows at first, as for `rich.progress.Progress.add_task`.
    """

    def __init__(self, console: Console, *columns: ProgressColumn, **task: Any) -> None:
        self.console, self._shown = console, 0.0
        self.bar: Progress | None = None
        if console.is_terminal or console.is_jupyter:
            self.bar = Progress(*columns, console=console, expand=True, transient=True)
            self._task = self.bar.add_task(**task)

    def __enter__(self) -> Self:
        if self.bar is not None:
            self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.stop()

    def is_due(self) -> bool:
        """Returns whether it is time to show something again, and counts from now on if it is."""
        now = time.monotonic()
        if now - self._shown < (LINE_SECONDS if self.bar is None else _BAR_SECONDS):
            return False
        self._shown = now
        return True

    def show(self, line: str, **fields: Any) -> None:
        """Moves the bar, or prints the line where there is none."""
        if self.bar is None:
            self.console.print(line, soft_wrap=True, markup=False)
        else:
            self.bar.update(self._task, **fields)


class FitWatch(Bar):
    """Shows a fit: the steps that are played, and then how the held-out error falls.

    Args:
        steps: that are to be played.
        console: where to; by default stderr.
    """

    def __init__(self, steps: int, console: Console | None = None) -> None:
        self._steps = steps
        super().__init__(
            console or Console(stderr=True, highlight=False),
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=None),
            TimeRemainingColumn(compact=True),
            description="Playing",
            total=steps,
        )

    def tell(self, now: "int | FitProgress") -> None:
        """Shows how far it is, if it is time to."""
        if not self.is_due():
            return
        if isinstance(now, int):
            line = f"{now:,} of {self._steps:,} steps played"
            self.show(line, description=line, completed=now)
        else:
            line = (
                f"{now.updates:,} updates, held-out error {now.error:.3g} of a constant guess's "
                f"(least {now.best:.3g})"
            )
            self.show(line, description=line, completed=now.share, total=1.0)
