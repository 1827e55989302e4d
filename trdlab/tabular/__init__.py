"""Finite models: solved exactly, and learned from samples."""

from typing import TYPE_CHECKING

from trdlab.tabular.mdp import MDP
from trdlab.tabular.solve import Solution, Ties, evaluate, improved, optimal
from trdlab.tabular.table import ExactTable, exact
from trdlab.tabular.totals import undiscounted_totals

if TYPE_CHECKING:
    from trdlab.tabular.environments import from_environment
    from trdlab.tabular.learned import LearnedTable
    from trdlab.tabular.learning import learn
    from trdlab.tabular.models import from_arrays
    from trdlab.tabular.named import Coordinate, TabularWorld
    from trdlab.tabular.operator import OperatorTable, operator_table
    from trdlab.tabular.toytext import make_world, tabular_world
    from trdlab.tabular.uncertainty import Spread, outcomes, spread
    from trdlab.tabular.windows import WindowBuilder, Windows

__all__ = [
    "MDP",
    "Coordinate",
    "ExactTable",
    "LearnedTable",
    "OperatorTable",
    "Solution",
    "Spread",
    "TabularWorld",
    "Ties",
    "WindowBuilder",
    "Windows",
    "evaluate",
    "exact",
    "from_arrays",
    "from_environment",
    "improved",
    "learn",
    "make_world",
    "operator_table",
    "optimal",
    "outcomes",
    "spread",
    "tabular_world",
    "undiscounted_totals",
]

_HOMES = {
    "Coordinate": "trdlab.tabular.named",
    "TabularWorld": "trdlab.tabular.named",
    "from_arrays": "trdlab.tabular.models",
    "from_environment": "trdlab.tabular.environments",
    "make_world": "trdlab.tabular.toytext",
    "tabular_world": "trdlab.tabular.toytext",
    "LearnedTable": "trdlab.tabular.learned",
    "learn": "trdlab.tabular.learning",
    "OperatorTable": "trdlab.tabular.operator",
    "operator_table": "trdlab.tabular.operator",
    "Spread": "trdlab.tabular.uncertainty",
    "outcomes": "trdlab.tabular.uncertainty",
    "spread": "trdlab.tabular.uncertainty",
    "WindowBuilder": "trdlab.tabular.windows",
    "Windows": "trdlab.tabular.windows",
}


def __getattr__(name: str) -> object:
    """Imports what the exact solver does not need when it is first asked for: it starts faster."""
    if name not in _HOMES:
        raise AttributeError(f"module 'trdlab.tabular' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
