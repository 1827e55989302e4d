"""Episodes and estimators that tests write down, and what can be solved exactly of tables."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trdlab.agents import Agent
from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations import CalibrationReport, Trial, explain
from trdlab.rollouts.episodes import Episode
from trdlab.tabular import ExactTable, exact
from trdlab.tabular.uncertainty import spread


@dataclass(frozen=True, eq=False)
class Given:
    """A table `[S, A, N+1]` of whatever components, as an Estimator."""

    components: FloatArray
    time_axis: TimeAxis
    future: Future

    def decompose(self, observations: Any) -> RewardDecomposition:
        return RewardDecomposition(self.components[observations], self.time_axis)


def try_out(
    agent: Agent,
    action: str,
    foil: str,
    *,
    seed: int = 0,
    copies: int | None = None,
    report: CalibrationReport | None = None,
) -> Trial | None:
    """What comes of two actions at the first step of an episode, each tried from so many copies."""
    tries = copies or agent.effort.tries
    known = replace(agent, effort=replace(agent.effort, tries=tries))
    asked: Any = {"report": report} if report is not None else {"episodes": 0}
    return explain(known, ("contrast",), seed=seed, action=action, foil=foil, **asked).trial


def episode(
    rewards: Sequence[float],
    axis: TimeAxis,
    expected: ArrayLike | None = None,
    **changes: Any,
) -> Episode:
    """An episode of one action: rewards `[T]`, and what each observation expected `[T+1, N+1]`.

    It has ended, unless `terminated` is changed.
    """
    total = len(rewards)
    rows = np.zeros((total + 1, axis.num_components)) if expected is None else np.array(expected)
    ends = np.zeros(total, dtype=np.bool_)
    ends[-1] = changes.get("terminated", True)
    known = Episode(
        decomposition=RewardDecomposition(rows[:total, None], axis),
        expected=rows,
        actions=np.zeros(total, dtype=np.int64),
        rewards=np.array(rewards),
        life_lost=np.zeros(total, dtype=np.bool_),
        ends=ends,
        terminated=True,
        random=np.zeros(total + axis.num_steps, dtype=np.bool_),
    )
    return replace(known, **changes)


def occupancy(table: ExactTable) -> FloatArray:
    """Returns `[S, A]`: how often an episode takes each action in each state."""
    mdp, policy = table.mdp, table.solution.policy
    follow = policy[mdp.transition_states, mdp.transition_actions] * mdp.continuation
    chain = np.zeros((mdp.num_states, mdp.num_states))
    np.add.at(chain, (mdp.next_states, mdp.transition_states), follow)
    begin = np.eye(mdp.num_states)[mdp.start]
    states: FloatArray = np.linalg.solve(np.eye(mdp.num_states) - chain, begin)
    return states[:, None] * policy


def exact_ceiling(table: ExactTable, visits: FloatArray) -> FloatArray:
    """Returns `[N+1]`: the skill of a perfect prediction, by how often `visits [S, A]` occur."""
    weights = (visits / visits.sum())[..., None]  # [S, A, 1]
    components = table.decomposition.components
    mean = (weights * components).sum(axis=(0, 1))
    between = (weights * (components - mean) ** 2).sum(axis=(0, 1))
    within = (weights * spread(table).variance).sum(axis=(0, 1))
    with np.errstate(invalid="ignore"):  # 0/0 where nothing varies
        return np.asarray(between / (between + within))


def exact_tails(table: ExactTable, visits: FloatArray, steps: int) -> FloatArray:
    """Returns `[steps + 1]`: the share of the discounted rewards that comes each step or later."""
    magnitudes = table.mdp.with_rewards(np.abs(table.mdp.rewards))
    axis = TimeAxis(table.time_axis.gamma, steps)
    components = exact(magnitudes, axis, policy=table.solution.policy).decomposition.components
    tails = np.cumsum(np.einsum("sa,san->n", visits, components)[::-1])[::-1]
    return np.asarray(tails / tails[0])
