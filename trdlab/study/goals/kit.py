"""The kit of a goal study: for each group of readers a page, and a folder of the same in files."""

from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from trdlab import __version__
from trdlab.errors import InputError
from trdlab.files import write_json, write_whole
from trdlab.study import sheets
from trdlab.study.candidates import Candidate
from trdlab.study.design import GOAL_STUDY
from trdlab.study.goals.figures import glance_figure, strip_figure
from trdlab.study.goals.game import GOALS
from trdlab.study.goals.known import Clips, Glance
from trdlab.study.goals.trials import Trial, draw_trials, trials_of
from trdlab.study.goals.words import QUESTION, how_to_read, intro
from trdlab.study.sheets import ANSWERS, wrapped
from trdlab.study.trials import headings, printed
from trdlab.verbs.making import agent as find

QUESTIONS = "questions.txt"
_MOST_TOLD = 2  # sentences on what to expect of an action: the first reward and the first cost


@dataclass(frozen=True)
class Block:
    """A part of what readers see of a trial.

    Args:
        heading: what stands above it.
        name: of the picture, without its trial and ending.
        picture: as PNG; empty where there is none.
        alt: what it shows, in words.
        told: sentences, each below a heading of its own.
    """

    heading: str
    name: str
    picture: bytes = b""
    alt: str = ""
    told: tuple[tuple[str, tuple[str, ...]], ...] = ()


