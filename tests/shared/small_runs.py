"""Runs that take a second or two."""

from pathlib import Path
from typing import Any

import torch

from trdlab.deep.settings import TrainSettings
from trdlab.training.run import begin, carry_on


def train(out: Path, env: str, **lines: Any) -> Path:
    """Trains into `out`, and returns it; a run sets the number of threads, which is put back."""
    threads = torch.get_num_threads()
    with begin(TrainSettings("gym", env).changed({"learning_starts": 100} | lines), out) as run:
        carry_on(run)
    torch.set_num_threads(threads)
    return out
