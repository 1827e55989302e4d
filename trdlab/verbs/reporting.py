"""Reporting: one page about an agent, to be sent to others."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from trdlab.verbs.making import agent as find

if TYPE_CHECKING:
    from trdlab.agents.places import Where
    from trdlab.explanations.calibration.report import CalibrationReport
    from trdlab.rollouts.playing import Watch


def report(
    agent: Any,
    env: "Where | None" = None,
    *,
    out: str | Path = "report.html",
    seed: int = 0,
    step: int | None = None,
    episodes: int | None = None,
    calibration: "CalibrationReport | None" = None,
    others: int | None = None,
    max_steps: int | None = None,
    overwrite: bool = False,
    watch: "Watch | None" = None,
    **how: Any,
) -> Path:
    """Writes one page about an agent and an episode of its own, which needs nothing else.

    Whoever opens it can go through the episode, choose actions, and see what is expected of them,
    when, how far to trust that, and what such rewards have looked like.

    Args:
        agent: whatever `trdlab.agent` takes.
        env: where it acts, if that is not where it was made for.
        out: the file, which ends in `.html`.
        seed: of the episode.
        step: at which the page begins; by default, in an episode that is not short, one before a
            reward that was foreseen.
        episodes: by how many others it is judged, 0 for not at all; by default as for `explain`.
        calibration: of `trdlab.calibrate` on the same agent, in place of such episodes.
        others: how many more episodes are recorded, to see what reward looks like; by default 3.
        max_steps: after which an episode is cut off; by default as `usual_limit` says.
        overwrite: whether it may replace a file.
        watch: told how far the episodes are, after every step.
        how: else, as for `trdlab.agent`.

    Returns:
        The path of the file.

    Raises:
        InputError: this is no agent, there is no such step, or the calibration is of another agent.
        OutputError: the file exists, or cannot be written.
    """
    from trdlab.rollouts.playing import unwatched
    from trdlab.show.report.report import OTHERS, check_report, report_agent

    path = Path(out)
    check_report(path, overwrite=overwrite)
    return report_agent(
        find(agent, env, **how),
        path,
        seed=seed,
        step=step,
        episodes=episodes,
        report=calibration,
        others=OTHERS if others is None else others,
        max_steps=max_steps,
        overwrite=overwrite,
        watch=watch or unwatched,
    )
