"""The pictures of a command in a folder: none of them over an old one, and each of them whole."""

from collections.abc import Collection
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from trdlab.errors import OutputError
from trdlab.files import check_output, write_whole

_CURE = "Choose another `out`."


def check_pictures(paths: Collection[Path]) -> None:
    """Checks that pictures can be written, before any work is done for them.

    Args:
        paths: all in folders that are made if there are none.

    Raises:
        OutputError: one of them exists, or cannot be written.
    """
    for path in paths:
        folder = path.parent
        if folder.exists() and not folder.is_dir():
            raise OutputError(f"'{folder}' is a file.", "Name a folder for the pictures.")
        if path.exists():
            raise OutputError(f"The picture '{path}' exists.", _CURE)
        if folder.is_dir():
            check_output(path, (".png",))


def write_picture(figure: Figure, path: Path) -> None:
    """Writes a picture, and makes its folder if there is none.

    Raises:
        OutputError: it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"Cannot make the folder '{path.parent}': {reason}.", _CURE) from error
    write_whole(path, partial(figure.savefig, dpi=160))
