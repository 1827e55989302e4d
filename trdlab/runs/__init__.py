"""A run on disk: a folder with its configuration, what it was made with, metrics, checkpoints.

Nothing here imports torch, and nothing that is read is ever executed.
"""

from trdlab.runs.checkpoint import (
    Checkpoint,
    best_step,
    checkpoint_steps,
    find_checkpoint,
    load_checkpoint,
    read_arrays,
    save_checkpoint,
)
from trdlab.runs.config import read_config, to_toml
from trdlab.runs.folder import RunFolder
from trdlab.runs.listing import RunSummary, list_runs
from trdlab.runs.metrics import MetricsFile, read_metrics

__all__ = [
    "Checkpoint",
    "MetricsFile",
    "RunFolder",
    "RunSummary",
    "best_step",
    "checkpoint_steps",
    "find_checkpoint",
    "list_runs",
    "load_checkpoint",
    "read_arrays",
    "read_config",
    "read_metrics",
    "save_checkpoint",
    "to_toml",
]
