"""Atari games, prepared as agents are trained on them."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.atari.environments import AtariEnvironments as AtariEnvironments
    from trdlab.atari.game import AtariGame as AtariGame
    from trdlab.atari.names import find_game as find_game
    from trdlab.atari.names import game_names as game_names
    from trdlab.atari.views import GreyAndColour as GreyAndColour
else:
    __getattr__ = lazily(__name__)
