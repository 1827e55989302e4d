"""The kit of a blind reading: pages to answer in, questions to print, answers for who asks."""

import json
import textwrap
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from html import escape
from itertools import chain
from pathlib import Path
from string import Template
from typing import Any, Literal

from trdlab import __version__
from trdlab.errors import OutputError
from trdlab.files import write_json, write_whole
from trdlab.study.candidates import CANDIDATES, LETTERS
from trdlab.study.crossroads import LATE, SOON, TIME_AXIS
from trdlab.study.trials import Trial

SCHEMA = "trdlab.study/2"
ANSWERS = "answers.json"
Group = Literal["text", "q"]
GROUPS: dict[Group, str] = {"text": "Readers of the text", "q": "Readers of Q alone"}
"""Who answers: those who read the text, and the control group, which sees the Q-values alone."""
FILES: dict[Group, tuple[str, str]] = {
    "text": ("study.html", "questions.txt"),
    "q": ("study-q.html", "questions-q.txt"),
}
_TEMPLATE = Path(__file__).parent / "page.html"
_WIDTH = 78
_NO_BREAK = "\N{NO-BREAK SPACE}"
_TITLE = "Which agent is it?"
_FIRST = "Three agents choose between four actions. Each of them does what is worth most to itself:"
_RISK = (
    f"Every action leads to a few rewards and to one danger. Soon is in {SOON[-1]} steps at most, "
    f"late is in {LATE[0]} steps or more. Agents A and B risk more than they would with the next "
    "best action. Agent C risks much less, for rewards that may come soon or late."
)
_NAMES = (
    "What is called action P in one trial may be action R in another. The same agent may come up "
    "several times. Each trial counts rewards in a unit of its own, so compare numbers only within "
    "a trial."
)
_LATER = (
    f"A reward is worth {100 * (1 - TIME_AXIS.gamma):.0f} % less now for each step that it comes "
    f"later (γ = {TIME_AXIS.gamma:g})."
)
_INTRO: dict[Group, tuple[str, ...]] = {
    "text": (
        "Each trial shows what was printed about one of them at one choice, and asks which agent "
        "it is.",
        _RISK,
        _NAMES,
        f"{_LATER} On average means over many tries: 10 with a chance of 30 % is 3 on average.",
    ),
    "q": (
        "Each trial shows what the four actions are worth to one of them at one choice (Q), and "
        "asks which agent it is. If you cannot tell, guess.",
        _RISK,
        _NAMES,
        f"{_LATER} Q is what an action pays on average, costs taken off.",
    ),
}


def write_kit(folder: Path, trials: Sequence[Trial], seed: int) -> tuple[Path, ...]:
    """Writes pages and questions of both groups and the answers, and returns their paths.

    Args:
        folder: it is made if there is none.
        trials: in the order in which they are asked.
        seed: that they were drawn with.

    Raises:
        OutputError: one of the files exists, or they cannot be written.
    """
    paths = kit_paths(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from error
    for group, names in FILES.items():
        for name, write in zip(names, (html, text), strict=True):
            write_whole(folder / name, _writing(write(trials, group)))
    write_json(folder / ANSWERS, key(trials, seed))
    return paths


def kit_paths(folder: Path) -> tuple[Path, ...]:
    """Returns where the files of a kit go, once it is known that none of them exists.

    Raises:
        OutputError: one of them does, or the folder is a file.
    """
    paths = tuple(folder / name for name in (*chain(*FILES.values()), ANSWERS))
    try:
        folder.resolve()  # raises where no folder can have this name
        is_file = folder.exists() and not folder.is_dir()
        there = [path for path in paths if path.exists()]
    except (OSError, ValueError) as error:
        raise _unwritable(folder, error) from error
    if is_file:
        raise OutputError(f"'{folder}' is a file.", "Name a folder for the kit.")
    if there:
        raise OutputError(f"The file '{there[0]}' exists.", "Choose another `out`.")
    return paths


def key(trials: Sequence[Trial], seed: int) -> dict[str, Any]:
    """Returns the answers as plain data: letters in one text, and the trials in full."""
    return {
        "schema": SCHEMA,
        "trdlab": __version__,
        "seed": seed,
        "answers": _answers(trials),
        "agents": [asdict(candidate) for candidate in CANDIDATES],
        "trials": [asdict(trial) for trial in trials],
    }


def text(trials: Sequence[Trial], group: Group = "text") -> str:
    """Returns the questions as plain text, to print or to read aloud."""
    choices = [_wrapped(c.about, f"  {c.letter}  ", "     ") for c in CANDIDATES]
    lines = [_TITLE.upper(), "", _wrapped(_FIRST), "", *choices, ""]
    for paragraph in _INTRO[group]:
        lines += [_wrapped(paragraph), ""]
    for number, trial in enumerate(trials, 1):
        lines += ["-" * _WIDTH, f"Trial {number} of {len(trials)}", ""]
        lines += _sentences(trial) if group == "text" else _worths(trial)
        lines += [f"{_TITLE}   {'   '.join(f'[ ] {letter}' for letter in LETTERS)}", ""]
    return "\n".join(lines)


def html(trials: Sequence[Trial], group: Group = "text") -> str:
    """Returns the page: all in one file, which loads nothing and shows the score itself."""
    about = (f"<dt>{c.letter}</dt><dd>{escape(c.about)}</dd>" for c in CANDIDATES)
    intro = [_paragraph(_FIRST), f"<dl>{''.join(about)}</dl>", *map(_paragraph, _INTRO[group])]
    sets = (_fieldset(trial, at, len(trials), group) for at, trial in enumerate(trials, 1))
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        intro="\n".join(intro),
        questions=FILES[group][1],
        trials="\n".join(sets),
        key=_hidden(trials),
    )


