"""Finite models: solved exactly, and learned from samples."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily
from trdlab.tabular.mdp import MDP as MDP
from trdlab.tabular.solve import Solution as Solution
from trdlab.tabular.solve import Ties as Ties
from trdlab.tabular.solve import evaluate as evaluate
from trdlab.tabular.solve import improved as improved
from trdlab.tabular.solve import optimal as optimal
from trdlab.tabular.table import ExactTable as ExactTable
from trdlab.tabular.table import exact as exact
from trdlab.tabular.totals import undiscounted_totals as undiscounted_totals

if TYPE_CHECKING:
    from trdlab.tabular.environments import from_environment as from_environment
    from trdlab.tabular.episodes import ModelEnvironments as ModelEnvironments
    from trdlab.tabular.learned import LearnedTable as LearnedTable
    from trdlab.tabular.learning import learn as learn
    from trdlab.tabular.models import from_arrays as from_arrays
    from trdlab.tabular.named import Coordinate as Coordinate
    from trdlab.tabular.named import TabularWorld as TabularWorld
    from trdlab.tabular.operator import OperatorTable as OperatorTable
    from trdlab.tabular.operator import operator_table as operator_table
    from trdlab.tabular.toytext import make_world as make_world
    from trdlab.tabular.toytext import tabular_world as tabular_world
    from trdlab.tabular.uncertainty import Spread as Spread
    from trdlab.tabular.uncertainty import outcomes as outcomes
    from trdlab.tabular.uncertainty import spread as spread
    from trdlab.tabular.windows import WindowBuilder as WindowBuilder
    from trdlab.tabular.windows import Windows as Windows
else:
    __getattr__ = lazily(__name__)
