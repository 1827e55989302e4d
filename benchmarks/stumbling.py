"""Agents of others, made to stumble: how far ahead can a fit of them be trusted?

An agent that never fails has nothing to predict. With some of its actions at random it falls now
and then, and its forecasts can be told from a constant guess.

    python benchmarks/stumbling.py dqn.zip ppo.zip --env CartPole-v1
"""

import argparse
import time
from pathlib import Path

import numpy as np
import torch

import trdlab
from trdlab.policies import EpsilonGreedy, acting


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("agents", nargs="+", type=Path)
    parser.add_argument("--env", required=True)
    parser.add_argument("--epsilon", type=float, default=0.3)
    parser.add_argument("--steps", type=int, default=50_000)
    parser.add_argument("--N", type=int, default=40)
    options = parser.parse_args()
    torch.set_num_threads(1)
    for path in options.agents:
        began = time.perf_counter()
        agent = trdlab.agent(path, env=options.env)
        stumbling = EpsilonGreedy(acting(agent.policy or agent.estimator), options.epsilon)
        agent = trdlab.agent(agent, policy=stumbling)
        fitted = trdlab.fit(agent, horizon=options.N, steps=options.steps)
        found = trdlab.calibrate(fitted).calibration
        judged = np.flatnonzero(np.isfinite(found.skill.low[:-1]))
        sure = np.append(found.skill.low[judged] > 0.0, False)
        last = f"t+{judged[sure.argmin() - 1]}" if sure[0] else "nothing"
        skill = " · ".join(f"t+{k}: {found.skill.value[k]:.2f}" for k in (1, 5, 10, 20, 39))
        took = time.perf_counter() - began
        print(f"{path.stem}: skill surely above 0 up to {last} ({skill}), {took:.0f} s", flush=True)


if __name__ == "__main__":
    main()
