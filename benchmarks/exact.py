"""Exact decompositions at scale: against bare sparse products, and against plain value iteration.

The model is a slippery gridworld without items: walls, and cells that pay 1 and end the episode.
Ratios are medians over rounds in which both sides take turns: machines drift, ratios hold.

    python benchmarks/exact.py            # 10³ … 10⁶ states
    python benchmarks/exact.py 32 316     # sides of your own choice
"""

import resource
import statistics
import sys
import time
from collections import deque
from collections.abc import Callable

import numpy as np

from trdlab.decomposition import TimeAxis
from trdlab.tabular import MDP, optimal
from trdlab.tabular.series import components, decompose
from trdlab.tabular.sweeps import optimal_values

GAMMA, HORIZON, ERROR, SLIP = 0.95, 40, 1e-8, 0.2
SIDES = (32, 100, 316, 1000)


def field(side: int, goals: int) -> MDP:
    """Returns a square of side² states, a tenth of them walls, with some terminal rewards."""
    rng = np.random.default_rng(side)
    size = side * side
    wall, goal = rng.random(size) < 0.1, np.zeros(size, dtype=bool)
    goal[rng.choice(np.flatnonzero(~wall), goals, replace=False)] = True
    row, column = np.divmod(np.arange(size), side)
    reached = []
    for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        to = np.clip(row + down, 0, side - 1) * side + np.clip(column + right, 0, side - 1)
        reached.append(np.where(wall[to], np.arange(size), to))
    aside = ((2, 3), (2, 3), (0, 1), (0, 1))
    outcomes = [
        np.stack([reached[a], reached[b], reached[c]], -1) for a, (b, c) in enumerate(aside)
    ]
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


def value_iteration(mdp: MDP) -> np.ndarray:
    """Plain value iteration on the CSR matrix, to the same proven error."""
    values, shape = np.zeros(mdp.num_states), (mdp.num_states, 4)
    while True:
        q_values = mdp.expected_rewards + GAMMA * (mdp.matrix @ values).reshape(shape)
        updated = q_values.max(axis=1)
        change = np.abs(updated - values).max()
        values = updated
        if change * GAMMA / (1 - GAMMA) <= ERROR:
            return values


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


def main(sides: list[int]) -> None:
    print(f"{'states':>9} {'goals':>6} | {'solve: VI/ours':>14} {'ours s':>8} | ", end="")
    print(f"{'streamed/N products':>19} {'table/N products':>16} {'float32':>8} | peak GB")
    for side in sides:
        for goals in (1, max(2, side * side // 2000)):
            mdp = field(side, goals)
            mdp.matrix, mdp.expected_rewards  # noqa: B018, derived once
            rounds = 3 if side > 500 else 9
            slow, quick = in_turn(
                rounds,
                lambda m=mdp: value_iteration(m),
                lambda m=mdp: optimal_values(m, GAMMA, ERROR),
            )
            solution, axis = optimal(mdp, GAMMA), TimeAxis(GAMMA, HORIZON)
            values = solution.state_values

            def bare(mdp: MDP = mdp, values: np.ndarray = values) -> None:
                for _ in range(HORIZON):
                    mdp.matrix @ values

            products, streamed, table, single = in_turn(
                rounds,
                bare,
                lambda m=mdp, s=solution, a=axis: deque(components(m, s, a), maxlen=0),
                lambda m=mdp, s=solution, a=axis: decompose(m, s, a),
                lambda m=mdp, s=solution, a=axis: decompose(m, s, a, np.float32),
            )
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
            print(
                f"{mdp.num_states:9} {goals:6} | {ratio(slow, quick):14.2f} "
                f"{statistics.median(quick):8.3f} | {ratio(streamed, products):19.2f} "
                f"{ratio(table, products):16.2f} {ratio(single, products):8.2f} | {peak:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main([int(side) for side in sys.argv[1:]] or list(SIDES))
