"""Verdicts: whose forecasts are good, bad or not tested, and about what comes when.

Components in a row of which the same is to be said are one verdict.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from typing import Literal, NamedTuple, TypeVar

from trdlab.explanations.calibration.calibration import Calibration, Status
from trdlab.explanations.rules import Fields, Language, Rule
from trdlab.statistics import FEWEST_EPISODES

E = TypeVar("E")
Kind = Literal[
    "better", "right", "no-better", "wrong", "too-few", "unsure", "undecided", "silent", "unseen"
]


class Judged(NamedTuple):
    """Forecasts that were judged.

    Args:
        whose: the forecasts, in words: `its forecasts`.
        calibration: how well they predicted each component.
        unseen: why it is not known what came, where it is not.
    """

    whose: str
    calibration: Calibration
    unseen: str = "no episode shows it"


_FEW = (
    "{episodes:count} different episodes are too few to judge {whose:text} about what comes "
    "{span:span}"
)
_SAYS: dict[Kind, str] = {
    "better": "{whose:text} are better than a guess about what comes {span:span}.",
    "right": "{whose:text} are right about what comes {span:span}: it was the same every time.",
    "no-better": "{whose:text} are no better than a guess about what comes {span:span}.",
    "wrong": (
        "{whose:text} are wrong about what comes {span:span}: {said:number} on average, where "
        "{came:number} came every time."
    ),
    "too-few": (
        "Judging {whose:text} about what comes {span:span} needs {enough:count} different episodes "
        "instead of {episodes:count}."
    ),
    "unsure": f"{_FEW}; about {{enough:count}} would do.",
    "undecided": f"{_FEW}.",
    "silent": "{whose:text} about what comes {span:span} were not tested: no reward came then.",
    "unseen": "{whose:text} about what comes {span:span} were not tested: {unseen:text}.",
}


_CONSTANT: dict[Status, Kind] = {"good": "right", "bad": "wrong", "open": "unsure"}


def add_verdicts(
    language: Language[E], judged: Callable[[E], Iterable[Judged]]
) -> tuple[Rule[E], ...]:
    """Adds a rule for each kind of verdict to a language, and returns them.

    Args:
        language: whose forms know `span`, `number`, `count`, `episodes` and `text`.
        judged: the forecasts that some evidence judges.
    """

    def finder(kind: Kind) -> Callable[[E], Iterator[Fields]]:
        def find(evidence: E) -> Iterator[Fields]:
            for of in judged(evidence):
                yield from (fields for own, fields in _runs(of) if own == kind)

        return find

    return tuple(language.rule(says, kind=kind)(finder(kind)) for kind, says in _SAYS.items())


def _runs(judged: Judged) -> Iterator[tuple[Kind, Fields]]:
    """Yields components in a row that are of one kind, with their numbers."""
    told = judged.calibration
    kinds = [_kind(told, i) for i in range(len(told.status))]
    for kind, run in groupby(range(len(kinds)), key=kinds.__getitem__):
        first, *_, last = (*run,) * 2
        here = slice(first, last + 1)
        fields: Fields = {"whose": judged.whose, "span": (first, last)}
        came = float(told.mean[here].sum())
        if kind in ("right", "wrong"):
            fields |= {"said": came + float(told.bias.value[here].sum()), "came": came}
        elif kind in ("too-few", "unsure"):
            needed = told.enough[here]
            fields |= {"episodes": int(told.num_episodes[here].min())}
            if None in needed:
                kind = "undecided"
            else:
                fields |= {"enough": max(x for x in needed if x is not None)}
        elif kind == "unseen":
            fields |= {"unseen": judged.unseen}
        yield kind, fields


def _kind(told: Calibration, i: int) -> Kind:
    if told.status[i] == "not tested":
        return "silent" if told.constant[i] else "unseen"
    if told.constant[i]:
        return _CONSTANT[told.status[i]]
    if told.status[i] == "open":
        return "too-few" if told.num_episodes[i] < FEWEST_EPISODES else "unsure"
    return "better" if told.status[i] == "good" else "no-better"
