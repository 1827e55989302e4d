"""Networks that learn gridworlds from samples, against the exact table of the same operator.

Behaviour is uniformly random throughout, so that what a window of w > 1 steps holds is known
(see `trdlab.tabular.operator_table`); episodes are short and begin anywhere, so that no state is
rare. Printed is the largest error of each component over every
reachable state and action, as training goes on.

    python benchmarks/pixels.py                           # through the Nature CNN
    python benchmarks/pixels.py --observation index       # one-hot, through the MLP
    python benchmarks/pixels.py --map ledge --w 2
"""

import argparse
import time

import numpy as np

from trdlab.decomposition import TimeAxis
from trdlab.deep.estimator import NetworkEstimator
from trdlab.deep.settings import TrainSettings
from trdlab.gridworld import Gridworld, load_map
from trdlab.gridworld.pixels import pictures
from trdlab.tabular import operator_table
from trdlab.tabular.reach import reachable
from trdlab.training.machine import resolved
from trdlab.training.setup import future, make_environments, new_trainer

GAMMA, HORIZON, ENVIRONMENTS = 0.9, 4, 8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--observation", default="pixels", choices=("pixels", "index"))
    parser.add_argument("--map", nargs="*", default=["drone", "ledge"])
    parser.add_argument("--treasure", type=float, help="what treasures pay")
    parser.add_argument("--w", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--steps", type=int, default=200_000, help="agent steps, at random")
    parser.add_argument("--updates", type=int, default=2_500)
    parser.add_argument("--batch", type=int, default=128)
    parser.add_argument("--lr", type=float, default=5e-4)
    parser.add_argument("--sync", type=int, default=250)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for name in options.map:
        for width in options.w:
            run(options, name, width)


def run(options: argparse.Namespace, name: str, width: int) -> None:
    axis = TimeAxis(GAMMA, HORIZON, width)
    grid, arguments = load_map(name), [f"map={name}", f"observation={options.observation}"]
    if options.treasure is not None:
        grid = grid.with_value("treasure", options.treasure)
        arguments.append(f"treasure={options.treasure}")
    world = Gridworld(grid)
    exact = operator_table(world.mdp, axis, 1.0).decomposition.components  # [S, A, N+1]
    states = np.flatnonzero(reachable(world.mdp) & ~world.mdp.terminal_states)
    seen = pictures(world)[states][:, None] if options.observation == "pixels" else states
    first = options.steps // 2  # so that the greedy actions are chosen with enough samples
    settings = TrainSettings(
        "gym",
        "trdlab/DroneGridworld-v0",
        env_arg=(*arguments, "exploring_starts=true", "max_episode_steps=6"),
        seed=options.seed,
        gamma=GAMMA,
        horizon=HORIZON,
        width=width,
        epsilon_end=1.0,
        num_envs=ENVIRONMENTS,
        learning_starts=first,
        update_every=(options.steps - first) // options.updates,
        agent_steps=options.steps,
        batch_size=options.batch,
        learning_rate=options.lr,
        learning_rate_end=0.0,
        target_sync_updates=options.sync,
        capacity=options.steps,
    )
    environments = make_environments(settings)
    trainer = new_trainer(resolved(settings, environments), environments)
    learned = NetworkEstimator(trainer.learner.q_network, axis, future(settings))
    print(f"{name}, w = {width}: {len(states)} states; largest error of each component")
    begun, told = time.perf_counter(), 0
    while not trainer.done:
        trainer.step()
        updates = trainer.learner.num_updates
        if updates >= told + options.updates // 10 or trainer.done:
            error = np.abs(learned.decompose(seen).components - exact[states])  # [S, A, N+1]
            each = " ".join(f"{of:6.3f}" for of in error.max(axis=(0, 1)))
            seconds = time.perf_counter() - begun
            print(f"{updates:7} updates {seconds:6.0f} s | {each} | {error.max():.3f}", flush=True)
            told = updates


if __name__ == "__main__":
    main()
