"""One Atari game as a Gymnasium environment, prepared as the agents that trdlab trains see it."""

from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from trdlab.atari.names import find_game
from trdlab.atari.vector import FRAMES_PER_SECOND, SIDE, STACK, action_names, make_vector
from trdlab.errors import InputError, TrdlabError, closest

Frames = npt.NDArray[np.uint8]


class AtariGame(gym.Env[Frames, np.int64]):
    """A game whose observation is the stack `(4, 84, 84)` of its newest frames in grey.

    The stack begins with zeros; rewards are the game's own; an episode is a whole game. `info` has
    `lives`. Frames are prepared as by `AtariEnvironments`, to the bit.

    Args:
        game: its name, such as `Breakout`, `space_invaders` or `ALE/Breakout-v5`.
        sticky: the probability that the last action is repeated in place of the one given.
        noop_max: episodes begin with fewer than so many idle frames (and FIRE, where there is one).
        max_frames: of the emulator, after which an episode is truncated.
        frame_skip: for how many frames an action is held.
        full_action_space: all 18 actions, in place of those that the game knows.
        render_mode: `rgb_array` for whole screens in colour, such as `(210, 160, 3)`: the game is
            played twice then, in step.

    Raises:
        InputError: there is no such game or render mode, or a value is out of its range.

    >>> env = AtariGame("Breakout")
    >>> observation, info = env.reset(seed=0)
    >>> observation.shape, info, env.action_names
    ((4, 84, 84), {'lives': 5}, ('NOOP', 'FIRE', 'RIGHT', 'LEFT'))
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": FRAMES_PER_SECOND / 4}  # noqa: RUF012

    def __init__(
        self,
        game: str,
        *,
        sticky: float = 0.0,
        noop_max: int = 30,
        max_frames: int = 108_000,
        frame_skip: int = 4,
        full_action_space: bool = False,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            cure = closest(str(render_mode), self.metadata["render_modes"])
            raise InputError(f"The render mode is '{render_mode}'.", cure)
        self.game, self.frame_skip, self.render_mode = find_game(game), frame_skip, render_mode
        made = partial(
            make_vector,
            self.game,
            1,
            sticky=sticky,
            noop_max=noop_max,
            max_frames=max_frames,
            frame_skip=frame_skip,
            full_action_space=full_action_space,
        )
        self._envs = made(stack=STACK)
        self._shown = None if render_mode is None else made(stack=1, colour=True)
        self._screen: Frames | None = None
        self.action_names = action_names(self._envs)
        self.metadata = {**self.metadata, "render_fps": FRAMES_PER_SECOND / frame_skip}
        self.observation_space = gym.spaces.Box(0, 255, (STACK, SIDE, SIDE), np.uint8)
        self.action_space = gym.spaces.Discrete(len(self.action_names))
        self._begun = self._running = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Frames, dict[str, Any]]:
        """Begins a game; with a seed, all that follows is a function of it and of the actions.

        There are no `options`.
        """
        super().reset(seed=seed)
        if seed is not None or not self._begun:  # a seeded reset costs 15 times as much
            told: dict[str, Any] = {"seed": np.array([self.np_random.integers(2**31)])}
        else:
            told = {}
        observations, info = self._envs.reset(**told)
        if self._shown is not None:
            self._screen = self._shown.reset(**told)[0][0, 0]
        self._begun = self._running = True
        return observations[0], {"lives": int(info["lives"][0])}

    def step(self, action: np.int64 | int) -> tuple[Frames, float, bool, bool, dict[str, Any]]:
        """Takes an action.

        Raises:
            InputError: there is no such action.
            TrdlabError: no game is running.
        """
        if not self.action_space.contains(action):
            last = len(self.action_names) - 1
            raise InputError(f"There is no action {action!r}.", f"They run from 0 to {last}.")
        if not self._running:
            raise TrdlabError("No game is running.", "Call reset() first.")
        given = np.array([action], dtype=np.int64)
        observations, rewards, terminated, truncated, info = self._envs.step(given)
        if self._shown is not None:
            self._screen = self._shown.step(given)[0][0, 0]
        ends = bool(terminated[0]), bool(truncated[0])
        self._running = not any(ends)
        return observations[0], float(rewards[0]), *ends, {"lives": int(info["lives"][0])}

    def render(self) -> Any:
        """Returns the whole screen in colour, `[H, W, 3]`.

        Raises:
            TrdlabError: there is nothing to show before the first reset.
        """
        if self.render_mode is None:
            gym.logger.warn(
                "render() has nothing to return without a render mode. "
                'Make the environment with render_mode="rgb_array".'
            )
            return None
        if self._screen is None:
            raise TrdlabError("There is no episode yet.", "Call reset() first.")
        return self._screen.copy()
