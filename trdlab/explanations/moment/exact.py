"""Moments of exactly solved models, where everything that can be known is known."""

from collections.abc import Callable, Sequence

import numpy as np

from trdlab.arrays import RELATIVE_ZERO, BoolArray, FloatArray, IntArray
from trdlab.explanations.moment.moment import Moment, Uncertainty, WhatIf
from trdlab.gridworld import Gridworld, Source
from trdlab.tabular import MDP, ExactTable, improved, optimal, undiscounted_totals
from trdlab.tabular.chains import Chain
from trdlab.tabular.named import TabularWorld
from trdlab.tabular.reach import reached
from trdlab.tabular.uncertainty import outcomes, spread

_ROUNDING = 1e-9  # of a total: sums of many steps that differ by less are the same
GAMMA_RANGE = (0.01, 0.99)
MAX_SPREAD = 10_000_000  # states times steps, beyond which spread is not worked out
MAX_WHAT_IF_STATES = 2_000  # each quantity takes a hundred solves
REWARD_RANGE = 10.0  # times its present value: up to that a source of reward is varied


def tabular_moment(
    table: ExactTable, state: int, action_names: Sequence[str], what_ifs: Sequence[WhatIf] = ()
) -> Moment:
    """Returns what a solved model expects in one state, with undiscounted totals and ties.

    Args:
        table: the exact decomposition.
        state: the index of the state.
        action_names: A names.
        what_ifs: quantities that can be varied.
    """
    solution, mdp = table.solution, table.mdp
    totals = undiscounted_totals(mdp, solution.policy)  # [S, A]
    size = np.abs(table.decomposition.components[state]).sum(axis=-1)  # [A]
    cancel = np.abs(totals[state]) <= RELATIVE_ZERO * size  # rewards and costs, but for rounding
    ambiguous = table.ambiguous | _totals_differ(totals, solution.tied)
    here = bool(ambiguous[state])
    tied = zip(action_names, solution.tied[state] & here, strict=True)
    return Moment(
        decomposition=table.decomposition[state],
        action_names=tuple(action_names),
        future=table.future,
        policy=solution.policy[state],
        totals=np.where(cancel, 0.0, totals[state]),
        stays=_stays(mdp, state),
        is_over=bool(mdp.terminal_states[state]),
        tied=tuple(name for name, is_tied in tied if is_tied),
        tied_later=int((ambiguous & _later(table, state)).sum()) - here,
        what_ifs=tuple(what_ifs),
        uncertainty=_uncertainty(table, state),
        possible=_possible(mdp),
    )


def _possible(mdp: MDP) -> tuple[float, float]:
    """Returns the least and the most that a component can be: 0 where all rewards have one sign."""
    least, most = mdp.rewards.min(initial=0.0), mdp.rewards.max(initial=0.0)
    return (-np.inf if least < 0.0 else 0.0), (np.inf if most > 0.0 else 0.0)


def _totals_differ(totals: FloatArray, tied: BoolArray) -> BoolArray:
    """Returns `[S]`: where actions that tie have different totals."""
    known = tied & ~np.isnan(totals)
    least = np.where(known, totals, np.inf).min(axis=1)
    most = np.where(known, totals, -np.inf).max(axis=1)
    size = np.maximum(np.abs(least), np.abs(most))
    return np.asarray((known.sum(axis=1) > 1) & (most - least > _ROUNDING * size))


def _stays(mdp: MDP, state: int) -> tuple[float, ...]:
    """Returns `[A]`: how likely each action leaves the state as it is.

    It is 0 of an action that pays less than another one that surely stays: to fall off a cliff and
    begin anew is no bump into a wall.
    """
    rows = state * mdp.num_actions + np.arange(mdp.num_actions)
    chances, rewards = np.zeros(mdp.num_actions), np.zeros(mdp.num_actions)
    for action, row in enumerate(rows):
        part = slice(mdp.offsets[row], mdp.offsets[row + 1])
        back = (mdp.next_states[part] == state) & ~mdp.terminated[part]
        chances[action] = mdp.probabilities[part][back].sum()
        rewards[action] = mdp.probabilities[part] @ mdp.rewards[part]
    sure = chances >= 1.0 - 1e-12
    worse = rewards < rewards[sure].max(initial=-np.inf)
    return tuple(np.where(sure & worse, 0.0, chances).tolist())


