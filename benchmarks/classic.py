"""The classic tasks with nothing but their names: what the presets reach, with and without N.

Trains every task with its own preset, for each N and seed, and prints a row as soon as a run is
done: the mean return of 100 episodes of the run's agent (no random actions), what random actions
reach in as many, and the seconds of training. Then it draws the training curves of all. A run takes
one core for one to six minutes. What is done in the folder stays, and a run that was stopped goes
on: begin it again whenever you like.

    python benchmarks/classic.py classic                      # all: N = 0 and 10, seeds 1 to 3
    python benchmarks/classic.py classic --envs Acrobot-v1 --N 10 --seeds 1
"""

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import cycle, product
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from trdlab.deep.presets import preset
from trdlab.errors import InputError
from trdlab.rollouts.evaluation import Evaluation
from trdlab.runs import RunFolder, read_metrics
from trdlab.runs.folder import is_run
from trdlab.show.plots import style
from trdlab.show.plots.training import learning_curves
from trdlab.training.loading import agent_step, evaluate_run
from trdlab.training.run import begin, carry_on, resume

REACH = {"CartPole-v1": 475, "Acrobot-v1": -85, "MountainCar-v0": -115, "LunarLander-v3": 150}
"""The mean return that counts as solved here, by task."""
FLOOR = {"LunarLander-v3": -300}
"""Where a picture ends below, if the first episodes are too bad to be of interest."""
EPISODES = 100


@dataclass(frozen=True)
class Trained:
    """A run that is done, its agent's episodes, and as many of random actions."""

    env: str
    horizon: int
    seed: int
    folder: RunFolder
    seconds: float
    result: Evaluation
    chance: Evaluation

    @property
    def row(self) -> str:
        """Its row of the table."""
        mean = self.result.mean
        cells = [self.env, str(self.horizon), str(self.seed), f"{mean.value:.1f}"]
        cells += [f"{mean.low:.1f} … {mean.high:.1f}", f"{self.chance.mean.value:.1f}"]
        cells += [str(REACH.get(self.env, "")), f"{self.seconds:.0f}"]
        return f"| {' | '.join(cells)} |"


def main() -> None:
    options = _options()
    print("| task | N | seed | mean return | 95 % interval | random | to reach | seconds |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|", flush=True)
    runs = []
    for env, horizon, seed in product(options.envs, options.N, options.seeds):
        try:
            runs.append(trained(options.folder, env, horizon, seed))
        except InputError as error:  # such as an environment that is not installed
            print(f"| {env} | {horizon} | {seed} | {error} |", flush=True)
        else:
            print(runs[-1].row, flush=True)
    if runs:
        style.save(curves(runs), options.folder / "curves.png")


def trained(folder: Path, env: str, horizon: int, seed: int) -> Trained:
    """Trains a run, or goes on with it, and plays with its agent."""
    settings = preset("gym", env).changed({"N": horizon, "seed": seed})
    path = folder / f"{env}-N{horizon}-seed{seed}"
    with resume(path) if is_run(path) else begin(settings, path) as run:
        carry_on(run)
    played = [evaluate_run(path, episodes=EPISODES, epsilon=of)[0] for of in (0.0, 1.0)]
    return Trained(env, horizon, seed, run.folder, run.seconds, *played)


@style.settings()
def curves(runs: Sequence[Trained]) -> Figure:
    """Returns the picture of the training curves: a panel for each task, a colour for each N."""
    envs = list(dict.fromkeys(run.env for run in runs))
    horizons = sorted({run.horizon for run in runs}, reverse=True)
    colours = dict(zip(horizons, cycle(style.AGENTS), strict=False))
    rows = -(-len(envs) // 2)
    figure = style.new_figure(1.0 + 1.9 * rows)
    panels = list(figure.subplots(rows, 2, squeeze=False).flat)
    for ax, env in zip(panels, envs, strict=False):
        panel(ax, env, [run for run in runs if run.env == env], colours)
    for ax in panels[len(envs) :]:
        ax.set_visible(False)
    marks = [Line2D([], [], color=of, label=f"N = {n}") for n, of in colours.items()]
    marks.append(Line2D([], [], color=style.MUTED, linestyle=":", label="solved"))
    marks.append(Line2D([], [], color=style.INK, marker="o", linestyle="", label="agent"))
    note = "score by agent steps, random actions included; dots: agents without them"
    style.add_legend(figure, marks, note)
    return figure


def panel(ax: Axes, env: str, runs: Iterable[Trained], colours: dict[int, str]) -> None:
    """Draws the scores of a task along its training, and what its agents reach without ε."""
    for run in runs:
        colour, rows = colours[run.horizon], read_metrics(run.folder.metrics)
        learning_curves(ax, {run.folder.path.name: rows})
        ax.lines[-1].set(color=colour, linewidth=1)
        at = agent_step(run.folder) or rows[-1]["agent_steps"]
        ax.plot(at, run.result.mean.value, "o", color=colour, markersize=5, clip_on=False, zorder=5)
    if env in REACH:
        ax.axhline(REACH[env], color=style.MUTED, linestyle=":", linewidth=1)
    ax.set(title=env, xlabel="", ylabel="")
    ax.set_ylim(bottom=FLOOR.get(env))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--envs", nargs="*", default=[*REACH])
    parser.add_argument("--N", type=int, nargs="*", default=[0, 10])
    parser.add_argument("--seeds", type=int, nargs="*", default=[1, 2, 3])
    return parser.parse_args()


if __name__ == "__main__":
    main()
