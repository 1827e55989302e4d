"""The trials of a blind reading: what is printed of an agent at a choice, names left out."""

from collections.abc import Iterable, Mapping
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

FEWEST, MOST = 3, 30
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
        return (
            (f"Why {self.action}, not {self.foil}", self.why),
            (f"What to expect of {self.action}, which it takes", self.promise),
            (f"What to expect of {self.foil}, the next best", self.instead),
        )


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
    each, rest = divmod(count, len(CANDIDATES))
    if rest or not FEWEST <= count <= MOST:
        raise InputError(
            f"There cannot be {count} trials.",
            f"Give a multiple of {len(CANDIDATES)}, from {FEWEST} to {MOST}.",
        )
    rng = np.random.default_rng(seed)
    letters = rng.permutation([*LETTERS * each]).tolist()
    return tuple(_trial(letter, *draw(letter, rng)) for letter in letters)


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
    instead = moment.choice(choice.foil, choice.action)
    decimals = decimals_to_tell(moment.q_values)
    return Trial(
        letter=letter,
        action=choice.action,
        foil=choice.foil,
        worth={name: number(moment.q_value(name), decimals) for name in _NAMES},
        why=_printed(contrast.in_brief(choice), choice),
        promise=_printed(forecast.forecast(choice), choice),
        instead=_printed(forecast.forecast(instead), instead),
        reason=" ".join(_described(name, ways[name]) for name in (choice.action, choice.foil)),
    )


def _printed(claims: Iterable[Claim], choice: Choice) -> tuple[str, ...]:
    """Returns claims as sentences, read back and checked."""
    texts = tuple(claim.sentence for claim in claims)
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
