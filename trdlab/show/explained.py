"""An agent explained: what it expects at a moment, how far to trust that; as text or plain data."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.console import Group, RenderableType

from trdlab.explanations.calibration import claims as calibrations
from trdlab.explanations.calibration.faults import REPORTS
from trdlab.explanations.claims import Finding
from trdlab.explanations.explained import FIELDS, PARTS, Explained
from trdlab.explanations.moment import outcome
from trdlab.explanations.moment.contrast import in_short
from trdlab.explanations.moment.explanation import Explanation
from trdlab.explanations.moment.sentences import MOMENTS, sentence
from trdlab.explanations.rules import plain_data
from trdlab.explanations.slots import Language, checked, split
from trdlab.show.page import action_table, paragraph, story
from trdlab.show.report import actions_to_dict
from trdlab.show.story import STORIES, story_lines, story_sentence, story_to_dict
from trdlab.time_axis import axis_title

SCHEMA = "trdlab.explanations/1"

_NOT_TRIED = "It was not: the states of this environment cannot be copied."
_MOST_OF_EACH = 2  # sentences of a kind, where only what matters most is told


def page(explained: Explained, *, ascii_only: bool = False) -> RenderableType:
    """Returns the explanation as text: what was asked for, or what matters most.

    Args:
        explained: what is told.
        ascii_only: for terminals without UTF-8.
    """
    lines: list[RenderableType] = []

    def add(text: str, style: str = "", indent: int = 0) -> None:
        lines.append(paragraph(text, style, indent, ascii_only=ascii_only))

    add(_heading(explained), "bold")
    add(_setting(explained), "dim")
    add("")
    if not explained.parts:
        for part in summary(explained):
            add(part.heading, "bold")
            for text in part.sentences:
                add(text, indent=2)
        return Group(*lines)
    explanation = explained.explanation
    if explanation is not None:
        is_contrast = "contrast" in explained.parts
        foil = explanation.foil if is_contrast else None
        add("Expected discounted reward of each action, by the step it is expected at")
        moment, action = explanation.moment, explanation.action
        lines.append(action_table(moment, action, foil, ascii_only=ascii_only))
        add("")
        lines.append(story(explanation, sections=_fields(explained), ascii_only=ascii_only))
    if "contrast" in explained.parts:
        add("Tried out", "bold")
        tried = None if explained.trial is None else outcome.sections(explained.trial)
        for text in (_NOT_TRIED,) if tried is None else tried[0].sentences:
            add(text, indent=2)
    if explained.story is not None:
        add(f"The episode with seed {explained.seed}", "bold")
        for text in story_lines(explained.story):
            add(text, indent=2)
        add("t is the step that a sentence names; the first one is step 0.", "dim", 2)
        add(_whose(explained), "dim", 2)
        if "calibration" not in explained.parts and explained.report is not None:
            add(calibrations.verdicts(explained.report)[0].sentence, "dim", 2)
    if "calibration" in explained.parts and explained.report is not None:
        for section in calibrations.sections(explained.report):
            add(section.heading, "bold")
            for text in section.sentences:
                add(text, indent=2)
    return Group(*lines)


@dataclass(frozen=True)
class Section:
    """A few sentences under the question that they answer.

    Args:
        heading: the question, in short.
        sentences: the answer.
    """

    heading: str
    sentences: tuple[str, ...]


def summary(explained: Explained) -> list[Section]:
    """Returns the few sentences that matter most, by the question that they answer.

    What the action promises, why not the next best and what came of both, the moment of the episode
    that surprised most if one did, how far to trust that and why no further, whose future it is.
    """
    explanation, report, told = explained.explanation, explained.report, explained.story
    sections: dict[str, list[str]] = {}
    if explanation is not None:
        promises = _told(explanation.forecast[:_MOST_OF_EACH], explanation)
        sections[f"What {explanation.action} promises"] = promises
        sections[f"Why not {explanation.foil}"] = [
            *_told(in_short(explanation.contrast), explanation),
            *(
                claim.sentence
                for claim in ([] if explained.trial is None else outcome.in_brief(explained.trial))
            ),
        ]
    if told is not None and told.most is not None:
        sections["What surprised it in this episode"] = [story_sentence(told.most, told.played)]
    if report is not None:
        shown = calibrations.in_brief(report)
        sections["How far to trust it"] = [claim.sentence for claim in shown]
    if explanation is not None:
        sections["Whose future"] = _told(explanation.context[:1], explanation)
    return [Section(heading, tuple(texts)) for heading, texts in sections.items() if texts]


def check_explained(text: str, explained: Explained) -> list[Any]:
    """Reads rendered sentences back, tests each against what it speaks of, and returns the claims.

    Args:
        text: sentences as they are printed of any part, separated by white space.
        explained: what they speak of.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    rules: list[tuple[Any, Any]] = [
        (REPORTS, explained.report),
        (outcome.TRIALS, explained.trial),
    ]
    subjects: tuple[tuple[Language[Any], Any], ...] = (
        (MOMENTS, explained.explanation),
        (STORIES, None if explained.story is None else explained.story.played),
    )
    known = [(language, subject) for language, subject in subjects if subject is not None]

    def true(piece: str) -> Any:
        found = (rule.true(piece, of) for rule, of in rules if of is not None)
        return next((claim for claim in found if claim is not None), None)

    return [true(piece) or checked(piece, known) for piece in split(text)]


