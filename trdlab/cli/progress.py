"""How long work is watched, and stopped: a bar on a terminal, now and then a line elsewhere."""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn

from trdlab.verbs.watching import LINE_SECONDS, Bar

if TYPE_CHECKING:
    from trdlab.deep.trainer import Trainer, TrainMetrics
    from trdlab.rollouts.playing import Progress as Playing

_HANGUP = getattr(signal, "SIGHUP", None)  # Windows has none


class Stop:
    """Whether the user, or the system, has asked to stop; `code` is what to exit with then."""

    code: int | None = None

    def __call__(self) -> bool:
        return self.code is not None


@contextmanager
def stopping() -> Iterator[Stop]:
    """Turns Ctrl-C, SIGTERM and a closed terminal into a request; a second one ends it at once.

    What is ignored stays so: `nohup` asks for that.
    """
    stop, terminals = Stop(), [stream for stream in (1, 2) if os.isatty(stream)]
    numbers = [signal.SIGINT, signal.SIGTERM]
    if _HANGUP is not None and signal.getsignal(_HANGUP) != signal.SIG_IGN:
        numbers.append(_HANGUP)
    before = {number: signal.getsignal(number) for number in numbers}

    def ask(number: int, frame: FrameType | None) -> None:
        stop.code = 128 + number
        for each in numbers:
            signal.signal(each, before[each])
        if number == _HANGUP:  # whoever writes to a closed terminal fails
            for stream in terminals:
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream)

    for number in numbers:
        signal.signal(number, ask)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class TrainingProgress(Bar):
    """Shows a training run: steps, speed, time left, score and loss.

    Args:
        console: where to; a bar if it is a terminal, otherwise a line now and then.
        total: the steps of the whole run, by its clock.
        done: those taken before.
    """

    def __init__(self, console: Console, total: int, done: int = 0) -> None:
        self._what, self._first, self._begun = "steps", done, time.monotonic()
        self._state = "score –, loss –"
        super().__init__(
            console,
            BarColumn(bar_width=None),
            TextColumn("{task.fields[steps]}"),
            TimeRemainingColumn(compact=True),
            TextColumn("{task.fields[state]}", markup=False),
            description="",
            total=total,
            completed=done,
            steps="",
            state=self._state,
        )

    def on_metrics(self, metrics: "TrainMetrics") -> None:
        """Takes note of score and loss."""
        score = "–" if metrics.score is None else f"{metrics.score:.4g}"
        loss = "–" if metrics.loss is None else f"{metrics.loss:.3g}"
        self._state = f"score {score}, loss {loss}"

    def on_step(self, trainer: "Trainer") -> None:
        """Shows where the run stands, if it is time to."""
        if not self.is_due():
            return
        done, total, what = trainer.standing
        steps = f"{done:,} of {total:,} {what}{self._speed(trainer.clock, what)}"
        line = f"{steps}, {self._state}"
        self.show(line, completed=trainer.clock, steps=steps, state=self._state)

    def _speed(self, done: int, what: str) -> str:
        if what != self._what:  # another phase has a speed of its own
            self._what, self._first, self._begun = what, done, time.monotonic()
        passed = time.monotonic() - self._begun
        return f", {(done - self._first) / passed:,.0f}/s" if passed > 1.0 else ""


class VideoProgress(Bar):
    """Shows how many frames of a video are done.

    Args:
        console: where to; a bar if it is a terminal, otherwise a line now and then.
    """

    def __init__(self, console: Console) -> None:
        super().__init__(
            console,
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=None),
            TimeRemainingColumn(compact=True),
            description="Drawing",
            total=None,
        )
        self._shown = time.monotonic()  # most are done before there is a line to print

    def on_frame(self, done: int, count: int) -> None:
        """Shows how far it is, if it is time to."""
        if self.is_due():
            line = f"{done:,} of {count:,} frames drawn"
            self.show(line, description=line, completed=done, total=count)


class EpisodeProgress:
    """Shows how far episodes are that are played.

    Args:
        console: where to; a line that changes if it is a terminal, otherwise one now and then.
        begin: what a terminal shows before the first one is played.
    """

    def __init__(self, console: Console, begin: str = "Evaluating") -> None:
        self._console, self._shown = console, time.monotonic()
        self._status = console.status(begin) if console.is_terminal else None

    def __enter__(self) -> "EpisodeProgress":
        if self._status is not None:
            self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()

    def on_progress(self, progress: "Playing") -> None:
        """Shows how far episodes are, if it is time to."""
        line = (
            f"Playing {progress.what}: step {progress.steps:,}, {progress.finished} of "
            f"{progress.episodes} are over"
        )
        if self._status is not None:
            self._status.update(line)
        elif time.monotonic() - self._shown >= LINE_SECONDS:
            self._shown = time.monotonic()
            self._console.print(line, soft_wrap=True, markup=False)
