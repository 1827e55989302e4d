"""Learning curves: metrics in, lines on axes out."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from trdlab.files import write_whole
from trdlab.runs import read_metrics


def learning_curves(
    ax: Axes, runs: Mapping[str, Sequence[Mapping[str, Any]]], *, value: str = "score"
) -> Axes:
    """Draws a line for each run: a metric against the agent steps.

    Args:
        ax: where to draw.
        runs: lines of metrics (see `trdlab.runs.read_metrics`) by what to call the run.
        value: which metric; lines that do not have it are left out.
    """
    for name, rows in runs.items():
        told = [row for row in rows if row.get(value) is not None]
        ax.plot([row["agent_steps"] for row in told], [row[value] for row in told], label=name)
    ax.set_xlabel("agent steps")
    ax.set_ylabel("mean return of the last 100 episodes" if value == "score" else value)
    ax.xaxis.set_major_formatter(lambda steps, _: f"{steps:,.0f}")
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(alpha=0.3)
    if runs:
        ax.legend(frameon=False)
    return ax


def save_learning_curves(folders: Sequence[Path], path: Path) -> None:
    """Writes a picture of the scores of some runs.

    Args:
        folders: of the runs; one without metrics is left out.
        path: the picture.

    Raises:
        OutputError: it cannot be written.
        TrdlabError: a file of metrics is torn.
    """
    from matplotlib.figure import Figure

    files = {folder.name: folder / "metrics.jsonl" for folder in folders}
    rows = {name: read_metrics(file) for name, file in files.items() if file.exists()}
    figure = Figure(figsize=(8, 4.5), layout="constrained")
    learning_curves(figure.add_subplot(), rows)
    write_whole(path, lambda temporary: figure.savefig(temporary, dpi=150))
