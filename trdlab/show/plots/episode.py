"""An episode as a matplotlib picture: what was expected all along, and the rewards that came."""

import textwrap
from itertools import pairwise
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration.trust import Trust
from trdlab.explanations.episode.promises import Broken
from trdlab.explanations.episode.story import Story
from trdlab.show.story import story_sentence
from trdlab.time_axis import axis_title

_REWARD = "#1f4e8c"
_COST = "#c77b12"
_MARK = "#222222"
_MUTED = "#5b6470"
_SHADES = ["#7a4300", "#e39a2d", "#ffffff", "#6f9bd1", "#12305a"]  # orange costs, blue rewards
_COLOURS = LinearSegmentedColormap.from_list("costs to rewards", _SHADES)
_REWARDS = LinearSegmentedColormap.from_list("rewards", _SHADES[2:])
_VEIL = 0.6  # of white, over what is not to be trusted
_HARDLY = 0.02  # negative values below this share of the largest need no colour of their own
_MOST_LABELS = 8
_MOST_DOTS = 120
_NEAR = 0.03  # of the episode: numbers nearer than this share a place
_LETTERS = 145  # in a line beneath the picture
_LINE = 0.145  # inches


def plot_story(ax: Axes, below: Axes, told: Story, trust: Trust | None = None) -> Axes:
    """Draws what was expected at each step, the rewards that came, and the numbered key moments.

    Above, a column is a step of the episode, and a row is how many steps ahead; the residual stands
    apart on top. A reward that is expected at its right step runs down a diagonal until it comes.
    What is not to be trusted is faded.

    Args:
        ax: the axes of what was expected.
        below: the axes of the rewards, with the same steps.
        told: the story.
        trust: how far such forecasts can be trusted, if that is known.

    Returns:
        `ax`; the last of its images is in discounted reward, for a colour bar.
    """
    _plot_expected(ax, told, trust)
    _plot_rewards(below, told)
    _mark_moments(ax, below, told)
    _mark_ends(ax, below, told)
    return ax


def story_figure(told: Story, title: str, trust: Trust | None = None) -> Figure:
    """Returns the picture of an episode, with the sentence of each numbered moment beneath it."""
    axis = told.played.episode.time_axis
    faded = trust is not None and bool(trust.doubtful.any())
    lines = [
        line
        for number, claim in enumerate(told.moments, 1)
        for line in textwrap.wrap(f"{number}  {story_sentence(claim, told.played)}", _LETTERS)
    ]
    note = f"{axis_title(axis)}{' · faded: has not proved better than a guess' * faded}"
    foot = 0.2 + _LINE * (len(lines) + 1)
    height = 4.6 + foot
    layout = ConstrainedLayoutEngine(rect=(0.0, foot / height, 1.0, 1.0 - foot / height))
    figure = Figure(figsize=(8.0, height), layout=layout)
    figure.suptitle(title, fontsize=11)
    ax, below = figure.subplots(2, 1, sharex=True, height_ratios=(3.0, 1.0))
    plot_story(ax, below, told, trust)
    extend = _extend(told.played.episode.predicted)
    bar = figure.colorbar(ax.images[-1], ax=[ax, below], pad=0.02, extend=extend)
    bar.set_label("expected discounted reward, as of the step", fontsize=8, color=_MUTED)
    bar.ax.tick_params(labelsize=7)
    text = "\n".join([*lines, note])
    figure.text(0.02, 0.1 / height, text, fontsize=7, color=_MUTED, va="bottom", linespacing=1.35)
    return figure


