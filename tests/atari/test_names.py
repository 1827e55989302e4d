"""Games are found however they are written."""

import pytest

from trdlab.atari.names import find_game, game_names, rom_name
from trdlab.errors import InputError


@pytest.mark.parametrize(
    ("written", "game"),
    [
        ("Breakout", "Breakout"),
        ("breakout", "Breakout"),
        ("BREAKOUT", "Breakout"),
        ("space_invaders", "SpaceInvaders"),
        ("SpaceInvaders", "SpaceInvaders"),
        ("space invaders", "SpaceInvaders"),
        ("MsPacman", "MsPacman"),
        ("ms-pacman", "MsPacman"),
        ("ALE/Breakout-v5", "Breakout"),
        ("BreakoutNoFrameskip-v4", "Breakout"),
        ("SpaceInvadersDeterministic-v4", "SpaceInvaders"),
        ("Pong-v0", "Pong"),
        ("TicTacToe3D", "TicTacToe3D"),
    ],
)
def test_written_like_this(written, game):
    assert find_game(written) == game


def test_every_name_is_found_and_has_a_rom():
    for name in game_names():
        assert find_game(name) == find_game(name.lower()) == find_game(rom_name(name)) == name


@pytest.mark.parametrize(
    ("written", "cure"),
    [
        ("Brekout", "There is no Atari game 'Brekout'. Did you mean 'Breakout'?"),
        ("ALE/SpaceInvader-v5", "Did you mean 'SpaceInvaders'?"),
        ("Breakout-ram-v4", "Did you mean 'Breakout'?"),
        ("CartPole-v1", "for example, Breakout, Pong and SpaceInvaders"),
        ("combat", "There is no Atari game 'combat'."),  # its ROM needs two players
        ("", "There is no Atari game ''."),
    ],
)
def test_refused_with_the_nearest(written, cure):
    with pytest.raises(InputError) as refusal:
        find_game(written)
    assert cure in str(refusal.value)
