"""Packages whose names are imported when they are first asked for."""

from collections.abc import Callable, Mapping
from importlib import import_module


def lazily(package: str, names: Mapping[str, str]) -> Callable[[str], object]:
    """Returns the `__getattr__` of a package that imports a name from the module it lives in.

    Type checkers do not see it: for them the package imports the same names under `TYPE_CHECKING`.

    Args:
        package: its full name.
        names: those of each module within the package, with spaces between.

    >>> lazily("trdlab", {"time_axis": "TimeAxis"})("TimeAxis").__name__
    'TimeAxis'
    """
    homes = {name: module for module, some in names.items() for name in some.split()}

    def find(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return find
