"""All runs in a folder, at a glance."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from trdlab.errors import TrdlabError
from trdlab.runs.checkpoint import checkpoint_steps
from trdlab.runs.folder import RunFolder, is_fit, run_paths
from trdlab.runs.lock import holder
from trdlab.runs.metrics import last_metrics


@dataclass(frozen=True)
class RunSummary:
    """What is known of a run without loading it.

    Args:
        path: its folder.
        config: what it was told to do.
        started: when it began, in ISO 8601.
        metrics: its last line of metrics; empty if there is none yet.
        step: of its newest checkpoint, in agent steps; None if there is none yet.
        is_fit: whether it is a fit.
        pid: the process that trains it, 0 if its number is not known, None if there is none.
        fault: why the rest is not known; None if all is well.
    """

    path: Path
    config: dict[str, Any] = field(default_factory=dict)
    started: str | None = None
    metrics: dict[str, Any] = field(default_factory=dict)
    step: int | None = None
    is_fit: bool = False
    pid: int | None = None
    fault: str | None = None


def list_runs(parent: Path) -> list[RunSummary]:
    """Returns a summary of each run in `parent`, by name; a torn one has a row that says so."""
    return [_summary(path) for path in run_paths(parent)]


def _summary(path: Path) -> RunSummary:
    known: dict[str, Any] = {}
    try:
        known["pid"] = holder(path)
        run = RunFolder.open(path)
        known |= {"config": run.config, "started": run.manifest.get("started")}
        known["is_fit"] = is_fit(path)
        known["step"] = max(checkpoint_steps(run), default=None)
        if run.metrics.exists():
            known["metrics"] = last_metrics(run.metrics)
    except (TrdlabError, OSError) as error:
        known["fault"] = str(error)
    return RunSummary(path, **known)
