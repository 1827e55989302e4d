"""Two agents brought together: checked that they can be compared, and compared."""

from dataclasses import replace

from trdlab.agents.agent import Agent
from trdlab.errors import InputError
from trdlab.explanations.assessment import assess, usual_episodes
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison.comparison import SIDES, Comparison, compared
from trdlab.explanations.comparison.states import visit
from trdlab.rollouts.playing import Progress, Watch, unwatched, usual_limit


def compare(
    first: Agent,
    second: Agent,
    *,
    episodes: int | None = None,
    judged_by: int | None = None,
    seed: int = 0,
    max_steps: int | None = None,
    most_states: int = 1_000,
    watch: Watch = unwatched,
) -> Comparison:
    """Compares two agents at states of episodes of both, played where the first one acts.

    Args:
        first: called A.
        second: called B; it acts where the first one does.
        episodes: how many each plays, with the seeds from `seed` on; by default 20, or 50 if both
            are exact tables.
        judged_by: how many more each plays to judge its forecasts by, 0 for none; by default as
            many, or where nothing is said 50, and 300 of an exact table.
        seed: of the first episode, and of everything else.
        max_steps: after which an episode is cut off, if not before; by default as `usual_limit`
            says.
        most_states: how many states are kept at most, half of them of the episodes of each.
        watch: told how far the episodes are, after every step.

    Raises:
        InputError: the two do not see or do the same, discount otherwise, or there is no episode.
    """
    tables = first.world is not None and second.world is not None
    count = (50 if tables else 20) if episodes is None else episodes
    if count < 1:
        raise InputError(f"There are {count} episodes.", "Ask for at least 1.")
    first.estimator.time_axis.shared(second.estimator.time_axis)  # refuses other discounts
    if differs := first.interface.unlike(second.interface):
        raise InputError(
            f"{first.name} and {second.name} cannot be compared: they have {differs[0]} and "
            f"{differs[1]}.",
            "Compare agents that see and do the same.",
        )
    there = replace(second, make=first.make, origin=None)
    if first.origin and second.origin:
        there = replace(there, origin=second.origin.at(first.origin))
    players = (first, there)
    longest = max(usual_limit(agent.estimator.time_axis) for agent in players)
    limit = longest if max_steps is None else max_steps
    visits = visit(
        players, episodes=count, seed=seed, most_states=most_states, max_steps=limit, watch=watch
    )
    reports: list[CalibrationReport | None] = []
    for side, agent in zip(SIDES, players, strict=True):

        def tell(progress: Progress, side: str = side) -> None:
            watch(replace(progress, what=f"{progress.what} {side}"))

        more = judged_by if judged_by is not None else episodes or usual_episodes(agent)
        reports.append(assess(agent, episodes=more, max_steps=limit, watch=tell) if more else None)
    return compared(
        visits,
        names=(first.name, second.name),
        words=tuple(() if of.origin is None else of.origin.words for of in players),
        place=first.origin.place if first.origin else (),
        action_names=first.action_names,
        futures=(first.estimator.future, second.estimator.future),
        reports=(reports[0], reports[1]),
        episodes=count,
        max_steps=limit,
        seconds_per_step=first.seconds_per_step,
        seed=seed,
    )
