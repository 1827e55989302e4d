"""A strip over the steps of an episode: the rewards that came, and what was expected of them."""

from collections.abc import Sequence

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.episode.played import Played
from trdlab.explanations.words import counted
from trdlab.rollouts.episodes import Episode
from trdlab.show.plots import style
from trdlab.show.video.canvas import Frame, Sheet, even, line_of, width_of

_LINES = 6  # of text: how high a strip is
_EXPECTED = "#9fb0c8"
_FAR = 10  # steps: how long before a reward its expectation is shown, where no second is known
_NOW = (213, 94, 0)


def before(episode: Episode, steps: int) -> FloatArray:
    """Returns `[T]`: the reward that was expected of each step, so many steps before it came.

    It is not discounted; of components that cover several steps, it is the mean over these. It is
    NaN where nothing was expected yet, because the episode had not begun.

    Args:
        episode: as it was played.
        steps: a multiple of w, of those that the explicit components cover.
    """
    axis = episode.time_axis
    component = steps // axis.width
    told = episode.predicted[:, component] / axis.discounts[component] / axis.width  # [T]
    expected = np.full(len(episode), np.nan)
    expected[steps:] = told[: len(episode) - steps]
    return expected


def lead_of(played: Played) -> int:
    """Returns how many steps before a reward its expectation is shown: about a second."""
    axis, seconds = played.episode.time_axis, played.seconds_per_step
    wanted = _FAR if seconds is None else max(1, round(1.0 / seconds))
    return max(0, min(wanted // axis.width, axis.horizon - 1)) * axis.width


class Strip:
    """A strip so many pixels wide; what is still to come is not shown.

    Args:
        played: the episode.
        width: in pixels.
        size: of letters, in pixels.
        marks: the steps of key moments, in order; they are numbered.

    Attributes:
        height: in pixels.
    """

    def __init__(self, played: Played, width: int, size: int, marks: Sequence[int] = ()) -> None:
        self._steps, self._width, self._size = len(played.episode), width, size
        self._line = line_of(size)
        self.height = even(_LINES * self._line)
        lead = lead_of(played)
        expected, came = before(played.episode, lead), played.episode.rewards
        values = np.concatenate([expected[np.isfinite(expected)], came])
        self._low, self._high = min(0.0, float(values.min())), max(0.0, float(values.max()))
        empty = self._ground(lead, marks)
        self._empty, full = empty.frame, Sheet(width, self.height, size, empty.image)
        for rewards, colour, share in ((expected, _EXPECTED, 0.0), (came, style.INK, 0.3)):
            self._bars(full, rewards, colour, share)
        self._full = full.frame

    def column(self, step: float) -> int:
        """Returns the first column of pixels of a step."""
        room = self._width - 2 * self._size
        return self._size + round(room * step / self._steps)

    def line_at(self, reward: float) -> int:
        """Returns the line of pixels at which a reward stands; its bar ends there."""
        top, bottom = 2 * self._line, self.height - self._line - 2
        span = (self._high - self._low) or 1.0
        return bottom - int(0.5 + (bottom - top) * float(reward - self._low) / float(span))

    def at(self, steps: int) -> Frame:
        """Returns the picture `[height, width, 3]` once so many steps have been taken."""
        frame, now = self._empty.copy(), self.column(steps)
        frame[:, :now] = self._full[:, :now]
        frame[2 * self._line - 3 : self.height - self._line, now : now + 2] = _NOW
        return frame

    def _ground(self, lead: int, marks: Sequence[int]) -> Sheet:
        sheet, line, size = Sheet(self._width, self.height, self._size), self._line, self._size
        x = size
        when = "at the same step" if not lead else f"{counted(lead, 'step')} before"
        for colour, text in ((style.INK, "reward that came"), (_EXPECTED, f"expected {when}")):
            sheet.draw.rectangle((x, size // 4, x + size - 4, size), colour)
            sheet.write(x + size, 0, text, style.MUTED)
            x += 3 * size + width_of(text, size)
        zero, foot = self.line_at(0.0), self.height - line
        sheet.draw.line((self.column(0), zero, self.column(self._steps), zero), style.MUTED)
        sheet.write(self.column(0), foot, "step 0", style.MUTED)
        sheet.write(self.column(self._steps), foot, f"{self._steps:,}", style.MUTED, at="ra")
        for number, step in enumerate(marks, 1):
            sheet.write(self.column(step + 0.5), line, f"{number}", at="ma", bold=True)
        return sheet

    def _bars(self, sheet: Sheet, rewards: FloatArray, colour: str, inset: float) -> None:
        zero = self.line_at(0.0)
        known = np.flatnonzero(np.nan_to_num(rewards))
        for step in known[np.argsort(np.abs(rewards[known]))].tolist():  # the largest on top
            left = self.column(step + inset)
            right = max(left, self.column(step + 1 - inset) - 1)
            top, bottom = sorted((zero, self.line_at(float(rewards[step]))))
            sheet.draw.rectangle((left, top, right, bottom), colour)