def _uncertainty(table: ExactTable, state: int) -> Uncertainty | None:
    """Returns spread and survival at a state, in models that are small enough to ask for them."""
    mdp, axis, policy = table.mdp, table.time_axis, table.solution.policy
    if mdp.num_states * axis.num_steps > MAX_SPREAD:
        return None
    known = spread(table)
    steps = axis.num_steps if axis.width == 1 else 0
    paid = (outcomes(mdp, policy, state, action, steps) for action in range(mdp.num_actions))
    return Uncertainty(
        deviation=known.deviation[state],
        return_deviation=np.sqrt(known.return_variance[state]),
        survival=known.survival[state],
        outcomes=tuple(map(tuple, paid)),
    )


def gridworld_moment(world: Gridworld, table: ExactTable, state: int) -> Moment:
    """Returns what a solved gridworld expects in one state; under the optimal policy also what-ifs.

    These are γ and every source of reward, in models of up to `MAX_WHAT_IF_STATES` states.

    Args:
        world: the gridworld.
        table: its exact decomposition.
        state: the index of the state.
    """
    what_ifs: list[WhatIf] = []
    if table.solution.is_optimal and world.mdp.num_states <= MAX_WHAT_IF_STATES:
        gamma = table.time_axis.gamma
        what_ifs.append(gamma_what_if(world.mdp, gamma, state))
        for source in (source for source in world.sources if source.value):
            solver = _Resolved(state, lambda value, s=source: (world.mdp_if(s, value), gamma))  # type: ignore[misc]
            low, high = sorted((0.0, REWARD_RANGE * source.value))
            what_ifs.append(WhatIf(source_name(world, source), source.value, low, high, solver))
    return tabular_moment(table, state, world.action_names, what_ifs)


def exact_moment(world: Gridworld | TabularWorld, table: ExactTable, state: int) -> Moment:
    """Returns what the table of a model expects in one state, with what can be varied there."""
    if isinstance(world, Gridworld):
        return gridworld_moment(world, table, state)
    from trdlab.tabular.models import part_after  # gridworlds do without it

    gamma, part = table.time_axis.gamma, part_after(table.mdp, state)
    is_small = part.num_states <= MAX_WHAT_IF_STATES
    what_ifs = [gamma_what_if(part, gamma, part.start)] if is_small else []
    return tabular_moment(table, state, world.action_names, what_ifs)


def gamma_what_if(mdp: MDP, gamma: float, state: int) -> WhatIf:
    """Returns γ as a quantity that can be varied, the optimal policy solved for again each time."""
    low, high = min(GAMMA_RANGE[0], gamma), max(GAMMA_RANGE[1], gamma)
    return WhatIf("γ", gamma, low, high, _Resolved(state, lambda value: (mdp, value)))


def source_name(world: Gridworld, source: Source) -> str:
    """Returns how a source of reward is called in a sentence.

    >>> from trdlab.gridworld import load_map
    >>> world = Gridworld(load_map("drone"))
    >>> [source_name(world, source) for source in world.sources]
    ['each coin', 'the treasure']
    """
    if source.kind == "step":
        return "a step"
    cells = [world.grid.legend[symbol] for row in world.grid.rows for symbol in row]
    count = sum(cell.kind == source.kind and cell.value == source.value for cell in cells)
    alike = {other for other in world.sources if other.kind == source.kind}
    worth = f" of {source.value:g}" if len(alike) > 1 else ""
    return f"{'the' if count == 1 else 'each'} {source.kind}{worth}"


class _Resolved:
    """Q-values of one state as one quantity varies, each solve starting from the last one."""

    def __init__(self, state: int, model: Callable[[float], tuple[MDP, float]]) -> None:
        self.state, self.model = state, model
        self.last: tuple[float, IntArray, Chain | None] | None = None

    def __call__(self, value: float) -> FloatArray:
        mdp, gamma = self.model(value)
        before, actions, chain = self.last or (gamma, optimal(mdp, gamma).policy.argmax(1), None)
        actions, q_values, chain = improved(mdp, gamma, actions, chain if gamma == before else None)
        self.last = gamma, actions, chain
        return np.asarray(q_values[self.state])


def _later(table: ExactTable, state: int) -> BoolArray:
    """Returns `[S]`: the states that can follow any first action and optimal ones after it."""
    mdp, solution = table.mdp, table.solution
    followed = (solution.policy > 0.0) | solution.tied
    followed[state] = True
    edge = (mdp.continuation > 0.0) & followed[mdp.transition_states, mdp.transition_actions]
    sources, targets = mdp.transition_states[edge], mdp.next_states[edge]
    return reached(np.arange(mdp.num_states) == state, sources, targets)
