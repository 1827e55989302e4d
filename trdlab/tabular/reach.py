"""Which states can follow which."""

import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.tabular.mdp import MDP, SMALL


def reached(begin: BoolArray, sources: IntArray, targets: IntArray) -> BoolArray:
    """Returns `[S]`: the states in `begin [S]`, and all that edges lead to from there.

    With sources and targets exchanged it tells from where `begin` can be reached.
    """
    if len(begin) > SMALL:
        return _searched(begin, sources, targets)
    found, size = begin.copy(), -1
    while found.sum() != size:
        size = int(found.sum())
        found[targets[found[sources]]] = True
    return found


def _searched(begin: BoolArray, sources: IntArray, targets: IntArray) -> BoolArray:
    """Returns what `reached` does, by a search of each edge once."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import breadth_first_order

    size, first = len(begin), np.flatnonzero(begin)  # a state of its own leads to all of these
    rows = np.concatenate([sources, np.full(len(first), size)])
    edges = (np.ones(len(rows), dtype=np.int8), (rows, np.concatenate([targets, first])))
    order = breadth_first_order(
        csr_array(edges, (size + 1, size + 1)), size, return_predecessors=False
    )
    found = np.zeros(size + 1, dtype=np.bool_)
    found[order] = True
    return found[:-1]


def reachable(mdp: MDP, starts: BoolArray | None = None) -> BoolArray:
    """Returns `[S]`: the states in which an episode can go on that began in one of `starts [S]`.

    A state in which it is over does not count. Without `starts` it begins in the model's own.
    """
    if starts is None:
        starts = np.arange(mdp.num_states) == mdp.start
    goes_on = mdp.continuation > 0.0
    return reached(starts, mdp.transition_states[goes_on], mdp.next_states[goes_on])
