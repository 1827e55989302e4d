"""Finite models solved exactly: values, policies and decompositions."""

from trdlab.tabular.mdp import MDP
from trdlab.tabular.solve import Solution, evaluate, improved, optimal, undiscounted_totals
from trdlab.tabular.table import ExactTable, exact

__all__ = [
    "MDP",
    "ExactTable",
    "Solution",
    "evaluate",
    "exact",
    "improved",
    "optimal",
    "undiscounted_totals",
]
