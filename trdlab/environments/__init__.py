"""Environments as an agent acts in them: B at a time, ends told exactly, restorable to the bit."""

from trdlab.environments.protocol import Environments, NotReproducible, Padding, Step

__all__ = ["Environments", "NotReproducible", "Padding", "Step"]
