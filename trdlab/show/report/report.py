"""Making a report: what is recorded for it, and the file it is written to."""

from pathlib import Path
from typing import Any

from trdlab.agents.agent import Agent
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.episode.played import Played
from trdlab.explanations.episode.promises import foreseen
from trdlab.explanations.episode.story import place, tell
from trdlab.explanations.explanation import Explanation, explain
from trdlab.explanations.gallery.gallery import Recorded, gallery_of
from trdlab.files import check_output, write_whole
from trdlab.rollouts.episodes import distinct
from trdlab.rollouts.playing import Watch, unwatched, usual_limit
from trdlab.rollouts.reel import Reel
from trdlab.show.report.maps import packed_maps
from trdlab.show.report.page import Material, html
from trdlab.show.report.recording import Take, record
from trdlab.show.report.told import tell_moments

SUFFIXES = (".html", ".htm")
OTHERS = 3
"""Episodes that are recorded beside the one that is shown, to see what reward looks like."""
SHORT = 20
"""Steps: an episode with fewer is told from its beginning."""
AHEAD = 10
"""Steps before a reward that was foreseen, at which a page begins."""


def check_report(path: Path, *, overwrite: bool = False) -> None:
    """Checks that a report can be written to a path, before any work is done for it.

    Raises:
        OutputError: unknown ending, no such folder, not writable, or the file exists.
    """
    check_output(path, SUFFIXES, overwrite=overwrite)


def report_agent(
    agent: Agent,
    path: Path,
    *,
    seed: int = 0,
    step: int | None = None,
    episodes: int | None = None,
    report: CalibrationReport | None = None,
    others: int = OTHERS,
    max_steps: int | None = None,
    overwrite: bool = False,
    watch: Watch = unwatched,
) -> Path:
    """Writes the page about an agent and an episode of its own, and returns its path.

    Args:
        agent: whom it is about.
        path: of the file, which ends in `.html`.
        seed: of the episode.
        step: at which the page begins; by default, in an episode that is not short, one before a
            reward that was foreseen.
        episodes: by how many others the forecasts are judged, as for `explain`.
        report: how far the forecasts can be trusted, if that is known.
        others: how many more episodes are recorded, to see what reward looks like.
        max_steps: after which an episode is cut off, if not before.
        overwrite: whether it may replace a file.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: as for `explain`.
        OutputError: the file exists, or cannot be written.
    """
    check_report(path, overwrite=overwrite)
    how: Any = {"episodes": episodes, "report": report, "max_steps": max_steps, "watch": watch}
    if step is not None:
        explained = explain(agent, seed=seed, step=step, **how)
        return write_report(explained, path, others=others, overwrite=overwrite, watch=watch)
    reel = Reel()
    limit = usual_limit(agent.estimator.time_axis) if max_steps is None else max_steps
    take = record(agent, reel, seed=seed, max_steps=limit, with_moments=True, watch=watch)
    explained = explain(agent, seed=seed, step=_opening(agent, take), **how)
    return _write(_material(explained, take, reel, others, watch), path)


def write_report(
    explained: Explanation,
    path: Path,
    *,
    others: int = OTHERS,
    overwrite: bool = False,
    watch: Watch = unwatched,
) -> Path:
    """Writes the page about an explanation and all of its episode, and returns its path.

    Args:
        explained: the moment it begins with; the report of its calibration is told, too.
        path: of the file, which ends in `.html`.
        others: how many more episodes are recorded, to see what reward looks like.
        overwrite: whether it may replace a file.
        watch: told how far the episodes are, after every step.

    Raises:
        OutputError: the file exists, or cannot be written.
    """
    check_report(path, overwrite=overwrite)
    agent, reel = explained.agent, Reel()
    limit = explained.max_steps or usual_limit(agent.estimator.time_axis)
    take = record(agent, reel, seed=explained.seed, max_steps=limit, with_moments=True, watch=watch)
    return _write(_material(explained, take, reel, others, watch), path)


def _write(material: Material, path: Path) -> Path:
    page = html(material)
    write_whole(path, lambda temporary: temporary.write_text(page, encoding="utf-8"))
    return path


def _material(
    explained: Explanation, take: Take, reel: Reel, others: int, watch: Watch
) -> Material:
    agent, report = explained.agent, explained.report
    limit = explained.max_steps or usual_limit(agent.estimator.time_axis)
    judged = take if report is None else take.judged(report)
    more: list[Recorded] = [take.recorded]
    for other in range(1, others + 1):
        seed = explained.seed + other
        found = record(agent, reel, seed=seed, max_steps=limit, watch=watch).recorded
        more.append(found)
        if len(distinct([of.episode for of in more])) < len(more):
            more.pop()  # nothing here knows chance: all others are likely the same, too
            break
    told = tell_moments(judged.moments, agent.action_names)
    usual = [action for action, _ in told.usual]
    return Material(
        explained=explained,
        take=judged,
        story=tell(_played(agent, take)),
        told=told,
        gallery=gallery_of(more, reel),
        reel=reel,
        maps=packed_maps(agent.estimator, take.observations, usual),
    )


def _opening(agent: Agent, take: Take) -> int:
    """Returns the step that a page begins with: some steps before a reward that was foreseen."""
    played = _played(agent, take)
    if len(played.episode) < SHORT:
        return 0
    ahead = foreseen(played)
    if ahead:
        return int(max(0, ahead[0].step - min(ahead[0].steps, AHEAD)))
    most = tell(played).most
    return 0 if most is None else min(place(most), len(played.episode) - 1)


def _played(agent: Agent, take: Take) -> Played:
    return Played(take.recorded.episode, agent.action_names, agent.seconds_per_step)
