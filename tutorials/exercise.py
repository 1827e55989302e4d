"""The exercises of the lessons: what is right, and what wrong answers usually mean."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Answer = float | Sequence[float]

_GAMMA = 0.95
_DOWN = sum(
    _GAMMA**step for step in (1, 2, 3, 4)
)  # what four coins in a row are worth


@dataclass(frozen=True)
class Exercise:
    """A solution, and what to say about other answers.

    Args:
        right: the solution; numbers agree when they are within half a hundredth.
        hint: for a wrong answer that is no known mistake.
        mistakes: wrong answers that show what was misunderstood, each with what to say.
    """

    right: Answer
    hint: str
    mistakes: tuple[tuple[Answer, str], ...] = ()


EXERCISES = {
    "1.1": Exercise(
        right=1.62 / 0.9**2,
        hint="Component i was multiplied by γ to the power i.",
        mistakes=(
            (
                1.62,
                "That is what the reward is worth from here. Undo the discount.",
            ),
            (1.62 / 0.9, "You divided by γ once. Two steps away means twice."),
            (1.62 * 0.9**2, "You discounted it once more. Divide instead."),
        ),
    ),
    "1.2": Exercise(
        right=[2, 3],
        hint="Component 0 comes first. It begins with the step taken now, and has w steps.",
        mistakes=(
            (
                [1],
                "Each component covers w = 2 steps, so the answer has two entries.",
            ),
            ([0, 1], "Those are the steps of component 0. We count from 0."),
            ([1, 2], "Component 0 already covers step 1: it has steps 0 and 1."),
            (
                [3, 4],
                "Component 0 begins with the step taken now, which is step 0.",
            ),
        ),
    ),
    "1.3": Exercise(
        right=_DOWN / _GAMMA**4,
        hint="The treasure, discounted four times, must be worth what down is worth.",
        mistakes=(
            (
                _DOWN,
                "That is what it must be worth from here. It pays four steps later.",
            ),
            (
                4 + _DOWN - 4 * _GAMMA**4,
                "The gap is discounted. What closes it must be larger.",
            ),
        ),
    ),
    "2.1": Exercise(
        right=[0.5, 0.5, 3],
        hint="Write r, then 0.5 times each entry of n. That is one too many: add the last two.",
        mistakes=(
            (
                [0.5, 0.5, 1, 2],
                "Four entries, but N stays the same. Fold the last two.",
            ),
            (
                [0.5, 0.5, 1],
                "The last entry was dropped. The residual takes it in: 1 + 2.",
            ),
            (
                [0.5, 0.5, 2],
                "What passes the horizon joins the residual: 0.5·(2 + 4).",
            ),
            (
                [0.5, 1, 6],
                "The next components are one step further away. Discount them.",
            ),
        ),
    ),
    "2.2": Exercise(
        right=7,
        hint="N · w = 30 with w = 5 gives N. Then count all components.",
        mistakes=(
            (
                6,
                "Those are the explicit ones. What comes after step 30 needs a place too.",
            ),
            (30, "That would be w = 1, and without a residual."),
            (31, "That would be w = 1. With groups of 5 you need fewer."),
        ),
    ),
    "2.3": Exercise(
        right=18 / 20,
        hint="One is discounted once, the other twice. Set them equal, and solve for γ.",
        mistakes=(
            (
                0.95,
                "That was for 19. The near reward is smaller now: less patience is enough.",
            ),
            (20 / 18, "That is above 1. Turn it over."),
        ),
    ),
    "3.1": Exercise(
        right=[0.5, 1.5, 3.5],
        hint="First the target, by the law. Then go half the way from the old entry to it.",
        mistakes=(
            ([1, 1, 3], "That is the target. Go only half the way to it."),
            (
                [1, 2, 4],
                "Was n taken for the target? Apply the law first: r in front, fold the last two.",
            ),
            (
                [0.5, 1.5, 2.5],
                "The last two entries of γ·n were not folded together.",
            ),
            (
                [0.5, 2, 5],
                "The next components were not discounted.",
            ),
        ),
    ),
    "3.2": Exercise(
        right=10,
        hint="On the first flight only the tenth step learns anything. Which one on the second?",
        mistakes=(
            (9, "After nine flights the news has come to the second step."),
            (
                5,
                "N does not stop the news: past the horizon the residual carries it on.",
            ),
            (1, "On the first flight only the last step learns anything."),
        ),
    ),
    "3.3": Exercise(
        right=(0.25 * 4**2 - 1) ** 0.5,
        hint="Average the squared distances from 1: one is (4 − 1)², the other (0 − 1)².",
        mistakes=(
            (3, "That is the variance. The spread is its square root."),
            (1, "That is the component: the average, not the distance from it."),
            (2, "Take the distances from the average, which is 1, and not from 0."),
            (
                1.5,
                "That is the mean distance. The spread averages the squares.",
            ),
        ),
    ),
    "4.1": Exercise(
        right=[2, 1, 1, 1],
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
            (
                [5, 4, 4, 4],
                "4 is missing from the sum, not from each component.",
            ),
        ),
    ),
    "4.2": Exercise(
        right=[2, 4],
        hint="Write down, for each of the four steps, whether three steps follow from it on.",
        mistakes=(
            (
                [4, 2],
                "The other way round: a short window is exact where nothing follows.",
            ),
            (
                [2, 2],
                "After a termination zeros follow, and a short window is exact.",
            ),
            ([4, 4], "After a truncation nobody knows what would have followed."),
            (
                [1, 4],
                "The window of steps 2, 3, 4 is full: its last state is known, cut off or not.",
            ),
        ),
    ),
    "4.3": Exercise(
        right=0.85**2,
        hint="A random action is the greedy one by accident, once in four. A tail has two actions.",
        mistakes=(
            (
                0.85,
                "That is one action. The tail of a window of three steps has two.",
            ),
            (0.8**2, "A random action may happen to be the greedy one."),
            (
                0.85**3,
                "The first action may be anything: only the tail must be greedy.",
            ),
            (
                0.8**3,
                "Only the tail must be greedy, and a random action may happen to be.",
            ),
        ),
    ),
    "5.1": Exercise(
        right=6 * 41,
        hint="Each action has its own vector.",
        mistakes=(
            (6 * 40, "That leaves out the residual: a vector has N + 1 entries."),
            (41, "That is one action's vector. There are six actions."),
            (46, "Not 6 + 40: every action has a whole vector."),
        ),
    ),
    "5.2": Exercise(
        right=10 * 250 * 4,
        hint="Component 1 can begin after the first copy, component 2 after the second, ...",
        mistakes=(
            (10 * 250, "Those are updates. There are 4 agent steps for each."),
            (
                9 * 250 * 4,
                "Component 1 needs one copy already, so component 10 needs ten.",
            ),
            (11 * 250 * 4, "Component 0 needs no copy: it is the reward itself."),
        ),
    ),
    "5.3": Exercise(
        right=0.25 + 2.25,
        hint="Build the target first: the reward, then the discounted vector, the last two added.",
        mistakes=(
            (0.25, "What is shifted beyond the end joins the last entry: 1 + 1.5."),
            (2.5 / 3, "That is the mean over the components. Take the sum."),
        ),
    ),
    "6.1": Exercise(
        right=2,
        hint="0.81 is 0.9 to which power?",
        mistakes=(
            (4, "That is what it should use: 0.9 to the power 4 is 0.6561."),
            (1, "A missing power would give 0.9 itself."),
            (8, "A doubled power would give 0.43. This one is halved."),
        ),
    ),
    "6.2": Exercise(
        right=[4, 0.5, 4],
        hint="It uses the law as if the next episode were a part of this one.",
        mistakes=(
            ([4, 0, 0], "That is right, but this agent has it wrong."),
            (
                [4, 0.5, 1],
                "What passes the horizon joins the residual: 0.5·(2 + 6).",
            ),
            ([4, 1, 8], "What is expected there is one step away. Discount it."),
            (
                [4, 0.5, 1, 3],
                "Four entries, but N stays the same. Add the last two.",
            ),
        ),
    ),
    "6.3": Exercise(
        right=1,
        hint="Say of each line which steps it is about. With w = 2 there are steps 0 and 1.",
        mistakes=(
            (
                2,
                "It is right: the rewards of steps 0 and 1, the second discounted.",
            ),
            (3, "It is right: two steps pass, and the second one may be the last."),
            (4, "It is right, if it is given the right state."),
        ),
    ),
    "7.1": Exercise(
        right=1 - (0.1 + 0.2 + 0.3),
        hint="Each is the chance that the game ends at just that step. It ends only once.",
        mistakes=(
            (
                0.9 * 0.8 * 0.7,
                "You would multiply if each were the chance for a game that still runs. "
                "These are told from now on, so add them up.",
            ),
            (0.6, "That is how likely it has fallen by then."),
            (0.7, "It may also have fallen at t or t+1."),
        ),
    ),
    "7.2": Exercise(
        right=0.405 / 0.9**2,
        hint="The component is γ² times the reward times the chance that it comes.",
        mistakes=(
            (
                0.405,
                "That is what the reward is worth from here. Undo the discount.",
            ),
            (0.405 / 0.9, "You divided by γ once. Two steps away means twice."),
            (0.405 * 0.9**2, "You discounted it once more. Divide instead."),
        ),
    ),
    "7.3": Exercise(
        right=0.1 / 2,
        hint="A forced action is any action, evenly.",
        mistakes=(
            (0.1, "So often an action is forced. Half of these go left."),
            (
                0.0,
                "It never goes right by itself, but some of its actions are forced.",
            ),
            (0.5, "Of the forced actions. How many actions are forced?"),
        ),
    ),
    "7.4": Exercise(
        right=2,
        hint="As far as every step up to there is better than a guess.",
        mistakes=(
            (
                5,
                "It is better than a guess there, but not at t+3. Trust ends before that.",
            ),
            (3, "At t+3 it is worse than a guess."),
            (0, "Better than a guess is enough: 0.3 is far above 0."),
        ),
    ),
    "8.1": Exercise(
        right=1 - (27 - 2) / (102 - 2),
        hint="It is 1 where the student plays like chance, and 0 where it plays like the teacher.",
        mistakes=(
            (0.25, "That is how far the student has come. What is left weighs."),
            (1 - 27 / 102, "Count from what random actions reach, not from 0."),
        ),
    ),
    "8.2": Exercise(
        right=0.9 * np.log(0.9 / 0.5) + 0.1 * np.log(0.1 / 0.5),
        hint="Sum over both actions. A chance that is left belongs to the other action.",
        mistakes=(
            (0.9 * np.log(0.9 / 0.5), "There is another action: add it."),
            (
                0.5 * np.log(0.5 / 0.9) + 0.5 * np.log(0.5 / 0.1),
                "That is the other way round: p is the teacher's.",
            ),
        ),
    ),
    "9.1": Exercise(
        right=0.9**2 * (0.6 - 0.5),
        hint="How much more is expected at t+2 with 0.6 there than with 0.5? Discount it.",
        mistakes=(
            (
                0.9**2 * 0.6,
                "That is all that is expected. How much of it is beyond the baseline?",
            ),
            (0.6 - 0.5, "It is paid two steps later. Discount it."),
            (0.0, "Up to 0.75 the weight is paid, so here it counts."),
        ),
    ),
    "9.2": Exercise(
        right=0.62 - 0.40 - (0.30 - 0.12 + 0.01),
        hint="All four together add what is expected here beyond the baseline.",
        mistakes=(
            (
                0.62 - (0.30 - 0.12 + 0.01),
                "They add up to what is expected beyond the baseline: to 0.22.",
            ),
            (
                0.62 - 0.40 - (0.30 + 0.12 + 0.01),
                "One of them takes. Keep its sign.",
            ),
        ),
    ),
    "9.3": Exercise(
        right=1 - 6 * (3**2 + 1 + 1 + 1) / (4 * (4**2 - 1)),
        hint="By the map the ranks are 1, 2, 3, 4. By hiding the first patch comes last.",
        mistakes=(
            (-0.291, "That is the correlation of the numbers. Take their ranks."),
            (
                1 - 6 * (3 + 1 + 1 + 1) / (4 * (4**2 - 1)),
                "Square the differences first.",
            ),
        ),
    ),
    "9.4": Exercise(
        right=[3],
        hint="New weights: below 0.50. Hiding: 0.30 or more. And what is it a map of?",
        mistakes=(
            (
                [3, 4],
                "Map 4 passes, but it shows what a forecast hangs on that is worth nothing.",
            ),
            (
                [1, 3],
                "Map 1 is much the same with new weights: it shows what is on the screen.",
            ),
            (
                [1, 3, 4],
                "Map 1 needs no learning to look so, and the forecast of map 4 is a guess.",
            ),
            (
                [2, 3],
                "Where map 2 is strong, hiding changes less than elsewhere.",
            ),
        ),
    ),
    "10.1": Exercise(
        right=[_GAMMA + _GAMMA**2, _GAMMA**3 + _GAMMA**4],
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
            (
                [2, 2],
                "Those are the rewards. Each is discounted by its own step.",
            ),
        ),
    ),
    "10.2": Exercise(
        right=4 + 0.5 * 2,
        hint="Two rewards belong to a group of w = 2. The second one is a step later.",
        mistakes=(
            (
                14,
                "That is the first row of Eq. 15 as printed: three, none discounted.",
            ),
            (6, "Two rewards, but the second one is a step later. Discount it."),
            (4 + 1 + 2, "The sum ends at w − 1: that is one reward too many."),
        ),
    ),
    "10.3": Exercise(
        right=(1444 - 148) / (1324 - 148),
        hint="Take what random play has away from both, then divide.",
        mistakes=(
            (
                1444 / 1324,
                "By that measure random play would have come a ninth of the way.",
            ),
            ((1324 - 148) / (1444 - 148), "Turn it over: the agent is ahead."),
        ),
    ),
}


def check(name: str, answer: Answer | None) -> None:
    """Prints whether the answer to an exercise is right; if not, why, as far as can be guessed."""
    exercise = EXERCISES[name]
    if answer is None:
        print(
            f"Exercise {name}: not answered yet. Replace None, then run this cell again."
        )
    elif _same(answer, exercise.right):
        print(f"Exercise {name}: right.")
    else:
        known = (said for wrong, said in exercise.mistakes if _same(answer, wrong))
        said = next(known, f"Hint: {exercise.hint}")
        print(f"Exercise {name}: {answer} is not right. {said}")


def _same(a: Answer, b: Answer) -> bool:
    try:
        left, right = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    except (TypeError, ValueError):
        return False
    return left.shape == right.shape and bool(np.all(np.abs(left - right) <= 0.005))