def _plot_expected(ax: Axes, told: Story, trust: Trust | None) -> None:
    axis, expected = told.played.episode.time_axis, told.played.episode.predicted  # [T, N+1]
    horizon, top = axis.horizon, _residual_row(axis.horizon)
    low, high = _limits(expected)
    colours = _COLOURS if low < 0.0 else _REWARDS
    blocks = [(expected[:, -1:], top)] + ([(expected[:, :-1], 0.0)] if horizon else [])
    for block, bottom in blocks:
        steps, rows = block.shape
        extent = (-0.5, steps - 0.5, bottom - 0.5, bottom + rows - 0.5)
        ax.imshow(
            block.T,
            cmap=colours,
            vmin=low,
            vmax=high,
            origin="lower",
            extent=extent,
            aspect="auto",
        )
    for row, is_doubtful in enumerate(() if trust is None else trust.doubtful):
        if is_doubtful:
            at = row if row < horizon else top
            ax.axhspan(at - 0.5, at + 0.5, color="white", alpha=_VEIL, linewidth=0, zorder=2)
    shown = [*range(0, horizon, -(-max(horizon, 1) // _MOST_LABELS)), horizon]
    ax.set_yticks([*shown[:-1], top], [axis.label(row) for row in shown])
    ax.set(xlim=(-0.5, len(expected) - 0.5), ylim=(-0.5, top + 0.5))
    ax.set_ylabel("expected at (t is the step)", fontsize=9, color=_MUTED)
    ax.tick_params(labelsize=8, labelbottom=False)
    ax.spines[["top", "right"]].set_visible(False)


def _plot_rewards(ax: Axes, told: Story) -> None:
    rewards = told.played.episode.rewards
    for colour, came in ((_REWARD, rewards > 0.0), (_COST, rewards < 0.0)):
        at = np.flatnonzero(came)
        ax.vlines(at, 0.0, rewards[at], color=colour, linewidth=1.5 if at.size < 200 else 0.6)
        if 0 < at.size < _MOST_DOTS:
            ax.plot(at, rewards[at], "o" if colour == _REWARD else "v", color=colour, markersize=4)
    ax.axhline(0.0, color="black", linewidth=0.8)
    if rewards.any():
        ax.margins(y=0.2)
    else:
        ax.set(ylim=(-0.1, 1.0), yticks=(0.0,))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=10))
    ax.set_xlabel("step of the episode", fontsize=9, color=_MUTED)
    ax.set_ylabel("reward", fontsize=9, color=_MUTED)
    ax.tick_params(labelsize=8)
    ax.spines[["top", "right"]].set_visible(False)


def _mark_moments(ax: Axes, below: Axes, told: Story) -> None:
    """Numbers the moments; where some are near each other, their numbers stand together."""
    places = [claim.place or 0 for claim in told.moments]
    for place in set(places):
        for panel in (ax, below):
            panel.axvline(place, color=_MARK, linewidth=0.7, linestyle=(0, (2, 2)), zorder=3)
    for claim in told.moments:
        if isinstance(claim, Broken):
            rows = [claim.component] * 2
            for colour, width in (("white", 3.5), (_MARK, 1.5)):
                ax.plot([claim.first, claim.last], rows, color=colour, linewidth=width, zorder=4)
    near = _NEAR * len(told.played.episode)
    starts = [0, *(i + 1 for i, (a, b) in enumerate(pairwise(places)) if b - a > near)]
    for start, stop in zip(starts, [*starts[1:], len(places)], strict=True):
        if start < stop:
            ax.annotate(
                ", ".join(str(number + 1) for number in range(start, stop)),
                (float(np.mean(places[start:stop])), 1.0),
                xycoords=ax.get_xaxis_transform(),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                fontsize=8,
                fontweight="bold",
                color=_MARK,
            )


def _mark_ends(ax: Axes, below: Axes, told: Story) -> None:
    """Draws a line where nothing was left to come, and says how the episode ended."""
    episode = told.played.episode
    for step in np.flatnonzero(episode.ends):
        for panel in (ax, below):
            panel.axvline(step + 0.5, color=_MARK, linewidth=1.2, zorder=3, clip_on=False)
    below.annotate(
        "ended" if episode.terminated else "cut off",
        (1.0, -0.02),
        xycoords="axes fraction",
        xytext=(0, -18),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=8,
        color=_MUTED,
    )


def _limits(expected: FloatArray) -> tuple[float, float]:
    """Returns the values `[T, N+1]` that the colours end at: those of the explicit components."""
    values = expected[:, :-1] if expected.shape[1] > 1 else expected
    largest = float(np.abs(values).max()) or 1.0
    has_costs = float(values.min()) < -_HARDLY * largest
    return (-largest if has_costs else 0.0), largest


def _extend(expected: FloatArray) -> Literal["neither", "both", "min", "max"]:
    """Returns at which ends of the colour bar the residual goes on."""
    low, high = _limits(expected)
    below, above = (
        bool((expected[:, -1] < low - _HARDLY * high).any()),
        bool((expected[:, -1] > high).any()),
    )
    if below and above:
        return "both"
    return "min" if below else "max" if above else "neither"


def _residual_row(horizon: int) -> float:
    """Returns where the residual stands: above the explicit components, and apart from them."""
    return horizon + max(0.5, 0.04 * horizon) if horizon else 0.0
