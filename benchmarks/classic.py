"""The classic tasks with nothing but their names: what the presets reach, with and without N.

Trains every task with its own preset, for each N and seed, and prints a row as soon as a run is
done: the mean return of 100 episodes of the final network (no random actions), what random actions
reach in as many, and the seconds of training. A run takes one core for one to ten minutes. What is
done in the folder stays, and a run that was stopped goes on: begin it again whenever you like.

    python benchmarks/classic.py classic                      # all: N = 0 and 10, seeds 1 to 3
    python benchmarks/classic.py classic --envs Acrobot-v1 --N 10 --seeds 1
"""

import argparse
from itertools import product
from pathlib import Path

from trdlab.deep.presets import preset
from trdlab.errors import InputError
from trdlab.rollouts.evaluation import Evaluation
from trdlab.runs.folder import is_run
from trdlab.training.loading import evaluate_run
from trdlab.training.run import begin, carry_on, resume

REACH = {"CartPole-v1": 475, "Acrobot-v1": -85, "MountainCar-v0": -115, "LunarLander-v3": 150}
"""The mean return that counts as solved here, by task."""
EPISODES = 100


def main() -> None:
    options = _options()
    print("| task | N | seed | mean return | 95 % interval | random | to reach | seconds |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|", flush=True)
    for env, horizon, seed in product(options.envs, options.N, options.seeds):
        try:
            seconds, result, chance = trained(options.folder, env, horizon, seed)
        except InputError as error:  # such as an environment that is not installed
            print(f"| {env} | {horizon} | {seed} | {error} |", flush=True)
            continue
        mean, cells = result.mean, [env, str(horizon), str(seed)]
        cells += [f"{mean.value:.1f}", f"{mean.low:.1f} … {mean.high:.1f}"]
        cells += [f"{chance.mean.value:.1f}", str(REACH.get(env, "")), f"{seconds:.0f}"]
        print(f"| {' | '.join(cells)} |", flush=True)


def trained(
    folder: Path, env: str, horizon: int, seed: int
) -> tuple[float, Evaluation, Evaluation]:
    """Trains a run, or goes on with it; returns the seconds, and how it and chance do."""
    settings = preset("gym", env).changed({"N": horizon, "seed": seed})
    path = folder / f"{env}-N{horizon}-seed{seed}"
    with resume(path) if is_run(path) else begin(settings, path) as run:
        carry_on(run)
        seconds = run.seconds
    return seconds, *(evaluate_run(path, episodes=EPISODES, epsilon=of)[0] for of in (0.0, 1.0))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--envs", nargs="*", default=[*REACH])
    parser.add_argument("--N", type=int, nargs="*", default=[0, 10])
    parser.add_argument("--seeds", type=int, nargs="*", default=[1, 2, 3])
    return parser.parse_args()


if __name__ == "__main__":
    main()
