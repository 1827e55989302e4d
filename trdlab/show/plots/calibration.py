"""How far forecasts can be trusted: the skill of every component, and how often rewards came."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trdlab.arrays import FloatArray
from trdlab.explanations.calibration.calibration import Reliability
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.formatting import amount
from trdlab.show.plots import bars, style
from trdlab.time_axis import axis_title, step_label

_LOWEST = -0.5  # skill below this is an arrow at the edge; the lowest with its number


@style.settings()
def trust_figure(report: CalibrationReport, title: str = "") -> Figure:
    """Returns the skill of every component, and how far a forecast can be trusted.

    Where rewards are either 0 or one amount, how often it came stands below it.
    """
    found = report.calibration.reliability
    heading = f"{title}: how far its forecasts can be trusted" if title else ""
    figure = style.new_figure(4.0 if found is None else 6.8, heading)
    panels = np.atleast_1d(np.asarray(figure.subplots(1 if found is None else 2, 1)))
    plot_trust(panels[0], report)
    if found is not None:
        plot_reliability(panels[1], found)
    note = f"{axis_title(report.time_axis)} · {report.judged.episodes} episodes"
    style.add_legend(figure, trust_handles(report), note)
    return figure


def plot_trust(ax: Axes, report: CalibrationReport) -> Axes:
    """Draws the skill of every component with its interval on `ax`, which is returned.

    The ground is green where it has proved better than a constant guess, red where it is surely
    not, and grey where that is open or was not tested. Where there was nothing to predict stands a
    ring on the line of no skill; where nothing was tested, a cross. The ceiling, if there is one,
    is a dashed line: what lies above it cannot be known.
    """
    found, x = report.calibration, style.positions(report.time_axis, 1.0)
    style.draw_grounds(ax, x, found.status)
    ax.axhline(0.0, color=style.MUTED, linewidth=0.8)
    if report.ceiling is not None:
        _draw_skill(ax, x, report.ceiling.skill, style.MUTED, linestyle="--")
    _draw_skill(ax, x, found.skill, style.EXPECTED, marker="o", markersize=3.5)
    below = np.flatnonzero(found.skill.value < _LOWEST)
    if below.size:
        ax.plot(x[below], 0.0 * below + _LOWEST, "v", color=style.EXPECTED)
        worst = below[found.skill.value[below].argmin()]
        text = f"down to {style.told(float(found.skill.value[worst]), 1)}"
        how = {"ha": "left" if worst < len(x) / 2 else "right", "va": "top", "gid": bars.CUT}
        style.note(ax, text, (x[worst], _LOWEST), (0, -5), **how)
    for marker, where in zip("ox", _untested(report), strict=True):
        ax.plot(x[where], 0.0 * x[where], marker, color=style.MUTED, mfc="white", markersize=5)
    style.label_steps(ax, report.time_axis, x)
    floor = _LOWEST - 0.25 * bool(below.size)
    ax.set(ylim=(floor, 1.1), yticks=(-0.5, 0.0, 0.5, 1.0), xlabel="steps ahead")
    ax.set_ylabel("skill (1: perfect,\n0: a constant guess)")
    last = report.trust.last_step
    text = "not trusted" if last is None else f"trusted to {step_label(last)}"
    ax.set_title(text, fontsize=style.TITLE, loc="left")
    return style.tidy(ax)


def plot_reliability(ax: Axes, found: Reliability) -> Axes:
    """Draws on `ax` how often a reward came, by the chance that was forecast, and returns it.

    On the diagonal all is well. Large dots are all steps together, their area by the number of
    forecasts; small ones are single steps. Forecasts below 0 and above 1 count as 0 and 1.
    """
    ax.plot([0.0, 1.0], [0.0, 1.0], color=style.MUTED, linewidth=0.8, linestyle=":")
    chances = np.clip(found.predicted, 0.0, 1.0)  # [N, bins]
    ax.scatter(chances, found.observed, s=8, color=style.MUTED, alpha=0.5, linewidth=0)
    count = found.counts.sum(axis=0)  # [bins]
    seen = count > 0
    chance, share = (
        np.nansum(of * found.counts, axis=0)[seen] / count[seen] for of in (chances, found.observed)
    )
    ax.plot(chance, share, color=style.EXPECTED, linewidth=1.0)
    area = 20.0 + 160.0 * count[seen] / count.max()
    ax.scatter(chance, share, s=area, color=style.EXPECTED, alpha=0.7)
    ax.set(xlim=(-0.1, 1.1), ylim=(-0.1, 1.1), xticks=(0.0, 0.5, 1.0), yticks=(0.0, 0.5, 1.0))
    ax.set(aspect="equal", xlabel="chance that was forecast", ylabel="share that came")
    ax.set_title(f"the reward of {amount(found.amount)}", fontsize=style.TITLE)
    return style.tidy(ax)


def trust_handles(report: CalibrationReport) -> list[Artist]:
    """Returns what a legend explains of `plot_trust`: only what is there."""
    muted: Any = {"colour": style.MUTED}
    handles: list[Artist] = [bars.handle("this forecast", "-", "o", style.EXPECTED, style.EXPECTED)]
    if report.ceiling is not None:
        handles.append(bars.handle("a perfect forecast", "--", **muted))
    handles += style.ground_handles(report.calibration.status)
    constant, unknown = _untested(report)
    handles += [bars.handle("nothing to predict", "", "o", **muted)] * bool(constant.any())
    handles += [bars.handle("not tested", "", "x", **muted)] * bool(unknown.any())
    return handles


def _untested(report: CalibrationReport) -> tuple[Any, Any]:
    """Returns two of `[N+1]`: where there was nothing to predict, and where nothing was tested."""
    found = report.calibration
    untested = found.is_("not tested")
    return found.constant & ~untested, untested


def _draw_skill(ax: Axes, x: FloatArray, skill: Any, colour: str, **how: Any) -> None:
    """Draws a line and a band through the explicit components; at the residual a point, a bar."""
    low, high = np.maximum(skill.low, _LOWEST), np.maximum(skill.high, _LOWEST)
    shown = np.where(skill.value < _LOWEST, np.nan, skill.value)
    ax.fill_between(x[:-1], low[:-1], high[:-1], color=colour, alpha=0.2, linewidth=0)
    ax.plot(x[:-1], shown[:-1], linewidth=1.5, color=colour, **how)
    if np.isfinite(low[-1]):
        ax.vlines(x[-1:], low[-1:], high[-1:], color=colour, alpha=0.4, linewidth=4)
    if np.isfinite(shown[-1]):  # a lone NaN would be laid out at the corner of the page
        ax.plot(x[-1:], shown[-1:], marker="D", markersize=4, color=colour)
