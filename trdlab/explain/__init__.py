"""Explanations: an Estimator's decompositions in, findings with their evidence out."""

from trdlab.explain.explanation import Explanation, explain
from trdlab.explain.finding import Finding
from trdlab.explain.flips import find_flips
from trdlab.explain.moment import Moment, Uncertainty, WhatIf, moment_of
from trdlab.explain.tabular import gridworld_moment, tabular_moment

__all__ = [
    "Explanation",
    "Finding",
    "Moment",
    "Uncertainty",
    "WhatIf",
    "explain",
    "find_flips",
    "gridworld_moment",
    "moment_of",
    "tabular_moment",
]
