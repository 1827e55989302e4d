"""Lesson 9, which pixels matter."""

from trdlab.teach.exercise import Exercise

EXERCISES = {
    "9.1": Exercise(
        right=0.9**2 * (0.6 - 0.5),
        solution=(
            "Between 0.5 and 0.6 the full weight is paid, as both are below 0.75. The parcel is "
            "0.6 − 0.5 = 0.1 above the baseline, and it is paid two steps later: 0.9² · 0.1 = "
            "0.081."
        ),
        hint="How much more is expected at t+2 with 0.6 there than with 0.5? Discount it.",
        mistakes=(
            (0.9**2 * 0.6, "That is all that is expected. How much of it is beyond the baseline?"),
            (0.6 - 0.5, "It is paid two steps later. Discount it."),
            (0.0, "Up to 0.75 the weight is paid, so here it counts."),
        ),
    ),
    "9.2": Exercise(
        right=0.62 - 0.40 - (0.30 - 0.12 + 0.01),
        solution=(
            "All four together must add 0.62 − 0.40 = 0.22. Three of them add 0.30 − 0.12 + 0.01 "
            "= 0.19. So the fourth one adds 0.22 − 0.19 = 0.03."
        ),
        hint="All four together add what is expected here beyond the baseline.",
        mistakes=(
            (
                0.62 - (0.30 - 0.12 + 0.01),
                "They add up to what is expected beyond the baseline: to 0.22.",
            ),
            (0.62 - 0.40 - (0.30 + 0.12 + 0.01), "One of them takes. Keep its sign."),
        ),
    ),
    "9.3": Exercise(
        right=1 - 6 * (3**2 + 1 + 1 + 1) / (4 * (4**2 - 1)),
        solution=(
            "By the map the ranks are 1, 2, 3, 4. By hiding, 0.1 is the least, so they are 4, 1, "
            "2, 3. The differences are −3, 1, 1, 1, and their squares add up to 12. So the "
            "correlation is 1 − 6·12 / (4·15) = 1 − 1.2 = −0.2."
        ),
        hint="By the map the ranks are 1, 2, 3, 4. By hiding the first patch comes last.",
        mistakes=(
            (-0.291, "That is the correlation of the numbers. Take their ranks."),
            (1 - 6 * (3 + 1 + 1 + 1) / (4 * (4**2 - 1)), "Square the differences first."),
        ),
    ),
    "9.4": Exercise(
        right=[3],
        solution=(
            "Only map 3. Map 1 keeps 0.62 of its order with new weights: it shows what is on the "
            "screen, not what was learned. Map 2 fails hiding: −0.20 is below 0.30. Map 4 passes "
            "both checks, but its forecast is no better than a guess, so there is nothing to "
            "explain."
        ),
        hint="New weights: below 0.50. Hiding: 0.30 or more. And what is it a map of?",
        mistakes=(
            ([3, 4], "Map 4 passes, but it shows what a forecast hangs on that is worth nothing."),
            ([1, 3], "Map 1 is much the same with new weights: it shows what is on the screen."),
            (
                [1, 3, 4],
                "Map 1 needs no learning to look so, and the forecast of map 4 is a guess.",
            ),
            ([2, 3], "Where map 2 is strong, hiding changes less than elsewhere."),
        ),
    ),
}
