"""Exact values and decompositions at scale: against plain value iteration and sparse products.

Values: `optimal`, with its policy, ties and proven bounds, against plain value iteration on the
same matrix. Value iteration proves one error for all states; it stops at the largest error that
`optimal` proves. Where rewards are far that is more than a value: so it is timed again until its
error is as small as that of `optimal` at every state. Ratios are medians over rounds in which the
sides take turns: machines drift, ratios hold.

    python benchmarks/exact.py                   # 10³ … 10⁵ states
    python benchmarks/exact.py 1000 1000000      # sizes of your own choice
"""

import resource
import statistics
import sys
import time
from collections import deque
from collections.abc import Callable

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.tabular import MDP, Solution, optimal
from trdlab.tabular.series import components, decompose

HORIZON, SLIP = 40, 0.2
SIZES = (1_000, 10_000, 100_000)
ASIDE = ((2, 3), (2, 3), (0, 1), (0, 1))  # where up, down, left and right slip to


# ---- shapes --------------------------------------------------------------------------------------


def slippery(reached: IntArray, goal: BoolArray) -> MDP:
    """Returns a model of four moves that lead to `reached [S, 4]`; goals pay 1 and end it."""
    size = len(reached)
    outcomes = [reached[:, [a, *aside]] for a, aside in enumerate(ASIDE)]
    next_states = np.stack(outcomes, axis=1)  # [S, A, 3]
    over = goal[:, None, None]
    return MDP(
        offsets=np.arange(0, size * 12 + 1, 3),
        next_states=next_states.ravel(),
        probabilities=np.tile([1 - SLIP, SLIP / 2, SLIP / 2], size * 4),
        rewards=(goal[next_states] & ~over).ravel().astype(np.float64),
        terminated=(goal[next_states] | over).ravel(),
        num_actions=4,
        start=int(np.flatnonzero(~goal)[0]),
    )


def neighbours(side: int) -> IntArray:
    """Returns `[S, 4]`: where each move leads in an open square, which has an edge."""
    row, column = np.divmod(np.arange(side * side), side)
    moves = ((-1, 0), (1, 0), (0, -1), (0, 1))
    edge = side - 1
    return np.stack(
        [np.clip(row + d, 0, edge) * side + np.clip(column + r, 0, edge) for d, r in moves], axis=1
    )


