"""Explanations: an Estimator's decompositions in, claims with their numbers and words out."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.explanations.assessment import assess as assess
    from trdlab.explanations.assessment import moment_at as moment_at
    from trdlab.explanations.calibration.report import CalibrationReport as CalibrationReport
    from trdlab.explanations.calibration.report import judge as judge
    from trdlab.explanations.comparison.comparison import Comparison as Comparison
    from trdlab.explanations.comparison.comparison import compare as compare
    from trdlab.explanations.explanation import Explanation as Explanation
    from trdlab.explanations.explanation import explain as explain
    from trdlab.explanations.moment.exact import gridworld_moment as gridworld_moment
    from trdlab.explanations.moment.exact import tabular_moment as tabular_moment
    from trdlab.explanations.moment.moment import Moment as Moment
    from trdlab.explanations.moment.moment import moment_of as moment_of
    from trdlab.explanations.moment.outcome import Trial as Trial
    from trdlab.explanations.rules import Claim as Claim
    from trdlab.explanations.rules import UnsupportedSentenceError as UnsupportedSentenceError
    from trdlab.explanations.rules import check as check
    from trdlab.explanations.solved import SolvedState as SolvedState
    from trdlab.explanations.solved import solve_state as solve_state
else:
    __getattr__ = lazily(__name__)
