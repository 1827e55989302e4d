"""Gymnasium environments that also show what people see of them."""

import os
import sys
import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.environments.aside import aside
from trdlab.environments.gym import GymEnvironments
from trdlab.environments.protocol import Environments, Frames, Step

MODE = "rgb_array"
"""How Gymnasium calls pictures as arrays."""


class DrawnEnvironments(GymEnvironments):
    """B Gymnasium environments that are drawn at every step, and else do as `GymEnvironments`.

    Attributes:
        screens: `[B, H, W, 3]`, what people see when the next action is chosen; None where an
            environment draws nothing.

    >>> environments = DrawnEnvironments("CartPole-v1", 1, seed=0,
    ...     env_arguments={"render_mode": "rgb_array"})
    >>> environments.reset().shape, environments.screens.shape
    ((1, 4), (1, 400, 600, 3))
    """

    screens: Frames | None = None
    _last: dict[int, Any]

    def reset(self) -> Frames:
        """Begins an episode in every environment, and returns their first frames `[B, ...]`."""
        self._last = {}
        frames = super().reset()
        self.screens = self._all_drawn()
        return frames

    def step(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        """Takes actions `[B]`; the step has the screens that it led to."""
        self._last = {}
        step = super().step(actions, active)
        following = self._all_drawn() if self.screens is not None else None
        screens = None if following is None else following.copy()
        for env, last in self._last.items():
            if screens is not None and last is not None and last.shape == screens.shape[1:]:
                screens[env] = last
        self.screens = following
        return replace(step, screens=screens)

    def _begin(self, env: int, frames: Frames, seeding: int | None = None) -> None:
        if self.screens is not None:  # an episode is over: this is how it ended
            self._last[env] = _drawn(self._envs[env])
        super()._begin(env, frames, seeding)

    def _all_drawn(self) -> Frames | None:
        found = [_drawn(env) for env in self._envs]
        shapes = {None if one is None else one.shape for one in found}
        return None if None in shapes or len(shapes) > 1 else np.stack(found)  # type: ignore[arg-type]


def screened(environments: Environments) -> Environments:
    """Returns environments that do as some that have not begun, and show `screens` if they can.

    Args:
        environments: they are closed, if others take their place.

    >>> from trdlab.environments import GymEnvironments
    >>> drawn = screened(GymEnvironments("CartPole-v1", 1, seed=0))
    >>> drawn.reset().shape, drawn.screens.shape
    ((1, 4), (1, 400, 600, 3))
    """
    if hasattr(environments, "screened"):  # games, and what wraps others
        made: Environments = environments.screened()
        return made
    return _drawn_as(environments) if isinstance(environments, GymEnvironments) else environments


def _drawn_as(of: GymEnvironments) -> GymEnvironments:
    """Returns environments made of what others were made of, such that they draw if they can."""
    of.close()
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        os.environ.setdefault(
            "SDL_VIDEODRIVER", "dummy"
        )  # else SDL complains that it has no screen
    env, seed, arguments = of.given
    if isinstance(env, str) and MODE in of.render_modes:
        arguments = {"render_mode": MODE} | arguments
    return DrawnEnvironments(env, of.num_envs, seed=seed, env_arguments=arguments)


def _drawn(env: Any) -> Frames | None:
    """Returns the picture `[H, W, 3]` of an environment, None where it draws none."""
    if getattr(env, "render_mode", None) != MODE:
        return None
    try:
        with aside(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of libraries that draw
            picture = np.asarray(env.render())
    except Exception:  # noqa: BLE001  whatever it is, there is no picture
        return None
    is_picture = picture.dtype == np.uint8 and picture.ndim == 3 and picture.shape[2] == 3
    return picture.copy() if is_picture else None
