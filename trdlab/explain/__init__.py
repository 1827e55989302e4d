"""Explanations: an Estimator's decompositions in, findings with their evidence out."""

from trdlab.explain.contrast import contrast, what_would_flip
from trdlab.explain.explanation import Explanation, explain
from trdlab.explain.findings import Finding
from trdlab.explain.flips import find_flips
from trdlab.explain.forecast import forecast
from trdlab.explain.moment import Moment, WhatIf
from trdlab.explain.tabular import gridworld_moment, tabular_moment

__all__ = [
    "Explanation",
    "Finding",
    "Moment",
    "WhatIf",
    "contrast",
    "explain",
    "find_flips",
    "forecast",
    "gridworld_moment",
    "tabular_moment",
    "what_would_flip",
]
