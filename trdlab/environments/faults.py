"""What an environment does wrong while it is stepped: said once, for whoever steps it."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.environments.protocol import Frames
from trdlab.errors import TrdlabError


class EnvironmentFault(TrdlabError):  # noqa: N818  EnvironmentError is another name of OSError
    """An environment raised an error, or gave what is no number."""


@contextmanager
def blamed(when: str) -> Iterator[None]:
    """Tells errors that an environment raises from our own, and from those of writing files.

    Args:
        when: it happened, to go on with after "The environment failed".

    Raises:
        EnvironmentFault: something else than a `TrdlabError` was raised.

    >>> with blamed("at agent step 7"):
    ...     raise BrokenPipeError(32, "the simulator has gone")
    Traceback (most recent call last):
    trdlab.environments.faults.EnvironmentFault: The environment failed at agent step 7 \
(BrokenPipeError: [Errno 32] the simulator has gone). Correct it.
    """
    try:
        yield
    except TrdlabError:
        raise
    except Exception as error:
        reason = ": ".join(filter(None, (type(error).__name__, str(error))))
        raise EnvironmentFault(f"The environment failed {when} ({reason}).", "Correct it.") from (
            error
        )


def check_finite(name: str, values: Frames | FloatArray, when: str) -> None:
    """Refuses numbers that would spoil a network now, or later out of a memory.

    Args:
        name: what they are.
        values: of any shape.
        when: they were given.

    Raises:
        EnvironmentFault: one is not finite.
    """
    finite = np.isfinite(values)
    if not finite.all():
        raise EnvironmentFault(
            f"The environment gave the {name} {values[~finite][0]} {when}. Nothing was learned "
            "from it.",
            "Correct the environment.",
        )
