"""Lesson 8, from a teacher to a trusted agent."""

import numpy as np

from trdlab.teach.exercise import Exercise

EXERCISES = {
    "8.1": Exercise(
        right=1 - (27 - 2) / (102 - 2),
        solution=(
            "The student has come 27 − 2 = 25 of the 102 − 2 = 100 points from random actions to "
            "the teacher. That is 0.25 of the way, so the teacher weighs 1 − 0.25 = 0.75."
        ),
        hint="It is 1 where the student plays like chance, and 0 where it plays like the teacher.",
        mistakes=(
            (0.25, "That is how far the student has come. What is left weighs."),
            (1 - 27 / 102, "Count from what random actions reach, not from 0."),
        ),
    ),
    "8.2": Exercise(
        right=0.9 * np.log(0.9 / 0.5) + 0.1 * np.log(0.1 / 0.5),
        solution=(
            "The other action has the chances 0.1 (teacher) and 0.5 (student). So 0.9·ln(0.9 / "
            "0.5) + 0.1·ln(0.1 / 0.5) = 0.529 − 0.161 = 0.368."
        ),
        hint="Sum over both actions. A chance that is left belongs to the other action.",
        mistakes=(
            (0.9 * np.log(0.9 / 0.5), "There is another action: add it."),
            (
                0.5 * np.log(0.5 / 0.9) + 0.5 * np.log(0.5 / 0.1),
                "That is the other way round: p is the teacher's.",
            ),
        ),
    ),
}
