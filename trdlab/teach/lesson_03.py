"""Lesson 3, learn it."""

from trdlab.teach.exercise import Exercise

EXERCISES = {
    "3.1": Exercise(
        right=[0.5, 1.5, 3.5],
        solution=(
            "First the target, by the law: 1 in front, then 0.5·2, 0.5·2 and 0.5·4, with the last "
            "two folded. That is [1, 1, 3]. A step of size 0.5 goes half the way from [0, 2, 4] "
            "to it: [0.5, 1.5, 3.5]."
        ),
        hint="First the target, by the law. Then go half the way from the old entry to it.",
        mistakes=(
            ([1, 1, 3], "That is the target. Go only half the way to it."),
            (
                [1, 2, 4],
                "Was n taken for the target? Apply the law first: r in front, fold the last two.",
            ),
            ([0.5, 1.5, 2.5], "The last two entries of γ·n were not folded together."),
            ([0.5, 2, 5], "The next components were not discounted."),
        ),
    ),
    "3.2": Exercise(
        right=10,
        solution=(
            "On the first flight only the tenth step is paid, so only its vector changes. On the "
            "second flight the ninth step learns it from there. Each flight carries the news one "
            "step towards the start, so it takes 10. N = 4 does not stop it: past the horizon the "
            "residual carries it on."
        ),
        hint="On the first flight only the tenth step learns anything. Which one on the second?",
        mistakes=(
            (9, "After nine flights the news has come to the second step."),
            (5, "N does not stop the news: past the horizon the residual carries it on."),
            (1, "On the first flight only the last step learns anything."),
        ),
    ),
    "3.3": Exercise(
        right=(0.25 * 4**2 - 1) ** 0.5,
        solution=(
            "The spread is the standard deviation. The average of the squares is 0.25 · 4² = 4, "
            "and the square of the average is 1. So the variance is 4 − 1 = 3, and the spread is "
            "√3 = 1.73."
        ),
        hint="Average the squared distances from 1: one is (4 − 1)², the other (0 − 1)².",
        mistakes=(
            (3, "That is the variance. The spread is its square root."),
            (1, "That is the component: the average, not the distance from it."),
            (2, "Take the distances from the average, which is 1, and not from 0."),
            (1.5, "That is the mean distance. The spread averages the squares."),
        ),
    ),
}
