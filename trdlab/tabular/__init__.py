"""Finite models: solved exactly, and learned from samples."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily
from trdlab.tabular.mdp import MDP
from trdlab.tabular.solve import Solution, Ties, evaluate, improved, optimal
from trdlab.tabular.table import ExactTable, exact
from trdlab.tabular.totals import undiscounted_totals

if TYPE_CHECKING:
    from trdlab.tabular.environments import from_environment
    from trdlab.tabular.episodes import ModelEnvironments
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
    "ModelEnvironments",
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
    "Coordinate": "named",
    "TabularWorld": "named",
    "from_arrays": "models",
    "from_environment": "environments",
    "make_world": "toytext",
    "tabular_world": "toytext",
    "ModelEnvironments": "episodes",
    "LearnedTable": "learned",
    "learn": "learning",
    "OperatorTable": "operator",
    "operator_table": "operator",
    "Spread": "uncertainty",
    "outcomes": "uncertainty",
    "spread": "uncertainty",
    "WindowBuilder": "windows",
    "Windows": "windows",
}

__getattr__ = lazily(__name__, _HOMES)
