"""An explanation: what an agent expects at a moment, why nothing else, and how far to trust it."""

from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from trdlab.agents.agent import Agent
from trdlab.environments import NotCopyable
from trdlab.environments.screens import screened
from trdlab.errors import InputError, closest
from trdlab.estimator import MapMethod
from trdlab.explanations.assessment import (
    assess,
    moment_of_play,
    trial_of,
    try_in_play,
    usual_episodes,
)
from trdlab.explanations.calibration import claims as calibration
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.episode.played import Played
from trdlab.explanations.episode.story import Story, tell
from trdlab.explanations.moment import outcome, outlook, telling
from trdlab.explanations.moment.moment import Choice
from trdlab.explanations.moment.outcome import Trial
from trdlab.explanations.rules import Claim
from trdlab.explanations.saliency import claims as mattering
from trdlab.explanations.saliency.asking import saliency_at
from trdlab.explanations.saliency.saliency import Saliency
from trdlab.explanations.sections import Section, at_first
from trdlab.printable import Printable
from trdlab.rollouts.playing import Watch, unwatched, usual_limit
from trdlab.time_axis import TimeAxis

Part = Literal["forecast", "contrast", "episode", "calibration", "saliency"]
PARTS: tuple[Part, ...] = get_args(Part)
USUAL = PARTS[:4]
"""What is told of where nothing is asked for."""

_OF_PART: dict[Part, tuple[str, ...]] = {
    "forecast": ("forecast", "outcomes", "context"),
    "contrast": ("contrast", "flips", "differences", "trial", "context"),
    "episode": ("episode",),
    "calibration": ("score", "trust", "faults", "later", "others", "critic", "judged"),
    "saliency": ("saliency", "belief"),
}


@dataclass(frozen=True, eq=False, repr=False)
class Explanation(Printable):
    """An agent at one moment: what it expects, why nothing else, and how far to trust that.

    Args:
        agent: whom it is about.
        parts: what was asked for; nothing, if only what matters most is told.
        seed: of the episode that the moment is in.
        step: of that episode.
        choice: the action of that moment and the one it is held against; None where nothing was
            asked that speaks of a moment.
        report: how far forecasts can be trusted; None where no episodes were played.
        trial: what came of both actions where they were tried; None where they were not.
        story: of the whole episode; None where it was not asked for.
        max_steps: after which episodes were cut off, if not before; None for never.
        missing: what is not known, and why, in sentences.
        observation: what the agent's forecasts are about at the moment, as its estimator is asked;
            None where nothing was asked that speaks of a moment.
        saliency: what matters for near and for far reward; None where it was not asked for.
    """

    agent: Agent
    parts: tuple[Part, ...]
    seed: int
    step: int
    choice: Choice | None
    report: CalibrationReport | None
    trial: Trial | None = None
    story: Story | None = None
    max_steps: int | None = None
    missing: tuple[str, ...] = ()
    observation: NDArray[Any] | None = None
    saliency: Saliency | None = None

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.agent.estimator.time_axis

    @property
    def state(self) -> int | None:
        """The number of the state that the moment is in, if its agent has a model."""
        seen = None if self.agent.world is None else self.observation
        return None if seen is None else int(seen)

    def to_html(self, path: str | Path, *, overwrite: bool = False) -> Path:
        """Writes the page about it and all of its episode, and returns where that is.

        Args:
            path: of the file, which ends in `.html`.
            overwrite: whether it may replace a file.

        Raises:
            OutputError: the file exists, or cannot be written.
        """
        show = import_module("trdlab.show.report.report")  # found by its name, as by `Printable`
        written: Path = show.write_report(self, Path(path), overwrite=overwrite)
        return written

    @cached_property
    def answer(self) -> tuple[Claim, ...]:
        """The few sentences that matter most: how it does, what it expects, how far to trust it."""
        moment = [] if self.choice is None else telling.in_brief(self.choice)
        tried = [] if self.trial is None else outcome.in_brief(self.trial)
        asked = [] if self.choice is None else outlook.in_brief(self.choice)  # by the user
        trust = [] if self.report is None else calibration.in_brief(self.report)
        surprise = [] if self.story is None or self.story.most is None else [self.story.most]
        matters = [] if self.saliency is None else mattering.in_brief(self.saliency)
        brief = [*trust[:1], *moment[:2], *(asked or tried[:1]), *trust[1:2]]
        if self.saliency is not None and self.choice is None:
            brief = [*matters, *brief]
        return at_first([*brief, *surprise, *moment[2:], *matters])

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """All that was asked for, or all there is, by the question that it answers."""
        episode = () if self.story is None else self.story.claims
        told = [
            *([] if self.choice is None else telling.sections(self.choice)),
            *([] if self.trial is None else outcome.sections(self.trial)),
            Section("episode", f"The episode with seed {self.seed}", episode),
            *([] if self.saliency is None else mattering.sections(self.saliency)),
            *([] if self.report is None else calibration.sections(self.report)),
            Section("missing", "What is not known", notes=self.missing),
        ]
        wanted = [name for part in self.parts or USUAL for name in _OF_PART[part]]
        return tuple(part for part in told if part and part.name in (*wanted, "missing"))

    def to_video(self, path: str | Path, what: str = "episode", **how: Any) -> Path:
        """Writes its episode as a video, and returns the path.

        Args:
            path: `.mp4` (with the extra `video`), `.webp` or `.gif`.
            what: `episode`, `saliency` or `components`.
            how: else, as for `trdlab.show.video.films.save_video`.

        Raises:
            InputError: the episode was not asked for, or there is nothing to see of it.
            OutputError: the file exists, or cannot be written.
        """
        found: Path = import_module("trdlab.show.video.films").save_video(self, path, what, **how)
        return found


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


