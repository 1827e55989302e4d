"""The story of an episode: what was expected, what turned out otherwise, and how it ended."""

from dataclasses import dataclass

import numpy as np

from trdlab.arrays import same
from trdlab.explanations.claims import agrees
from trdlab.explanations.episode.played import Played, StoryClaim
from trdlab.explanations.episode.promises import broken_promises, foreseen
from trdlab.explanations.episode.surprises import sizes, surprise
from trdlab.rollouts.episodes import Episode

MOMENTS = 5
"""How many moments of an episode are told."""
SHARE = 0.05
"""A surprise is told if it is larger than this share of `Played.scale`."""
STANDS_OUT = 0.25
"""A surprise may be what matters most if it is larger than this share of `Played.scale`."""
ROUNDING = 1e-9
"""What is smaller than this share of `Played.scale` is no surprise at all."""


# ---- the beginning and the end -------------------------------------------------------------------


class ExpectedAtStart(StoryClaim):
    """What was expected in all at the first step, and the largest component of it."""

    value: float
    component: int

    def holds(self, played: Played) -> bool:
        row = played.episode.expected[0]  # [N+1]
        largest = len(row) > 1 and int(np.abs(row).argmax()) == self.component
        return largest and bool(row.any()) and agrees(self.value, float(row.sum()))


class ExpectedInAll(StoryClaim):
    """What was expected at the first step, where there is no explicit component."""

    value: float

    def holds(self, played: Played) -> bool:
        row = played.episode.expected[0]  # [N+1]
        return len(row) == 1 and bool(row.any()) and agrees(self.value, float(row.sum()))


class ExpectedNothing(StoryClaim):
    """No component was expected to hold anything at the first step."""

    def holds(self, played: Played) -> bool:
        return not played.episode.expected[0].any()


class NothingChanged(StoryClaim):
    """No step changed what was expected, but for rounding."""

    def holds(self, played: Played) -> bool:
        found = sizes(played)
        return bool(found.size and found.max() <= ROUNDING * played.scale)


class LittleChanged(StoryClaim):
    """The most that a step changed."""

    most: float

    def holds(self, played: Played) -> bool:
        found = sizes(played)
        changed = bool(found.size and found.max() > ROUNDING * played.scale)
        return changed and agrees(self.most, float(found.max()))


class Ended(StoryClaim):
    """The episode terminated after so many steps."""

    steps: int

    def holds(self, played: Played) -> bool:
        return played.episode.terminated and self.steps == len(played.episode)


class CutOff(StoryClaim):
    """The episode was truncated after so many steps."""

    steps: int

    def holds(self, played: Played) -> bool:
        return not played.episode.terminated and self.steps == len(played.episode)


class _Outcome(StoryClaim):
    """The discounted reward up to the first end, as of the first step."""

    got: float
    until: int

    def _is_outcome(self, played: Played) -> bool:
        until = first_end(played.episode)
        right = until is not None and until == self.until
        return right and agrees(self.got, _worth(played.episode, self.until))


class AsExpected(_Outcome):
    """It is what was expected then, but for rounding."""

    def holds(self, played: Played) -> bool:
        return self._is_outcome(played) and _is_as_expected(played, self.until)


class OtherThanExpected(_Outcome):
    """It is not what was expected then."""

    expected: float

    def holds(self, played: Played) -> bool:
        right = agrees(self.expected, float(played.episode.expected[0].sum()))
        return right and self._is_outcome(played) and not _is_as_expected(played, self.until)


def first_end(episode: Episode) -> int | None:
    """Returns the first step after which nothing is left to come, None if a truncation was first.

    That is where the episode terminated, or a life was lost and that counts.
    """
    return int(episode.ends.argmax()) if episode.ends.any() else None


def _worth(episode: Episode, until: int) -> float:
    """Returns the reward up to a step, discounted to the first one."""
    discounts = float(episode.time_axis.gamma) ** np.arange(until + 1)
    return float(discounts @ episode.rewards[: until + 1])