@dataclass(frozen=True, eq=False)
class Kit:
    """What a goal study asks.

    Args:
        trials: in the order in which they are asked.
        candidates: the goals to choose from.
        seed: that the trials were drawn with.
        is_own_game: whether they are of the game that comes with the study, whose rules are told.
    """

    trials: Sequence[Trial]
    candidates: Sequence[Candidate]
    seed: int
    is_own_game: bool = True

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups of readers for which there is something to see in every trial."""
        return tuple(of for of in GOAL_STUDY.groups if all(of in t.groups for t in self.trials))

    @property
    def answers(self) -> str:
        """The right ones, a letter for each trial."""
        return "".join(trial.letter for trial in self.trials)


def own_kit(seed: int, count: int = 4) -> Kit:
    """Returns the kit of the game that comes with the study (see `draw_trials`)."""
    return Kit(draw_trials(seed, count), [goal.candidate for goal in GOALS], seed)


def kit_of(named: Sequence[str], seed: int, max_steps: int | None = None) -> Kit:
    """Returns the kit of four agents of one game.

    Args:
        named: four times `GOAL=AGENT`, a goal in words and an agent as `trdlab.agent` takes it.
        seed: of the order and of the episodes.
        max_steps: after which an episode is cut off, if not before.

    Raises:
        InputError: there are not four, one is no agent, or as for `trials_of`.
    """
    letters = GOAL_STUDY.letters
    pairs = [tuple(part.strip() for part in of.partition("=")[::2]) for of in named]
    for words, (goal, agent) in zip(named, pairs, strict=True):
        if not goal or not agent:
            raise InputError(f"'{words}' is no goal and agent.", "Write GOAL=AGENT.")
    goals = len({goal for goal, _ in pairs})
    if not len(pairs) == goals == len(letters):
        cause = f"There {'is 1 goal' if goals == 1 else f'are {goals} goals'}."
        raise InputError(cause, f"Give {len(letters)} different ones, each with its agent.")
    found = dict(zip(letters, (agent for _, agent in pairs), strict=True))
    trials = trials_of({letter: find(name) for letter, name in found.items()}, seed, max_steps)
    candidates = [Candidate(letter, goal) for letter, (goal, _) in zip(letters, pairs, strict=True)]
    return Kit(trials, candidates, seed, is_own_game=False)


def kit_paths(folder: Path) -> tuple[Path, ...]:
    """Returns where the files and folders of a kit go, once it is known that none of them exists.

    Raises:
        OutputError: one of them does, or the folder is a file.
    """
    groups = GOAL_STUDY.groups
    return sheets.free_paths(folder, (*(f"{of}.html" for of in groups), *groups, ANSWERS))


def write_kit(folder: Path, kit: Kit) -> tuple[Path, ...]:
    """Writes a page and a folder for each group, and the answers, and returns their paths.

    Args:
        folder: it is made if there is none.
        kit: what is asked.

    Raises:
        OutputError: one of them exists, or they cannot be written.
    """
    kit_paths(folder)
    sheets.make_folder(folder)
    written = []
    for group in kit.groups:
        shown = [list(blocks(trial, group)) for trial in kit.trials]
        page, files = folder / f"{group}.html", folder / group
        write_whole(page, sheets.writing(_html(kit, group, shown)))
        write_whole(files, lambda at, g=group, s=shown: _write_files(at, kit, g, s))  # type: ignore[misc]
        written += [page, files]
    write_json(folder / ANSWERS, key(kit))
    return (*written, folder / ANSWERS)


def key(kit: Kit) -> dict[str, Any]:
    """Returns the answers as plain data."""
    return {
        "schema": GOAL_STUDY.schema,
        "trdlab": __version__,
        "seed": kit.seed,
        "answers": kit.answers,
        "agents": [asdict(of) for of in kit.candidates],
        "trials": [_key_of(trial) for trial in kit.trials],
    }


def _key_of(trial: Trial) -> dict[str, Any]:
    told = (words for of in trial.glances for _, part in _told(of) for words in part)
    shown = ((of.step, of.choice.action, of.choice.foil) for of in trial.glances)
    return {
        "letter": trial.letter,
        "sentences": list(told),
        "moments": [dict(zip(("step", "action", "foil"), of, strict=True)) for of in shown],
        "clips": [of.caption for of in trial.clips],
        "reason": trial.reason,
    }


def blocks(trial: Trial, group: str) -> Iterator[Block]:
    """Yields what a group sees of a trial, in order."""
    for number, of in enumerate(trial.glances, 1):
        if group != "clips":
            yield _moment(of, number, group)
    for number, clips in enumerate(trial.clips, 1):
        if group in ("report", "clips"):
            yield _clips(clips, number)


def _moment(glance: Glance, number: int, group: str) -> Block:
    is_report = group == "report"
    figure = glance_figure(
        glance,
        with_bars=group != "saliency",
        with_saliency=group != "bars" and glance.saliency is not None,
    )
    seen = f"What is seen at step {glance.step}"
    return Block(
        heading=f"Moment {number}",
        name=f"moment-{number}",
        picture=_png(figure),
        alt=seen if group == "saliency" else f"{seen}. {_numbers(glance)}",
        told=_told(glance) if is_report else (),
    )


def _clips(clips: Clips, number: int) -> Block:
    """Returns clips with what they are of; where nothing could be seen, only that."""
    heading = clips.caption.rstrip(".")
    if not clips.strips:
        return Block(heading, f"clips-{number}")
    alt = f"{len(clips.strips)} times what was seen just before, when it came, and just after"
    return Block(heading, f"clips-{number}", _png(strip_figure(clips.strips)), alt)


def _told(glance: Glance) -> tuple[tuple[str, tuple[str, ...]], ...]:
    choice = glance.choice
    if choice.foil is None:
        return ()
    return tuple(
        zip(headings(choice.action, choice.foil), printed(choice, _MOST_TOLD), strict=True)
    )


def _numbers(glance: Glance) -> str:
    """Returns the bars in words, for readers who do not see them."""
    choice, told = glance.choice, []
    for name in filter(None, (choice.action, choice.foil)):
        row = zip(choice.time_axis.labels, choice.moment.components(name), strict=True)
        bars = [f"{label} {value:.2f}" for label, value in row if abs(value) >= 0.005]
        told.append(f"Bars of {name}: {', '.join(bars) or 'none'}.")
    return " ".join(told)


def _png(figure: Figure) -> bytes:
    file = BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def _html(kit: Kit, group: str, shown: Sequence[Sequence[Block]]) -> str:
    first, *others = intro(is_own_game=kit.is_own_game)
    parts = map(sheets.paragraph, (*others, *how_to_read(group)))
    return sheets.page(
        title=QUESTION,
        intro=[sheets.paragraph(first), sheets.listed(kit.candidates), *parts],
        trials=["\n".join(map(_html_of, of)) for of in shown],
        reasons=[trial.reason for trial in kit.trials],
        answers=kit.answers,
        candidates=kit.candidates,
        without_script=f"{group}/{QUESTIONS}",
    )


def _html_of(block: Block) -> str:
    lines = [f"<h3>{escape(block.heading)}</h3>"]
    if block.picture:
        uri = f"data:image/png;base64,{b64encode(block.picture).decode()}"
        lines.append(f'<figure><img alt="{escape(block.alt)}" src="{uri}"></figure>')
    return "\n".join([*lines, *(sheets.sentences(heading, told) for heading, told in block.told)])


def _write_files(folder: Path, kit: Kit, group: str, shown: Sequence[Sequence[Block]]) -> None:
    folder.mkdir()
    for number, of in enumerate(shown, 1):
        for block in of:
            if block.picture:
                (folder / _file(number, block)).write_bytes(block.picture)
    (folder / QUESTIONS).write_text(_text(kit, group, shown), encoding="utf-8")


def _file(number: int, block: Block) -> str:
    return f"trial-{number}-{block.name}.png"


def _text(kit: Kit, group: str, shown: Sequence[Sequence[Block]]) -> str:
    """Returns the questions as plain text, which names the pictures."""
    first, *others = intro(is_own_game=kit.is_own_game)
    lines = [QUESTION.upper(), "", wrapped(first), "", *sheets.choices(kit.candidates), ""]
    for words in (*others, *how_to_read(group)):
        lines += [wrapped(words), ""]
    for number, of in enumerate(shown, 1):
        lines += ["-" * sheets.WIDTH, f"Trial {number} of {len(shown)}", ""]
        for block in of:
            lines += [f"{block.heading}:"]
            lines += [f"  [picture: {_file(number, block)}]"] * bool(block.picture)
            for heading, told in block.told:
                lines += [f"  {heading}:", *(wrapped(words, "  - ", "    ") for words in told)]
            lines.append("")
        lines += [sheets.ticks(QUESTION, "".join(c.letter for c in kit.candidates)), ""]
    return "\n".join(lines)
