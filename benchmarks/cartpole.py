"""CartPole with and without components: the same settings, budget and seeds, side by side.

Prints the evaluation of each final network (100 episodes, no random actions), and leaves the runs
and a picture of their learning curves in a folder. A run takes one core for about two minutes.

    python benchmarks/cartpole.py cartpole              # N = 0 and 40, seeds 1 to 3
    python benchmarks/cartpole.py cartpole --seeds 1    # of the folder, what is done stays
"""

import argparse
from pathlib import Path

from trdlab.deep.presets import preset
from trdlab.runs.folder import is_run
from trdlab.show.plots.style import save
from trdlab.show.plots.training import curves_figure
from trdlab.training.loading import evaluate_run
from trdlab.training.run import begin, carry_on, resume


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--N", type=int, nargs="*", default=[0, 40])
    parser.add_argument("--seeds", type=int, nargs="*", default=[1, 2, 3])
    options = parser.parse_args()
    paths = []
    for seed in options.seeds:
        for horizon in options.N:
            settings = preset("gym", "CartPole-v1").changed({"N": horizon, "seed": seed})
            path = options.folder / f"N{horizon}-seed{seed}"
            with resume(path) if is_run(path) else begin(settings, path) as run:
                carry_on(run)
                seconds = run.seconds
            result, _ = evaluate_run(path, episodes=100, epsilon=0.0)
            print(f"N = {horizon:2}, seed {seed}: {result.mean}, {seconds:.0f} s", flush=True)
            paths.append(path)
    save(curves_figure(paths), options.folder / "curves.png")


if __name__ == "__main__":
    main()
