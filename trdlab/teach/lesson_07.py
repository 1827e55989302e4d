"""Lesson 7, explain your own agent."""

from trdlab.teach.exercise import Exercise

EXERCISES = {
    "7.1": Exercise(
        right=1 - (0.1 + 0.2 + 0.3),
        solution=(
            "It has fallen by t+3 with a chance of 0.1 + 0.2 + 0.3 = 0.6: these are chances of "
            "different steps, and it falls only once. So the game still runs with a chance of 1 − "
            "0.6 = 0.4."
        ),
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
        solution=(
            "At t+2 it is paid 1 if the game still runs, and nothing otherwise. So component 2 is "
            "γ² times the chance: 0.81 · chance = 0.405. The chance is 0.5."
        ),
        hint="The component is γ² times the reward times the chance that it comes.",
        mistakes=(
            (0.405, "That is what the reward is worth from here. Undo the discount."),
            (0.405 / 0.9, "You divided by γ once. Two steps away means twice."),
            (0.405 * 0.9**2, "You discounted it once more. Divide instead."),
        ),
    ),
    "7.3": Exercise(
        right=0.1 / 2,
        solution=(
            "The agent itself never goes right there. One action in ten is forced, and a forced "
            "action is left or right evenly. So the fit sees right in 0.1 / 2 = 0.05 of the "
            "visits."
        ),
        hint="A forced action is any action, evenly.",
        mistakes=(
            (0.1, "So often an action is forced. Half of these go left."),
            (0.0, "It never goes right by itself, but some of its actions are forced."),
            (0.5, "Of the forced actions. How many actions are forced?"),
        ),
    ),
    "7.4": Exercise(
        right=2,
        solution=(
            "The skill is above 0 at t, t+1 and t+2, by more than the 0.05 that is unsure. At t+3 "
            "it is below 0: no better than a guess. Trust ends before that, so k = 2. What lies "
            "beyond is of no help, even if it is above 0 again."
        ),
        hint="As far as every step up to there is better than a guess.",
        mistakes=(
            (5, "It is better than a guess there, but not at t+3. Trust ends before that."),
            (3, "At t+3 it is worse than a guess."),
            (0, "Better than a guess is enough: 0.3 is far above 0."),
        ),
    ),
}
