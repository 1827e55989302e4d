"""Learning from a teacher (QDagger): three phases, what the teacher says in them, and its weight.

First the teacher acts and the student only remembers; then the student learns from that, offline;
then it acts by itself, and the teacher says what it would have done. All that is learned from it
was said when somebody acted: no update asks the teacher.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.deep.settings import TrainSettings
from trdlab.environments import Environments
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError
from trdlab.policies.teacher import Lesson, Teacher
from trdlab.rollouts.playing import any_actions, drawn, shown

TAUGHT = "taught"
"""What the replay memory calls the teacher's probabilities."""


Phase = Literal["teacher", "offline", "online"]


@dataclass(frozen=True)
class Levels:
    """What a student is measured by: raw scores, as the environment pays them.

    Args:
        teacher: the teacher's mean return.
        chance: that of random actions.

    Raises:
        InputError: the teacher is not better than chance.

    >>> levels = Levels(teacher=18.0, chance=-21.0)
    >>> [levels.weight(score) for score in (None, -21.0, -1.5, 18.0, 30.0, -40.0)]
    [1.0, 1.0, 0.5, 0.0, 0.0, 1.0]
    """

    teacher: float
    chance: float

    def __post_init__(self) -> None:
        if not self.teacher > self.chance:
            raise InputError(
                f"The teacher's score is {self.teacher:g}, and that of random actions "
                f"{self.chance:g}.",
                "Choose a teacher that is better than chance.",
            )

    def share(self, score: float) -> float:
        """Returns how much of the way from chance to the teacher a score is: teacher-normalised.

        >>> Levels(teacher=18.0, chance=-22.0).share(-2.0)
        0.5
        """
        return (score - self.chance) / (self.teacher - self.chance)

    def weight(self, student: float | None) -> float:
        """Returns λ: 1 at the level of chance, 0 at the teacher's, and in proportion between.

        Args:
            student: its mean return; None before there is one.

        Source: Agarwal et al. (2022), corrected (errata P6).
        """
        if student is None:
            return 1.0
        return min(1.0, max(0.0, 1.0 - self.share(student)))


class Lessons:
    """Where a run stands with its teacher.

    Args:
        teacher: whom it learns from.
        levels: by which λ falls.
        settings: of the run.
        num_envs: B.
    """

    def __init__(
        self, teacher: Teacher, levels: Levels, settings: TrainSettings, num_envs: int
    ) -> None:
        self.teacher, self.levels, self.settings = teacher, levels, settings
        self.teacher_steps, self.offline_updates = 0, 0
        self._distance, self._updates = 0.0, 0  # since they were told
        self._remembered: Any = None
        self._begins: BoolArray = np.ones(num_envs, dtype=np.bool_)

    @property
    def phase(self) -> Phase:
        """What comes next."""
        if self.teacher_steps < self.settings.teacher_steps:
            return "teacher"
        return "offline" if self.offline_updates < self.settings.offline_updates else "online"

    def weight(self, student: float | None) -> float:
        """Returns what the teacher's probabilities weigh in an update.

        They alone teach a policy head, so for that they go on to weigh what they do.
        """
        has_own = self.phase == "online" and self.settings.distil == "values"
        fallen = self.levels.weight(student) if has_own else 1.0
        return self.settings.distillation * fallen

    def ask(self, environments: Environments, stack: FrameStack) -> Lesson:
        """Returns what the teacher says now; to be asked once at each step of all episodes."""
        state = None if self._begins.all() else self._remembered
        seen = shown(self.teacher.policy, environments, stack)
        allowed = getattr(environments, "allowed", None)
        lesson, self._remembered = self.teacher.ask(seen, state, self._begins, allowed)
        return lesson

    def actions(
        self, lesson: Lesson, environments: Environments, rng: np.random.Generator
    ) -> IntArray:
        """Returns what the teacher does `[B]`, now and then at random."""
        allowed = getattr(environments, "allowed", None)
        count, num_actions = len(lesson.likely), lesson.likely.shape[1]
        own = drawn(lesson.likely, rng.random(count))
        random = rng.random(count) < self.settings.teacher_epsilon
        return np.where(random, any_actions(rng, count, num_actions, allowed), own)

    def follow(self, ended: BoolArray) -> None:
        """Takes note of where episodes `[B]` have ended, and others begun."""
        self._begins = ended.copy()

    def learned(self, distance: float) -> None:
        """Takes note of how far the student was from the teacher in an update."""
        self._distance, self._updates = self._distance + distance, self._updates + 1

    def tell(self) -> float | None:
        """Returns the mean distance of the updates since the last call; None if there was none."""
        mean = self._distance / self._updates if self._updates else None
        self._distance, self._updates = 0.0, 0
        return mean

    def state_dict(self) -> dict[str, Any]:
        """Returns everything that the rest of the run depends on: plain numbers and arrays."""
        return {
            "teacher_steps": self.teacher_steps,
            "offline_updates": self.offline_updates,
            "distance": self._distance,
            "updates": self._updates,
            "begins": self._begins.copy(),
            "remembered": _plain(self._remembered),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Takes over what `state_dict` returned."""
        self.teacher_steps = state["teacher_steps"]
        self.offline_updates = state["offline_updates"]
        self._distance, self._updates = state["distance"], state["updates"]
        self._begins[:] = state["begins"]
        self._remembered = _as_it_was(state["remembered"])


def _plain(tree: Any) -> Any:
    """Returns what a policy remembers without tuples, which no file holds."""
    if isinstance(tree, dict):
        return {"names": list(tree), "of": [_plain(leaf) for leaf in tree.values()]}
    if isinstance(tree, list | tuple):
        kind = "tuple" if isinstance(tree, tuple) else "list"
        return {"kind": kind, "of": [_plain(leaf) for leaf in tree]}
    return None if tree is None else np.array(tree)


def _as_it_was(plain: Any) -> Any:
    if not isinstance(plain, dict):
        return plain
    leaves = [_as_it_was(leaf) for leaf in plain["of"]]
    if "names" in plain:
        return dict(zip(plain["names"], leaves, strict=True))
    return tuple(leaves) if plain["kind"] == "tuple" else leaves
