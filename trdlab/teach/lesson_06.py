"""Lesson 6, debug an agent."""

from trdlab.teach.exercise import Exercise

EXERCISES = {
    "6.1": Exercise(
        right=2,
        solution=(
            "0.9² = 0.81, so its code uses the power 2. It should use the power w = 4, as 0.9⁴ = "
            "0.656."
        ),
        hint="0.81 is 0.9 to which power?",
        mistakes=(
            (4, "That is what it should use: 0.9 to the power 4 is 0.6561."),
            (1, "A missing power would give 0.9 itself."),
            (8, "A doubled power would give 0.43. This one is halved."),
        ),
    ),
    "6.2": Exercise(
        right=[4, 0.5, 4],
        solution=(
            "It applies the law as if the next episode followed: 4 in front, then 0.5·1, 0.5·2 "
            "and 0.5·6, with the last two folded: [4, 0.5, 4]. The right vector is [4, 0, 0], as "
            "nothing follows the last step."
        ),
        hint="It uses the law as if the next episode were a part of this one.",
        mistakes=(
            ([4, 0, 0], "That is right, but this agent has it wrong."),
            ([4, 0.5, 1], "What passes the horizon joins the residual: 0.5·(2 + 6)."),
            ([4, 1, 8], "What is expected there is one step away. Discount it."),
            ([4, 0.5, 1, 3], "Four entries, but N stays the same. Add the last two."),
        ),
    ),
    "6.3": Exercise(
        right=1,
        solution=(
            "Line 1. A window of two steps leads to the state two steps later, which is "
            "`log.states[:, 2]`. Emil takes the state after the first step. So he counts what is "
            "paid in the second step twice, and all that follows comes a step too late."
        ),
        hint="Say of each line which steps it is about. With w = 2 there are steps 0 and 1.",
        mistakes=(
            (2, "It is right: the rewards of steps 0 and 1, the second discounted."),
            (3, "It is right: two steps pass, and the second one may be the last."),
            (4, "It is right, if it is given the right state."),
        ),
    ),
}
