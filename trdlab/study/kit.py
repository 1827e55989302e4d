"""The kit of a blind reading: pages to answer in, questions to print, answers for who asks."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from html import escape
from itertools import chain
from pathlib import Path
from typing import Any, Literal

from trdlab import __version__
from trdlab.files import write_json, write_whole
from trdlab.study import sheets
from trdlab.study.candidates import CANDIDATES, LETTERS
from trdlab.study.crossroads import LATE, SOON, TIME_AXIS
from trdlab.study.design import BLIND_READING
from trdlab.study.sheets import ANSWERS, wrapped
from trdlab.study.trials import Trial

Group = Literal["text", "q"]
"""Who answers: those who read the text, and the control group, which sees the Q-values alone."""
FILES: dict[Group, tuple[str, str]] = {
    "text": ("study.html", "questions.txt"),
    "q": ("study-q.html", "questions-q.txt"),
}
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
    sheets.make_folder(folder)
    for group, names in FILES.items():
        for name, write in zip(names, (html, text), strict=True):
            write_whole(folder / name, sheets.writing(write(trials, group)))
    write_json(folder / ANSWERS, key(trials, seed))
    return paths


def kit_paths(folder: Path) -> tuple[Path, ...]:
    """Returns where the files of a kit go, once it is known that none of them exists.

    Raises:
        OutputError: one of them does, or the folder is a file.
    """
    return sheets.free_paths(folder, (*chain(*FILES.values()), ANSWERS))


def key(trials: Sequence[Trial], seed: int) -> dict[str, Any]:
    """Returns the answers as plain data: letters in one text, and the trials in full."""
    return {
        "schema": BLIND_READING.schema,
        "trdlab": __version__,
        "seed": seed,
        "answers": _answers(trials),
        "agents": [asdict(candidate) for candidate in CANDIDATES],
        "trials": [asdict(trial) for trial in trials],
    }


def text(trials: Sequence[Trial], group: Group = "text") -> str:
    """Returns the questions as plain text, to print or to read aloud."""
    choices = sheets.choices(CANDIDATES)
    lines = [_TITLE.upper(), "", wrapped(_FIRST), "", *choices, ""]
    for paragraph in _INTRO[group]:
        lines += [wrapped(paragraph), ""]
    for number, trial in enumerate(trials, 1):
        lines += ["-" * sheets.WIDTH, f"Trial {number} of {len(trials)}", ""]
        lines += _sentences(trial) if group == "text" else _worths(trial)
        lines += [sheets.ticks(_TITLE, LETTERS), ""]
    return "\n".join(lines)


def html(trials: Sequence[Trial], group: Group = "text") -> str:
    """Returns the page: all in one file, which loads nothing and shows the score itself."""
    parts = map(sheets.paragraph, _INTRO[group])
    return sheets.page(
        title=_TITLE,
        intro=[sheets.paragraph(_FIRST), sheets.listed(CANDIDATES), *parts],
        trials=["\n".join((_lists if group == "text" else _table)(trial)) for trial in trials],
        reasons=[trial.reason for trial in trials],
        answers=_answers(trials),
        candidates=CANDIDATES,
        without_script=FILES[group][1],
    )


def _sentences(trial: Trial) -> Iterator[str]:
    for heading, sentences in trial.parts:
        yield f"{heading}:"
        yield from (wrapped(told, "  - ", "    ") for told in sentences)
        yield ""


def _worths(trial: Trial) -> Iterator[str]:
    yield "What each action is worth (Q):"
    wide = max(map(len, trial.worth.values()))
    for name, worth in trial.worth.items():
        yield f"  {name}   {worth.rjust(wide)}   {_note(trial, name)}".rstrip()
    yield ""


def _note(trial: Trial, name: str) -> str:
    return {trial.action: "which it takes", trial.foil: "the next best"}.get(name, "")


def _lists(trial: Trial) -> Iterator[str]:
    for heading, told in trial.parts:
        yield sheets.sentences(heading, told)


def _table(trial: Trial) -> Iterator[str]:
    yield "<table><caption>What each action is worth (Q)</caption>"
    for name, worth in trial.worth.items():
        cells = f'<td class="number">{escape(worth)}</td><td>{_note(trial, name)}</td>'
        yield f'<tr><th scope="row">{escape(name)}</th>{cells}</tr>'
    yield "</table>"


def _answers(trials: Sequence[Trial]) -> str:
    return "".join(trial.letter for trial in trials)
