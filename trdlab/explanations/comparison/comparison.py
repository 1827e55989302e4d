"""Two agents compared: how far they are apart over many states, with intervals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.arrays import FloatArray
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.explanations.assessment import assess, usual_episodes
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.comparison.states import Visits, visit
from trdlab.explanations.rules import Language
from trdlab.explanations.words import forms_of
from trdlab.printable import Printable
from trdlab.rollouts.playing import Progress, Watch, unwatched, usual_limit
from trdlab.statistics import FEWEST_EPISODES, Estimate, Estimates, draws, percentiles, pooled

SIDES = ("A", "B")
"""What the two are called."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Printable):
    """How far two agents are apart, on average over the states that both came to.

    Intervals are bootstrapped by the seeds of the episodes: the two episodes of a seed, that of the
    one agent and that of the other, can be much alike. They are NaN where too few episodes differ.

    Args:
        agents: the two, where the first one acts.
        reports: how far the forecasts of each can be trusted; None where that was not judged.
        episodes: how many each of them played.
        max_steps: after which an episode was cut off, if not before.
        visits: what both expect at every state.
        means: `[2, N+1]`, what each expects of what it would do.
        difference: `[N+1]`, the second's mean minus the first's.
        apart: `[N+1]`, the mean absolute difference at a state.
        of_any_action: `[N+1]`, the same of one and the same action, over all that are allowed.
        gap: the difference over all components.
        shift: by how many steps later the second expects its rewards (see `centre`).
        agreement: the share of the states at which both would take the same action.
    """

    agents: tuple[Agent, Agent]
    reports: Sequence[CalibrationReport | None]
    episodes: int
    max_steps: int
    visits: Visits
    means: Estimates
    difference: Estimates
    apart: Estimates
    of_any_action: Estimates
    gap: Estimate
    shift: Estimate
    agreement: Estimate

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""
        return self.visits.time_axis

    @property
    def names(self) -> tuple[str, str]:
        """Of the two."""
        return self.agents[0].name, self.agents[1].name

    @property
    def words(self) -> tuple[tuple[str, ...], ...]:
        """What names each on the command line, where both act; nothing of who has no such name."""
        return tuple(() if of.origin is None else of.origin.words for of in self.agents)

    @property
    def titles(self) -> tuple[str, ...]:
        """Who A and who B is; in full where their names do not tell."""
        names = [agent.name for agent in self.agents]
        origins = [agent.origin for agent in self.agents if agent.origin is not None]
        if names[0] == names[1] and len(origins) == 2:
            names = [origin.name for origin in origins]
        return tuple(f"{side}: {name}" for side, name in zip(SIDES, names, strict=True))


COMPARISONS = Language[Comparison](
    "this comparison", lambda of: forms_of(of.time_axis, of.agents[0].seconds_per_step)
)


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
            many, or where nothing is said 300 of an exact table, 16 of a game, and else 50.
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
    return compared(players, visits, reports, episodes=count, max_steps=limit, seed=seed)


def compared(
    agents: tuple[Agent, Agent],
    visits: Visits,
    reports: Sequence[CalibrationReport | None] = (None, None),
    *,
    episodes: int,
    max_steps: int,
    seed: int = 0,
) -> Comparison:
    """Returns how far apart two agents are at some states; for the rest see `Comparison`."""
    size, actions = visits.time_axis.num_components, visits.actions
    rows = np.concatenate(
        [
            *visits.expected,
            visits.difference,
            np.abs(visits.difference),
            visits.of_any_action,
            (actions[0] == actions[1])[:, None],
        ],
        axis=1,
    )  # [M, 5·(N+1) + 1]
    counted = np.concatenate([np.ones((len(visits), 1)), rows], axis=1)
    seeds, of = np.unique(visits.seed, return_inverse=True)  # [E], [M]
    sums = np.zeros((len(seeds), counted.shape[1]))  # [E, 5·(N+1) + 2]
    np.add.at(sums, of.ravel(), counted)

    def statistics(sums: FloatArray) -> FloatArray:
        means = sums[:, 1:] / sums[:, :1]
        gap = means[:, 2 * size : 3 * size].sum(axis=1)
        gap[np.abs(gap) <= size * visits.least] = 0.0
        one, other = (centre(means[:, i * size : (i + 1) * size], visits.time_axis) for i in (0, 1))
        return np.column_stack([means, gap, other - one])

    drawn = draws(len(sums), seed)
    values = statistics(pooled(drawn, sums))
    found = percentiles(values, visits.different >= FEWEST_EPISODES)
    exists = ~np.isnan(found.value)
    found = found.where(exists, exists)
    ends = [of[: 5 * size].reshape(5, size) for of in (found.value, found.low, found.high)]
    means, difference, apart, of_any_action = (
        Estimates(*(end[part] for end in ends)) for part in (slice(2), 2, 3, 4)
    )
    return Comparison(
        agents=agents,
        reports=reports,
        episodes=episodes,
        max_steps=max_steps,
        visits=visits,
        means=means,
        difference=difference,
        apart=apart,
        of_any_action=of_any_action,
        agreement=found[5 * size],
        gap=found[5 * size + 1],
        shift=found[5 * size + 2],
    )


def centre(means: FloatArray, axis: TimeAxis) -> FloatArray:
    """Returns `[...]`: the mean step at which rewards come, weighted by what they are worth now.

    Of means `[..., N+1]` each component counts at its first step, so the residual at N·w. NaN where
    components have two signs or are all zero.

    >>> centre(np.array([[1.0, 0.0, 3.0], [1.0, -1.0, 0.0]]), TimeAxis(0.9, 2, 5))
    array([7.5, nan])
    """
    total = means.sum(axis=-1)
    one_sign = (means >= 0.0).all(axis=-1) | (means <= 0.0).all(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = means @ (np.arange(axis.num_components) * axis.width) / total
    return np.where(one_sign & (total != 0.0), found, np.nan)
