"""What kits share: pages that load nothing and score themselves, and files that replace none."""

import json
import textwrap
from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path
from string import Template

from trdlab.errors import OutputError
from trdlab.study.candidates import Candidate

ANSWERS = "answers.json"
WIDTH = 78  # letters of a line that is printed
_TEMPLATE = Path(__file__).parent / "page.html"
_NO_BREAK = "\N{NO-BREAK SPACE}"


def free_paths(folder: Path, names: Iterable[str]) -> tuple[Path, ...]:
    """Returns where the files of a kit go, once it is known that none of them exists.

    Raises:
        OutputError: one of them does, or the folder is a file.
    """
    paths = tuple(folder / name for name in names)
    try:
        folder.resolve()  # raises where no folder can have this name
        is_file = folder.exists() and not folder.is_dir()
        there = [path for path in paths if path.exists()]
    except (OSError, ValueError) as error:
        raise _unwritable(folder, error) from error
    if is_file:
        raise OutputError(f"'{folder}' is a file.", "Name a folder for the kit.")
    if there:
        what = "folder" if there[0].is_dir() else "file"
        raise OutputError(f"The {what} '{there[0]}' exists.", "Choose another `out`.")
    return paths


def make_folder(folder: Path) -> None:
    """Makes a folder if there is none.

    Raises:
        OutputError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from error


def writing(content: str) -> Callable[[Path], object]:
    """Returns what writes a text, for `write_whole`."""
    return lambda temporary: temporary.write_text(content, encoding="utf-8")


def page(
    title: str,
    intro: Iterable[str],
    trials: Sequence[str],
    reasons: Sequence[str],
    answers: str,
    candidates: Sequence[Candidate],
    without_script: str,
) -> str:
    """Returns a page: all in one file, which loads nothing and shows the score itself.

    Args:
        title: the question.
        intro: paragraphs, as HTML.
        trials: what is shown in each of them, as HTML.
        reasons: what was right, in words, for after the answers.
        answers: the right ones, a letter for each trial.
        candidates: the answers to choose from.
        without_script: where the same questions are, for readers without JavaScript.
    """
    sets = (
        _fieldset(shown, f"Trial {number} of {len(trials)}", number, title, candidates)
        for number, shown in enumerate(trials, 1)
    )
    hidden = json.dumps({"answers": answers, "reasons": list(reasons)})  # not read by accident
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=escape(title),
        intro="\n".join(intro),
        questions=escape(without_script),
        trials="\n".join(sets),
        choices=len(candidates),
        key=b64encode(hidden.encode()).decode(),
    )


def _fieldset(
    shown: str, legend: str, number: int, title: str, candidates: Sequence[Candidate]
) -> str:
    lines = [f"<fieldset><legend>{legend}</legend>", shown]
    lines += [f'<p class="ask">{escape(title)}</p>', '<div class="choices">']
    lines += [
        f'<label><input type="radio" name="trial-{number}" value="{c.letter}">'
        f"<span><strong>{c.letter}</strong> {escape(c.about)}</span></label>"
        for c in candidates
    ]
    return "\n".join([*lines, "</div></fieldset>"])


def listed(candidates: Iterable[Candidate]) -> str:
    """Returns the answers to choose from as an HTML list."""
    about = (f"<dt>{c.letter}</dt><dd>{escape(c.about)}</dd>" for c in candidates)
    return f"<dl>{''.join(about)}</dl>"


def paragraph(words: str) -> str:
    """Returns a paragraph of a page."""
    return f"<p>{escape(words)}</p>"


def sentences(heading: str, told: Iterable[str]) -> str:
    """Returns sentences of a page, each an item below a heading."""
    items = "".join(f"<li>{unbroken(escape(words))}</li>" for words in told)
    return f"<h3>{escape(heading)}</h3>\n<ul>{items}</ul>"


def wrapped(words: str, first: str = "", later: str = "") -> str:
    """Returns a paragraph to print."""
    filled = textwrap.fill(unbroken(words), WIDTH, initial_indent=first, subsequent_indent=later)
    return filled.replace(_NO_BREAK, " ")


def choices(candidates: Iterable[Candidate]) -> list[str]:
    """Returns the answers to choose from, to print."""
    return [wrapped(c.about, f"  {c.letter}  ", "     ") for c in candidates]


def ticks(question: str, letters: str) -> str:
    """Returns a question to print, with a box to tick for each answer."""
    return f"{question}   {'   '.join(f'[ ] {letter}' for letter in letters)}"


def unbroken(words: str) -> str:
    """Returns a text in which no line begins with a percent sign."""
    return words.replace(" %", f"{_NO_BREAK}%")


def _unwritable(folder: Path, error: Exception) -> OutputError:
    reason = getattr(error, "strerror", None) or error
    return OutputError(f"Cannot make '{folder}': {reason}.", "Choose another `out`.")
