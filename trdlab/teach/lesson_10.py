"""Lesson 10, the paper, reproduced."""

from trdlab.teach.exercise import Exercise

_GAMMA = 0.95

EXERCISES = {
    "10.1": Exercise(
        right=[_GAMMA + _GAMMA**2, _GAMMA**3 + _GAMMA**4],
        solution=(
            "Component 0 has the steps t, t+1 and t+2, which pay 0, 1 and 1: 0.95 + 0.95² = 1.85. "
            "The residual has t+3 and t+4: 0.95³ + 0.95⁴ = 1.67. Together they are 3.52, which is "
            "Q."
        ),
        hint="Component 0 has the steps t, t+1 and t+2, each discounted. The rest is the residual.",
        mistakes=(
            (
                [_GAMMA + _GAMMA**2 + _GAMMA**3, _GAMMA**3 + _GAMMA**4],
                "That is Eq. 13 as printed: t+3 is counted twice, and the sum is not Q.",
            ),
            (
                [_GAMMA + _GAMMA**2 + _GAMMA**3, _GAMMA**4],
                "Those are four steps. The action taken now is the first of three.",
            ),
            ([2, 2], "Those are the rewards. Each is discounted by its own step."),
        ),
    ),
    "10.2": Exercise(
        right=4 + 0.5 * 2,
        solution=(
            "A group of w = 2 has two rewards, 4 now and 2 a step later: 4 + 0.5 · 2 = 5. The 8 "
            "and the 1 are in the vector of a later state."
        ),
        hint="Two rewards belong to a group of w = 2. The second one is a step later.",
        mistakes=(
            (14, "That is the first row of Eq. 15 as printed: three rewards, none discounted."),
            (6, "Two rewards, but the second one is a step later. Discount it."),
            (4 + 1 + 2, "The sum ends at w − 1: that is one reward too many."),
        ),
    ),
    "10.3": Exercise(
        right=(1444 - 148) / (1324 - 148),
        solution=(
            "(1444 − 148) / (1324 − 148) = 1296 / 1176 = 1.10: all the way, and a tenth more. The "
            "plain ratio of the scores, 1.09, gives a part of the way to random play as well."
        ),
        hint="Take what random play has away from both, then divide.",
        mistakes=(
            (1444 / 1324, "By that measure random play would have come a ninth of the way."),
            ((1324 - 148) / (1444 - 148), "Turn it over: the agent is ahead."),
        ),
    ),
}
