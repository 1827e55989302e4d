"""The trust report as a matplotlib picture: axes in, axes out."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration.reliability import Reliability
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.formatting import amount
from trdlab.show.plots.steps_axis import STEPS, label_steps, positions
from trdlab.time_axis import axis_title, step_label

_SKILL = "#1f4e8c"  # dark, solid, with dots
_CEILING = "#e39a2d"  # light, dashed
_MUTED = "#5b6470"
_TRUSTED = "#dfeade"
_LOWEST = -0.5  # skill below this is shown as an arrow at the edge
_GAP = 1.0  # between the explicit components and the residual, in components


def plot_trust(ax: Axes, report: CalibrationReport) -> Axes:
    """Draws the skill of every component with its interval, and how far it can be trusted.

    The trusted range is shaded. Where there was nothing to predict stands a small ring on the line
    of no skill; where nothing is known or too few episodes tell, a cross. The ceiling, if there is
    one, is a second line: what lies above it cannot be known.

    Args:
        ax: the axes to draw on.
        report: what is drawn.

    Returns:
        `ax`.
    """
    axis, found = report.time_axis, report.calibration
    x = positions(axis, _GAP)
    _shade(ax, report)
    ax.axhline(0.0, color="black", linewidth=0.8)
    if report.ceiling is not None:
        limit = report.ceiling.skill
        _band(ax, x, limit.low, limit.high, _CEILING)
        _line(ax, x, limit.value, color=_CEILING, linestyle="--", label="a perfect forecast")
    _band(ax, x, found.skill.low, found.skill.high, _SKILL)
    _line(ax, x, found.skill.value, color=_SKILL, marker="o", markersize=3, label="this forecast")
    below = found.skill.value < _LOWEST
    if below.any():
        lowest = np.full(below.sum(), _LOWEST)
        ax.plot(x[below], lowest, "v", color=_SKILL, markersize=6, clip_on=False)
    told = ~np.isnan(found.skill.low)
    _mark(ax, x[found.constant & found.is_("good")], "o", "always the same, and right")
    _mark(ax, x[found.is_("not tested")], ".", "not tested")
    _mark(ax, x[~told & (found.is_("open") | found.is_("bad"))], "x", "wrong, or too few episodes")
    _dress(ax, report, x)
    return ax


def plot_reliability(ax: Axes, found: Reliability) -> Axes:
    """Draws how often a reward came, by the chance that was forecast; on the diagonal all is well.

    Large dots are all steps together, their area by the number of forecasts; small ones are single
    steps.

    Args:
        ax: the axes to draw on.
        found: what came, for rewards that are either 0 or one amount.

    Returns:
        `ax`.
    """
    ax.plot([0.0, 1.0], [0.0, 1.0], color=_MUTED, linewidth=0.8, linestyle=":")
    ax.scatter(found.predicted, found.observed, s=6, color=_MUTED, alpha=0.5, linewidth=0)
    count = found.counts.sum(axis=0)  # [bins]
    seen = count > 0
    chance, share = (
        np.nansum(of * found.counts, axis=0)[seen] / count[seen]
        for of in (found.predicted, found.observed)
    )
    ax.plot(chance, share, color=_SKILL, linewidth=1.0)
    ax.scatter(chance, share, s=20.0 + 160.0 * count[seen] / count.max(), color=_SKILL, alpha=0.7)
    ax.set(xlim=(-0.05, 1.05), ylim=(-0.05, 1.05), xticks=(0.0, 0.5, 1.0), yticks=(0.0, 0.5, 1.0))
    ax.set_aspect("equal")
    ax.set_xlabel("forecast", fontsize=9, color=_MUTED)
    ax.set_ylabel("came", fontsize=9, color=_MUTED)
    ax.set_title(f"chance of the reward of {amount(found.amount)}", fontsize=9, color=_MUTED)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8)
    return ax


def _shade(ax: Axes, report: CalibrationReport) -> None:
    trusted = report.trust
    if trusted.last_step is None:
        return
    ax.axvspan(-0.5, trusted.components - 0.5, color=_TRUSTED, linewidth=0, zorder=0)
    ax.text(
        -0.4,
        1.03,
        f"trusted to {step_label(trusted.last_step)}",
        fontsize=8,
        color=_MUTED,
        va="bottom",
    )


def _band(ax: Axes, x: FloatArray, low: FloatArray, high: FloatArray, colour: str) -> None:
    """Draws intervals: a band over the explicit components, a bar at the residual."""
    low, high = np.maximum(low, _LOWEST), np.maximum(high, _LOWEST)
    ax.fill_between(x[:-1], low[:-1], high[:-1], color=colour, alpha=0.25, linewidth=0)
    if np.isfinite(low[-1]):
        ax.vlines(x[-1:], low[-1:], high[-1:], color=colour, alpha=0.5, linewidth=4)


def _line(ax: Axes, x: FloatArray, y: FloatArray, *, color: str, **style: Any) -> None:
    """Draws a line through the explicit components and a point at the residual."""
    shown = np.where(y < _LOWEST, np.nan, y)
    ax.plot(x[:-1], shown[:-1], linewidth=1.5, color=color, **style)
    if np.isfinite(shown[-1]):  # a lone NaN would be laid out at the corner of the page
        ax.plot(x[-1:], shown[-1:], marker="D", markersize=4, color=color)


def _mark(ax: Axes, x: FloatArray, marker: str, label: str) -> None:
    """Marks components that have no skill, on the line of none."""
    if x.size:
        ax.scatter(
            x,
            np.zeros_like(x),
            marker=marker,
            s=24,
            facecolor="white" if marker == "o" else _MUTED,
            edgecolor=_MUTED if marker == "o" else None,
            label=label,
            zorder=3,
        )


def _dress(ax: Axes, report: CalibrationReport, x: FloatArray) -> None:
    axis = report.time_axis
    label_steps(ax, axis, x)
    ax.set(xlim=(-0.6, x[-1] + 0.6), ylim=(_LOWEST, 1.12), yticks=(-0.5, 0.0, 0.5, 1.0))
    ax.set_xlabel(STEPS, fontsize=9, color=_MUTED)
    ax.set_ylabel("skill (1: perfect,\n0: a constant guess)", fontsize=9, color=_MUTED)
    ax.set_title(
        f"{axis_title(axis)} · {report.judged.episodes} episodes",
        fontsize=9,
        color=_MUTED,
        loc="right",
    )
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8)
    ax.legend(loc="upper right", fontsize=8, frameon=False)
