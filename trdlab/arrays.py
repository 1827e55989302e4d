"""The array types that signatures name, trees of them, and when two numbers are the same one."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.floating[Any]]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

RELATIVE_ZERO = 1e-12
"""Two computed numbers closer than this, relative to the larger, are the same number."""


def same(a: float, b: float) -> bool:
    """Returns whether two computed numbers are the same up to rounding.

    >>> same(0.1 + 0.2, 0.3), same(0.0, 1e-300)
    (True, False)
    """
    return abs(a - b) <= RELATIVE_ZERO * max(abs(a), abs(b))


def difference(a: npt.ArrayLike, b: npt.ArrayLike) -> FloatArray:
    """Returns a − b `[...]`, exactly 0 where the two are the same up to rounding.

    >>> difference([0.1 + 0.2, 2.0], [0.3, 1.0]).tolist()
    [0.0, 1.0]
    """
    apart, least = np.subtract(a, b), RELATIVE_ZERO * np.maximum(np.abs(a), np.abs(b))
    return np.where(np.abs(apart) <= least, 0.0, apart)


def map_leaves(function: Callable[[Any], Any], tree: Any) -> Any:
    """Returns a tree with a function applied to each of its arrays; None stays None.

    Args:
        function: from an array to anything.
        tree: an array, None, or a dict, list or tuple of trees.

    >>> map_leaves(lambda leaf: leaf[[1]], {"h": np.array([3, 4]), "c": (np.array([5, 6]), None)})
    {'h': array([4]), 'c': (array([6]), None)}
    """
    if isinstance(tree, Mapping):
        return {key: map_leaves(function, leaf) for key, leaf in tree.items()}
    if isinstance(tree, list | tuple):
        leaves = [map_leaves(function, leaf) for leaf in tree]
        return leaves if isinstance(tree, list) else tuple(leaves)
    return None if tree is None else function(tree)


def one_sign(row: FloatArray) -> bool:
    """Returns whether shares and means of components make sense: one sign, and not all zero."""
    return bool(row.any() and ((row >= 0.0).all() or (row <= 0.0).all()))
