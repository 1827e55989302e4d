"""Learning curves: metrics in, lines on axes out."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from trdlab.runs import read_metrics
from trdlab.show.plots import style

_SHADES = LinearSegmentedColormap.from_list("agents", style.AGENTS)
_LINES = ("-", "--", ":", "-.")


def learning_curves(
    ax: Axes, runs: Mapping[str, Sequence[Mapping[str, Any]]], *, value: str = "score"
) -> Axes:
    """Draws a line for each run: a metric against the agent steps.

    Args:
        ax: where to draw.
        runs: lines of metrics (see `trdlab.runs.read_metrics`) by what to call the run.
        value: which metric; lines that do not have it are left out, and those of a teacher.
    """
    for i, (name, rows) in enumerate(runs.items()):
        own = [row for row in rows if row.get("phase", "online") == "online"]
        told = [(row["agent_steps"], row[value]) for row in own if row.get(value) is not None]
        steps, values = zip(*told, strict=True) if told else ((), ())
        shade, marker = _SHADES(i / max(len(runs) - 1, 1)), "o" if len(told) == 1 else ""
        ax.plot(steps, values, _LINES[i % 4], color=shade, marker=marker, label=name)
    ax.set(xlabel="agent steps", ylabel=value)
    ax.xaxis.set_major_formatter(EngFormatter(sep=""))
    ax.grid(axis="y", alpha=0.3)
    return style.tidy(ax)


@style.settings()
def curves_figure(folders: Sequence[Path]) -> Figure:
    """Returns the picture of the scores of the runs in some folders, of those with metrics.

    Raises:
        TrdlabError: a file of metrics is torn.
    """
    files = {folder.name: folder / "metrics.jsonl" for folder in folders}
    rows = {name: read_metrics(file) for name, file in files.items() if file.exists()}
    figure = style.new_figure(3.6 + 0.2 * len(rows))
    ax = learning_curves(figure.subplots(), rows)
    lines, _ = ax.get_legend_handles_labels()
    style.add_legend(figure, lines, "score: mean return of the last 100 episodes")
    return figure
