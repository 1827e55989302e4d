"""Explanations: an Estimator's decompositions in, claims with their evidence and words out."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.explanations.assessment import assess, moment_at
    from trdlab.explanations.calibration.calibration import Calibration, calibrate
    from trdlab.explanations.calibration.ceiling import Ceiling
    from trdlab.explanations.calibration.report import CalibrationReport, judge
    from trdlab.explanations.calibration.trust import Trust
    from trdlab.explanations.claims import Finding
    from trdlab.explanations.comparison.compare import compare, find_pair
    from trdlab.explanations.comparison.report import Comparison
    from trdlab.explanations.episode.played import Played, play
    from trdlab.explanations.episode.revision import Revision, revise
    from trdlab.explanations.episode.story import Story, tell
    from trdlab.explanations.explained import Explained, explain_agent
    from trdlab.explanations.moment.exact import gridworld_moment, tabular_moment
    from trdlab.explanations.moment.explanation import Explanation, explain
    from trdlab.explanations.moment.moment import Moment, Uncertainty, WhatIf, moment_of
    from trdlab.explanations.moment.sensitivity import find_flips
    from trdlab.explanations.moment.sentences import check, sentence, sentences
    from trdlab.explanations.rules import UnsupportedSentenceError

__all__ = [
    "Calibration",
    "CalibrationReport",
    "Ceiling",
    "Comparison",
    "Explained",
    "Explanation",
    "Finding",
    "Moment",
    "Played",
    "Revision",
    "Story",
    "Trust",
    "Uncertainty",
    "UnsupportedSentenceError",
    "WhatIf",
    "assess",
    "calibrate",
    "check",
    "compare",
    "explain",
    "explain_agent",
    "find_flips",
    "find_pair",
    "gridworld_moment",
    "judge",
    "moment_at",
    "moment_of",
    "play",
    "revise",
    "sentence",
    "sentences",
    "tabular_moment",
    "tell",
]

_HOMES = {
    "Explanation": "moment.explanation",
    "explain": "moment.explanation",
    "Finding": "claims",
    "find_flips": "moment.sensitivity",
    "Moment": "moment.moment",
    "Uncertainty": "moment.moment",
    "WhatIf": "moment.moment",
    "moment_of": "moment.moment",
    "gridworld_moment": "moment.exact",
    "tabular_moment": "moment.exact",
    "compare": "comparison.compare",
    "find_pair": "comparison.compare",
    "Comparison": "comparison.report",
    "assess": "assessment",
    "moment_at": "assessment",
    "Calibration": "calibration.calibration",
    "calibrate": "calibration.calibration",
    "Ceiling": "calibration.ceiling",
    "Explained": "explained",
    "explain_agent": "explained",
    "Played": "episode.played",
    "play": "episode.played",
    "Revision": "episode.revision",
    "revise": "episode.revision",
    "Story": "episode.story",
    "tell": "episode.story",
    "CalibrationReport": "calibration.report",
    "judge": "calibration.report",
    "Trust": "calibration.trust",
    "UnsupportedSentenceError": "rules",
    "check": "moment.sentences",
    "sentence": "moment.sentences",
    "sentences": "moment.sentences",
}

__getattr__ = lazily(__name__, _HOMES)
