"""The teacher of a run: measured before anything is written, noted, and found again."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from hashlib import file_digest
from pathlib import Path
from typing import Any

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.deep.lessons import Levels
from trdlab.deep.settings import TrainSettings
from trdlab.environments import Environments
from trdlab.errors import InputError, TrdlabError
from trdlab.policies import Memoryless, Policy
from trdlab.policies.teacher import Teacher
from trdlab.rollouts.evaluation import score
from trdlab.rollouts.playing import Watch, unwatched, usual_limit
from trdlab.runs import RunFolder
from trdlab.statistics import Estimate
from trdlab.training.loading import EVALUATION_SEED
from trdlab.training.setup import make_environments

EPISODES = 30
"""That a teacher plays to be measured, and chance too."""
_TEACHER = "teacher"


@dataclass(frozen=True, eq=False)
class Candidate:
    """An agent that a run may learn from.

    Args:
        name: by which it is found again, wherever the command is given.
        file: what holds it; None where nothing on disk does.
        policy: who acts.
        values: from observations `[B, ...]` to the value of each action `[B, A]`, where it acts by
            them; else None.
        on_scale: whether these count as the student does: with its γ, and its rewards.
        needs: how the game is to be played for it, and so for the student, too; as `KEY=VALUE`.
        beside: what the student's environments are to be made with beside their own arguments, so
            that they show what this agent looks at; as `KEY=VALUE`.
    """

    name: str
    file: Path | None
    policy: Policy
    values: Callable[[Any], FloatArray] | None
    on_scale: bool
    needs: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()

    def settled(self, settings: TrainSettings) -> TrainSettings:
        """Returns the settings with what `auto` stands for with this teacher, and what it needs."""
        settings = replace(settings, env_arg=(*settings.env_arg, *self.needs))
        by_values = self.values is not None and self.on_scale
        if settings.distil != "auto":
            return settings
        return replace(settings, distil="values" if by_values else "policy")

    def make(
        self, settings: TrainSettings, num_envs: int | None = None, seed: int | None = None
    ) -> Environments:
        """Makes the environments of a run, as it and the student act in them."""
        both = replace(settings, env_arg=(*settings.env_arg, *self.beside))
        return make_environments(both, num_envs, seed)

    def teacher(self, settings: TrainSettings) -> Teacher:
        """Returns it as the teacher of a run with these settings."""
        by_values = settings.distil == "values" and self.values is not None
        return Teacher(self.policy, self.values, settings.temperature, by_values)

    @property
    def sha256(self) -> str | None:
        """Of its file."""
        if self.file is None:
            return None
        with self.file.open("rb") as content:
            return file_digest(content, "sha256").hexdigest()


FindTeacher = Callable[[TrainSettings], Candidate]
"""From the settings of a run to the agent that they name as its teacher."""


def measure(
    settings: TrainSettings, candidate: Candidate, watch: Watch = unwatched
) -> tuple[Levels, dict[str, Any]]:
    """Plays episodes with a teacher and with random actions, as the student will be scored.

    Args:
        settings: of the run.
        candidate: the teacher.
        watch: told how far the episodes are.

    Returns:
        The two levels, and what to note of the teacher in the manifest.

    Raises:
        InputError: it is not clearly better than random actions.
    """

    def evenly(seen: Any) -> FloatArray:
        return np.full((len(seen), num_actions), 1.0 / num_actions)

    def measured(who: Policy, epsilon: float) -> Estimate:
        return score(
            who,
            partial(candidate.make, settings),
            EPISODES,
            epsilon=epsilon,
            enough=usual_limit(settings.time_axis),
            seed=EVALUATION_SEED,  # from the starts of an evaluation, which can be compared then
            watch=watch,
        ).mean

    with closing(candidate.make(settings, 1)) as environments:
        num_actions = environments.num_actions
    teacher = measured(candidate.policy, settings.evaluate_epsilon)
    chance = measured(Memoryless(evenly), 0.0)
    if teacher.low <= chance.high:
        raise InputError(
            f"The teacher '{candidate.name}' is not clearly better than random actions: in "
            f"{EPISODES} episodes each, with intervals of 95 %, it reaches {teacher}, and they "
            f"{chance}.",
            "Choose a better teacher, or train without one.",
        )
    noted = {
        "name": candidate.name,
        "sha256": candidate.sha256,
        "episodes": EPISODES,
        "score": teacher.value,
        "random": chance.value,
    }
    return Levels(teacher.value, chance.value), {_TEACHER: noted}


def levels_noted(folder: RunFolder) -> tuple[Levels, str | None]:
    """Returns the levels that were measured when a run began, and the sha256 of the teacher's file.

    Raises:
        TrdlabError: the manifest is torn, or there was no teacher.
    """
    try:
        noted = folder.manifest[_TEACHER]
        return Levels(float(noted["score"]), float(noted["random"])), noted["sha256"]
    except (LookupError, TypeError, ValueError) as error:
        raise TrdlabError(
            f"The run '{folder.path}' does not say what its teacher reached: its manifest is torn.",
            "Put back the manifest.json that was written when it began.",
        ) from error


def levels_of(folder: RunFolder, candidate: Candidate) -> Levels:
    """Returns the levels that were measured when a run began.

    Raises:
        InputError: the teacher is another one now.
        TrdlabError: the manifest is torn.
    """
    levels, sha256 = levels_noted(folder)
    if candidate.sha256 != sha256:
        raise InputError(
            f"The run '{folder.path}' began with another teacher than '{candidate.name}' is now.",
            "Put it back, or begin another run.",
        )
    return levels
