"""Whatever environments print goes to stderr: stdout is for results."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout


@contextmanager
def aside() -> Iterator[None]:
    """Sends to stderr what Python code prints within, also as a decorator.

    What a library written in C prints by itself goes its own way. A microsecond each time.

    >>> with aside():
    ...     print("new episode")
    """
    with redirect_stdout(sys.stderr):
        yield
