"""The story of an episode: what was expected, what turned out otherwise, and how it ended."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import same
from trdlab.explanations.episode.played import EPISODES, Played
from trdlab.explanations.episode.promises import broken_promises, foreseen
from trdlab.explanations.episode.surprises import sizes, surprise
from trdlab.explanations.rules import Claim, Fields, every, first
from trdlab.explanations.sections import Section
from trdlab.rollouts.episodes import Episode

MOMENTS = 5
"""How many moments of an episode are told."""
SHARE = 0.05
"""A surprise is told if it is larger than this share of `Played.scale`."""
STANDS_OUT = 0.25
"""A surprise may be what matters most if it is larger than this share of `Played.scale`."""
ROUNDING = 1e-9
"""What is smaller than this share of `Played.scale` is no surprise at all."""


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
    start: tuple[Claim, ...]
    moments: tuple[Claim, ...]
    end: tuple[Claim, ...]
    most: Claim | None

    @property
    def claims(self) -> tuple[Claim, ...]:
        """All of it."""
        return (*self.start, *self.moments, *self.end)

    def section(self, seed: int) -> Section:
        """Returns all of it as a section about the episode with a seed."""
        return Section("episode", f"The episode with seed {seed}", self.claims)


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
    most = (*broken, *(surprises[:1] if large else ()))
    is_calm = not surprises and not broken
    calm = first(played, nothing_changed, little_changed) if is_calm else []
    return Story(
        played=played,
        start=tuple(first(played, expected_nothing, expected_in_all, expected_at_start)),
        moments=tuple(sorted([*told, *surprises], key=place)),
        end=(*calm, *every(played, ended, cut_off, as_expected, other_than_expected)),
        most=most[0] if most else None,
    )


def place(claim: Claim) -> int:
    """Returns the step of the episode that a moment is about."""
    return int(claim.fields["step"] if "step" in claim.fields else claim.fields["first"])


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


# ---- the beginning and the end -----------------------------------------------------------------


@EPISODES.rule("At the start the agent expected no rewards.")
def expected_nothing(played: Played) -> Iterator[Fields]:
    if not played.episode.expected[0].any():
        yield {}


@EPISODES.rule("At the start the agent expected {value:rewards}.")
def expected_in_all(played: Played) -> Iterator[Fields]:
    """There is no explicit component."""
    row = played.episode.expected[0]  # [N+1]
    if len(row) == 1 and row.any():
        yield {"value": float(row.sum())}


@EPISODES.rule(
    "At the start the agent expected {value:rewards}, the largest part {component:when}."
)
def expected_at_start(played: Played) -> Iterator[Fields]:
    row = played.episode.expected[0]  # [N+1]
    if len(row) > 1 and row.any():
        yield {"value": float(row.sum()), "component": int(np.abs(row).argmax())}


@EPISODES.rule("No step changed what it expected.")
def nothing_changed(played: Played) -> Iterator[Fields]:
    found = sizes(played)
    if found.size and found.max() <= ROUNDING * played.scale:
        yield {}


@EPISODES.rule("No step changed what it expected by more than {most:bound}.")
def little_changed(played: Played) -> Iterator[Fields]:
    found = sizes(played)
    if found.size and found.max() > ROUNDING * played.scale:
        yield {"most": float(found.max())}


@EPISODES.rule("The episode ended after {steps:steps}{seconds:text}.")
def ended(played: Played) -> Iterator[Fields]:
    if played.episode.terminated:
        yield _length(played)


@EPISODES.rule("The episode was cut off after {steps:steps}{seconds:text}.")
def cut_off(played: Played) -> Iterator[Fields]:
    if not played.episode.terminated:
        yield _length(played)


@EPISODES.rule("Seen from the start it got {got:rewards}{scope:text}, as it had expected.")
def as_expected(played: Played) -> Iterator[Fields]:
    """The discounted reward up to the first end is what was expected then, but for rounding."""
    yield from (of for of in _outcome(played) if of["is_as_expected"])


@EPISODES.rule(
    "Seen from the start it got {got:rewards}{scope:text}; it had expected {expected:number}."
)
def other_than_expected(played: Played) -> Iterator[Fields]:
    yield from (of for of in _outcome(played) if not of["is_as_expected"])


def _outcome(played: Played) -> Iterator[Fields]:
    episode, until = played.episode, first_end(played.episode)
    if until is not None:
        got, expected = _worth(episode, until), float(episode.expected[0].sum())
        is_close = same(got, expected) or abs(got - expected) <= ROUNDING * played.scale
        lost = f" up to step {until:,}, where a life was lost"
        yield {
            "got": got,
            "expected": expected,
            "until": until,
            "scope": "" if until == len(episode) - 1 else lost,
            "is_as_expected": is_close,
        }


def _length(played: Played) -> Fields:
    seconds, steps = played.seconds_per_step, len(played.episode)
    return {"steps": steps, "seconds": "" if seconds is None else f" ({steps * seconds:.2g} s)"}


def first_end(episode: Episode) -> int | None:
    """Returns the first step after which nothing is left to come, None if a truncation was first.

    That is where the episode terminated, or a life was lost and that counts.
    """
    return int(episode.ends.argmax()) if episode.ends.any() else None


def _worth(episode: Episode, until: int) -> float:
    """Returns the reward up to a step, discounted to the first one."""
    discounts = float(episode.time_axis.gamma) ** np.arange(until + 1)
    return float(discounts @ episode.rewards[: until + 1])
