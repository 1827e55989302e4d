"""An agent explained: what it expects at a moment, how far to trust that; as text or plain data."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.text import Text

from trdlab.errors import InputError, closest
from trdlab.explain.agents import Agent
from trdlab.explain.assessment import assess, try_out
from trdlab.explain.contrast import in_short
from trdlab.explain.explanation import Explanation, explain
from trdlab.explain.finding import Claim, Finding
from trdlab.explain.limits import judged
from trdlab.explain.played import play
from trdlab.explain.playing import Watch, unwatched, usual_limit
from trdlab.explain.story import Story, tell
from trdlab.explain.tried import Trial, trial_findings
from trdlab.explain.trust.findings import trust_findings
from trdlab.explain.trust.report import TrustReport
from trdlab.show.report import actions_to_dict
from trdlab.show.sentences import MOMENTS, sentence
from trdlab.show.story import STORIES, story_lines, story_sentence, story_to_dict
from trdlab.show.templates import Language, checked, split
from trdlab.show.text import action_table, fit, story
from trdlab.show.trials import TRIALS, trial_sentence, trial_sentences
from trdlab.show.trust_data import plain_data, trust_to_dict
from trdlab.show.verdicts import REPORTS, trust_sentence
from trdlab.time_axis import TimeAxis, axis_title

Part = Literal["forecast", "contrast", "episode", "calibration"]
PARTS: tuple[Part, ...] = get_args(Part)
SCHEMA = "trdlab.explain/1"

_FIELDS: dict[Part, tuple[str, ...]] = {
    "forecast": ("forecast", "limits", "context"),
    "contrast": ("contrast", "flips", "limits", "context"),
    "episode": (),
    "calibration": (),
}
_FAULTS = (
    "too-late",
    "too-early",
    "amount-off",
    "discount-off",
    "goes-on-in-next",
    "goes-on-after-end",
)
_OUTCOMES = ("came-in-all", "missed-in-all", "open-in-all", "missed-at")
_NOT_TRIED = "It was not: the states of this environment cannot be copied."
_MOST_OF_EACH = 2  # sentences of a kind, where only what matters most is told


@dataclass(frozen=True, eq=False)
class Explained:
    """An agent at one moment, and how far its forecasts can be trusted.

    Args:
        agent: whom it is about.
        parts: what was asked for; nothing, if only what matters most is told.
        seed: of the episode that the moment is in.
        step: of that episode.
        explanation: of the moment; None where no part that speaks of one was asked for.
        report: how far forecasts can be trusted; None where no episodes were played.
        trial: what came of action and foil where they were tried; None where they were not, or
            where states cannot be copied.
        story: of the whole episode; None where it was not asked for.
        max_steps: after which episodes were cut off, if not before; None for never.
    """

    agent: Agent
    parts: tuple[Part, ...]
    seed: int
    step: int
    explanation: Explanation | None
    report: TrustReport | None
    trial: Trial | None = None
    story: Story | None = None
    max_steps: int | None = None

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.agent.estimator.time_axis


def parse_parts(text: str | None) -> tuple[Part, ...]:
    """Returns the parts that are written with commas between them, in a fixed order.

    Raises:
        InputError: there is no such part.

    >>> parse_parts("calibration,forecast")
    ('forecast', 'calibration')
    """
    words = [] if text is None else [word.strip() for word in text.split(",")]
    for word in words:
        if word not in PARTS:
            raise InputError(f"There is no explanation '{word}'.", closest(word, PARTS))
    return tuple(part for part in PARTS if part in words)


def explain_agent(
    agent: Agent,
    parts: tuple[Part, ...] = (),
    *,
    seed: int = 0,
    step: int = 0,
    action: str | None = None,
    foil: str | None = None,
    episodes: int | None = None,
    max_steps: int | None = None,
    watch: Watch = unwatched,
) -> Explained:
    """Explains an agent at a step of an episode of its own, and judges it by other episodes.

    Args:
        agent: whom to explain.
        parts: what is asked for; without any, what matters most of all.
        seed: of the episode that the moment is in.
        step: of that episode.
        action: the name or number of the action to explain, by default what the policy does.
        foil: of the one to contrast it with, by default the best other one.
        episodes: by how many the forecasts are judged, 0 for not at all; by default 300 of an exact
            table and 50 of another agent.
        max_steps: after which an episode is cut off, if not before; by default as `usual_limit`
            says, and no sooner than the step that is explained.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: the episode has no such step, there is no such action, or no episode to judge
            by where calibration was asked for.
    """
    wanted = parts or PARTS
    if max_steps is not None and step >= max_steps:
        raise InputError(
            f"There is no step {step} in {max_steps} steps.", "Choose another --max-steps."
        )
    limit = max(usual_limit(agent.estimator.time_axis), step + 1)
    limit = limit if max_steps is None else max_steps
    is_of_moment = any(_FIELDS[part] for part in wanted)
    moment = agent.moment(seed=seed, step=step) if is_of_moment else None
    chosen = None if action is None else agent.action(action)
    other = None if foil is None else agent.action(foil)
    pair = None if moment is None else moment.pair(chosen, other)  # fails before what takes long
    if "contrast" in parts and pair is not None and pair[1] is None:
        raise InputError("There is no other action to contrast it with.", "Ask for --what forecast")
    count = (50 if agent.world is None else 300) if episodes is None else episodes
    if "calibration" in parts and count == 0:
        raise InputError("A calibration needs episodes.", "Ask for --episodes 50.")
    told = tell(play(agent, seed, max_steps=limit)) if "episode" in wanted else None
    copied = "calibration" in wanted or "contrast" in wanted
    copying = agent.copying if copied else None
    report = None
    if count:
        report = assess(agent, episodes=count, max_steps=limit, copying=copying, watch=watch)
    explanation = None
    if moment is not None and pair is not None:
        explanation = explain(moment if report is None else judged(moment, report), *pair)
    trial = None
    if pair is not None and pair[1] is not None and "contrast" in wanted:
        trial = try_out(agent, pair[0], pair[1], seed=seed, step=step)
    return Explained(agent, parts, seed, step, explanation, report, trial, told, limit)


def page(explained: Explained, *, ascii_only: bool = False) -> RenderableType:
    """Returns the explanation as text: what was asked for, or what matters most.

    Args:
        explained: what is told.
        ascii_only: for terminals without UTF-8.
    """
    lines: list[RenderableType] = []

    def add(text: str, style: str = "", indent: int = 0) -> None:
        line = Text(fit(text, ascii_only=ascii_only), style=style)
        lines.append(Padding(line, (0, 0, 0, indent)))

    add(_heading(explained), "bold")
    add(_setting(explained), "dim")
    add("")
    if not explained.parts:
        for section in summary(explained):
            add(section.heading, "bold")
            for text in section.sentences:
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
        for text in [_NOT_TRIED] if explained.trial is None else trial_sentences(explained.trial):
            add(text, indent=2)
    if explained.story is not None:
        add(f"The episode with seed {explained.seed}", "bold")
        for text in story_lines(explained.story):
            add(text, indent=2)
        add("t is the step that a sentence names; the first one is step 0.", "dim", 2)
        add(_whose(explained), "dim", 2)
        if "calibration" not in explained.parts and explained.report is not None:
            add(_trust(explained.report)[0], "dim", 2)
    if "calibration" in explained.parts and explained.report is not None:
        add("How far its forecasts can be trusted", "bold")
        for text in _trust(explained.report):
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
            *(() if explained.trial is None else _outcomes(explained.trial)),
        ]
    if told is not None and told.most is not None:
        sections["What surprised it in this episode"] = [story_sentence(told.most, told.played)]
    if report is not None:
        found = trust_findings(report)
        shown = [x for i, x in enumerate(found) if i < _MOST_OF_EACH or x.kind() in _FAULTS]
        sections["How far to trust it"] = [trust_sentence(finding, report) for finding in shown]
    if explanation is not None:
        sections["Whose future"] = _told(explanation.context[:1], explanation)
    return [Section(heading, tuple(texts)) for heading, texts in sections.items() if texts]


def _outcomes(trial: Trial) -> list[str]:
    """Returns what matters most of two actions that were tried."""
    found = [finding for finding in trial_findings(trial) if finding.kind() in _OUTCOMES]
    return [trial_sentence(finding, trial) for finding in found]


def check_explained(text: str, explained: Explained) -> list[Claim]:
    """Reads rendered sentences back, tests each against what it speaks of, and returns the claims.

    Args:
        text: sentences as they are printed of any part, separated by white space.
        explained: what they speak of.

    Raises:
        UnsupportedSentenceError: a sentence is none that trdlab writes, or is not true.
    """
    subjects: tuple[tuple[Language[Any], Any], ...] = (
        (MOMENTS, explained.explanation),
        (REPORTS, explained.report),
        (TRIALS, explained.trial),
        (STORIES, None if explained.story is None else explained.story.played),
    )
    known = [(language, subject) for language, subject in subjects if subject is not None]
    return [checked(piece, known) for piece in split(text)]


def to_dict(explained: Explained) -> dict[str, Any]:
    """Returns the explanation as plain data at full precision.

    The schema is `trdlab.explain/1`: what was not asked for, and what is not known, is `null`.
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
        "trial": None if explained.trial is None else _trial_to_dict(explained.trial),
        "episode": None
        if explained.story is None
        else {"seed": explained.seed} | story_to_dict(explained.story),
        "calibration": None if report is None else trust_to_dict(report),
    }


