"""What a teacher sees where a student acts: the same, unless the environments show it more."""

from typing import Any, Protocol, runtime_checkable

from trdlab.environments.protocol import Environments
from trdlab.environments.stack import FrameStack


@runtime_checkable
class ShowsTeacher(Protocol):
    """Environments that show a teacher something else than the student, of the same states."""

    @property
    def teacher_observations(self) -> Any:
        """`[B, ...]`: what the teacher sees now, at the frames the next action is chosen at.

        It follows `reset`, `step` and `load_state_dict` as those frames do.
        """


def seen_by_teacher(environments: Environments, stack: FrameStack) -> Any:
    """Returns what a teacher sees now, `[B, ...]`.

    Args:
        environments: where the student acts.
        stack: what the student sees.
    """
    if isinstance(environments, ShowsTeacher):
        return environments.teacher_observations
    return stack.observations
