"""The story of an episode: what was expected, what turned out otherwise, and how it ended."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trdlab.arrays import one_sign, same
from trdlab.explanations.episode.played import EPISODES, Played
from trdlab.explanations.episode.promises import broken_promises, foreseen
from trdlab.explanations.episode.surprises import sizes, surprise
from trdlab.explanations.rules import Claim, Found, every

MOMENTS = 5  # of an episode are told
MOST = 0.5  # of what is expected: a component with a larger share is named

# a surprise is measured as a share of `Played.scale`
SHARE = 0.05  # a larger one is told
STANDS_OUT = 0.25  # a larger one may be what matters most
ROUNDING = 1e-9  # a smaller one is none at all


@dataclass(frozen=True, eq=False)
class Story:
    """What there is to say of an episode, few of it and in order.

    Args:
        played: what it is about.
        start: what was expected.
        moments: surprises, draws of the agent itself, the largest reward that was foreseen, and
            the promise that was broken for longest; by their steps.
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


def tell(played: Played) -> Story:
    """Returns the story of an episode, with `MOMENTS` at most."""
    broken = broken_promises(played)[:1]
    told = [*broken, *foreseen(played)[:1]]
    goes_on = not played.episode.terminated  # past what was seen, so its last step ends no promise
    cut = len(played.episode) - 1 if goes_on else None
    stays = [range(of.first, of.last + (of.last == cut)) for of in broken]
    rows = key_rows(played, MOMENTS - len(told), *stays)
    surprises = [surprise(played, row) for row in rows]
    large = bool(rows) and sizes(played)[rows[0]] > STANDS_OUT * played.scale
    most = (*broken, *(surprises[:1] if large else ()))
    calm = every(played, *changed) if not surprises and not broken else []
    return Story(
        played=played,
        start=tuple(every(played, *expected)),
        moments=tuple(sorted([*told, *surprises], key=lambda of: (place(of), of.kind != "drawn"))),
        end=(*calm, *every(played, *ended, *outcome)),
        most=most[0] if most else None,
    )


def place(claim: Claim) -> int:
    """Returns the step of the episode that a moment is about."""
    return int(claim.fields["step"] if "step" in claim.fields else claim.fields["first"])


def key_rows(played: Played, count: int, *told: range) -> list[int]:
    """Returns the turns that surprise most, spread over the episode; most first (see `sizes`).

    Of two that are closer than T/(2·count) steps, or than w, the less surprising one is left out,
    if both are draws or none is. So is all that is no larger than `SHARE` of `Played.scale`, or at
    steps that are `told` of.
    """
    found = sizes(played)
    steps = np.append(played.revision.steps, played.unlikely)
    is_draw = np.arange(len(found)) >= len(played.revision)
    apart = max(played.episode.time_axis.width, len(played.episode) / (2 * max(count, 1)))
    chosen: list[int] = []
    for row in np.argsort(-found, kind="stable").tolist():
        if len(chosen) >= count or found[row] <= SHARE * played.scale:
            break
        is_new = not any(steps[row] in of for of in told)
        near = np.abs(steps[chosen] - steps[row]) < apart
        if is_new and not (near & (is_draw[chosen] == is_draw[row])).any():
            chosen.append(row)
    return chosen


@EPISODES.kinds(
    {
        "expected-nothing": "At the start, the agent expected no rewards.",
        "expected-in-all": "At the start, all that the agent expected was worth {value:number}.",
        "expected-mostly": (
            "At the start, all that the agent expected was worth {value:number}, most of it "
            "{component:when}."
        ),
    }
)
def expected(played: Played) -> Iterator[Found]:
    row = played.episode.expected[0]  # [N+1]
    value = {"value": float(row.sum())}
    if not row.any():
        yield "expected-nothing", {}
    elif len(row) > 1 and one_sign(row) and np.abs(row).max() > MOST * abs(row.sum()):
        yield "expected-mostly", value | {"component": int(np.abs(row).argmax())}
    else:
        yield "expected-in-all", value


@EPISODES.kinds(
    {
        "nothing-changed": "No step brought a surprise.",
        "little-changed": "No step changed what was still expected by more than {most:bound}.",
    }
)
def changed(played: Played) -> Iterator[Found]:
    found = np.append(sizes(played), np.abs(played.draws))
    if len(played.revision) and found.max() <= ROUNDING * played.scale:
        yield "nothing-changed", {}
    elif len(played.revision):
        yield "little-changed", {"most": float(found.max())}


@EPISODES.kinds(
    {
        "ended": "The episode ended after {steps:steps}{seconds:text}.",
        "cut-off": "The episode was cut off after {steps:steps}{seconds:text}.",
    }
)
def ended(played: Played) -> Iterator[Found]:
    seconds, steps = played.seconds_per_step, len(played.episode)
    length = {"steps": steps, "seconds": "" if seconds is None else f" ({steps * seconds:.2g} s)"}
    yield "ended" if played.episode.terminated else "cut-off", length


@EPISODES.kinds(
    {
        "as-expected": (
            "What came was worth {got:number} at the start{scope:text}, as the agent had expected."
        ),
        "other-than-expected": (
            "What came was worth {got:number} at the start{scope:text}; the agent had expected "
            "{expected:number}."
        ),
    }
)
def outcome(played: Played) -> Iterator[Found]:
    """The discounted reward up to the first end, and whether that was expected but for rounding."""
    episode = played.episode
    if episode.ends.any():  # else a truncation came first, and more could have come
        until = int(episode.ends.argmax())
        discounts = float(episode.time_axis.gamma) ** np.arange(until + 1)
        got = float(discounts @ episode.rewards[: until + 1])
        expected = float(episode.expected[0].sum())
        is_close = same(got, expected) or abs(got - expected) <= ROUNDING * played.scale
        lost = f" (up to step {until:,}, where a life was lost)"
        fields = {
            "got": got,
            "expected": expected,
            "until": until,
            "scope": "" if until == len(episode) - 1 else lost,
            "is_as_expected": is_close,
        }
        yield "as-expected" if is_close else "other-than-expected", fields
