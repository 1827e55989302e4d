"""Playing: episodes, copies of a moment, what really came, and how well an agent does."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.rollouts.branches import Branches, Branching, Copying
    from trdlab.rollouts.counterfactual import Counterfactual
    from trdlab.rollouts.episodes import Episode, Recording, collect
    from trdlab.rollouts.evaluation import Evaluation, evaluate
    from trdlab.rollouts.playing import Playing

__all__ = [
    "Branches",
    "Branching",
    "Copying",
    "Counterfactual",
    "Episode",
    "Evaluation",
    "Playing",
    "Recording",
    "collect",
    "evaluate",
]

_HOMES = {
    "Branches": "branches",
    "Branching": "branches",
    "Copying": "branches",
    "Counterfactual": "counterfactual",
    "Episode": "episodes",
    "Playing": "playing",
    "Recording": "episodes",
    "collect": "episodes",
    "Evaluation": "evaluation",
    "evaluate": "evaluation",
}

__getattr__ = lazily(__name__, _HOMES)
