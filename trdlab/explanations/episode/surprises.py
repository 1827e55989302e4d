"""Claims about steps that turned out other than expected, and why."""

from collections.abc import Iterator

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.explanations.claims import agrees
from trdlab.explanations.episode.played import Played, StoryClaim

FOCUS = 1 / 3
"""The share of a surprise that one component must account for, to be named as its reason."""
NEARLY = 1 / 4
"""The share of what moved from one step to another by which signs may be mixed there."""


class _Turn(StoryClaim):
    """A step, the action taken then, and what the two changed in what was expected."""

    step: int
    action: str

    @property
    def place(self) -> int:
        return self.step

    def holds(self, played: Played) -> bool:
        row = played.row(self.step)
        return row is not None and played.action(self.step) == self.action and self._is(played, row)

    def _is(self, played: Played, row: int) -> bool:
        raise NotImplementedError


# ---- more or less in all -------------------------------------------------------------------------


class _Surprise(_Turn):
    """A step that turned out better or worse in all, by as much as the revision sums to."""

    gap: float
    outcome: str

    def _is(self, played: Played, row: int) -> bool:
        change = played.revision.change[row]  # [N+1]
        total, sign = float(change.sum()), {"better": 1.0, "worse": -1.0}.get(self.outcome, 0.0)
        right = sign * total > 0.0 and agrees(self.gap, abs(total))
        return right and self._is_why(played, row, sign * change)

    def _is_why(self, played: Played, row: int, directed: FloatArray) -> bool:
        raise NotImplementedError


class Surprise(_Surprise):
    """Nothing is known of when, for there is no explicit component."""

    def _is_why(self, played: Played, row: int, directed: FloatArray) -> bool:
        return len(directed) == 1


class EndSurprise(_Surprise):
    """The future ended, which changed more than the reward did."""

    ending: str
    promised: float

    def _is_why(self, played: Played, row: int, directed: FloatArray) -> bool:
        last, episode = played.revision.last[row], played.episode
        is_over = episode.terminated and last == len(episode) - 1
        right = self.ending == ("the episode ended" if is_over else "a life was lost")
        promised = float(played.revision.before[row, 1:].sum())
        return right and _by_end(played, row, directed) and agrees(self.promised, promised)


class RewardSurprise(_Surprise):
    """The reward was another than expected."""

    reward: float
    expected: float

    def _is_why(self, played: Played, row: int, directed: FloatArray) -> bool:
        came, expected = played.revision.after[row, 0], played.revision.before[row, 0]
        right = agrees(self.reward, came) and agrees(self.expected, expected)
        return right and came != 0.0 and _by_component(played, row, directed) == 0


class NoRewardSurprise(_Surprise):
    """No reward came."""

    expected: float

    def _is_why(self, played: Played, row: int, directed: FloatArray) -> bool:
        came, expected = played.revision.after[row, 0], played.revision.before[row, 0]
        right = came == 0.0 and agrees(self.expected, expected)
        return right and _by_component(played, row, directed) == 0


class BeliefSurprise(_Surprise):
    """Another reward is expected of a later component than before."""

    component: int
    was: float
    now: float

    def _is_why(self, played: Played, row: int, directed: FloatArray) -> bool:
        c, of = self.component, played.revision
        if c < 1 or _by_component(played, row, directed) != c:
            return False
        return agrees(self.was, of.before[row, c]) and agrees(self.now, of.after[row, c])


class SpreadSurprise(_Surprise):
    """Many components changed; half of what speaks for the outcome lies at a step or before."""

    by: int

    def _is_why(self, played: Played, row: int, directed: FloatArray) -> bool:
        width, so_far = played.episode.time_axis.width, np.maximum(directed, 0.0).cumsum()
        half = int((so_far >= so_far[-1] / 2.0).argmax())
        spread = not _by_end(played, row, directed) and focus(directed) is None
        return spread and self.by == (half + 1) * width - 1


def focus(directed: FloatArray) -> int | None:
    """Returns the component that changed most in a direction, None if many changed as much.

    Args:
        directed: `[N+1]`, the change; what is above 0 speaks for the outcome.
    """
    peak = int(directed.argmax())
    return peak if directed[peak] >= FOCUS * np.maximum(directed, 0.0).sum() else None


def _by_end(played: Played, row: int, directed: FloatArray) -> bool:
    """Returns whether it was above all the end that changed something."""
    return bool(played.revision.ended[row]) and float(directed[1:].sum()) > directed[0]


