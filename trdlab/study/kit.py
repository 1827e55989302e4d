"""The kit of a blind reading: a page to answer in, questions to print, answers for who asks."""

import json
import textwrap
from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from trdlab import __version__
from trdlab.errors import OutputError
from trdlab.files import write_json, write_whole
from trdlab.study.candidates import CANDIDATES, LETTERS, TIME_AXIS, study_map
from trdlab.study.trials import Trial

SCHEMA = "trdlab.study/1"
PAGE, QUESTIONS, ANSWERS = "study.html", "questions.txt", "answers.json"
_TEMPLATE = Path(__file__).parent / "page.html"
_WIDTH = 78
_NO_BREAK = "\N{NO-BREAK SPACE}"
_QUESTION = "Which agent is it?"
_INTRO = (
    "Three agents act on the same map. Each of them is rewarded for other things, and acts as is "
    "best for itself:",
    "Each trial shows what was printed about one of them at one moment, and asks which one it is. "
    "You see neither the map nor the names of the actions: they are called P, Q, R and S, and what "
    "is P in one trial may be R in another. The same agent may come up several times.",
    f"t is the step taken now, t+3 is three steps later, and {TIME_AXIS.labels[-1]} is all that "
    f"comes from t+{TIME_AXIS.num_steps} on. Soon is within about three steps, late is after that.",
    "What is expected is what comes on average: a reward of 1 with a chance of 90 % is 0.90. "
    "A reward that is expected later is worth less now: "
    f"{100 * (1 - TIME_AXIS.gamma):.0f} % less for each step (γ = {TIME_AXIS.gamma:g}). "
    "A cost is a reward below 0.",
)


def write_kit(folder: Path, trials: Sequence[Trial], seed: int) -> tuple[Path, ...]:
    """Writes the page, the questions and the answers into a folder, and returns their paths.

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
    page, questions, answers = paths
    write_whole(page, _writing(html(trials)))
    write_whole(questions, _writing(text(trials)))
    write_json(answers, key(trials, seed))
    return paths


def kit_paths(folder: Path) -> tuple[Path, ...]:
    """Returns where the files of a kit go, once it is known that none of them exists.

    Raises:
        OutputError: one of them does, or the folder is a file.
    """
    paths = tuple(folder / name for name in (PAGE, QUESTIONS, ANSWERS))
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


def text(trials: Sequence[Trial]) -> str:
    """Returns the questions as plain text, to print or to read aloud."""
    lines = ["WHICH AGENT IS IT?", ""]
    first, *others = _INTRO
    lines += [_wrapped(first), "", *_choices(), ""]
    for paragraph in others:
        lines += [_wrapped(paragraph), ""]
    for number, trial in enumerate(trials, 1):
        lines += ["-" * _WIDTH, f"Trial {number} of {len(trials)}", ""]
        for heading, sentences in trial.parts:
            lines += [f"{heading}:", *(_wrapped(told, "  - ", "    ") for told in sentences), ""]
        lines += [f"{_QUESTION}   {'   '.join(f'[ ] {letter}' for letter in LETTERS)}", ""]
    return "\n".join(lines)


def html(trials: Sequence[Trial]) -> str:
    """Returns the page: all in one file, which loads nothing and shows the score itself."""
    first, *others = _INTRO
    about = (f"<dt>{c.letter}</dt><dd>{escape(c.about)}</dd>" for c in CANDIDATES)
    intro = [_paragraph(first), f"<dl>{''.join(about)}</dl>", *map(_paragraph, others)]
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        intro="\n".join(intro),
        trials="\n".join(_fieldset(trial, at, len(trials)) for at, trial in enumerate(trials, 1)),
        key=_hidden(trials),
    )


def _unwritable(folder: Path, error: Exception) -> OutputError:
    reason = getattr(error, "strerror", None) or error
    return OutputError(f"Cannot make '{folder}': {reason}.", "Choose another `out`.")


def _fieldset(trial: Trial, number: int, count: int) -> str:
    lines = [f"<fieldset><legend>Trial {number} of {count}</legend>"]
    for heading, sentences in trial.parts:
        items = "".join(f"<li>{_unbroken(escape(told))}</li>" for told in sentences)
        lines += [f"<h3>{escape(heading)}</h3>", f"<ul>{items}</ul>"]
    lines += [f'<p class="ask">{_QUESTION}</p>', '<div class="choices">']
    lines += [
        f'<label><input type="radio" name="trial-{number}" value="{c.letter}">'
        f"<span><strong>{c.letter}</strong> {escape(c.about)}</span></label>"
        for c in CANDIDATES
    ]
    return "\n".join([*lines, "</div></fieldset>"])


def _hidden(trials: Sequence[Trial]) -> str:
    """Returns the answers such that they cannot be read by accident."""
    grid = study_map()
    data = {
        "answers": _answers(trials),
        "reasons": [trial.reason for trial in trials],
        "map": "\n".join(grid.rows),
        "about": (
            "S start, c coin, h hazard, T treasure, which ends the episode, # wall. "
            f"A move slips sideways with a chance of {100 * grid.slip:.0f} %."
        ),
        "pays": [f"Agent {c.letter} gets {c.pays}." for c in CANDIDATES],
    }
    return b64encode(json.dumps(data).encode()).decode()


def _answers(trials: Iterable[Trial]) -> str:
    return "".join(trial.letter for trial in trials)


def _choices() -> list[str]:
    return [_wrapped(c.about, f"  {c.letter}  ", "     ") for c in CANDIDATES]


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
