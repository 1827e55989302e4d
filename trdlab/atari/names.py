"""What Atari games are called."""

import re
from functools import cache

from ale_py.roms import get_all_rom_ids

from trdlab.errors import InputError, closest

# ale-py brings them along, but they need two players, and Gymnasium does not register them.
_FOR_TWO = {"combat", "joust", "maze_craze", "warlords"}
_GYM_ID = re.compile(r"(?:ALE/)?(.+?)(?:NoFrameskip|Deterministic)?(?:-v\d+)?", re.IGNORECASE)


@cache
def game_names() -> tuple[str, ...]:
    """Returns the games that there are, by the names that Gymnasium gives them.

    >>> len(game_names()), game_names()[:3]
    (104, ('Adventure', 'AirRaid', 'Alien'))
    """
    return tuple(sorted(_title(rom) for rom in get_all_rom_ids() if rom not in _FOR_TWO))


def find_game(name: str) -> str:
    """Returns the name of the game that is meant, however it is written.

    Of Gymnasium's ids only the game is read, not the settings that they stand for.

    Raises:
        InputError: there is no such game.

    >>> [find_game(name) for name in ("MS_PACMAN", "ALE/MsPacman-v5", "MsPacmanNoFrameskip-v4")]
    ['MsPacman', 'MsPacman', 'MsPacman']
    """
    match = _GYM_ID.fullmatch(name.strip())
    games = {title.lower(): title for title in game_names()}
    found = games.get(re.sub(r"[\s_-]", "", match[1]).lower()) if match else None
    if found is None:
        cure = closest(match[1] if match else name, game_names())
        raise InputError(
            f"There is no Atari game '{name}'.",
            cure
            if cure.startswith("Did you mean")
            else "Known are, for example, Breakout, Pong "
            "and SpaceInvaders; trdlab.atari.game_names() lists all.",
        )
    return found


def rom_name(game: str) -> str:
    """Returns what ale-py calls the ROM of a game.

    >>> rom_name("MsPacman")
    'ms_pacman'
    """
    return next(rom for rom in get_all_rom_ids() if _title(rom) == game)


def _title(rom: str) -> str:
    return rom.title().replace("_", "")