def to_dict(explained: Explained) -> dict[str, Any]:
    """Returns the explanation as plain data at full precision.

    The schema is `trdlab.explanations/1`: what was not asked for, and what is not known, is `null`.
    """
    explanation, report, axis = explained.explanation, explained.report, explained.time_axis
    moment = None
    if explanation is not None:
        moment = {
            "seed": explained.seed,
            "step": explained.step,
            "actions": actions_to_dict(explanation.moment),
            "error": plain_data(explanation.moment.error),
            "foil_error": plain_data(explanation.moment.foil_error),
            "only_reward": plain_data(explanation.moment.only_reward),
            "action": explanation.action,
            "foil": explanation.foil,
            "findings": [
                plain_data(finding.to_dict()) | {"sentence": sentence(finding, explanation)}
                for field in _fields(explained)
                for finding in getattr(explanation, field)
            ],
        }
    return {
        "schema": SCHEMA,
        "agent": explained.agent.name,
        "seconds_per_step": explained.agent.seconds_per_step,
        "max_steps": explained.max_steps,
        "time_axis": {**asdict(axis), "labels": axis.labels},
        "future": asdict(explained.agent.estimator.future),
        "summary": [asdict(section) for section in summary(explained)],
        "moment": moment,
        "trial": None if explained.trial is None else explained.trial.to_dict(),
        "episode": None
        if explained.story is None
        else {"seed": explained.seed} | story_to_dict(explained.story),
        "calibration": None if report is None else calibrations.to_dict(report),
    }


def _fields(explained: Explained) -> tuple[str, ...]:
    """Returns the fields of the explanation that are told, each once."""
    named = (field for part in explained.parts or PARTS for field in FIELDS[part])
    return tuple(dict.fromkeys(named))


def _heading(explained: Explained) -> str:
    explanation = explained.explanation
    words = [explained.agent.name]
    if explanation is not None:
        words.append(f"step {explained.step} of the episode with seed {explained.seed}")
        foil = f" or {explanation.foil}" if explanation.foil is not None else ""
        words.append(f"{explanation.action}{foil}")
    elif explained.story is not None:
        words.append(f"the episode with seed {explained.seed}")
    return " · ".join(words)


def _setting(explained: Explained) -> str:
    words = [axis_title(explained.time_axis)]
    seconds = explained.agent.seconds_per_step
    if seconds is not None:
        words.append(f"a step is {seconds:.2g} s of play")
    if _is_cut_off(explained):
        unit = "step" if explained.max_steps == 1 else "steps"
        words.append(f"episodes are cut off after {explained.max_steps:,} {unit}")
    return " · ".join(words)


def _is_cut_off(explained: Explained) -> bool:
    """Returns whether an episode was cut off by us, and not by a limit of its environment."""
    report, told, cut = explained.report, explained.story, set()
    if report is not None and report.judged.truncated:
        cut.add(report.judged.time_limit)
    if told is not None and not told.played.episode.terminated:
        cut.add(told.played.episode.time_limit)
    return explained.max_steps in cut - {None}


def _whose(explained: Explained) -> str:
    future = explained.agent.estimator.future
    return f"The future of {future.policy} · {future.reward} · ends at {future.ending}"


def _told(findings: Sequence[Finding], explanation: Explanation) -> list[str]:
    return [sentence(finding, explanation) for finding in findings]
