"""Atari games, prepared as agents are trained on them."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.atari.environments import AtariEnvironments
    from trdlab.atari.game import AtariGame
    from trdlab.atari.names import find_game, game_names

__all__ = ["AtariEnvironments", "AtariGame", "find_game", "game_names"]

_HOMES = {
    "AtariEnvironments": "environments",
    "AtariGame": "game",
    "find_game": "names",
    "game_names": "names",
}

__getattr__ = lazily(__name__, _HOMES)
