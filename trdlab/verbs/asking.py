"""Asking agents: how far to trust them, what they expect, and how two differ."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from trdlab.verbs.making import agent as find

if TYPE_CHECKING:
    from trdlab.agents.places import Where
    from trdlab.explanations.calibration.report import CalibrationReport
    from trdlab.explanations.comparison.comparison import Comparison
    from trdlab.explanations.explanation import Explanation
    from trdlab.rollouts.playing import Watch


def calibrate(
    agent: Any,
    *,
    episodes: int | None = None,
    epsilon: float | None = None,
    max_steps: int | None = None,
    seed: int = 1000,
    watch: "Watch | None" = None,
) -> "CalibrationReport":
    """Says how far ahead an agent's expectations can be trusted, by episodes that it plays.

    Args:
        agent: whatever `trdlab.agent` takes.
        episodes: by how many it is judged; by default 300 of an exact table, 16 of a game, and else
            50.
        epsilon: the chance of a random action in them; by default none, or a little where all
            episodes would be the same.
        max_steps: after which an episode is cut off; by default as `usual_limit` says.
        seed: of everything.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: this is no agent, there is no episode, or ε is outside [0, 1).
    """
    from trdlab.explanations.assessment import assess, usual_episodes
    from trdlab.rollouts.playing import unwatched, usual_limit

    judged = find(agent)
    return assess(
        judged,
        episodes=usual_episodes(judged) if episodes is None else episodes,
        epsilon=epsilon,
        max_steps=usual_limit(judged.estimator.time_axis) if max_steps is None else max_steps,
        effort=judged.effort,
        seed=seed,
        watch=watch or unwatched,
    )


def explain(
    agent: Any,
    env: "Where | None" = None,
    *,
    seed: int = 0,
    step: int = 0,
    action: str | int | None = None,
    foil: str | int | None = None,
    parts: str | None = None,
    episodes: int | None = None,
    report: "CalibrationReport | None" = None,
    max_steps: int | None = None,
    watch: "Watch | None" = None,
    **how: Any,
) -> "Explanation":
    """Explains what an agent expects at a step of an episode of its own, and how far to trust that.

    Args:
        agent: whatever `trdlab.agent` takes.
        env: where it acts, if that is not where it was made for.
        seed: of the episode.
        step: of that episode.
        action: the name or number of the action to explain, by default what the agent does.
        foil: of the one to contrast it with, by default the best other one.
        parts: what is asked for, of forecast, contrast, episode and calibration, with commas
            between; by default what matters most.
        episodes: by how many other episodes it is judged, 0 for not at all; by default 300 of an
            exact table, 16 of a game, and else 50.
        report: of `trdlab.calibrate` on the same agent, in place of such episodes.
        max_steps: after which an episode is cut off; by default as `usual_limit` says.
        watch: told how far the episodes are, after every step.
        how: else, as for `trdlab.agent`.

    Raises:
        InputError: this is no agent, there is no such step, action or part, or the report is of
            another agent.
    """
    from trdlab.explanations.explanation import explain as explaining
    from trdlab.explanations.explanation import parse_parts
    from trdlab.rollouts.playing import unwatched

    wanted = parse_parts(parts)
    return explaining(
        find(agent, env, **how),
        wanted,
        seed=seed,
        step=step,
        action=None if action is None else str(action),
        foil=None if foil is None else str(foil),
        episodes=episodes,
        report=report,
        max_steps=max_steps,
        watch=watch or unwatched,
    )


def compare(
    first: Any,
    second: Any,
    env: "Where | None" = None,
    *,
    episodes: int | None = None,
    seed: int = 0,
    max_steps: int | None = None,
    watch: "Watch | None" = None,
    **how: Any,
) -> "Comparison":
    """Compares what two agents expect at the same states, when, and how far each can be trusted.

    Args:
        first: whatever `trdlab.agent` takes; both act where this one does.
        second: likewise. An exact table takes γ, N and w of a run beside it.
        env: where both act, if that is not where the first was made for.
        episodes: how many each plays, and as many again to be judged by; by default 20 and 50, of
            exact tables 50 and 300.
        seed: of the first episode.
        max_steps: after which an episode is cut off; by default as `usual_limit` says.
        watch: told how far the episodes are, after every step.
        how: else, as for `trdlab.agent`: γ, N and w of exact tables.

    Raises:
        InputError: one is no agent, or the two cannot be compared.
    """
    from trdlab.agents.naming import find_pair
    from trdlab.explanations.comparison import comparison
    from trdlab.rollouts.playing import unwatched

    names = (first, second)
    if all(isinstance(name, str | Path) for name in names):
        pair = find_pair((str(first), str(second)), env=env, **how)
    else:
        pair = find(first, env, **how), find(second, env, **how)
    return comparison.compare(
        *pair, episodes=episodes, seed=seed, max_steps=max_steps, watch=watch or unwatched
    )