def _by_component(played: Played, row: int, directed: FloatArray) -> int | None:
    """Returns the component that accounts for a surprise, None if none or the only one does."""
    is_known = len(directed) > 1 and not _by_end(played, row, directed)
    return focus(directed) if is_known else None


# ---- the same, at another step -------------------------------------------------------------------


class Moved(_Turn):
    """As much is expected as before, but rewards, or costs, lie at another step."""

    things: str
    worth: float
    origin: int
    to: int
    way: str

    def _is(self, played: Played, row: int) -> bool:
        before, after = played.revision.before[row], played.revision.after[row]
        up, down, moved = moved_between(after - before)
        ends = {"rewards": (down, up), "costs": (up, down)}.get(self.things)
        right = ends == (self.origin, self.to) and agrees(self.worth, moved)
        way = "put off" if self.to > self.origin else "brought forward"
        return right and way == self.way and _moving(before, after) == self.things


class Exchanged(_Turn):
    """As much is expected as before, but more at one step and less at another."""

    up: int
    gain: float
    down: int
    loss: float

    def _is(self, played: Played, row: int) -> bool:
        before, after = played.revision.before[row], played.revision.after[row]
        change = after - before
        right = moved_between(change)[:2] == (self.up, self.down) and _moving(before, after) == ""
        return (
            right and agrees(self.gain, change[self.up]) and agrees(self.loss, -change[self.down])
        )


def moved_between(change: FloatArray) -> tuple[int, int, float]:
    """Returns where most was gained and lost, and how much of it moved; 0 if the total changed.

    Args:
        change: `[N+1]`; its total must be at most half of what moved.
    """
    up, down = int(change.argmax()), int(change.argmin())
    moved = max(0.0, float(min(change[up], -change[down])))
    return up, down, moved if abs(float(change.sum())) <= moved / 2.0 else 0.0


def _moving(before: FloatArray, after: FloatArray) -> str | None:
    """Returns what moved, `` if that is of mixed sign, None if nothing did."""
    up, down, moved = moved_between(after - before)
    slack = NEARLY * moved
    if moved == 0.0:
        return None
    if before[up] >= -slack and after[down] >= -slack:
        return "rewards"
    return "costs" if after[up] <= slack and before[down] <= slack else ""


# ---- which of them -------------------------------------------------------------------------------


def sizes(played: Played) -> FloatArray:
    """Returns `[T′]`, in discounted reward, how much the steps of the revision surprise.

    That is how much the total changed; where as much is expected as before, how much moved.
    """
    change = played.revision.change
    amount = np.abs(change.sum(axis=1))
    moved = np.maximum(0.0, np.minimum(change.max(axis=1), -change.min(axis=1)))
    return np.asarray(np.where(amount <= moved / 2.0, moved, amount))


def surprise(played: Played, row: int) -> StoryClaim:
    """Returns what is to say of a step that changed something.

    Args:
        played: the episode.
        row: the place of the step in its revision.
    """
    return next(claim for claim in _candidates(played, row) if claim.holds(played))


def _candidates(played: Played, row: int) -> Iterator[StoryClaim]:
    of, episode = played.revision, played.episode
    step, before, after = int(of.steps[row]), of.before[row], of.after[row]
    turn = (step, played.action(step))
    up, down, moved = moved_between(after - before)
    if moved:
        for things, origin, to in (("rewards", down, up), ("costs", up, down)):
            way = "put off" if to > origin else "brought forward"
            yield Moved(*turn, things, moved, origin, to, way)
        yield Exchanged(*turn, up, float((after - before)[up]), down, float((before - after)[down]))
    total = float((after - before).sum())
    gone = (*turn, abs(total), "better" if total > 0.0 else "worse")
    directed = np.sign(total) * (after - before)
    is_over = episode.terminated and of.last[row] == len(episode) - 1
    ending = "the episode ended" if is_over else "a life was lost"
    yield Surprise(*gone)
    yield EndSurprise(*gone, ending, float(before[1:].sum()))
    yield RewardSurprise(*gone, float(after[0]), float(before[0]))
    yield NoRewardSurprise(*gone, float(before[0]))
    peak = int(directed.argmax())
    yield BeliefSurprise(*gone, peak, float(before[peak]), float(after[peak]))
    so_far = np.maximum(directed, 0.0).cumsum()
    half = int(np.searchsorted(so_far, so_far[-1] / 2.0))
    yield SpreadSurprise(*gone, (half + 1) * episode.time_axis.width - 1)