def explain(
    agent: Agent,
    parts: tuple[Part, ...] = (),
    *,
    seed: int = 0,
    step: int = 0,
    action: str | None = None,
    foil: str | None = None,
    episodes: int | None = None,
    report: CalibrationReport | None = None,
    max_steps: int | None = None,
    components: str | None = None,
    layer: int = 0,
    maps: MapMethod = "gradcam",
    watch: Watch = unwatched,
) -> Explanation:
    """Explains an agent at a step of an episode of its own, and judges it by other episodes.

    Args:
        agent: whom to explain.
        parts: what is asked for; without any, what matters most of all.
        seed: of the episode that the moment is in.
        step: of that episode.
        action: the name or number of the action to explain, by default what the policy does.
        foil: of the one to contrast it with, by default the best other one.
        episodes: by how many the forecasts are judged, 0 for not at all; by default 300 of an exact
            table, 16 of a game, and else 50.
        report: how far the forecasts can be trusted, if that is known: then no episodes are played.
        max_steps: after which an episode is cut off, if not before; by default as `usual_limit`
            says, and no sooner than the step that is explained.
        components: those that saliency is asked about (see `parse_groups`); by default near and
            far ones.
        layer: the convolution that saliency is asked of, from 0.
        maps: how its maps are made: as in the paper, or by the gradient at each place.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: the episode has no such step, there is no such action, no episode to judge by
            where calibration was asked for, or the report is of another agent.
    """
    wanted = parts or USUAL
    limit = _limit(agent, step, max_steps)
    count = usual_episodes(agent) if episodes is None else episodes
    if report is not None:
        _check_report(report, agent, episodes)
    elif "calibration" in parts and count == 0:
        raise InputError("A calibration needs episodes.", "Ask for `episodes=50`.")
    is_usual = agent.effort.unasked and {"calibration", "contrast"} & set(wanted)
    effort = agent.effort if is_usual or "calibration" in parts else None
    choice, observation, tried, story, matters = None, None, None, None, None
    missing: list[str] = []
    film = screened if "saliency" in parts else None
    with agent.begin(seed=seed, max_steps=limit, film=film) as recording:
        names = [None if name is None else agent.action(name) for name in (action, foil)]
        if {"forecast", "contrast", "saliency"} & set(wanted):
            recording.play_to(step)
            choice = moment_of_play(agent, recording.playing).choice(*names)
            observation = np.array(recording.playing.stack.observations[0])
        if "contrast" in parts and choice is not None and len(agent.action_names) < 2:
            raise InputError(
                "There is no other action to hold it against.", "Ask for `parts=forecast`."
            )
        if "contrast" in wanted and choice is not None and choice.foil is not None:
            try:
                pair = (choice.action, choice.foil)
                tried = try_in_play(agent, recording.playing, *pair, seed=seed)
            except NotCopyable as error:
                missing.append(f"{error.cause} So the two actions were not tried out.")
        if "saliency" in wanted and choice is not None:
            of = agent, recording.playing, choice.action, names[1]
            matters = saliency_at(*of, components=components, layer=layer, method=maps, seed=seed)
        if "episode" in wanted:
            recording.play()
            (episode,) = recording.episodes()
            story = tell(Played(episode, agent.action_names, agent.seconds_per_step))
    if count and report is None:
        report = assess(agent, episodes=count, max_steps=limit, effort=effort, watch=watch)
    missing += [] if report is None or not report.lost else [report.lost]
    if choice is not None and report is not None:
        known = replace(choice.moment, calibration=report.calibration, foils=report.foils)
        choice = replace(choice, moment=known)
    if matters is not None and report is not None:
        matters = matters.judged(report.trust, usual=components is None)
    if not {"forecast", "contrast"} & set(wanted):
        choice = None
    trial = None if tried is None else trial_of(agent, tried, report, seed=seed)
    return Explanation(
        agent,
        parts,
        seed,
        step,
        choice,
        report,
        trial,
        story,
        limit,
        tuple(missing),
        observation,
        matters,
    )


def _check_report(report: CalibrationReport, agent: Agent, episodes: int | None) -> None:
    """Checks that a report is of an agent, and that nobody asks for another one."""
    if episodes is not None:
        raise InputError(f"There is a report, and {episodes} episodes.", "Leave out one of them.")
    if report.agent is None or not agent.is_same(report.agent):
        whose = "does not say of whom it is" if report.agent is None else "is of another agent"
        raise InputError(f"The report {whose}.", "Make it with trdlab.calibrate(agent).")


def _limit(agent: Agent, step: int, max_steps: int | None) -> int:
    """Returns the steps after which an episode is cut off."""
    if max_steps is None:
        return max(usual_limit(agent.estimator.time_axis), step + 1)
    if step >= max_steps:
        raise InputError(
            f"There is no step {step} in {max_steps} steps.", "Choose another `max_steps`."
        )
    return max_steps
