"""Gymnasium wrappers that draw the forecast beside each frame, and record videos of that."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import wrappers
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import VectorEnv
from gymnasium.wrappers import vector

from trdlab.environments.naming import action_names
from trdlab.errors import InputError
from trdlab.estimator import Estimator
from trdlab.show.video.beside import Beside, Told
from trdlab.wrappers import CHOSEN, TemporalRewardDecomposition, VectorTemporalRewardDecomposition

_FRAMES = "rgb_array"


class ForecastRendering(TemporalRewardDecomposition):
    """Draws what the estimator expects beside each frame of an environment.

    `render()` returns the environment's own frame, unchanged or each pixel enlarged to a square,
    and beside it bars of the actions that are worth most at the observation shown: a bar for each
    component, the residual hatched. All frames have one size, with even sides, so that
    `gymnasium.wrappers.RecordVideo` makes a video of them (see `record_video`). The scale of the
    bars only grows within an episode; where it has just grown, it stands on a dark ground for some
    frames. `info` is that of `TemporalRewardDecomposition`.

    Args:
        env: an environment with discrete actions that is made with `render_mode="rgb_array"`.
        estimator: shared, not copied.
        rows: how many actions are drawn.
        zoom: how many pixels wide each pixel of the environment's own frame becomes; by default as
            many as make it 300 pixels high.

    Raises:
        InputError: as for `TemporalRewardDecomposition`; the environment draws no frames, or one of
            another size than before; or there is not a single row.

    >>> from trdlab.decomposition import TimeAxis
    >>> from trdlab.gridworld.env import GridworldEnv
    >>> from trdlab.tabular import exact
    >>> env = GridworldEnv("drone", render_mode="rgb_array")
    >>> env = ForecastRendering(env, exact(env.mdp, TimeAxis(0.95, horizon=4)))
    >>> _ = env.reset(seed=0)
    >>> env.render().shape
    (384, 1192, 3)
    """

    def __init__(
        self,
        env: gym.Env[Any, Any],
        estimator: Estimator,
        *,
        rows: int = 2,
        zoom: int | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(
            self, _disable_deepcopy=True, estimator=estimator, rows=rows, zoom=zoom
        )
        super().__init__(env, estimator)
        _check_draws(env)
        self.metadata = {**env.metadata, "render_modes": [_FRAMES]}
        self._beside = _beside(env, self._actions, estimator, rows, zoom)
        self._told = Told()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Resets the environment, and the scale of the bars."""
        answer = super().reset(seed=seed, options=options)
        self._told = self._beside.grown(Told(), self.components)
        return answer

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Steps, and notes what is to be drawn of it."""
        answer = super().step(action)
        _, reward, terminated, _, info = answer
        if CHOSEN in info:
            taken = int(action) - int(self._actions.start)
            told = self._told.after(taken, float(reward), terminated)
        else:  # the step has only begun the next episode
            told = Told()
        self._told = self._beside.grown(told, self.components)
        return answer

    def render(self) -> Any:
        """Returns `[H, W, 3]`: the environment's frame, and the forecast beside it."""
        return self._beside.draw(self.env.render(), self.components, self._told)


class VectorForecastRendering(VectorTemporalRewardDecomposition):
    """Draws what the estimator expects beside each frame of a vector environment.

    `render()` returns a tuple of frames, one for each environment, each as `ForecastRendering`
    draws it: `gymnasium.wrappers.vector.RecordVideo` makes a video of them.

    Args:
        env: a vector environment with discrete actions that is made with `render_mode="rgb_array"`.
        estimator: shared, not copied; it is asked once for the whole batch.
        rows: how many actions are drawn.
        zoom: as for `ForecastRendering`.

    Raises:
        InputError: as for `ForecastRendering`.
    """

    def __init__(
        self,
        env: VectorEnv[Any, Any, Any],
        estimator: Estimator,
        *,
        rows: int = 2,
        zoom: int | None = None,
    ) -> None:
        super().__init__(env, estimator)
        _check_draws(env)
        first = getattr(env.unwrapped, "envs", [env])[0]
        self._beside = _beside(first, self._actions, estimator, rows, zoom)
        self._told = [Told()] * self.num_envs

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Resets the environments (or those of `reset_mask`), and the scale of their bars."""
        begun = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=np.bool_)).copy()
        answer = super().reset(seed=seed, options=options)
        self._tell([Told() if new else told for new, told in zip(begun, self._told, strict=True)])
        return answer

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Steps, and notes what is to be drawn of it."""
        answer = super().step(actions)
        _, rewards, terminated, truncated, infos = answer
        begins = terminated | truncated if self._mode == "SAME_STEP" else ~infos[f"_{CHOSEN}"]
        taken = np.asarray(actions) - int(self._actions.start)
        told = map(Told.after, self._told, taken.tolist(), rewards.tolist(), terminated.tolist())
        self._tell([Told() if new else of for new, of in zip(begins, told, strict=True)])
        return answer

    def render(self) -> Any:
        """Returns a tuple of frames `[H, W, 3]`, one for each environment."""
        frames: Any = self.env.render()
        return tuple(map(self._beside.draw, frames, self.components, self._told))

    def _tell(self, told: list[Told]) -> None:
        self._told = list(map(self._beside.grown, told, self.components))


def record_video(env: Any, folder: str | Path, **how: Any) -> Any:
    """Returns an environment that records videos of its episodes: Gymnasium's `RecordVideo`.

    Args:
        env: with `ForecastRendering` or `VectorForecastRendering` around it; any other that draws.
        folder: where the videos go.
        how: else, as for `gymnasium.wrappers.RecordVideo`, or that of `gymnasium.wrappers.vector`.

    Raises:
        InputError: what it needs is not installed, or the environment draws no frames.
    """
    _check_draws(env)
    if find_spec("moviepy") is None:
        raise InputError(
            "Gymnasium records videos by moviepy, which is not installed.",
            "Run: pip install 'trdlab[video]'",
        )
    recorder = getattr(vector if isinstance(env, VectorEnv) else wrappers, "RecordVideo", None)
    if recorder is None:
        raise InputError(
            f"Gymnasium {gym.__version__} records no videos of vector environments.",
            "Run: pip install --upgrade gymnasium",
        )
    return recorder(env, str(folder), **how)


def _check_draws(env: Any) -> None:
    if env.render_mode != _FRAMES:
        raise InputError(
            f"The render mode of the environment is {env.render_mode!r}.",
            f'Make it with render_mode="{_FRAMES}".',
        )


def _beside(
    env: Any, actions: gym.spaces.Discrete, estimator: Estimator, rows: int, zoom: int | None
) -> Beside:
    names = action_names(env, [int(actions.n)], int(actions.start))
    return Beside(estimator.time_axis, names, rows=rows, zoom=zoom)
