"""Lesson 1, read a reward vector."""

from trdlab.teach.exercise import Exercise

_GAMMA = 0.95
_DOWN = sum(_GAMMA**step for step in (1, 2, 3, 4))  # what four coins in a row are worth

EXERCISES = {
    "1.1": Exercise(
        right=1.62 / 0.9**2,
        solution=(
            "Component 2 is the reward at t+2, discounted twice: 0.9² · reward = 1.62. So the "
            "reward is 1.62 / 0.81 = 2."
        ),
        hint="Component i was multiplied by γ to the power i.",
        mistakes=(
            (1.62, "That is what the reward is worth from here. Undo the discount."),
            (1.62 / 0.9, "You divided by γ once. Two steps away means twice."),
            (1.62 * 0.9**2, "You discounted it once more. Divide instead."),
        ),
    ),
    "1.2": Exercise(
        right=[2, 3],
        solution=(
            "Each component covers w = 2 steps. Component 0 begins with the step taken now, so it "
            "has steps 0 and 1. Component 1 comes next, with steps 2 and 3. In general component "
            "i has the steps i·w to i·w + w − 1."
        ),
        hint="Component 0 comes first. It begins with the step taken now, and has w steps.",
        mistakes=(
            ([1], "Each component covers w = 2 steps, so the answer has two entries."),
            ([0, 1], "Those are the steps of component 0. We count from 0."),
            ([1, 2], "Component 0 already covers step 1: it has steps 0 and 1."),
            ([3, 4], "Component 0 begins with the step taken now, which is step 0."),
        ),
    ),
    "1.3": Exercise(
        right=_DOWN / _GAMMA**4,
        solution=(
            "Down is worth 0.95 + 0.95² + 0.95³ + 0.95⁴ = 3.524. The treasure comes four steps "
            "later, so up is worth 0.95⁴ = 0.8145 times what it pays. Both are worth the same if "
            "it pays 3.524 / 0.8145 = 4.327."
        ),
        hint="The treasure, discounted four times, must be worth what down is worth.",
        mistakes=(
            (_DOWN, "That is what it must be worth from here. It pays four steps later."),
            (4 + _DOWN - 4 * _GAMMA**4, "The gap is discounted. What closes it must be larger."),
        ),
    ),
}
