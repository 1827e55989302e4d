"""Lesson 2, derive it."""

from trdlab.teach.exercise import Exercise

EXERCISES = {
    "2.1": Exercise(
        right=[0.5, 0.5, 3],
        solution=(
            "Put r in front of the discounted components: 0.5, then 0.5·1, 0.5·2 and 0.5·4. That "
            "is 0.5, 0.5, 1, 2: one entry too many. Fold the last two: 1 + 2 = 3. The answer is "
            "[0.5, 0.5, 3]."
        ),
        hint="Write r, then 0.5 times each entry of n. That is one too many: add the last two.",
        mistakes=(
            ([0.5, 0.5, 1, 2], "Four entries, but N stays the same. Fold the last two."),
            ([0.5, 0.5, 1], "The last entry was dropped. The residual takes it in: 1 + 2."),
            ([0.5, 0.5, 2], "What passes the horizon joins the residual: 0.5·(2 + 4)."),
            ([0.5, 1, 6], "The next components are one step further away. Discount them."),
        ),
    ),
    "2.2": Exercise(
        right=7,
        solution=(
            "The explicit components must reach N · w = 30 steps. With w = 5 that is N = 6. The "
            "residual is one more, so there are N + 1 = 7 outputs for each action."
        ),
        hint="N · w = 30 with w = 5 gives N. Then count all components.",
        mistakes=(
            (6, "Those are the explicit ones. What comes after step 30 needs a place too."),
            (30, "That would be w = 1, and without a residual."),
            (31, "That would be w = 1. With groups of 5 you need fewer."),
        ),
    ),
    "2.3": Exercise(
        right=18 / 20,
        solution=(
            "Left is worth 18·γ, right 20·γ². They tie where 18·γ = 20·γ². Divide by γ, which is "
            "above 0: 18 = 20·γ, so γ = 18 / 20 = 0.9."
        ),
        hint="One is discounted once, the other twice. Set them equal, and solve for γ.",
        mistakes=(
            (0.95, "That was for 19. The near reward is smaller now: less patience is enough."),
            (20 / 18, "That is above 1. Turn it over."),
        ),
    ),
}
