"""Steps of an episode that turned out other than expected, and why."""

from functools import lru_cache

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.episode.played import EPISODES, Played
from trdlab.explanations.rules import Claim, Fields, Found

FOCUS = 1 / 3  # of a surprise: what one component must account for, to be named as its reason
NEARLY = 1 / 4  # of what moved from one step to another: how far signs may be mixed there

_TURNED = "At {step:step}, {action} turned out {gap:number} {outcome:text} than expected"
_ALIKE = "in all, it expects about as much as before."
_SAYS = {
    "turned-out": f"{_TURNED}.",  # there is no explicit component, so nothing is known of when
    "ended-early": (  # the future ended, which changed more than the reward did
        f"{_TURNED}, mainly because {{ending:text}} while {{promised:rewards}} were still expected."
    ),
    "other-reward": (
        f"{_TURNED}, mainly because {{reward:paid}} came where {{expected:number}} was expected."
    ),
    "no-reward": f"{_TURNED}, mainly because nothing came where {{expected:number}} was expected.",
    "other-belief": (  # of a later component
        f"{_TURNED}, mainly because what it expects to come {{place:at}} went from {{was:number}} "
        "to {now:number}."
    ),
    "spread-out": (  # half of what speaks for the outcome lies at a step or before
        f"{_TURNED}, spread over many steps: half of it up to {{by:step}}."
    ),
    "put-off": (
        "At {step:step}, {action} delayed {worth:rewards}: they were to come {origin:at}, and now "
        f"{{to:at}}; {_ALIKE}"
    ),
    "brought-forward": (
        "At {step:step}, {action} brought {worth:rewards} forward: they were to come {origin:at}, "
        f"and now {{to:at}}; {_ALIKE}"
    ),
    "exchanged": (
        "At {step:step}, {action} gained {gain:number} {up:at} and lost {loss:number} "
        f"{{down:at}}; {_ALIKE}"
    ),
    "drawn": (
        "At {step:step}, the agent drew {action}, with {chance:chance}, instead of {likeliest}, "
        "its likeliest action: {gap:number} {outcome:text} than its draws on average."
    ),
}


def surprise(played: Played, row: int) -> Claim:
    """Returns what is to say of a turn that changed something (see `sizes`)."""
    kind, fields = _turns(played)[row]
    return Claim(EPISODES.rules[kind], played, fields)


@lru_cache(maxsize=8)
def _turns(played: Played) -> tuple[Found, ...]:
    """Returns `[T′ + D]`, of each turn what kind it was, and its numbers (see `sizes`)."""
    revised = (_turn(played, row) for row in range(len(played.revision)))
    return (*revised, *(_draw(played, step) for step in played.unlikely.tolist()))


@EPISODES.kinds(_SAYS)
def turns(played: Played) -> tuple[Found, ...]:
    """Steps that changed what was expected, with the main reason, and draws that did."""
    return _turns(played)


def _turn(played: Played, row: int) -> Found:
    of = played.revision
    step, before, after = int(of.steps[row]), of.before[row], of.after[row]
    about: Fields = {"step": step, "action": played.action(step)}
    change = after - before
    if moved := float(moved_by(change)):
        return _shift(about, before, after, moved)
    total = float(change.sum())
    about |= {"gap": abs(total), "outcome": "better" if total > 0.0 else "worse"}
    directed = np.sign(total) * change  # what is above 0 speaks for the outcome
    if len(directed) == 1:
        return "turned-out", about
    if of.ended[row] and float(directed[1:].sum()) > directed[0]:
        is_over = played.episode.terminated and of.last[row] == len(played.episode) - 1
        ending = "the episode ended" if is_over else "a life was lost"
        return "ended-early", about | {"ending": ending, "promised": float(before[1:].sum())}
    peak, speaks_for_it = int(directed.argmax()), np.maximum(directed, 0.0)
    if not directed[peak] >= FOCUS * speaks_for_it.sum():
        so_far = speaks_for_it.cumsum()
        half = int((so_far >= so_far[-1] / 2.0).argmax())
        by = step + (half + 1) * played.episode.time_axis.width - 1
        return "spread-out", about | {"by": by}
    was, now = float(before[peak]), float(after[peak])
    if peak > 0:
        return "other-belief", about | {"place": (step, peak), "was": was, "now": now}
    if now == 0.0:
        return "no-reward", about | {"expected": was}
    return "other-reward", about | {"expected": was, "reward": now}


def _shift(about: Fields, before: FloatArray, after: FloatArray, moved: float) -> Found:
    """Returns what a step did that moved rewards, or costs, and left the total about the same."""
    slack, step, change = NEARLY * moved, about["step"], after - before
    up, down = int(change.argmax()), int(change.argmin())
    if before[up] >= -slack and after[down] >= -slack:
        worth, origin, to = moved, down, up
    elif after[up] <= slack and before[down] <= slack:
        worth, origin, to = -moved, up, down
    else:
        places = {"up": (step, up), "down": (step, down)}
        gains = {"gain": float(change[up]), "loss": -float(change[down])}
        return "exchanged", about | places | gains
    kind = "put-off" if to > origin else "brought-forward"
    return kind, about | {"worth": worth, "origin": (step, origin), "to": (step, to)}


def _draw(played: Played, step: int) -> Found:
    """Returns what was drawn at a step in place of the likeliest action, and what that changed."""
    likely, gap = np.asarray(played.episode.probabilities)[step], float(played.draws[step])
    return "drawn", {
        "step": step,
        "action": played.action(step),
        "chance": float(likely[played.episode.actions[step]]),
        "likeliest": played.action_names[int(likely.argmax())],
        "gap": abs(gap),
        "outcome": "better" if gap > 0.0 else "worse",
    }


def moved_by(change: FloatArray) -> FloatArray:
    """Returns `[...]`: how much moved from one component to another; 0 if the total changed.

    Args:
        change: `[..., N+1]`; its total must be at most half of what moved.
    """
    moved = np.maximum(0.0, np.minimum(change.max(axis=-1), -change.min(axis=-1)))
    return np.where(np.abs(change.sum(axis=-1)) <= moved / 2.0, moved, 0.0)


def sizes(played: Played) -> FloatArray:
    """Returns `[T′ + D]`, in discounted reward, how much each turn surprises.

    Of a step of the revision that is how much the total changed; where as much is expected as
    before, how much moved. Then comes what the draws at `Played.unlikely` changed.
    """
    change = played.revision.change
    moved = moved_by(change)
    revised = np.where(moved > 0.0, moved, np.abs(change.sum(axis=1)))
    return np.append(revised, np.abs(played.draws[played.unlikely]))
