"""What a run tells of itself every now and then: the lines of its metrics."""

from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from trdlab.deep.lessons import Phase


class Standing(NamedTuple):
    """How far a run is in its phase.

    Args:
        done: so many are done in it.
        total: of so many.
        what: of what.
    """

    done: int
    total: int
    what: str


@dataclass(frozen=True)
class TeachingMetrics:
    """What a run tells of itself that learns from a teacher.

    Args:
        clock: what it has done in all phases together (see `Trainer.clock`).
        phase: `teacher`, `offline` or `online`.
        teacher_steps: that the teacher has taken.
        distance: the mean of KL(teacher ‖ student) in the updates since the line before; None if
            there was none.
        weight: what it weighs in an update now: λ.
    """

    clock: int
    phase: Phase
    teacher_steps: int
    distance: float | None
    weight: float


@dataclass(frozen=True)
class TrainMetrics:
    """What a run tells of itself every now and then.

    Args:
        agent_steps: taken so far, of all environments together.
        updates: made so far.
        episodes: ended so far.
        score: the mean return of the last hundred, as the environment pays it; None before one.
        length: their mean length, in agent steps.
        loss: the mean loss of the updates since the line before; None if there was none.
        mean_value: the mean Q-value of the actions taken, likewise.
        epsilon: the chance of a random action.
        learning_rate: Adam's.
        teaching: what there is beside where there is a teacher. While it acts, score and length
            are its own.
    """

    agent_steps: int
    updates: int
    episodes: int
    score: float | None
    length: float | None
    loss: float | None
    mean_value: float | None
    epsilon: float
    learning_rate: float
    teaching: TeachingMetrics | None = None

    def row(self) -> dict[str, Any]:
        """Returns a line of metrics."""
        row = asdict(self)
        return row | (row.pop("teaching") or {})
