"""The scores of a blind reading as a page, and as plain data."""

from collections.abc import Iterator
from typing import Any

from rich.console import Group as Lines
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from trdlab.formatting import percent
from trdlab.show.text import plain_ascii, wrapped
from trdlab.statistics import Estimate
from trdlab.study.candidates import LETTERS
from trdlab.study.kit import GROUPS, Group
from trdlab.study.scoring import CHANCE, NO_ANSWER, GroupScores, Help, Score, Scores

_SURE = 0.05
"""Below this probability under chance alone, a difference is told as one."""


def page(scores: Scores, *, width: int = 80, ascii_only: bool = False) -> RenderableType:
    """Returns the scores to read: does the text help, each group, and each trial.

    Args:
        scores: of a class.
        width: of the page, in letters.
        ascii_only: for terminals without UTF-8.
    """
    lines: list[Text | Table] = []
    if scores.help is not None:
        lines += [*wrapped(_helped(scores.help), width, "bold"), Text()]
    for name, group in scores.groups.items():
        lines += [*wrapped(_rated(name, group.overall), width, "bold"), Text()]
        lines += [_readers(group, ascii_only=ascii_only), Text()]
    lines += [_trials(scores), *_misled(scores, width)]
    return Lines(*(_plain(line) if ascii_only else line for line in lines))


def to_dict(scores: Scores) -> dict[str, Any]:
    """Returns the scores as plain data; the schema is `trdlab.study-scores/2`."""
    answers = scores.key.answers
    return {
        "schema": "trdlab.study-scores/2",
        "chance": CHANCE,
        "groups": {
            name: {
                "overall": _score_to_dict(of.overall),
                "readers": {reader: _score_to_dict(score) for reader, score in of.readers.items()},
            }
            for name, of in scores.groups.items()
        },
        "help": None if scores.help is None else _help_to_dict(scores.help),
        "trials": [
            {
                "answer": answer,
                "given": {name: of.trials[i] for name, of in scores.groups.items()},
                "misled": [name for name, of in scores.groups.items() if i in of.misled(answers)],
            }
            for i, answer in enumerate(answers)
        ],
    }


def _score_to_dict(of: Score) -> dict[str, Any]:
    return {
        "right": of.right,
        "total": of.total,
        "rate": of.rate.value,
        "interval": [of.rate.low, of.rate.high],
        "p_value": of.p_value,
    }


def _help_to_dict(of: Help) -> dict[str, Any]:
    interval = [of.difference.low, of.difference.high]
    return {"difference": of.difference.value, "interval": interval, "p_value": of.p_value}


def _helped(of: Help) -> str:
    low, high = sorted(abs(100.0 * end) for end in (of.difference.low, of.difference.high))
    points = f"{abs(100 * of.difference.value):.0f} percentage points ({low:.0f} to {high:.0f})"
    if of.p_value < _SURE:
        told = f"The text helps: its readers are right more often than those of Q, by {points}."
    elif of.difference.high < 0.0:
        return f"The text misleads: its readers are right less often than those of Q, by {points}."
    else:
        told = (
            "These answers do not tell whether the text helps: its readers are right by "
            f"{100 * of.difference.value:+.0f} percentage points more often than those of Q "
            f"({100 * of.difference.low:+.0f} to {100 * of.difference.high:+.0f})."
        )
    return f"{told} Chance alone does as much with a probability of {_small(of.p_value)}."


def _rated(name: Group, of: Score) -> str:
    return (
        f"{GROUPS[name]}: {of.right} of {of.total} answers are right, {percent(of.rate.value)} % "
        f"({_range(of.rate, '%')}). Guessing gets {percent(CHANCE)} % on average, and so many "
        f"right with a probability of {_small(of.p_value)}."
    )


def _range(of: Estimate, unit: str) -> str:
    return f"{100 * of.low:.0f} to {100 * of.high:.0f} {unit}"


def _readers(group: GroupScores, *, ascii_only: bool) -> Table:
    table = _table("reader", "right", "share", "95 % interval", "by guessing")
    for name, of in group.readers.items():
        share = f"{percent(of.rate.value)} %"
        cells = (name, f"{of.right}/{of.total}", share, _range(of.rate, "%"), _small(of.p_value))
        table.add_row(*(_plain(Text(cell)) if ascii_only else Text(cell) for cell in cells))
    return table


def _trials(scores: Scores) -> Table:
    """Returns, of each trial, how often each group gave each answer."""
    several = len(scores.groups) > 1
    heads = [f"{name} {x}" if several else x for name in scores.groups for x in (*LETTERS, "none")]
    table = _table("trial", "answer", *heads)
    for i, answer in enumerate(scores.key.answers):
        given = (of.trials[i].get(x, 0) for of in scores.groups.values() for x in _GIVEN)
        table.add_row(str(i + 1), answer, *map(str, given))
    return table


_GIVEN = (*LETTERS, NO_ANSWER)


def _misled(scores: Scores, width: int) -> Iterator[Text]:
    """Yields the texts that most readers took for those of another agent."""
    group, key = scores.groups.get("text"), scores.key
    for i in [] if group is None else group.misled(key.answers):
        given = group.trials[i] if group is not None else {}
        taken = max(LETTERS, key=lambda x: given.get(x, 0))
        told = (
            f"Trial {i + 1} misleads: {given[taken]} took it for {taken}, "
            f"{given.get(key.answers[i], 0)} for {key.answers[i]}, which is right. It says:"
        )
        yield from (Text(), *wrapped(told, width, "bold"))
        for sentence in key.texts[i]:
            yield from wrapped(sentence, width, indent=2)


def _table(*columns: str) -> Table:
    table = Table(box=None, padding=(0, 3, 0, 0), header_style="bold", pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left", no_wrap=bool(i))
    return table


def _plain(line: Text | Table) -> Text | Table:
    return plain_ascii(line) if isinstance(line, Text) else line


def _small(p_value: float) -> str:
    return "less than 0.0001" if p_value < 1e-4 else f"{p_value:.2g}"
