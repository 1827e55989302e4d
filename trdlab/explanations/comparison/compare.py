"""Two agents brought together: found, checked that they can be compared, and compared."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from trdlab.agents.agent import AXIS, Agent, find_agent
from trdlab.agents.models import is_model
from trdlab.agents.places import seen
from trdlab.errors import InputError
from trdlab.explanations.assessment import assess
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison.report import SIDES, Comparison, compared
from trdlab.explanations.comparison.states import visit
from trdlab.rollouts.playing import Progress, Watch, unwatched, usual_limit

_EPISODES, _JUDGED_BY = 20, 50  # of what has to be played; of an exact table it is cheap
_EPISODES_OF_TABLES, _TABLES_JUDGED_BY = 50, 300
_MOST_STATES = 1_000


def find_pair(
    names: tuple[str, str],
    *,
    gamma: float | None = None,
    horizon: int | None = None,
    width: int | None = None,
    env: str | None = None,
    env_arguments: Sequence[str] = (),
) -> tuple[Agent, Agent]:
    """Returns two agents by their names; an exact table takes γ, N and w of a run beside it.

    Args:
        names: as `find_agent` reads them.
        gamma: of exact tables, by default that of the run, or 0.95.
        horizon: N of exact tables, by default that of the run, or 4.
        width: w of exact tables, by default that of the run, or 1.
        env: an environment to act in instead of their own (see `find_place`).
        env_arguments: what to make that one with, as `KEY=VALUE`.

    Raises:
        InputError: there is no such agent, or something does not fit it.
    """
    exact = [is_model(name) for name in names]
    own = {"gamma": gamma, "horizon": horizon, "width": width}
    given: dict[str, Any] = {key: value for key, value in own.items() if value is not None}
    if given and not any(exact):
        raise InputError("Runs have their own γ, N and w.", "Leave out --gamma, --N and --w.")
    found: dict[int, Agent] = {}
    for i in sorted((0, 1), key=lambda i: exact[i]):  # runs first
        axes = [agent.estimator.time_axis for agent in found.values()]
        axis = replace(axes[0] if axes else AXIS, **given) if exact[i] else None
        found[i] = find_agent(names[i], time_axis=axis, env=env, env_arguments=env_arguments)
    return found[0], found[1]


def compare(
    first: Agent,
    second: Agent,
    *,
    episodes: int | None = None,
    judged_by: int | None = None,
    seed: int = 0,
    max_steps: int | None = None,
    most_states: int = _MOST_STATES,
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
    usual = _EPISODES_OF_TABLES if tables else _EPISODES
    count = usual if episodes is None else episodes
    if count < 1:
        raise InputError(f"There are {count} episodes.", "Ask for at least 1.")
    check_comparable(first, second)
    away = () if second.place == first.place else first.place
    there = replace(second, make=first.make, place=first.place, words=(*second.words, *away))
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

        enough = _JUDGED_BY if agent.world is None else _TABLES_JUDGED_BY
        more = judged_by if judged_by is not None else episodes or enough
        reports.append(assess(agent, episodes=more, max_steps=limit, watch=tell) if more else None)
    return compared(
        visits,
        names=(first.name, second.name),
        words=(first.words, there.words),
        place=first.place,
        action_names=first.action_names,
        futures=(first.estimator.future, second.estimator.future),
        reports=(reports[0], reports[1]),
        episodes=count,
        max_steps=limit,
        seconds_per_step=first.seconds_per_step,
        seed=seed,
    )


def check_comparable(first: Agent, second: Agent) -> None:
    """Checks that two agents see and do the same, and discount alike.

    Raises:
        InputError: they do not.
    """
    first.estimator.time_axis.shared(second.estimator.time_axis)
    for what, one, other in (
        ("see", *(_seen(agent) for agent in (first, second))),
        ("have", *(_doable(agent, (first, second)) for agent in (first, second))),
    ):
        if one != other:
            raise InputError(
                f"{first.name} and {second.name} cannot be compared: they {what} {one} and "
                f"{other}.",
                "Compare agents that see and do the same.",
            )


def _seen(agent: Agent) -> str:
    environments = agent.make(1, 0)
    try:
        return seen(environments)
    finally:
        environments.close()


def _doable(agent: Agent, pair: tuple[Agent, Agent]) -> str:
    """Returns the actions; in words if both agents have words for them."""
    named = all(not is_numbered(of.action_names) for of in pair)
    count = len(agent.action_names)
    return f"the actions {', '.join(agent.action_names)}" if named else f"{count} actions"


def is_numbered(action_names: Sequence[str]) -> bool:
    """Returns whether actions have numbers for names."""
    return all(name == f"action {i}" for i, name in enumerate(action_names))
