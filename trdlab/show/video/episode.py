"""An episode beside its forecast: what is expected of the action taken and of the best other."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.explanations.calibration.calibration import Trust
from trdlab.explanations.episode.played import Played
from trdlab.explanations.episode.story import Story, place
from trdlab.formatting import said
from trdlab.show.video.beside import panel_for
from trdlab.show.video.canvas import (
    Frame,
    Sheet,
    enlarged,
    even,
    letters_for,
    line_of,
    wrapped,
    zoom_for,
)
from trdlab.show.video.panel import ABOUT, Row, Span
from trdlab.show.video.sights import Sight
from trdlab.show.video.strip import Strip

REST = 2.0  # seconds for which the last frame stays
_READ = 4.0  # seconds for which a sentence stays, if no other takes its place
_PANEL = 400  # pixels: how wide a panel is, as far as the size of letters is concerned


class Caption(NamedTuple):
    """A sentence, and when it is read.

    Args:
        first: the step at which it begins to be shown.
        text: what is shown.
    """

    first: int
    text: str


def captions(told: Story) -> list[Caption]:
    """Returns the sentences of a story by their steps: start, key moments, end."""
    start = [Caption(0, claim.sentence) for claim in told.start[:1]]
    moments = [
        Caption(place(claim), f"{number}  {claim.sentence}")
        for number, claim in enumerate(told.moments, 1)
    ]
    end = " ".join(claim.sentence for claim in told.end)
    return [*start, *moments, Caption(len(told.played.episode), end)]


def caption_at(shown: list[Caption], step: int, stays: int) -> str:
    """Returns what is shown at a step: the sentence that began last, for so many steps."""
    begun = [caption for caption in shown if caption.first <= step]
    return begun[-1].text if begun and step < begun[-1].first + stays else ""


def episode_frames(
    told: Story, sights: Iterator[Sight], *, rate: float, trust: Trust | None = None
) -> Iterator[Frame]:
    """Yields T+1 frames of an episode, and some more of its end, `num_frames` in all.

    Args:
        told: the story.
        sights: T+1 of them.
        rate: how many frames are shown in a second.
        trust: how far such forecasts can be trusted, if that is known: what lies beyond is pale.
    """
    played = told.played
    first = next(sights)
    look = _Look(told, first.picture, rate, trust)
    frame = look.draw(first.picture, 0)
    yield frame
    for step, sight in enumerate(sights, 1):
        frame = look.draw(sight.picture, step)
        yield frame
    for _ in range(num_frames(played, rate) - len(played.episode) - 1):
        yield frame


def num_frames(played: Played, rate: float) -> int:
    """Returns how many frames the video of an episode has."""
    return len(played.episode) + 1 + round(REST * rate)


class _Look:
    """How the frames of one episode look: all of them alike, on one scale."""

    def __init__(self, told: Story, picture: Frame, rate: float, trust: Trust | None) -> None:
        self._played, episode = told.played, told.played.episode
        self._zoom = zoom_for(picture)
        height, width = (even(self._zoom * side) for side in picture.shape[:2])
        self._size, self._left = letters_for(width + _PANEL), width
        about = ABOUT if trust is None else f"{ABOUT}; pale: not to be trusted"
        names = self._played.action_names
        rows = min(2, len(names))
        self._panel = panel_for(episode.time_axis, names, height, self._size, rows, about)
        self._width = width + self._panel.width
        self._doubtful: BoolArray | None = None if trust is None else trust.doubtful
        self._foils = foils(episode.decomposition.components, episode.actions)
        self._span = Span().over(self._all_rows())
        self._captions, self._stays = captions(told), max(1, round(_READ * rate))
        marks = [place(claim) for claim in told.moments]
        self._strip = Strip(self._played, self._width, self._size, marks)
        self._lines = max(len(self._wrapped(caption.text)) for caption in self._captions)

    def draw(self, picture: Frame, step: int) -> Frame:
        """Returns the frame `[H, W, 3]` at a step."""
        top, line = self._panel.height, line_of(self._size)
        words = even(self._lines * line + self._size // 2)
        sheet = Sheet(self._width, top + words + self._strip.height, self._size)
        sheet.paste(enlarged(picture, self._zoom), 0, 0)
        sheet.paste(
            self._panel.draw(self._rows(step), self._span, self._heading(step)), self._left, 0
        )
        for row, text in enumerate(self._wrapped(caption_at(self._captions, step, self._stays))):
            sheet.write(self._size, top + self._size // 4 + row * line, text)
        sheet.paste(self._strip.at(step), 0, top + words)
        return sheet.frame

    def _wrapped(self, text: str) -> list[str]:
        return wrapped(text, self._width - 2 * self._size, self._size)

    def _rows(self, step: int) -> list[Row]:
        episode, names = self._played.episode, self._played.action_names
        if step == len(episode):
            return []
        action, rows = int(episode.actions[step]), episode.decomposition.components[step]
        shown = [Row(names[action], rows[action], "takes: ", self._doubtful)]
        if len(names) > 1:
            foil = int(self._foils[step])
            shown.append(Row(names[foil], rows[foil], "instead of: ", self._doubtful))
        return shown

    def _all_rows(self) -> FloatArray:
        episode, steps = self._played.episode, np.arange(len(self._played.episode))
        foil = episode.decomposition.components[steps, self._foils]
        return np.concatenate([episode.predicted, foil])  # [2·T, N+1]

    def _heading(self, step: int) -> str:
        rewards, total = self._played.episode.rewards, len(self._played.episode)
        so_far = f"rewards so far {said(float(rewards[:step].sum()))}"
        return f"step {step:,} of {total:,} · {so_far}"


def foils(components: FloatArray, actions: IntArray) -> IntArray:
    """Returns `[T]`: of each step the best action that was not taken.

    Args:
        components: `[T, A, N+1]`, of every action.
        actions: `[T]`, that were taken.
    """
    values = components.sum(axis=2, dtype=np.float64)
    values[np.arange(len(values)), actions] = -np.inf
    return np.asarray(values.argmax(axis=1))
