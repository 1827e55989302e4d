"""ale-py's vector environment, made with what all of trdlab uses."""

import sys
from contextlib import redirect_stdout

import gymnasium as gym
import numpy as np

from trdlab.atari.names import rom_name
from trdlab.errors import InputError, TrdlabError

try:
    from ale_py import AtariVectorEnv
    from gymnasium.vector import AutoresetMode
except ImportError as _error:
    raise InputError(
        f"Atari games need Gymnasium 1.1 or later, and this is {gym.__version__}.",
        "Run: pip install 'gymnasium>=1.1'",
    ) from _error

SIDE = 84
STACK = 4
FRAMES_PER_SECOND = 60.0
FRAME = gym.spaces.Box(0, 255, (SIDE, SIDE), np.uint8)

_WIDTH, _HEIGHT = 160, 210  # of most screens
_TALL = (
    *("Adventure", "AirRaid", "KeystoneKapers", "KingKong", "Klax", "LaserGates", "MrDo"),
    *("Pacman", "SirLancelot", "SpaceWar"),
)
_HEIGHTS = {  # of the others: ale-py's vector environment does not tell them
    **dict.fromkeys(_TALL, 250),
    "Carnival": 214,
    "JourneyEscape": 230,
    "Pooyan": 220,
}


def screen_shape(game: str) -> tuple[int, int, int]:
    """Returns the shape of the whole screen of a game in colour.

    Args:
        game: as `find_game` returns it.

    >>> screen_shape("Breakout"), screen_shape("AirRaid")
    ((210, 160, 3), (250, 160, 3))
    """
    return _HEIGHTS.get(game, _HEIGHT), _WIDTH, 3


def make_vector(
    game: str,
    num_envs: int,
    *,
    stack: int,
    sticky: float,
    noop_max: int,
    max_frames: int,
    frame_skip: int,
    full_action_space: bool,
    colour: bool = False,
) -> AtariVectorEnv:
    """Returns `num_envs` games that pay raw rewards and end where the game does.

    Frames are grey, 84×84, the maximum of the last two of those that are skipped. A lost life is
    not reported as an end: read it from `info["lives"]`.

    Args:
        game: as `find_game` returns it.
        num_envs: how many.
        stack: how many frames an observation has.
        sticky: the probability that the last action is repeated in place of the one given.
        noop_max: episodes begin with fewer than so many idle frames (and FIRE, where there is one).
        max_frames: of the emulator, after which an episode is truncated.
        frame_skip: for how many frames an action is held.
        full_action_space: all 18 actions, in place of those that the game knows.
        colour: frames are whole screens in colour, the last of those that are skipped.

    Raises:
        InputError: a value is out of its range.
        TrdlabError: the ROM cannot be read.
    """
    if not 0.0 <= sticky < 1.0:
        raise InputError(f"The sticky probability is {sticky}.", "It lies from 0 to below 1.")
    counts = {
        "noop_max": (noop_max, 0),
        "max_frames": (max_frames, 1),
        "frame_skip": (frame_skip, 1),
    }
    for name, (value, least) in counts.items():
        if value < least:
            raise InputError(f"The value of {name} is {value}.", f"It is at least {least}.")
    height, width = screen_shape(game)[:2] if colour else (SIDE, SIDE)
    try:
        with redirect_stdout(sys.stderr):  # where ale-py says that it found ALE_ROMS_DIR
            return AtariVectorEnv(
                rom_name(game),
                num_envs,
                stack_num=stack,
                img_height=height,
                img_width=width,
                grayscale=not colour,
                maxpool=not colour,
                reward_clipping=False,
                # This would reset the whole game at each lost life, and life_loss_info would
                # report lost lives and the end of the game by one and the same flag.
                episodic_life=False,
                life_loss_info=False,
                use_fire_reset=True,
                noop_max=noop_max,
                max_num_frames_per_episode=max_frames,
                frameskip=frame_skip,
                repeat_action_probability=sticky,
                full_action_space=full_action_space,
                autoreset_mode=AutoresetMode.NEXT_STEP,
            )
    except OSError as error:
        raise TrdlabError(
            f"The ROM of {game} cannot be read: {error}.",
            "Install ale-py anew, or unset ALE_ROMS_DIR.",
        ) from error


def action_names(envs: AtariVectorEnv) -> tuple[str, ...]:
    """Returns A names, such as `("NOOP", "FIRE", "RIGHT", "LEFT")`."""
    return tuple(action.name for action in envs.ale.get_action_set())
