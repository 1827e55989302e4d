"""What people and random actions reach in Atari games, as it was published."""

HUMAN = {
    "Breakout": (1.7, 31.8),
    "MsPacman": (307.3, 15_693.0),
    "Pong": (-20.7, 9.3),
    "Riverraid": (1_339.0, 13_513.0),
    "Seaquest": (68.4, 20_182.0),
    "SpaceInvaders": (148.0, 1_652.0),
}
"""The mean score of random actions and that of a person, by game.

Source: Mnih et al. (2015), extended data table 2. The person saw 60 frames a second, and games
began in another way than here: it is a measure, not a match.
"""


def human_normalised(game: str, score: float) -> float | None:
    """Returns (score − random) / (human − random); None where no scores were published.

    Args:
        game: as `find_game` returns it.
        score: the mean, raw.

    >>> human_normalised("Breakout", 31.8), human_normalised("Pong", -20.7)
    (1.0, 0.0)
    """
    if game not in HUMAN:
        return None
    random, human = HUMAN[game]
    return (score - random) / (human - random)