def _sentences(trial: Trial) -> Iterator[str]:
    for heading, sentences in trial.parts:
        yield f"{heading}:"
        yield from (_wrapped(told, "  - ", "    ") for told in sentences)
        yield ""


def _worths(trial: Trial) -> Iterator[str]:
    yield "What each action is worth (Q):"
    wide = max(map(len, trial.worth.values()))
    for name, worth in trial.worth.items():
        yield f"  {name}   {worth.rjust(wide)}   {_note(trial, name)}".rstrip()
    yield ""


def _note(trial: Trial, name: str) -> str:
    return {trial.action: "which it takes", trial.foil: "the next best"}.get(name, "")


def _unwritable(folder: Path, error: Exception) -> OutputError:
    reason = getattr(error, "strerror", None) or error
    return OutputError(f"Cannot make '{folder}': {reason}.", "Choose another `out`.")


def _fieldset(trial: Trial, number: int, count: int, group: Group) -> str:
    lines = [f"<fieldset><legend>Trial {number} of {count}</legend>"]
    lines += _lists(trial) if group == "text" else _table(trial)
    lines += [f'<p class="ask">{_TITLE}</p>', '<div class="choices">']
    lines += [
        f'<label><input type="radio" name="trial-{number}" value="{c.letter}">'
        f"<span><strong>{c.letter}</strong> {escape(c.about)}</span></label>"
        for c in CANDIDATES
    ]
    return "\n".join([*lines, "</div></fieldset>"])


def _lists(trial: Trial) -> Iterator[str]:
    for heading, sentences in trial.parts:
        items = "".join(f"<li>{_unbroken(escape(told))}</li>" for told in sentences)
        yield f"<h3>{escape(heading)}</h3>\n<ul>{items}</ul>"


def _table(trial: Trial) -> Iterator[str]:
    yield "<table><caption>What each action is worth (Q)</caption>"
    for name, worth in trial.worth.items():
        cells = f'<td class="number">{escape(worth)}</td><td>{_note(trial, name)}</td>'
        yield f'<tr><th scope="row">{escape(name)}</th>{cells}</tr>'
    yield "</table>"


def _hidden(trials: Sequence[Trial]) -> str:
    """Returns the answers such that they cannot be read by accident."""
    data = {"answers": _answers(trials), "reasons": [trial.reason for trial in trials]}
    return b64encode(json.dumps(data).encode()).decode()


def _answers(trials: Iterable[Trial]) -> str:
    return "".join(trial.letter for trial in trials)


def _paragraph(words: str) -> str:
    return f"<p>{escape(words)}</p>"


def _wrapped(words: str, first: str = "", later: str = "") -> str:
    filled = textwrap.fill(_unbroken(words), _WIDTH, initial_indent=first, subsequent_indent=later)
    return filled.replace(_NO_BREAK, " ")


def _unbroken(words: str) -> str:
    """Returns a text in which no line begins with a percent sign."""
    return words.replace(" %", f"{_NO_BREAK}%")


def _writing(content: str) -> Callable[[Path], object]:
    return lambda temporary: temporary.write_text(content, encoding="utf-8")
