"""The components that a TRD-DQN learned with its policy, beside fits of the same policy, frozen.

All are judged by the same new episodes. Of each: how far it is to be trusted, how much better than
a constant guess single components are (1 is perfect, 0 no better), the steps and the seconds that
it took beside those of training.

    python benchmarks/joint.py runs/Acrobot-v1-N10-w1-seed1 [RUN …]
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch

import trdlab
from trdlab.agents.agent import Agent
from trdlab.agents.naming import find_agent
from trdlab.explanations.calibration.calibration import Calibration

METHODS = ("mixed", "regression", "td")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--episodes", type=int, default=100)
    options = parser.parse_args()
    torch.set_num_threads(1)
    for path in options.runs:
        agent = find_agent(str(path), joint=True)
        axis = agent.estimator.time_axis
        shown = sorted({0, axis.horizon // 4, axis.horizon // 2, axis.horizon - 1})
        print(f"\n{path.name}: skill at {', '.join(axis.label(k) for k in shown)}", flush=True)
        _tell("joint", agent, 0, 0.0, shown, options.episodes)
        for method in METHODS:
            began = time.perf_counter()
            fitted = trdlab.fit(
                agent,
                horizon=axis.horizon,
                width=axis.width,
                gamma=axis.gamma,
                steps=options.steps,
                method=method,
            )
            took = time.perf_counter() - began
            _tell(method, fitted, options.steps, took, shown, options.episodes)


def _tell(
    name: str, agent: Agent, steps: int, seconds: float, shown: list[int], episodes: int
) -> None:
    """Prints how good forecasts are."""
    found = trdlab.calibrate(agent, episodes=episodes).calibration
    skills = " · ".join(_skill(found, k) for k in shown)
    last = found.trust.last_step
    trusted = "nothing" if last is None else f"t+{last}"
    print(f"{name:>10}: to {trusted:>7} | {skills} | {steps:,} steps, {seconds:.0f} s", flush=True)


def _skill(found: Calibration, k: int) -> str:
    value, low, high = (end[k] for end in (found.skill.value, found.skill.low, found.skill.high))
    if not np.isfinite(value):
        return "always the same"
    return f"{value:.2f} [{low:.2f}, {high:.2f}]"


if __name__ == "__main__":
    main()
