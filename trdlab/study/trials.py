"""The trials of a blind reading: what is printed of an agent at a choice, names left out."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from trdlab.errors import InputError
from trdlab.explanations.moment import contrast, forecast
from trdlab.explanations.moment.exact import tabular_moment
from trdlab.explanations.moment.moment import CHOICES, Choice, Moment
from trdlab.explanations.rules import Claim, check
from trdlab.explanations.words import joined, when_of
from trdlab.formatting import decimals_to_tell, number, percent, said
from trdlab.study.candidates import CANDIDATES, LETTERS
from trdlab.study.crossroads import TIME_AXIS, Way, draw_ways, draw_worths, model
from trdlab.tabular import exact

MOST = 30
_NAMES = ("action P", "action Q", "action R", "action S")


@dataclass(frozen=True)
class Trial:
    """What there is to read about a choice, and which agent it is about.

    Args:
        letter: of that agent.
        action: what it does, under a neutral name.
        foil: the next best action, under a neutral name.
        worth: the Q-value of each action, as it is printed.
        why: the sentences on the action against its foil.
        promise: the sentences on what the action promises.
        instead: the sentences on what the foil promises.
        reason: what truly lies on the two ways; for after the answer.
    """

    letter: str
    action: str
    foil: str
    worth: Mapping[str, str]
    why: tuple[str, ...]
    promise: tuple[str, ...]
    instead: tuple[str, ...]
    reason: str

    @property
    def parts(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """The parts of the text, each below its heading."""
        told = self.why, self.promise, self.instead
        return tuple(zip(headings(self.action, self.foil), told, strict=True))


def draw_trials(seed: int, count: int = 12) -> tuple[Trial, ...]:
    """Returns trials in random order, equally many about each candidate.

    The Q-values of a trial are drawn before it is asked whose they are. The text is what trdlab
    prints of such a choice: the contrast in brief, and the forecasts of both actions.

    Args:
        seed: of all chance.
        count: of trials.

    Raises:
        InputError: the count is no multiple of three, or out of range.
    """
    each = times_each(count, len(CANDIDATES), MOST)
    rng = np.random.default_rng(seed)
    letters = rng.permutation([*LETTERS * each]).tolist()
    return tuple(_trial(letter, *draw(letter, rng)) for letter in letters)


def times_each(count: int, candidates: int, most: int) -> int:
    """Returns how often each candidate is asked about in so many trials.

    Raises:
        InputError: that is no whole number, or there are no trials or too many.

    >>> times_each(12, candidates=3, most=30)
    4
    """
    each, rest = divmod(count, candidates)
    if rest or not 0 < count <= most:
        cure = f"Give a multiple of {candidates}, from {candidates} to {most}."
        raise InputError(f"There cannot be {count} trials.", cure)
    return each


def draw(letter: str, rng: np.random.Generator) -> tuple[Moment, dict[str, Way]]:
    """Returns a choice as an agent sees it, and what truly lies on the way of each action."""
    worths = draw_worths(rng)
    ways = draw_ways(letter, worths, rng)
    order = rng.permutation(len(ways))
    placed = tuple(ways[i] for i in order)
    moment = tabular_moment(exact(model(placed), TIME_AXIS), 0, _NAMES)
    return moment, dict(zip(_NAMES, placed, strict=True))


def _trial(letter: str, moment: Moment, ways: Mapping[str, Way]) -> Trial:
    choice = moment.choice()
    assert choice.foil is not None  # all four ways differ
    decimals = decimals_to_tell(moment.q_values)
    why, promise, instead = printed(choice)
    return Trial(
        letter=letter,
        action=choice.action,
        foil=choice.foil,
        worth={name: number(moment.q_value(name), decimals) for name in _NAMES},
        why=why,
        promise=promise,
        instead=instead,
        reason=" ".join(_described(name, ways[name]) for name in (choice.action, choice.foil)),
    )


def printed(
    choice: Choice, most: int | None = None
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Returns what is printed of a choice: why, and what to expect of its action and its foil.

    Args:
        choice: which has a foil.
        most: sentences that tell what to expect of each; by default all.
    """
    instead = choice.moment.choice(*choice.orders[1])
    one, other = (_sentences(forecast.forecast, of)[:most] for of in (choice, instead))
    return _sentences(contrast.in_brief, choice), one, other


def headings(action: str, foil: str) -> tuple[str, str, str]:
    """Returns what stands above these."""
    return (
        f"Why {action}, not {foil}",
        f"What to expect of {action}, which it takes",
        f"What to expect of {foil}, the next best",
    )


def _sentences(tell: Callable[[Choice], Iterable[Claim]], choice: Choice) -> tuple[str, ...]:
    """Returns claims as sentences, read back and checked."""
    texts = tuple(claim.sentence for claim in tell(choice))
    check(" ".join(texts), [(CHOICES, choice)])
    return texts


def _described(name: str, way: Way) -> str:
    """Returns what lies on a way as two sentences, rewards first."""
    rewards = [(k, event) for k, event in sorted(way.items()) if event.amount > 0.0]
    ((at, cost),) = [(k, event) for k, event in way.items() if event.amount < 0.0]
    pays = joined([f"{said(event.amount)} ({when_of(TIME_AXIS, k)})" for k, event in rewards])
    sure = rewards[0][1].chance == 1.0
    how = "for sure" if sure else f"each with a chance of {percent(rewards[0][1].chance)} %"
    return (
        f"{name[0].upper()}{name[1:]} pays {pays}, {how}. It costs {said(-cost.amount)} "
        f"({when_of(TIME_AXIS, at)}) with a chance of {percent(cost.chance)} %."
    )
