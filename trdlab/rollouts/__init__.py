"""Playing: episodes, copies of a moment, what really came, and how well an agent does."""

from typing import TYPE_CHECKING

from trdlab.lazy import lazily

if TYPE_CHECKING:
    from trdlab.rollouts.branches import Branching as Branching
    from trdlab.rollouts.branches import Effort as Effort
    from trdlab.rollouts.critique import Critique as Critique
    from trdlab.rollouts.critique import critique_of as critique_of
    from trdlab.rollouts.episodes import Episode as Episode
    from trdlab.rollouts.episodes import Recording as Recording
    from trdlab.rollouts.episodes import collect as collect
    from trdlab.rollouts.evaluation import Evaluation as Evaluation
    from trdlab.rollouts.evaluation import evaluate as evaluate
    from trdlab.rollouts.playing import Playing as Playing
else:
    __getattr__ = lazily(__name__)
