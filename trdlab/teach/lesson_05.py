"""Lesson 5, from pixels."""

from trdlab.teach.exercise import Exercise

EXERCISES = {
    "5.1": Exercise(
        right=6 * 41,
        solution=(
            "Each action has its own vector, of N + 1 = 41 entries with the residual. Six actions "
            "need 6 · 41 = 246 outputs."
        ),
        hint="Each action has its own vector.",
        mistakes=(
            (6 * 40, "That leaves out the residual: a vector has N + 1 entries."),
            (41, "That is one action's vector. There are six actions."),
            (46, "Not 6 + 40: every action has a whole vector."),
        ),
    ),
    "5.2": Exercise(
        right=10 * 250 * 4,
        solution=(
            "Component 1 can be right after a copy with a right component 0, component 2 after "
            "the next copy, and so on. Component 10 needs ten copies. A copy comes every 250 "
            "updates, and an update every 4 steps: 10 · 250 · 4 = 10 000."
        ),
        hint="Component 1 can begin after the first copy, component 2 after the second, ...",
        mistakes=(
            (10 * 250, "Those are updates. There are 4 agent steps for each."),
            (9 * 250 * 4, "Component 1 needs one copy already, so component 10 needs ten."),
            (11 * 250 * 4, "Component 0 needs no copy: it is the reward itself."),
        ),
    ),
    "5.3": Exercise(
        right=0.25 + 2.25,
        solution=(
            "The target, by the law: 4 in front, then 0.5·1, 0.5·2 and 0.5·3, with the last two "
            "folded: [4, 0.5, 2.5]. The network says [4, 1, 1], so it is off by 0, 0.5 and −1.5. "
            "The squares add up to 0.25 + 2.25 = 2.5."
        ),
        hint="Build the target first: the reward, then the discounted vector, the last two added.",
        mistakes=(
            (0.25, "What is shifted beyond the end joins the last entry: 1 + 1.5."),
            (2.5 / 3, "That is the mean over the components. Take the sum."),
        ),
    ),
}
