"""Atari games, prepared as agents are trained on them."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trdlab.atari.environments import AtariEnvironments
    from trdlab.atari.game import AtariGame
    from trdlab.atari.names import find_game, game_names

__all__ = ["AtariEnvironments", "AtariGame", "find_game", "game_names"]

_HOMES = {
    "AtariEnvironments": "trdlab.atari.environments",
    "AtariGame": "trdlab.atari.game",
    "find_game": "trdlab.atari.names",
    "game_names": "trdlab.atari.names",
}


def __getattr__(name: str) -> object:
    """Imports what needs ale-py when it is first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module 'trdlab.atari' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
