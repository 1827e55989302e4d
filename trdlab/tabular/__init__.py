"""Finite models solved exactly: values, policies and decompositions."""

from trdlab.tabular.mdp import MDP
from trdlab.tabular.solve import Solution, Ties, evaluate, improved, optimal, undiscounted_totals
from trdlab.tabular.table import ExactTable, exact

__all__ = [
    "MDP",
    "ExactTable",
    "Solution",
    "Ties",
    "evaluate",
    "exact",
    "improved",
    "optimal",
    "undiscounted_totals",
]
