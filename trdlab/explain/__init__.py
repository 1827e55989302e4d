"""Explanations: an Estimator's decompositions in, findings with their evidence out.

What plays episodes is imported when it is first asked for: it needs Gymnasium.
"""

from typing import TYPE_CHECKING

from trdlab.explain.explanation import Explanation, explain
from trdlab.explain.finding import Finding
from trdlab.explain.flips import find_flips
from trdlab.explain.moment import Moment, Uncertainty, WhatIf, moment_of
from trdlab.explain.tabular import gridworld_moment, tabular_moment
from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.explain.agents import Agent, find_agent, gridworld_agent, run_agent, tabular_agent
    from trdlab.explain.assessment import assess
    from trdlab.explain.branches import Branches, Branching, Copying
    from trdlab.explain.comparison.pair import compare, find_pair
    from trdlab.explain.comparison.report import Comparison
    from trdlab.explain.counterfactual import Counterfactual
    from trdlab.explain.episodes import Counting, Episode, collect
    from trdlab.explain.explained import Explained, explain_agent
    from trdlab.explain.playing import play_to
    from trdlab.explain.stories.played import Played, play
    from trdlab.explain.stories.revision import Revision, revise
    from trdlab.explain.stories.story import Story, tell
    from trdlab.explain.trust.calibration import Calibration, calibrate
    from trdlab.explain.trust.ceiling import Ceiling
    from trdlab.explain.trust.findings import trust_findings
    from trdlab.explain.trust.report import TrustReport, judge
    from trdlab.explain.trust.trusted import Trust

__all__ = [
    "Agent",
    "Branches",
    "Branching",
    "Calibration",
    "Ceiling",
    "Comparison",
    "Copying",
    "Counterfactual",
    "Counting",
    "Episode",
    "Explained",
    "Explanation",
    "Finding",
    "Moment",
    "Played",
    "Revision",
    "Story",
    "Trust",
    "TrustReport",
    "Uncertainty",
    "WhatIf",
    "assess",
    "calibrate",
    "collect",
    "compare",
    "explain",
    "explain_agent",
    "find_agent",
    "find_flips",
    "find_pair",
    "gridworld_agent",
    "gridworld_moment",
    "judge",
    "moment_of",
    "play",
    "play_to",
    "revise",
    "run_agent",
    "tabular_agent",
    "tabular_moment",
    "tell",
    "trust_findings",
]

_HOMES = {
    "Agent": "agents",
    "find_agent": "agents",
    "gridworld_agent": "agents",
    "run_agent": "agents",
    "tabular_agent": "agents",
    "compare": "comparison.pair",
    "find_pair": "comparison.pair",
    "Comparison": "comparison.report",
    "Copying": "branches",
    "assess": "assessment",
    "Branches": "branches",
    "Branching": "branches",
    "Calibration": "trust.calibration",
    "calibrate": "trust.calibration",
    "Ceiling": "trust.ceiling",
    "Counterfactual": "counterfactual",
    "play_to": "playing",
    "Counting": "episodes",
    "Episode": "episodes",
    "collect": "episodes",
    "Explained": "explained",
    "explain_agent": "explained",
    "Played": "stories.played",
    "play": "stories.played",
    "Revision": "stories.revision",
    "revise": "stories.revision",
    "Story": "stories.story",
    "tell": "stories.story",
    "trust_findings": "trust.findings",
    "TrustReport": "trust.report",
    "judge": "trust.report",
    "Trust": "trust.trusted",
}

__getattr__ = lazily(__name__, _HOMES)
