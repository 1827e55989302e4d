"""Packages whose names are imported when they are first asked for."""

from collections.abc import Callable, Mapping
from importlib import import_module


def lazily(package: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """Returns the `__getattr__` of a package that imports a name from its home.

    Args:
        package: its full name.
        homes: the module within the package that each name lives in.

    >>> lazily("trdlab", {"TimeAxis": "time_axis"})("TimeAxis").__name__
    'TimeAxis'
    """

    def find(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return find
