"""How long an update takes, against the bare one, and what a decomposition adds to plain DQN.

Bare is the same network in plain PyTorch: online forward and backward, target forward, fused
Adam, in the same precision and memory layout, on tensors that are ready. Ours begins with a batch
of numpy arrays and ends with the metrics; `sample` is where a replay memory goes to be counted
too. All sides take turns, and ratios are medians over rounds: machines drift, ratios hold.

    python benchmarks/update.py [--actions 4] [--updates 20] [--rounds 9] [--fp32]
"""

import argparse
import statistics
import time
from collections.abc import Callable
from itertools import count

import gymnasium as gym
import numpy as np
import torch
from torch import nn

from trdlab.decomposition import TimeAxis
from trdlab.deep.networks import build_network
from trdlab.deep.settings import UpdateSettings
from trdlab.deep.update import Batch, Learner, Windows

BATCH, HORIZON, SHAPE = 32, 40, (4, 84, 84)


def ready_batch(num_actions: int) -> Callable[[], Windows]:
    """Returns a `sample` function that costs nothing: always the same random batch."""
    rng = np.random.default_rng(0)
    batch = Batch(
        observations=rng.integers(0, 256, (BATCH, *SHAPE), dtype=np.uint8),
        actions=rng.integers(0, num_actions, BATCH),
        rewards=rng.integers(0, 2, BATCH).astype(np.float32),
        discounts=np.where(rng.random(BATCH) < 0.05, 0, 0.99).astype(np.float32),
        next_observations=rng.integers(0, 256, (BATCH, *SHAPE), dtype=np.uint8),
    )
    return lambda: batch


def ours(
    sample: Callable[[], Windows], num_actions: int, horizon: int, bf16: bool
) -> Callable[[], object]:
    """Returns one whole update: sampling, the update, its metrics."""
    space = gym.spaces.Box(0, 255, SHAPE, np.uint8)
    network = build_network(space, num_actions, TimeAxis(0.99, horizon))
    learner = Learner(network, UpdateSettings(precision="bfloat16" if bf16 else "float32"))
    return lambda: learner.update(sample())


def bare(num_actions: int, horizon: int, bf16: bool) -> Callable[[], None]:
    """Returns the least that an update must do, written down without trdlab."""

    def network() -> nn.Module:
        layers = (
            *(nn.Conv2d(4, 32, 8, 4), nn.ReLU(), nn.Conv2d(32, 64, 4, 2), nn.ReLU()),
            *(nn.Conv2d(64, 64, 3, 1), nn.ReLU(), nn.Flatten(), nn.Linear(3136, 512), nn.ReLU()),
            nn.Linear(512, num_actions * (horizon + 1)),
        )
        return nn.Sequential(*layers).to(memory_format=torch.channels_last)

    def images() -> torch.Tensor:
        return torch.randint(0, 256, (BATCH, *SHAPE), dtype=torch.uint8)

    online, target = network(), network()
    adam = torch.optim.Adam(online.parameters(), lr=1e-4, fused=True)
    observations, next_observations = images(), images()

    def forward(network: nn.Module, images: torch.Tensor) -> torch.Tensor:
        inputs = images.contiguous(memory_format=torch.channels_last).float() / 255
        return network(inputs).float()

    def update() -> None:
        with torch.autocast("cpu", torch.bfloat16, enabled=bf16):
            with torch.no_grad():
                following = forward(target, next_observations)
            loss = (forward(online, observations) - following).square().mean()
        adam.zero_grad(set_to_none=True)
        loss.backward()
        adam.step()

    return update


def milliseconds(update: Callable[[], object], updates: int) -> float:
    start = time.perf_counter()
    for _ in range(updates):
        update()
    return (time.perf_counter() - start) / updates * 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description="Time an update against the bare one.")
    parser.add_argument("--actions", type=int, default=4, help="4 as in Breakout, at most 18")
    parser.add_argument("--updates", type=int, default=20, help="in a turn")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--fp32", action="store_true", help="float32 alone")
    options = parser.parse_args()
    sample = ready_batch(options.actions)
    for bf16 in (False,) if options.fp32 else (False, True):
        sides = {
            "ours N = 40": ours(sample, options.actions, HORIZON, bf16),
            "bare N = 40": bare(options.actions, HORIZON, bf16),
            "ours N = 0": ours(sample, options.actions, 0, bf16),
        }
        taken: dict[str, list[float]] = {name: [] for name in sides}
        for turn in count():  # the first round does not count
            order = list(sides) if turn % 2 else list(sides)[::-1]
            for name in order:
                taken[name].append(milliseconds(sides[name], options.updates))
            if turn == options.rounds:
                break
        taken = {name: values[1:] for name, values in taken.items()}
        print(f"{'bf16' if bf16 else 'fp32'}, {options.actions} actions, batch {BATCH}")
        for name, values in taken.items():
            print(f"  {name:12} median {statistics.median(values):6.2f} ms", flush=True)
        for name, reach in (("bare N = 40", 1.25), ("ours N = 0", 1.03)):
            pairs = zip(taken["ours N = 40"], taken[name], strict=True)
            ratios = sorted(mine / other for mine, other in pairs)
            print(
                f"  ours N = 40 / {name:12} median {statistics.median(ratios):.3f} "
                f"(min {ratios[0]:.3f}, max {ratios[-1]:.3f}; to reach: at most {reach})"
            )


if __name__ == "__main__":
    main()
