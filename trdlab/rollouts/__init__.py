"""Playing: episodes, copies of a moment, what really came, and how well an agent does."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.rollouts.branches import Branches, Branching, Copying
    from trdlab.rollouts.counterfactual import Counterfactual
    from trdlab.rollouts.episodes import Counting, Episode, collect
    from trdlab.rollouts.evaluation import Evaluation, evaluate
    from trdlab.rollouts.playing import play_to

__all__ = [
    "Branches",
    "Branching",
    "Copying",
    "Counterfactual",
    "Counting",
    "Episode",
    "Evaluation",
    "collect",
    "evaluate",
    "play_to",
]

_HOMES = {
    "Branches": "branches",
    "Branching": "branches",
    "Copying": "branches",
    "Counterfactual": "counterfactual",
    "Counting": "episodes",
    "Episode": "episodes",
    "collect": "episodes",
    "play_to": "playing",
    "Evaluation": "evaluation",
    "evaluate": "evaluation",
}

__getattr__ = lazily(__name__, _HOMES)
