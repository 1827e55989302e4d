"""How long pictures take: the frame of an environment, the forecast beside it, and a video of both.

python benchmarks/rendering.py
"""

import os
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium as gym
import numpy as np

import trdlab
from trdlab.atari.game import AtariGame
from trdlab.rendering import ForecastRendering
from trdlab.show.plots.figures import figure
from trdlab.show.video.files import SUFFIXES, check_video, write_video

FRAMES = 100


def main() -> None:
    print("milliseconds of processor time for a frame")
    drone = gym.make("trdlab/DroneGridworld-v0", render_mode="rgb_array")
    show("drone, N = 4", drone, trdlab.agent("gridworld:drone"))
    game = AtariGame("Breakout", render_mode="rgb_array")
    show("Breakout, N = 40", game, trdlab.agent("pretrained:Breakout"))


def show(name: str, env: gym.Env[Any, Any], agent: trdlab.Agent) -> None:
    """Prints what the frames of an environment cost, and a figure of matplotlib in their place."""
    wrapped = ForecastRendering(env, agent.estimator)
    frames, own, both = [], [], []
    begins = True
    for step in range(FRAMES):
        if begins:
            wrapped.reset(seed=step)
        own.append(timed(env.render))
        both.append(timed(wrapped.render))
        frames.append(both[-1][1])
        value = wrapped.components.sum(axis=1)
        *_, terminated, truncated, _ = wrapped.step(int(value.argmax()))
        begins = terminated or truncated
    alone, beside = (float(np.median([cost for cost, _ in of])) for of in (own, both))
    explained = trdlab.explain(agent, parts="forecast", episodes=0)
    drawn = timed(lambda: figure(explained).savefig("/dev/null", format="png"))[0]
    print(f"{name}, {frames[0].shape[1]} × {frames[0].shape[0]} pixels")
    print(f"  its own frame {alone:.1f}, the forecast beside it {beside - alone:.1f}")
    print(f"  a figure of matplotlib in its place {drawn:.0f}")
    for suffix in SUFFIXES:
        print(f"  {suffix[1:]}: {written(frames, suffix)}")


def written(frames: list[Any], suffix: str) -> str:
    """Returns what it costs to write frames, and how large they become."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"a{suffix}"
        try:
            check_video(path)
        except trdlab.errors.TrdlabError as error:
            return str(error)
        cost, _ = timed(lambda: write_video(path, iter(frames), len(frames), 15.0))
        return f"{cost / FRAMES:.1f} to write, {path.stat().st_size / FRAMES / 1000:.1f} kB"


def timed(do: Callable[[], Any]) -> tuple[float, Any]:
    """Returns the milliseconds of processor time that something takes, and what comes of it."""
    begun = _spent()
    result = do()
    return 1000.0 * (_spent() - begun), result


def _spent() -> float:
    """Returns the seconds of processor time so far, those of ffmpeg beside it included."""
    return time.process_time() + sum(os.times()[2:4])


if __name__ == "__main__":
    main()
