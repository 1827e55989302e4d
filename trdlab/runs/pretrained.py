"""Runs that come with trdlab: `pretrained:Breakout` names one wherever a run can be named."""

from pathlib import Path

from trdlab.errors import InputError, closest
from trdlab.runs.folder import is_run, run_paths

PRETRAINED = "pretrained:"
"""What the names of those runs begin with."""
SHIPPED = Path(__file__).parents[1] / "pretrained"
"""Where they lie."""


def pretrained_names() -> tuple[str, ...]:
    """Returns the games of which a trained agent comes with trdlab."""
    return tuple(path.name for path in run_paths(SHIPPED))


def pretrained_path(name: str) -> Path:
    """Returns the folder of a run that comes with trdlab, by its name with or without the prefix.

    Raises:
        InputError: there is none; the message says which there are.
    """
    game = name.removeprefix(PRETRAINED)
    path = SHIPPED / game
    if not game or path.parent != SHIPPED or not is_run(path):
        known = pretrained_names()
        cure = closest(game, known) if known else "None come with this installation."
        raise InputError(f"No trained agent '{game}' comes with trdlab.", cure)
    return path


def is_shipped(path: Path) -> bool:
    """Returns whether a folder is that of a run that comes with trdlab, and so is left as it is."""
    return path.parent == SHIPPED