def field(states: int, goals: int = 0) -> MDP:
    """Returns a square, a tenth of it walls, with some goals, or one for each 2 000 states."""
    side = round(states**0.5)
    rng, reached = np.random.default_rng(side), neighbours(side)
    here = np.arange(side * side)
    wall, goal = rng.random(len(here)) < 0.1, np.zeros(len(here), dtype=bool)
    goal[rng.choice(np.flatnonzero(~wall), goals or max(2, len(here) // 2000), False)] = True
    return slippery(np.where(wall[reached], here[:, None], reached), goal)


def lone_field(states: int) -> MDP:
    """Returns a field with a single goal."""
    return field(states, goals=1)


def maze(states: int) -> MDP:
    """Returns a maze without loops, with its goal in a corner."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import minimum_spanning_tree

    side = round(states**0.5)
    reached, here = neighbours(side), np.arange(side * side)
    edges = np.concatenate([np.stack([here, reached[:, move]]) for move in (1, 3)], axis=1)
    weights = 1.0 + np.random.default_rng(side).random(edges.shape[1])
    ways = minimum_spanning_tree(coo_array((weights, edges), (len(here),) * 2).tocsr()).tocoo()
    is_open = np.zeros((len(here), 4), dtype=bool)
    down = ways.col - ways.row == side
    is_open[ways.row, np.where(down, 1, 3)] = True
    is_open[ways.col, np.where(down, 0, 2)] = True
    return slippery(np.where(is_open, reached, here[:, None]), here == len(here) - 1)


def corridor(states: int) -> MDP:
    """Returns cells in a row, left or right; the last one pays 1 and ends the episode."""
    here = np.arange(states)
    beside = np.stack([np.maximum(here - 1, 0), np.minimum(here + 1, states - 1)], axis=1)
    ends = (here == states - 1)[:, None] & [False, True]
    return MDP(
        offsets=np.arange(2 * states + 1),
        next_states=beside.ravel(),
        probabilities=np.ones(2 * states),
        rewards=ends.ravel().astype(np.float64),
        terminated=ends.ravel(),
        num_actions=2,
    )


def random_graph(states: int) -> MDP:
    """Returns four actions with three random successors each; a fifth of the transitions pay."""
    rng, count = np.random.default_rng(states), 12 * states
    return MDP(
        offsets=np.arange(0, count + 1, 3),
        next_states=rng.integers(0, states, count),
        probabilities=rng.dirichlet(np.ones(3), 4 * states).ravel(),
        rewards=np.where(rng.random(count) < 0.2, rng.normal(size=count), 0.0),
        terminated=np.zeros(count, dtype=np.bool_),
        num_actions=4,
    )


SHAPES: dict[str, Callable[[int], MDP]] = {
    "field": field,
    "field, one goal": lone_field,
    "maze": maze,
    "corridor": corridor,
    "random graph": random_graph,
}


# ---- timing --------------------------------------------------------------------------------------


def value_iteration(mdp: MDP, gamma: float, error: FloatArray | float) -> FloatArray:
    """Plain value iteration on the CSR matrix, to an error, or one for each state `[S]`."""
    values, allowed = np.zeros(mdp.num_states), error * (1.0 - gamma) / gamma
    while True:
        q_values = mdp.expected_rewards + gamma * (mdp.matrix @ values).reshape(mdp.shape)
        updated = q_values.max(axis=1)
        change = np.abs(updated - values)
        values = updated
        if (change <= allowed).all():
            return values


def proven(solution: Solution) -> FloatArray:
    """Returns `[S]`: the error of each state's value, or the least that sweeps can come to."""
    error = (solution.policy * solution.error_bound).sum(axis=1)
    return np.maximum(error, 4e-15 * np.abs(solution.state_values) / (1.0 - solution.gamma))


def in_turn(rounds: int, *functions: Callable[[], object]) -> list[list[float]]:
    """Returns the seconds of each function in each round; the first round does not count."""
    seconds: list[list[float]] = [[] for _ in functions]
    for _ in range(rounds + 1):
        for taken, function in zip(seconds, functions, strict=True):
            start = time.perf_counter()
            function()
            taken.append(time.perf_counter() - start)
    return [taken[1:] for taken in seconds]


def ratio(above: list[float], below: list[float]) -> float:
    return statistics.median(a / b for a, b in zip(above, below, strict=True))


def compare_values(name: str, states: int, gamma: float) -> None:
    mdp = SHAPES[name](states)
    mdp.matrix, mdp.expected_rewards  # noqa: B018, derived once
    error = proven(optimal(mdp, gamma))
    ours, same, everywhere = in_turn(
        1 if states > 10_000 else 5,
        lambda: optimal(mdp, gamma),
        lambda: value_iteration(mdp, gamma, float(error.max())),
        lambda: value_iteration(mdp, gamma, error),
    )
    print(
        f"{name:>16} {mdp.num_states:9} {gamma:6} | {statistics.median(ours):8.3f} "
        f"{error.max():8.0e} | {ratio(same, ours):14.2f} {ratio(everywhere, ours):17.2f}",
        flush=True,
    )


def compare_decompositions(states: int, gamma: float) -> None:
    mdp, axis = field(states), TimeAxis(gamma, HORIZON)
    solution = optimal(mdp, gamma)
    values = solution.state_values

    def bare() -> None:
        for _ in range(HORIZON):
            mdp.matrix @ values

    products, streamed, table, single = in_turn(
        3 if states > 100_000 else 9,
        bare,
        lambda: deque(components(mdp, solution, axis), maxlen=0),
        lambda: decompose(mdp, solution, axis),
        lambda: decompose(mdp, solution, axis, np.float32),
    )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(
        f"{mdp.num_states:9} | {ratio(streamed, products):19.2f} {ratio(table, products):16.2f} "
        f"{ratio(single, products):8.2f} | {peak:.2f}",
        flush=True,
    )


def main(sizes: list[int]) -> None:
    print(f"{'shape':>16} {'states':>9} {'gamma':>6} | {'ours s':>8} {'error':>8} | ", end="")
    print(f"{'VI/ours: error':>14} {'at every state':>17}")
    for states in sizes:
        for name in SHAPES:
            compare_values(name, states, 0.95)
    compare_values("corridor", 5_000, 0.999)
    print(f"\n{'states':>9} | {'streamed/N products':>19} {'table/N products':>16} ", end="")
    print(f"{'float32':>8} | peak GB")
    for states in sizes:
        compare_decompositions(states, 0.95)


if __name__ == "__main__":
    main([int(size) for size in sys.argv[1:]] or list(SIZES))
