"""Lesson 4, why the sum fails."""

from trdlab.teach.exercise import Exercise

EXERCISES = {
    "4.1": Exercise(
        right=[2, 1, 1, 1],
        solution=(
            "The sum must be 5 and is 1, so 4 is missing. The loss moves all four components by "
            "the same amount, so each gets 4 / 4 = 1. They end at [2, 1, 1, 1]."
        ),
        hint="The sum is 4 short. Each component is given the same share of that.",
        mistakes=(
            (
                [5, 0, 0, 0],
                "The loss does not know which component was right. It moves all of them.",
            ),
            (
                [1.25, 1.25, 1.25, 1.25],
                "That is where it ends from all zeros. This one begins elsewhere.",
            ),
            ([5, 4, 4, 4], "4 is missing from the sum, not from each component."),
        ),
    ),
    "4.2": Exercise(
        right=[2, 4],
        solution=(
            "Windows can begin at each of the four steps. Those from steps 1 and 2 are full: 1, "
            "2, 3 and 2, 3, 4. Those from steps 3 and 4 are cut short. After a truncation these "
            "two are dropped, which leaves 2. After a termination zeros follow, so all 4 are "
            "exact."
        ),
        hint="Write down, for each of the four steps, whether three steps follow from it on.",
        mistakes=(
            ([4, 2], "The other way round: a short window is exact where nothing follows."),
            ([2, 2], "After a termination zeros follow, and a short window is exact."),
            ([4, 4], "After a truncation nobody knows what would have followed."),
            (
                [1, 4],
                "The window of steps 2, 3, 4 is full: its last state is known, cut off or not.",
            ),
        ),
    ),
    "4.3": Exercise(
        right=0.85**2,
        solution=(
            "An action is greedy with a chance of 0.8, and a random one is greedy by accident in "
            "one of four cases: 0.8 + 0.2 / 4 = 0.85. The tail of a window of 3 steps has 2 "
            "actions, and both must be greedy: 0.85² = 0.7225."
        ),
        hint="A random action is the greedy one by accident, once in four. A tail has two actions.",
        mistakes=(
            (0.85, "That is one action. The tail of a window of three steps has two."),
            (0.8**2, "A random action may happen to be the greedy one."),
            (0.85**3, "The first action may be anything: only the tail must be greedy."),
            (0.8**3, "Only the tail must be greedy, and a random action may happen to be."),
        ),
    ),
}