def _is_as_expected(played: Played, until: int) -> bool:
    got, expected = _worth(played.episode, until), float(played.episode.expected[0].sum())
    return same(got, expected) or abs(got - expected) <= ROUNDING * played.scale


# ---- the story -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Story:
    """What there is to say of an episode, few of it and in order.

    Args:
        played: what it is about.
        start: what was expected.
        moments: surprises, the largest reward that was foreseen, and the promise that was broken
            for longest; by their steps.
        end: how it ended, and what came of what was expected.
        most: the one moment that matters most; None if none matters much.
    """

    played: Played
    start: tuple[StoryClaim, ...]
    moments: tuple[StoryClaim, ...]
    end: tuple[StoryClaim, ...]
    most: StoryClaim | None

    @property
    def findings(self) -> tuple[StoryClaim, ...]:
        """All of it."""
        return (*self.start, *self.moments, *self.end)


def tell(played: Played, *, moments: int = MOMENTS) -> Story:
    """Returns the story of an episode.

    Args:
        played: the episode.
        moments: how many are told, at most.
    """
    broken = broken_promises(played)[:1]
    told = [*broken, *foreseen(played)[:1]][:moments]
    goes_on = not played.episode.terminated  # past what was seen, so its last step ends no promise
    cut = len(played.episode) - 1 if goes_on else None
    stays = [range(of.first, of.last + (of.last == cut)) for of in broken]
    rows = key_rows(played, moments - len(told), *stays)
    surprises = [surprise(played, row) for row in rows]
    large = bool(rows) and sizes(played)[rows[0]] > STANDS_OUT * played.scale
    first = (*broken, *(surprises[:1] if large else ()))
    return Story(
        played=played,
        start=_start(played),
        moments=tuple(sorted([*told, *surprises], key=lambda claim: claim.place or 0)),
        end=_end(played, is_calm=not surprises and not broken),
        most=first[0] if first else None,
    )


def key_rows(played: Played, count: int, *told: range) -> list[int]:
    """Returns the rows of the revision that surprise most, spread over the episode; most first.

    Of two that are closer than T/(2·count) steps, or than w, the less surprising one is left out,
    and so is all that is no larger than `SHARE` of `Played.scale`.

    Args:
        played: the episode.
        count: how many there are, at most.
        told: steps of which something else is told already.
    """
    found, steps = sizes(played), played.revision.steps
    apart = max(played.episode.time_axis.width, len(played.episode) / (2 * max(count, 1)))
    chosen: list[int] = []
    for row in np.argsort(-found, kind="stable").tolist():
        if len(chosen) >= count or found[row] <= SHARE * played.scale:
            break
        is_new = not any(steps[row] in of for of in told)
        if is_new and (np.abs(steps[chosen] - steps[row]) >= apart).all():
            chosen.append(row)
    return chosen


def _start(played: Played) -> tuple[StoryClaim, ...]:
    row = played.episode.expected[0]  # [N+1]
    if not row.any():
        return (ExpectedNothing(),)
    value = float(row.sum())
    if len(row) == 1:
        return (ExpectedInAll(value),)
    return (ExpectedAtStart(value, int(np.abs(row).argmax())),)


def _end(played: Played, *, is_calm: bool) -> tuple[StoryClaim, ...]:
    episode, until = played.episode, first_end(played.episode)
    end: list[StoryClaim] = []
    found = sizes(played)
    if found.size and is_calm:
        most = float(found.max())
        end.append(LittleChanged(most) if most > ROUNDING * played.scale else NothingChanged())
    end.append((Ended if episode.terminated else CutOff)(len(episode)))
    if until is not None:
        got, expected = _worth(episode, until), float(episode.expected[0].sum())
        as_expected = _is_as_expected(played, until)
        end.append(
            AsExpected(got, until) if as_expected else OtherThanExpected(got, until, expected)
        )
    return tuple(end)
