"""The replay memory on five Atari games: its size, its speed, and its share of an update.

The agent acts at random, its frames are 84×84 grey ones of ale-py's own vector environment: frame
skip 4, up to 30 no-ops, then the button that starts a game; and it presses that button again with
every tenth action, lest Breakout stands still after a lost ball. A bare update is plain torch: the
Nature CNN (18 actions, channels last), batch 32, forward and backward, forward of the target
network, fused Adam; in float32, and with bfloat16 autocast. It takes turns with the sampling of 32
windows with stacks of four frames, as in training, so that the memory is read from behind cold
caches; machines drift, ratios hold.

    python benchmarks/replay.py             # 20 000 steps of each game
    python benchmarks/replay.py 2000        # fewer
"""

import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
import torch
from ale_py.vector_env import AtariVectorEnv
from torch import nn

from trdlab.deep.frames import FrameStore
from trdlab.deep.memory import memory_needed
from trdlab.deep.replay import Batch, ReplayBuffer

GAMES = ("breakout", "seaquest", "riverraid", "space_invaders", "ms_pacman")
BATCH, STACK, WIDTHS, ROUNDS, FIRE = 32, 4, (1, 3, 10), 40, 1


def play(game: str, steps: int, memories: list[ReplayBuffer]) -> np.ndarray:
    """Plays at random into all the memories, and returns some thousand frames."""
    envs = AtariVectorEnv(game, num_envs=1, stack_num=STACK)
    rng, kept = np.random.default_rng(0), []
    observations, _ = envs.reset(seed=0)
    ended = False  # the step after an end only resets
    for turn in range(steps):
        action = rng.integers(envs.single_action_space.n, size=1)
        action = np.where(rng.random(1) < 0.1, FIRE, action)
        following, rewards, terminated, truncated, _ = envs.step(action)
        for memory in memories:
            memory.add(
                observations[:, -1],
                action,
                rewards,
                terminated,
                truncated,
                following[:, -1],
                active=not ended,
            )
        ended = bool(terminated[0] or truncated[0])
        observations = following.copy()
        if turn % max(1, steps // 2000) == 0:
            kept.append(observations[0, -1])
    envs.close()
    return np.stack(kept)


def per_frame(frames: np.ndarray) -> tuple[float, float]:
    """Returns the millionths of a second that storing a frame takes, and reading a random one."""
    store = FrameStore(frames.shape[1:], frames.dtype, 1, 256, compress=True)
    storing = clock(lambda: [store.append(0, frame) for frame in frames])
    rng = np.random.default_rng(0)
    reading = []
    for _ in range(ROUNDS):
        numbers = rng.permutation(len(frames))[:256]
        reading.append(clock(lambda n=numbers: store.read(np.zeros_like(n), n)) / len(numbers))
    numbers = np.arange(len(frames))
    if not np.array_equal(store.read(np.zeros_like(numbers), numbers), frames):
        raise SystemExit("The frames read are not those that were stored.")
    return 1e6 * storing / len(frames), 1e6 * statistics.median(reading)


def clock(function: Callable[[], object]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def network(actions: int = 18) -> nn.Module:
    return nn.Sequential(
        *(nn.Conv2d(STACK, 32, 8, 4), nn.ReLU(), nn.Conv2d(32, 64, 4, 2), nn.ReLU()),
        *(nn.Conv2d(64, 64, 3, 1), nn.ReLU(), nn.Flatten(), nn.Linear(3136, 512), nn.ReLU()),
        nn.Linear(512, actions),
    ).to(memory_format=torch.channels_last)


def bare_update(bf16: bool) -> Callable[[Batch], None]:
    """Returns an update in plain torch, of Q-learning, that knows nothing of trdlab."""
    online, target = network(), network()
    adam = torch.optim.Adam(online.parameters(), lr=1e-4, fused=True)

    def images(stacks: np.ndarray) -> torch.Tensor:
        bytes_ = torch.from_numpy(stacks).to(memory_format=torch.channels_last)
        return bytes_.to(torch.float32) / 255

    def update(batch: Batch) -> None:
        with torch.autocast("cpu", torch.bfloat16, enabled=bf16):
            with torch.no_grad():
                following = target(images(batch.next_observations)).float().max(dim=1).values
            values = online(images(batch.observations)).float()
        wanted = torch.from_numpy(batch.rewards) + torch.from_numpy(batch.discounts) * following
        taken = values.gather(1, torch.from_numpy(batch.actions)[:, None])[:, 0]
        adam.zero_grad(set_to_none=True)
        (taken - wanted).square().mean().backward()
        adam.step()

    return update


def shares(
    memories: list[ReplayBuffer], updates: list[Callable[[Batch], None]]
) -> tuple[list[list[float]], list[list[list[float]]]]:
    """Returns the seconds of sampling by memory, and its shares of each update by memory."""
    rng = np.random.default_rng(1)
    seconds: list[list[float]] = [[] for _ in memories]
    parts: list[list[list[float]]] = [[[] for _ in updates] for _ in memories]
    for turn in range(ROUNDS + 3):  # the first three do not count
        for memory, sampling, part in zip(memories, seconds, parts, strict=True):
            for update, ratios in zip(updates, part, strict=True):
                start = time.perf_counter()
                batch = memory.sample(BATCH, rng)
                middle = time.perf_counter()
                update(batch)
                if turn >= 3:
                    sampling.append(middle - start)
                    ratios.append((middle - start) / (time.perf_counter() - middle))
    return seconds, parts


def main(steps: int) -> None:
    torch.manual_seed(0)
    updates = [bare_update(bf16=False), bare_update(bf16=True)]
    print(
        f"{'':14} | bytes per  | µs per frame  | ms to sample (shares of a bare update: fp32, bf16)"
    )
    widths = " | ".join(f"{f'w = {width}':^19}" for width in WIDTHS)
    print(f"{'game':14} | transition | store    read | {widths}", flush=True)
    sizes = []
    for game in GAMES:
        memories = [
            ReplayBuffer(steps, (84, 84), width=width, gamma=0.99, stack=STACK, padding="zero")
            for width in WIDTHS
        ]
        frames = play(game, steps, memories)
        storing, reading = per_frame(frames)
        sizes.append(memories[0].bytes_per_transition)
        told = " | ".join(
            f"{1e3 * statistics.median(seconds):5.2f} "
            + " ".join(f"{statistics.median(ratios):6.1%}" for ratios in part)
            for seconds, part in zip(*shares(memories, updates), strict=True)
        )
        print(
            f"{game:14} | {sizes[-1]:10.0f} | {storing:5.1f}   {reading:5.1f} | {told}", flush=True
        )
    mean, told = statistics.fmean(sizes), memory_needed(1_000_000, (84, 84)) / 1e9
    print(
        f"{'mean':14} | {mean:10.0f} | (at most 2000; {mean / 1e3:.2f} GB a million steps, ", end=""
    )
    print(f"told beforehand without a measurement: {told:.2f} GB)")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000)
