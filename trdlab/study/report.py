"""The scores of a study as a page, and as plain data."""

from collections.abc import Iterator
from typing import Any

from rich.console import Group as Lines
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from trdlab.formatting import percent
from trdlab.show.text import plain_ascii, wrapped
from trdlab.statistics import Estimate
from trdlab.study.design import Design
from trdlab.study.scoring import NO_ANSWER, GroupScores, Help, Score, Scores

_SURE = 0.05
"""Below this probability under chance alone, a difference is told as one."""


def page(scores: Scores, *, width: int = 80, ascii_only: bool = False) -> RenderableType:
    """Returns the scores to read: does what is tested help, each group, and each trial.

    Args:
        scores: of a class.
        width: of the page, in letters.
        ascii_only: for terminals without UTF-8.
    """
    lines: list[Text | Table] = []
    design = scores.key.design
    for control, of in scores.help.items():
        lines += [*wrapped(_helped(of, design, control), width, "bold"), Text()]
    for name, group in scores.groups.items():
        lines += [*wrapped(_rated(design, name, group.overall), width, "bold"), Text()]
        lines += [_readers(group, ascii_only=ascii_only), Text()]
    lines += [*_trials(scores), *_misled(scores, width)]
    lines = lines[:-1]  # an empty one
    return Lines(*(_plain(line) if ascii_only else line for line in lines))


def to_dict(scores: Scores) -> dict[str, Any]:
    """Returns the scores as plain data; the schema is `trdlab.study-scores/3`."""
    answers = scores.key.answers
    return {
        "schema": "trdlab.study-scores/3",
        "study": scores.key.design.schema,
        "chance": scores.key.design.chance,
        "groups": {
            name: {
                "overall": _score_to_dict(of.overall),
                "readers": {reader: _score_to_dict(score) for reader, score in of.readers.items()},
            }
            for name, of in scores.groups.items()
        },
        "help": {control: _help_to_dict(of) for control, of in scores.help.items()},
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


def _helped(of: Help, design: Design, control: str) -> str:
    tested, other = design.groups[design.tested], design.groups[control]
    low, high = sorted(abs(100.0 * end) for end in (of.difference.low, of.difference.high))
    points = f"{abs(100 * of.difference.value):.0f} percentage points ({low:.0f} to {high:.0f})"
    subject, whose = (
        f"{tested[0].upper()}{tested[1:]}",
        f"often than those of {other}, by {points}.",
    )
    if of.p_value < _SURE:
        told = f"{subject} helps: its readers are right more {whose}"
    elif of.difference.high < 0.0:
        return f"{subject} misleads: its readers are right less {whose}"
    else:
        told = (
            f"These answers do not tell whether {tested} helps: its readers are right by "
            f"{100 * of.difference.value:+.0f} percentage points more often than those of {other} "
            f"({100 * of.difference.low:+.0f} to {100 * of.difference.high:+.0f})."
        )
    return f"{told} Chance alone does as much with a probability of {_small(of.p_value)}."


def _rated(design: Design, name: str, of: Score) -> str:
    return (
        f"Readers of {design.groups[name]}: {of.right} of {of.total} answers are right, "
        f"{percent(of.rate.value)} % ({_range(of.rate, '%')}). Guessing gets "
        f"{percent(design.chance)} % on average, and so many right with a probability of "
        f"{_small(of.p_value)}."
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


def _trials(scores: Scores) -> Iterator[Table | Text]:
    """Yields for each group a table: how often each answer was given in each trial."""
    key, letters = scores.key, (*scores.key.design.letters, NO_ANSWER)
    for name, of in scores.groups.items():
        head = "trial" if len(scores.groups) == 1 else f"trial ({name})"
        table = _table(head, "answer", *(x.replace(NO_ANSWER, "none") for x in letters))
        for i, answer in enumerate(key.answers):
            table.add_row(str(i + 1), answer, *(str(of.trials[i].get(x, 0)) for x in letters))
        yield from (table, Text())


def _misled(scores: Scores, width: int) -> Iterator[Text]:
    """Yields the texts that most readers took for those of another agent."""
    key = scores.key
    group = scores.groups.get(key.design.tested)
    for i in [] if group is None else group.misled(key.answers):
        given = group.trials[i] if group is not None else {}
        taken = max(key.design.letters, key=lambda x: given.get(x, 0))
        told = (
            f"Trial {i + 1} misleads: {given[taken]} took it for {taken}, "
            f"{given.get(key.answers[i], 0)} for {key.answers[i]}, which is right. It says:"
        )
        yield from wrapped(told, width, "bold")
        for sentence in key.texts[i]:
            yield from wrapped(sentence, width, indent=2)
        yield Text()


def _table(*columns: str) -> Table:
    table = Table(box=None, padding=(0, 3, 0, 0), header_style="bold", pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left", no_wrap=bool(i))
    return table


def _plain(line: Text | Table) -> Text | Table:
    return plain_ascii(line) if isinstance(line, Text) else line


def _small(p_value: float) -> str:
    return "less than 0.0001" if p_value < 1e-4 else f"{p_value:.2g}"
