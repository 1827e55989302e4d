"""What all tests of training share."""

import os
from collections.abc import Iterator

import pytest
import torch


@pytest.fixture(autouse=True, scope="module")
def _the_power_is_not_cut() -> Iterator[None]:
    """Waiting for the disk takes most of the time here; see `tests/runs`, which do likewise."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda number: None)
        yield


@pytest.fixture(autouse=True, scope="module")
def _threads() -> Iterator[None]:
    """Runs set the number of threads for the whole process."""
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)
