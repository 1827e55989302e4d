"""Fits against exact answers: how far off is each method, for actions never taken, too?

A random policy of each world is frozen, a fifth of its actions is forced, and every component of
every state and action is compared with the exact evaluation of that policy. Episodes begin
anywhere.

    python benchmarks/fit.py                      # three worlds, three methods, five seeds
    python benchmarks/fit.py --seeds 1 --steps 200000
"""

import argparse
import time

import gymnasium as gym
import numpy as np
import torch

from trdlab.deep.experience import gather
from trdlab.deep.fit import Fit
from trdlab.deep.fit_settings import FitSettings, Method
from trdlab.estimator import Future
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Memoryless
from trdlab.tabular import MDP, exact
from trdlab.tabular.episodes import ModelEnvironments
from trdlab.tabular.toytext import make_world
from trdlab.time_axis import TimeAxis

AXIS = TimeAxis(0.95, 8)
METHODS: tuple[Method, ...] = ("mixed", "regression", "td")
FUTURE = Future("the given policy")


def worlds() -> dict[str, MDP]:
    """Returns models of which everything is known."""
    maps = {name: Gridworld(load_map(name).with_slip(0.1)).mdp for name in ("drone", "ledge")}
    return {"FrozenLake": make_world("FrozenLake-v1", {}).mdp} | maps


def error(mdp: MDP, method: Method, steps: int, seed: int) -> tuple[float, float]:
    """Returns the worst and the mean error of all components, as shares of the largest |Q|."""
    logits = np.random.default_rng(seed).normal(size=mdp.shape)
    policy = np.exp(logits) / np.exp(logits).sum(axis=1, keepdims=True)  # [S, A]
    alive = ~mdp.terminal_states
    experience = gather(
        lambda count, own: ModelEnvironments(
            mdp, count, seed=own, starts=alive / alive.sum(), time_limit=200
        ),
        Memoryless(lambda states: policy[states]),
        FUTURE,
        steps=steps,
        share=0.2,
        pause=AXIS.num_steps if method == "regression" else 0,
        num_envs=1_000,
        seed=seed,
    )
    how = FitSettings(method, learning_rate=0.01, batch_size=1_024, seed=seed)
    fit = Fit(experience, gym.spaces.Discrete(mdp.num_states), AXIS, how)
    fit.run()
    told = fit.estimator(FUTURE).decompose(np.flatnonzero(alive)).components
    true = exact(mdp, AXIS, policy=policy)
    apart = np.abs(told - true.decomposition.components[alive]).max(axis=-1)
    scale = np.abs(true.solution.q_values).max()
    return float(apart.max() / scale), float(apart.mean() / scale)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--seeds", type=int, default=5)
    options = parser.parse_args()
    torch.set_num_threads(1)
    for name, mdp in worlds().items():
        for method in METHODS:
            began = time.perf_counter()
            found = [error(mdp, method, options.steps, seed) for seed in range(options.seeds)]
            worst, mean = (100.0 * max(of) for of in zip(*found, strict=True))
            took = (time.perf_counter() - began) / options.seeds
            print(
                f"{name:>10} {method:>10}: off by at most {worst:4.1f} % of the largest |Q|, by "
                f"{mean:4.2f} % on average, {took:.0f} s each",
                flush=True,
            )


if __name__ == "__main__":
    main()
