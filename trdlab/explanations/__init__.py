"""Explanations: an Estimator's decompositions in, claims with their numbers and words out."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.explanations.assessment import assess, moment_at, try_out
    from trdlab.explanations.calibration.calibration import Calibration, calibrate
    from trdlab.explanations.calibration.ceiling import Ceiling
    from trdlab.explanations.calibration.report import CalibrationReport, judge
    from trdlab.explanations.calibration.trust import Trust
    from trdlab.explanations.comparison.comparing import compare
    from trdlab.explanations.comparison.comparison import Comparison
    from trdlab.explanations.episode.played import Played
    from trdlab.explanations.episode.revision import Revision, revise
    from trdlab.explanations.episode.story import Story, tell
    from trdlab.explanations.explanation import Explanation, explain
    from trdlab.explanations.moment.exact import gridworld_moment, tabular_moment
    from trdlab.explanations.moment.moment import Choice, Moment, Uncertainty, WhatIf, moment_of
    from trdlab.explanations.moment.outcome import Trial
    from trdlab.explanations.moment.sensitivity import find_flips
    from trdlab.explanations.rules import Claim, UnsupportedSentenceError, check
    from trdlab.explanations.sections import Section
    from trdlab.explanations.solved import SolvedState, solve_gridworld, solve_tabular

__all__ = [
    "Calibration",
    "CalibrationReport",
    "Ceiling",
    "Choice",
    "Claim",
    "Comparison",
    "Explanation",
    "Moment",
    "Played",
    "Revision",
    "Section",
    "SolvedState",
    "Story",
    "Trial",
    "Trust",
    "Uncertainty",
    "UnsupportedSentenceError",
    "WhatIf",
    "assess",
    "calibrate",
    "check",
    "compare",
    "explain",
    "find_flips",
    "gridworld_moment",
    "judge",
    "moment_at",
    "moment_of",
    "revise",
    "solve_gridworld",
    "solve_tabular",
    "tabular_moment",
    "tell",
    "try_out",
]

_HOMES = {
    "Choice": "moment.moment",
    "Moment": "moment.moment",
    "Uncertainty": "moment.moment",
    "WhatIf": "moment.moment",
    "moment_of": "moment.moment",
    "gridworld_moment": "moment.exact",
    "tabular_moment": "moment.exact",
    "find_flips": "moment.sensitivity",
    "Claim": "rules",
    "UnsupportedSentenceError": "rules",
    "check": "rules",
    "Section": "sections",
    "SolvedState": "solved",
    "solve_gridworld": "solved",
    "solve_tabular": "solved",
    "compare": "comparison.comparing",
    "Comparison": "comparison.comparison",
    "assess": "assessment",
    "moment_at": "assessment",
    "try_out": "assessment",
    "Explanation": "explanation",
    "explain": "explanation",
    "Calibration": "calibration.calibration",
    "calibrate": "calibration.calibration",
    "Ceiling": "calibration.ceiling",
    "CalibrationReport": "calibration.report",
    "judge": "calibration.report",
    "Trust": "calibration.trust",
    "Trial": "moment.outcome",
    "Played": "episode.played",
    "Revision": "episode.revision",
    "revise": "episode.revision",
    "Story": "episode.story",
    "tell": "episode.story",
}

__getattr__ = lazily(__name__, _HOMES)