def _trial_to_dict(trial: Trial) -> dict[str, Any]:
    return {
        "action": trial.action,
        "foil": trial.foil,
        "copies": trial.found.copies,
        "scope": trial.scope,
        "predicted": plain_data(trial.found.predicted),
        "observed": plain_data(trial.found.observed),
        "findings": [
            plain_data(finding.to_dict()) | {"sentence": trial_sentence(finding, trial)}
            for finding in trial_findings(trial)
        ],
    }


def _fields(explained: Explained) -> tuple[str, ...]:
    """Returns the fields of the explanation that are told, each once."""
    named = (field for part in explained.parts or PARTS for field in _FIELDS[part])
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
        words.append(f"episodes are cut off after {explained.max_steps:,} steps")
    return " · ".join(words)


def _is_cut_off(explained: Explained) -> bool:
    """Returns whether an episode was cut off by us, and not by a limit of its environment."""
    report, told, limit = explained.report, explained.story, explained.max_steps
    cut = report is not None and report.endings.truncated > 0
    if told is None:
        return limit is not None and cut
    episode = told.played.episode
    return episode.time_limit == limit and (cut or not episode.terminated)


def _whose(explained: Explained) -> str:
    future = explained.agent.estimator.future
    return f"The future of {future.policy} · {future.reward} · ends at {future.ending}"


def _told(findings: Sequence[Finding], explanation: Explanation) -> list[str]:
    return [sentence(finding, explanation) for finding in findings]


def _trust(report: TrustReport) -> list[str]:
    return [trust_sentence(finding, report) for finding in trust_findings(report)]
