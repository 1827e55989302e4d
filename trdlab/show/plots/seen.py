"""What is seen at a moment, and beside it what is expected: the manner of the paper's figures."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from trdlab.arrays import FloatArray
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.explanations.moment.steps import LEAST_DISCOUNT
from trdlab.show.plots import style
from trdlab.time_axis import axis_title, step_label

Picture = npt.NDArray[np.uint8]

_PALE = 0.35  # how much of its colour is left to what is not to be trusted
_SCREEN = 1.7  # inches that what is seen is wide
_PANEL = 1.9  # inches that a row of bars is high


@style.settings()
def seen_figure(choice: Choice, picture: Picture, title: str = "") -> Figure:
    """Returns the picture of a moment: what is seen, and the reward expected at each step.

    Rewards are those that are expected themselves, their discount taken out. With a foil, the bars
    of both stand beside each other, and below them is their difference. What is not known to be
    better than a guess, and what lies beyond that, is pale.

    Args:
        choice: the action and its foil.
        picture: `[H, W, 3]`, of what is seen.
        title: of the picture.
    """
    moment, rows = choice.moment, 1 if choice.foil is None else 2
    figure = style.new_figure(1.3 + rows * _PANEL, title)
    ratios = [_SCREEN, style.WIDTH - _SCREEN]
    grid = figure.add_gridspec(rows, 2, width_ratios=ratios)
    screen = figure.add_subplot(grid[:, 0])
    screen.imshow(picture, interpolation="nearest")
    screen.set_axis_off()
    axes = [figure.add_subplot(grid[row, 1]) for row in range(rows)]
    plot_expected(axes[0], choice)
    if choice.foil is not None:
        plot_difference(axes[1], choice)
        axes[0].tick_params(labelbottom=False)
    axes[-1].set_xlabel("component k: reward of t+k (t: the action taken now)")
    style.add_legend(figure, _handles(choice), _later(choice), axis_title(moment.time_axis))
    return figure


def plot_expected(ax: Axes, choice: Choice) -> Axes:
    """Draws the reward that is expected at each step, of an action and its foil, on `ax`."""
    moment, names = choice.moment, _names(choice)
    colours, width = style.action_colours(moment.action_names), 0.8 / len(names)
    for at, name in enumerate(names):
        rewards = _rewards(moment, name)
        shift = width * (at - (len(names) - 1) / 2)
        _bars(ax, rewards, shift, width, [colours[name]] * len(rewards), _trusted(moment, name))
    ax.set_ylabel("expected reward")
    return _dressed(ax, choice)


def plot_difference(ax: Axes, choice: Choice) -> Axes:
    """Draws how much more reward is expected of the action than of its foil, on `ax`."""
    moment, (action, foil) = choice.moment, _names(choice)
    delta = _rewards(moment, action) - _rewards(moment, foil)
    own = style.action_colours(moment.action_names)
    colours = [own[action] if value > 0.0 else own[foil] for value in delta]
    _bars(ax, delta, 0.0, 0.8, colours, min(_trusted(moment, of) for of in (action, foil)))
    ax.set_ylabel("difference")
    return _dressed(ax, choice)


def _names(choice: Choice) -> list[str]:
    return [choice.action] if choice.foil is None else [choice.action, choice.foil]


def _trusted(moment: Moment, action: str) -> int:
    """Returns how many explicit components in a row are good; of an exact answer all are.

    An action that the policy hardly ever takes is judged by what came where it was forced.
    """
    if moment.is_exact:
        return moment.time_axis.horizon
    judged = moment.calibration if moment.is_own(action) else moment.foils
    return 0 if judged is None else judged.trust.components


def _rewards(moment: Moment, action: str) -> FloatArray:
    """Returns `[N]`: the reward that is expected at each explicit step, its discount taken out."""
    discounts = np.maximum(moment.time_axis.discounts, LEAST_DISCOUNT)
    return np.asarray((moment.components(action) / discounts)[:-1])


def _bars(
    ax: Axes, rewards: FloatArray, shift: float, width: float, colours: Sequence[str], trusted: int
) -> None:
    places = np.arange(len(rewards)) + shift
    for bars, strength in ((slice(trusted), 1.0), (slice(trusted, None), _PALE)):
        ax.bar(places[bars], rewards[bars], width, color=colours[bars], alpha=strength)


def _dressed(ax: Axes, choice: Choice) -> Axes:
    axis = choice.time_axis
    ax.axhline(0.0, color=style.MUTED, linewidth=0.8)
    every = max(1, axis.horizon // 4)
    shown = [*range(0, axis.horizon, every)]
    ax.set_xticks(shown, [step_label(axis.start(i)) for i in shown])
    ax.set_xlim(-0.8, axis.horizon - 0.2)
    trusted = min(_trusted(choice.moment, name) for name in _names(choice))
    if 0 < trusted < axis.horizon:
        ax.axvline(trusted - 0.5, color=style.INK, linewidth=1.0, linestyle=(0, (2, 2)))
    return style.tidy(ax)


def _handles(choice: Choice) -> list[Artist]:
    moment, colours = choice.moment, style.action_colours(choice.moment.action_names)
    handles: list[Artist] = []
    for name in _names(choice):
        trusted, axis = _trusted(moment, name), moment.time_axis
        how = "not tested, or no better than a guess"
        if trusted:
            how = f"trustworthy to {step_label(trusted * axis.width - 1)}"
        handles.append(Patch(color=colours[name], label=f"{name}: {how}"))
    if any(_trusted(moment, name) < moment.time_axis.horizon for name in _names(choice)):
        handles.append(Patch(color=style.MUTED, alpha=_PALE, label="pale: not to be trusted"))
    return handles


def _later(choice: Choice) -> str:
    """Returns what is not drawn: all that comes after the explicit steps."""
    residual: list[Any] = []
    for name in _names(choice):
        value = float(choice.moment.components(name)[-1])
        residual.append(f"{style.told(value, 2)} for {name}")
    return f"later rewards, not drawn: {', '.join(residual)} (discounted)"
