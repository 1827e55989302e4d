"""Finite models: solved exactly, and learned from samples."""

from typing import TYPE_CHECKING

from trdlab.tabular.mdp import MDP
from trdlab.tabular.solve import Solution, Ties, evaluate, improved, optimal, undiscounted_totals
from trdlab.tabular.table import ExactTable, exact

if TYPE_CHECKING:
    from trdlab.tabular.learned import LearnedTable
    from trdlab.tabular.learning import learn
    from trdlab.tabular.operator import OperatorTable, operator_table
    from trdlab.tabular.windows import WindowBuilder, Windows

__all__ = [
    "MDP",
    "ExactTable",
    "LearnedTable",
    "OperatorTable",
    "Solution",
    "Ties",
    "WindowBuilder",
    "Windows",
    "evaluate",
    "exact",
    "improved",
    "learn",
    "operator_table",
    "optimal",
    "undiscounted_totals",
]

_HOMES = {
    "LearnedTable": "trdlab.tabular.learned",
    "learn": "trdlab.tabular.learning",
    "OperatorTable": "trdlab.tabular.operator",
    "operator_table": "trdlab.tabular.operator",
    "WindowBuilder": "trdlab.tabular.windows",
    "Windows": "trdlab.tabular.windows",
}


def __getattr__(name: str) -> object:
    """Imports what concerns learning when it is first asked for: the exact solver starts faster."""
    if name not in _HOMES:
        raise AttributeError(f"module 'trdlab.tabular' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
