"""What all tests of run folders share."""

import os
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="module")
def _the_power_is_not_cut() -> Iterator[None]:
    """Waiting for the disk takes most of the time here, and changes nothing that a test can see.

    That everything is waited for is tested with `trdlab.files`.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda number: None)
        yield
