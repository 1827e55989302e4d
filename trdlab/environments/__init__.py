"""Environments as an agent acts in them: B at a time, ends told exactly, restorable to the bit."""

from typing import TYPE_CHECKING

from trdlab.environments.protocol import (
    CopyableEnvironments,
    Environments,
    NotCopyable,
    NotParallel,
    NotReproducible,
    Padding,
    Step,
)
from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.environments.batches import in_batches
    from trdlab.environments.gym import GymEnvironments
    from trdlab.environments.making import make_environment

__all__ = [
    "CopyableEnvironments",
    "Environments",
    "GymEnvironments",
    "NotCopyable",
    "NotParallel",
    "NotReproducible",
    "Padding",
    "Step",
    "in_batches",
    "make_environment",
]

_HOMES = {
    "in_batches": "batches",
    "GymEnvironments": "gym",
    "make_environment": "making",
}

__getattr__ = lazily(__name__, _HOMES)
