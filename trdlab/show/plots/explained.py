"""Pictures of an explained agent: what it expects, what cannot be trusted of that, and why."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.explained import PARTS, Explained, Part
from trdlab.explanations.moment.explanation import Explanation
from trdlab.explanations.moment.leads import difference
from trdlab.explanations.moment.limits import doubtful
from trdlab.explanations.moment.moment import Moment
from trdlab.explanations.moment.outcome import Trial
from trdlab.show.plots.calibration import plot_reliability, plot_trust
from trdlab.show.plots.episode import story_figure
from trdlab.show.plots.moment import (
    plot_components,
    plot_contrast,
    plot_uncertainty,
    whiskers,
)
from trdlab.show.plots.pictures import check_pictures, write_picture
from trdlab.show.plots.steps_axis import cut_off, positions, room_for, share_scale
from trdlab.time_axis import axis_title

_COLOURS = ("#1f4e8c", "#e39a2d")  # dark for the action, light for its foil
_MUTED = "#5b6470"
_FADED = 0.25
_WIDTH = 8.0
_PANEL = 2.2
_RELIABILITY = 3.2
_FOOT = 0.5  # inches


def picture_paths(
    folder: Path, parts: tuple[Part, ...], *, seed: int, step: int
) -> dict[Part, Path]:
    """Returns where the picture of each part goes, once it is known that it can be written.

    Args:
        folder: where to; it is made if there is none.
        parts: what was asked for; nothing stands for all.
        seed: of the episode that is explained.
        step: of that episode.

    Raises:
        OutputError: one of them exists, or cannot be written.
    """
    ending = {"episode": f"-seed-{seed}", "calibration": ""}
    moment = f"-seed-{seed}-step-{step}"
    paths = {part: folder / f"{part}{ending.get(part, moment)}.png" for part in parts or PARTS}
    check_pictures(paths.values())
    return paths


def write_pictures(explained: Explained, paths: dict[Part, Path]) -> list[Path]:
    """Writes the pictures of an explained agent, and returns their paths.

    Args:
        explained: what is drawn; what it does not have is left out.
        paths: where each picture goes.

    Raises:
        OutputError: one cannot be written.
    """
    written = []
    for part, path in paths.items():
        figure = part_figure(explained, part)
        if figure is None:
            continue
        write_picture(figure, path)
        written.append(path)
    return written


def part_figure(explained: Explained, part: Part) -> Figure | None:
    """Returns the picture of a part; None where there is nothing to draw."""
    explanation, report = explained.explanation, explained.report
    if part == "calibration":
        return None if report is None else trust_figure(report, explained.agent.name)
    if part == "episode":
        title = f"{explained.agent.name}, the episode with seed {explained.seed}"
        trust = None if report is None else report.trust
        return None if explained.story is None else story_figure(explained.story, title, trust)
    if explanation is None or (part == "contrast" and explanation.foil is None):
        return None
    foil = explanation.foil if part == "contrast" else None
    title = f"{explained.agent.name}, step {explained.step} of the episode with seed"
    trial = explained.trial if part == "contrast" else None
    return moment_figure(explanation, foil, f"{title} {explained.seed}", trial=trial)


def moment_figure(
    explanation: Explanation, foil: str | None, title: str, *, trial: Trial | None = None
) -> Figure:
    """Returns the bars of an action; with a foil, those of both and of their difference.

    What is not to be trusted is faded. Where action and foil were tried, what came of their
    difference stands over the bars that were forecast.
    """
    moment, action = explanation.moment, explanation.action
    names = [action] if foil is None else [action, foil]
    panels = len(names) + (foil is not None)
    height = 1.3 + _PANEL * panels
    layout = ConstrainedLayoutEngine(rect=(0.0, _FOOT / height, 1.0, 1.0 - _FOOT / height))
    figure = Figure(figsize=(_WIDTH, height), layout=layout)
    figure.suptitle(title, fontsize=11)
    axes: list[Axes] = list(np.atleast_1d(figure.subplots(panels, 1, sharex=True)))
    for ax, name, colour in zip(axes, names, _COLOURS, strict=False):
        plot_components(ax, moment.components(name), moment.time_axis, colour=colour)
        plot_uncertainty(ax, moment, name)
        ax.set_title(f"{name}: worth {moment.q_value(name):.3g} in all", fontsize=10, loc="left")
    if foil is not None:
        plot_contrast(axes[-1], moment, action, foil)
        if trial is not None:
            plot_trial(axes[-1], trial)
        share_scale(axes[:-1])
        _cut_residuals(axes[-1:], moment, [difference(moment, action, foil)])
    _cut_residuals(axes[: len(names)], moment, [moment.components(name) for name in names])
    for ax, of in zip(axes, (*([name] for name in names), names), strict=False):
        fade(ax, moment, of)
        if ax is not axes[-1]:
            ax.label_outer()
    figure.supylabel("expected discounted reward", fontsize=9, color=_MUTED)
    _foot(figure, moment, names, height)
    return figure


def _cut_residuals(axes: Sequence[Axes], moment: Moment, rows: Sequence[FloatArray]) -> None:
    """Cuts residuals off beside which the bars of `rows`, one for each axes, cannot be seen."""
    room, x = room_for(np.stack(rows)), float(positions(moment.time_axis)[-1])
    if room is not None:
        for ax, row in zip(axes, rows, strict=True):
            cut_off(ax, room, [(x, float(row[-1]))])


def fade(ax: Axes, moment: Moment, actions: Sequence[str]) -> Axes:
    """Fades those bars of a moment that are not to be trusted; the axes hold one per component.

    Args:
        ax: the axes with the bars, as `plot_components` draws them.
        moment: that knows what can be trusted of which action.
        actions: the names of those that the bars tell of, both of them for a difference.

    Returns:
        `ax`.
    """
    faded = np.any([doubtful(moment, action) for action in actions], axis=0)
    for bar, is_doubtful in zip(ax.patches, faded, strict=True):
        if is_doubtful:
            bar.set_alpha(_FADED)
    return ax


def plot_trial(ax: Axes, trial: Trial) -> Axes:
    """Draws what came of the difference of two actions that were tried, over its bars.

    Args:
        ax: the axes with the bars of the difference, as `plot_contrast` draws them.
        trial: of the same two actions.

    Returns:
        `ax`.
    """
    found = trial.found
    bars = [bar.get_path().get_extents(bar.get_patch_transform()) for bar in ax.patches]
    x = np.array([0.25 * bar.x0 + 0.75 * bar.x1 for bar in bars])  # right of the numbers
    y, low, high = (
        of[:-1] for of in (found.observed.value, found.observed.low, found.observed.high)
    )
    known = ~np.isnan(y)
    reach = np.nan_to_num(np.array([y - low, high - y]))[:, known]  # no bar without an interval
    ax.errorbar(
        x[known],
        y[known],
        yerr=reach,
        fmt="D",
        color="black",
        markerfacecolor="white",
        markersize=5,
        capsize=3,
        linewidth=1.2,
        label=f"as it came, each tried {found.copies} times",
    )
    ax.margins(y=0.25)
    ax.legend(loc="best", fontsize=8, frameon=False)
    return ax


def trust_figure(report: CalibrationReport, title: str) -> Figure:
    """Returns the skill of every component, and how far a forecast can be trusted.

    Where rewards are either 0 or one amount, how often it came stands beside it.
    """
    found = report.calibration.reliability
    figure = Figure(figsize=(_WIDTH + _RELIABILITY * (found is not None), 4.0))
    figure.set_layout_engine("constrained")
    figure.suptitle(f"{title}: how far its forecasts can be trusted", fontsize=11)
    if found is None:
        plot_trust(figure.subplots(), report)
        return figure
    left, right = figure.subplots(1, 2, width_ratios=(_WIDTH, _RELIABILITY))
    plot_trust(left, report)
    plot_reliability(right, found)
    return figure


def _foot(figure: Figure, moment: Moment, actions: Sequence[str], height: float) -> None:
    future = moment.future
    is_faded = any(doubtful(moment, action).any() for action in actions)
    faded = " · faded: has not proved better than a guess" if is_faded else ""
    meaning = whiskers(moment)
    lines = (
        f"{axis_title(moment.time_axis)}{faded}{meaning and f' · {meaning}'}",
        f"after the first action the future of {future.policy}",
        f"{future.reward} · ends at {future.ending}",
    )
    figure.text(
        0.5, 0.08 / height, "\n".join(lines), fontsize=7, color=_MUTED, ha="center", va="bottom"
    )
