"""Temporal-difference learning of a decomposition from sampled windows, in a table."""

from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.bellman import target
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, TrdlabError, closest
from trdlab.estimator import Future
from trdlab.tabular.learned import LearnedTable
from trdlab.tabular.mdp import MDP, as_policy
from trdlab.tabular.operator import check_epsilon, epsilon_greedy
from trdlab.tabular.windows import WindowBuilder, Windows
from trdlab.tabular.worlds import GymWorlds, ModelWorlds

if TYPE_CHECKING:
    from gymnasium import Env
    from gymnasium.vector import VectorEnv

Tail = Literal["behaviour", "greedy"]
Loss = Literal["components", "sum"]


def learn(
    world: "MDP | VectorEnv[Any, Any, Any] | Env[Any, Any]",
    time_axis: TimeAxis,
    *,
    policy: FloatArray | None = None,
    epsilon: float = 0.1,
    tail: Tail = "behaviour",
    loss: Loss = "components",
    agent_steps: int = 1_000_000,
    num_envs: int = 512,
    initial: FloatArray | None = None,
    seed: int = 0,
) -> LearnedTable:
    """Learns a decomposition by temporal differences, with the law as target.

    With a `policy` this is its evaluation: some actions are drawn evenly (a policy that avoids an
    action would otherwise never tell what it leads to), windows are used whose later actions
    follow the policy, and n is the expectation under it. Without one it is control: the actions
    are ε-greedy, and n belongs to the greedy action, as in Q-learning.

    For w > 1 the windows of control contain the ε-greedy actions and their rewards, and the
    fixed point is not the optimal table (see `operator_table`). With `tail="greedy"` only those
    windows are used whose actions after the first were greedy, which removes that bias.

    From a model, `num_envs` environments begin episodes of w steps in random states with random
    actions, so that everything is visited evenly. A Gymnasium environment begins where it begins,
    and a window begins at every step; with a policy, one step in w is drawn evenly. What is seldom
    visited is learned badly, what is never visited not at all (see `LearnedTable.unlearned`).

    An entry's n-th update has the step size (1 + (1 − γ^w)·n)^(−0.7), and the result is the
    average of the tables of all times, weighted 1, 2, 3, … The average also says which action is
    greedy: in the newest table, noise keeps turning the order of two nearly equal actions, and
    with it the components, which may differ much even where Q hardly does.

    Args:
        world: a model, or a Gymnasium environment or vector environment with discrete
            observations and actions.
        time_axis: γ, N and w.
        policy: `[S, A]`, the policy to evaluate.
        epsilon: of control, the probability of a random action.
        tail: of control with w > 1, which windows to learn from.
        loss: `components` as in the law, or `sum` to see it fail: the same error of the sum, spread
            evenly over all components. Q is learned and the components are not (paper, section 4).
        agent_steps: how many steps to take, over all environments.
        num_envs: how many environments to draw from a model.
        initial: `[S, A, N+1]`, what to begin with; zero without it.
        seed: where all chance comes from.

    Raises:
        InputError: an option is out of its range, or does not fit the world.
        TrdlabError: not a single window could be used.

    Source: the paper's Eq. trd-loss (see `trdlab.bellman`). Step sizes: polynomial as in
    Even-Dar and Mansour, "Learning rates for Q-learning" (2003), rescaled as in Wainwright,
    "Stochastic approximation with cone-contractive operators" (2019). Averaging: Polyak and
    Juditsky, "Acceleration of stochastic approximation by averaging" (1992), weighted as in
    Lacoste-Julien, Schmidt and Bach, "A simpler approach to obtaining an O(1/t) convergence rate
    for the projected stochastic subgradient method" (2012).

    >>> coin = MDP.from_transitions([[[(1.0, 0, 0.0, False)], [(1.0, 0, 2.0, True)]]])
    >>> learned = learn(coin, TimeAxis(0.5, horizon=2), agent_steps=100_000)
    >>> learned.decomposition.components[0].round(3).tolist()
    [[0.0, 1.0, 0.0], [2.0, 0.0, 0.0]]
    """
    check_epsilon(epsilon)
    for name, choice, known in (("tail", tail, get_args(Tail)), ("loss", loss, get_args(Loss))):
        if choice not in known:
            raise InputError(f"The {name} is '{choice}'.", closest(choice, known))
    for name, number in (("agent steps", agent_steps), ("environments", num_envs)):
        if number < 1:
            raise InputError(f"The number of {name} is {number}.", "It must be at least 1.")
    rng, gamma, width = np.random.default_rng(seed), time_axis.gamma, time_axis.width
    is_model, exploring = isinstance(world, MDP), 1.0 / width  # of a policy's steps
    worlds = (
        ModelWorlds(world, num_envs, width, rng)
        if isinstance(world, MDP)
        else GymWorlds(world, seed)
    )
    num_actions = worlds.num_actions
    table = _initial(initial, (worlds.num_states, num_actions, time_axis.num_components))
    given = None if policy is None else as_policy(policy, table.shape[:2])
    builder = WindowBuilder(width, gamma, worlds.num_envs, time_limit=worlds.time_limit)
    visits, updates = (np.zeros(table.shape[:2], dtype=np.int64) for _ in range(2))
    mean_table, left_out = table.copy(), 0
    chance = 1.0  # that an action is one that windows may hold after their first
    if given is not None:
        chance = 1.0 if is_model else 1.0 - exploring
    elif tail == "greedy":
        chance = 1.0 - epsilon + epsilon / num_actions

    for turn in range(-(-agent_steps // worlds.num_envs)):  # rounded up
        here = worlds.observations  # [B]
        greedy = mean_table.sum(axis=2).argmax(axis=1)  # [S]
        evaluated = epsilon_greedy(greedy, num_actions, 0.0) if given is None else given  # [S, A]
        behaviour = epsilon_greedy(greedy, num_actions, epsilon) if given is None else given
        first = _explores(rng, builder, is_model, 0.0 if given is None else exploring)  # [B]
        evenly = rng.integers(num_actions, size=worlds.num_envs)
        actions = np.where(first, evenly, _drawn(behaviour[here], rng))
        step = worlds.step(actions)
        windows = builder.add(
            here,
            actions,
            step.rewards,
            step.terminated,
            step.truncated,
            step.next_observations,
            greedy=actions == greedy[here] if given is None else ~first,
            begins=first | (not is_model),
            active=step.active,
        )
        if chance < 1.0:
            kept = _tails_that_follow(windows, width, chance, rng)
            left_out += len(windows) - len(kept)
            windows = kept

        if len(windows):
            following = np.einsum("sa,san->sn", evaluated, table)[windows.next_observations]
            targets = target(windows.rewards, windows.discounts, following)  # [K, N+1]
            error, count = _mean_error(targets, windows, table)  # [S, A, N+1], [S, A]
            if loss == "sum":  # the gradient of (Σ target − Σ components)² is the same for each
                error = np.broadcast_to(error.mean(axis=2, keepdims=True), error.shape)
            visits += count
            updates += count > 0
            table = table + _step_sizes(updates, gamma**width)[..., None] * error
        mean_table += (table - mean_table) * (2.0 / (turn + 2.0))  # weighted 1, 2, 3, …

    _refuse_nothing_learned(int(visits.sum()), left_out, builder)
    return LearnedTable(
        decomposition=RewardDecomposition(mean_table, time_axis),
        future=_future(given is not None, time_axis, epsilon, tail, loss),
        visits=visits,
        left_out=left_out,
        dropped=builder.dropped,
    )


def _explores(
    rng: "np.random.Generator", builder: WindowBuilder, is_model: bool, chance: float
) -> BoolArray:
    """Returns `[B]`: where the next action is drawn evenly, whatever the policy says."""
    if is_model:  # at the beginning of each of its windows
        return np.asarray(builder.elapsed % builder.width == 0)
    return np.asarray(rng.random(builder.num_envs) < chance)


def _drawn(probabilities: FloatArray, rng: "np.random.Generator") -> IntArray:
    """Returns `[B]`: an action for each row of `probabilities [B, A]`."""
    cumulative = probabilities.cumsum(axis=1)
    level = rng.random(len(cumulative)) * cumulative[:, -1]  # the last may not be quite 1
    return np.asarray((cumulative <= level[:, None]).sum(axis=1))


def _tails_that_follow(
    windows: Windows, width: int, chance: float, rng: "np.random.Generator"
) -> Windows:
    """Returns the windows whose later actions were those asked for, all kinds equally often.

    A window that terminated early had fewer chances to go astray. To keep it whenever it did not
    would make an end look likelier than it is, so the actions that it was spared are drawn here.

    Args:
        windows: of which `tail_greedy` tells whether they followed.
        width: w.
        chance: that an action is one of those asked for.
        rng: where chance comes from.
    """
    spared = chance ** (width - windows.steps)  # [K]
    return windows.where(windows.tail_greedy & (rng.random(len(windows)) < spared))


def _mean_error(
    targets: FloatArray, windows: Windows, table: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Returns `[S, A, N+1]`, the mean of target − table of each entry, and `[S, A]`, how many."""
    num_rows, num_components = table[..., 0].size, table.shape[2]
    rows = windows.observations * table.shape[1] + windows.actions  # [K]
    cells = rows[:, None] * num_components + np.arange(num_components)  # [K, N+1]
    sums = np.bincount(cells.ravel(), targets.ravel(), num_rows * num_components)
    count = np.bincount(rows, minlength=num_rows).reshape(table.shape[:2])
    mean = sums.reshape(table.shape) / np.maximum(count, 1)[..., None]
    return np.where(count[..., None] > 0, mean - table, 0.0), count


def _step_sizes(updates: IntArray, discount: float) -> FloatArray:
    """Returns `[S, A]`: the step size of each entry's n-th update (see `learn`)."""
    return np.asarray((1.0 + (1.0 - discount) * updates) ** -0.7)


def _initial(initial: FloatArray | None, shape: tuple[int, ...]) -> FloatArray:
    if initial is None:
        return np.zeros(shape)
    table = np.array(initial, dtype=np.float64)
    if table.shape != shape or not np.isfinite(table).all():
        raise InputError(
            f"The initial table has shape {table.shape}, or an entry that is not finite.",
            f"Give finite numbers of shape {shape}.",
        )
    return table


def _refuse_nothing_learned(used: int, left_out: int, builder: WindowBuilder) -> None:
    if used:
        return
    if left_out:
        raise TrdlabError(
            f"None of {left_out} windows of {builder.width} steps followed the policy to its end.",
            "Choose a smaller epsilon or width, or take more steps.",
        )
    raise TrdlabError(
        f"All {builder.dropped} windows of {builder.width} steps were dropped: every episode was "
        "truncated, or learning ended, before it had as many.",
        "Choose a smaller width, a longer time limit, or more steps.",
    )


def _future(is_given: bool, axis: TimeAxis, epsilon: float, tail: Tail, loss: Loss) -> Future:
    """Returns whose future is learned."""
    if is_given:
        policy = "the given policy"
    elif axis.width == 1 or epsilon == 0.0 or tail == "greedy":
        policy = "the greedy policy"
    else:
        policy = (
            f"a policy that acts greedily once every {axis.width} steps and ε-greedily in between "
            f"(ε = {epsilon:g})"
        )
    only = "; only the sum is learned, the components mean nothing" if loss == "sum" else ""
    return Future(f"{policy}, learned from samples{only}")
