"""Packages whose names are imported when they are first asked for."""

import ast
import inspect
from collections.abc import Callable
from functools import cache
from importlib import import_module


def lazily(package: str) -> Callable[[str], object]:
    """Returns the `__getattr__` of a package that imports a name from the module it lives in.

    The names are those that the package imports for type checkers, under `TYPE_CHECKING`: there
    they are said, once. They are read from its source, as SPEC 1 of Scientific Python does.

    >>> lazily("trdlab")("TimeAxis").__name__
    'TimeAxis'
    """

    def find(name: str) -> object:
        home = None if name.startswith("__") else _homes(package).get(name)
        if home is None:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        return getattr(import_module(home), name)

    return find


@cache
def _homes(package: str) -> dict[str, str]:
    """Returns the module of each name that a package imports for type checkers."""
    imports = [
        line
        for block in ast.parse(inspect.getsource(import_module(package))).body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for line in block.body
        if isinstance(line, ast.ImportFrom)
    ]
    return {alias.name: str(line.module) for line in imports for alias in line.names}
