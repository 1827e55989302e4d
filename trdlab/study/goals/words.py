"""What readers of a goal study are told beforehand."""

from trdlab.study.goals.game import SLIP
from trdlab.study.goals.trials import EPISODES

QUESTION = "Which goal does it have?"
_FIRST = "Four agents play the same game. Each of them has another goal:"
_EACH = (
    "Each trial is about one of them, and asks which goal it has. Answer each trial by itself: any "
    "of the four may come up. If you cannot tell, guess."
)
_RULES = (
    "In the game a drone moves over a map, one cell in each step: up, down, left or right. With a "
    f"chance of {100 * SLIP:g} % it slips to the left or to the right of where it wanted to go. It "
    "can enter triangles, but no walls. It starts on the cell with the H.",
    "A circle or a square is gone once the drone was there; its outline is left. Triangles stay. "
    "The flag ends the episode, and pays all four agents the same.",
)
_UNITS = (
    "Amounts are told such that the largest reward of this agent is 1. What is below zero is a "
    "cost."
)
_MOMENTS = "A trial shows moments of one episode, and what the agent does there."
_BARS = (
    "Bars tell what it expects on average at each step from now: first of the action that it "
    "takes, then of the next best one. What may come or not has a lower bar, by its chance. A bar "
    "below zero is an expected cost. A reward counts a little less for each step that it comes "
    "later."
)
_SALIENCY = (
    "Colours show what the reward that the agent expects depends on. Without a thing on dark blue "
    "it would expect less reward, without a thing on red it would expect more."
)
_CLIPS = (
    f"Clips come from {EPISODES} episodes that the agent has played. They show moments when reward "
    "really came to it: just before, when it came, and just after. Each row stands for all moments "
    "of one kind."
)
_OF_GROUP = {
    "report": (_MOMENTS, _BARS, _SALIENCY, _CLIPS, _UNITS),
    "bars": (_MOMENTS, _BARS, _UNITS),
    "saliency": (_MOMENTS, _SALIENCY),
    "clips": (_CLIPS, _UNITS),
}


def intro(*, is_own_game: bool) -> tuple[str, ...]:
    """Returns what comes before the goals, and what after them."""
    return (_FIRST, *(_RULES if is_own_game else ()), _EACH)


def how_to_read(group: str) -> tuple[str, ...]:
    """Returns how to read what a group sees."""
    return _OF_GROUP[group]
