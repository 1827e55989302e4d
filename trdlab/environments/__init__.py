"""Environments as an agent acts in them: B at a time, ends told exactly, restorable to the bit."""

from typing import TYPE_CHECKING

from trdlab.environments.protocol import Environments, NotReproducible, Padding, Step

if TYPE_CHECKING:
    from trdlab.environments.gym import GymEnvironments
    from trdlab.environments.making import make_environment

__all__ = [
    "Environments",
    "GymEnvironments",
    "NotReproducible",
    "Padding",
    "Step",
    "make_environment",
]

_HOMES = {
    "GymEnvironments": "trdlab.environments.gym",
    "make_environment": "trdlab.environments.making",
}


def __getattr__(name: str) -> object:
    """Imports what needs Gymnasium when it is first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module 'trdlab.environments' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
