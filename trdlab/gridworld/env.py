"""A gridworld as a Gymnasium environment: it samples from the exact model, which it carries."""

from copy import copy, deepcopy
from pathlib import Path
from typing import Any, Literal, Self, get_args

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from trdlab.errors import InputError, TrdlabError, closest
from trdlab.gridworld.gridmap import ACTIONS, GridMap, load_map
from trdlab.gridworld.pixels import SIDE, pictures_of
from trdlab.gridworld.world import Gridworld
from trdlab.tabular.mdp import MDP
from trdlab.tabular.reach import reachable

Observed = Literal["index", "pixels"]
Observation = np.int64 | npt.NDArray[np.uint8]


class GridworldEnv(gym.Env[Observation, np.int64]):
    """A drone on a map: the observation is the state's index, the action one of four directions.

    Seen as pixels, the observation is a grey picture `(84, 84)` of the state: what people see,
    smaller. Either tells the state exactly.

    What happens is drawn from `mdp`, so whatever is learned here can be compared with the exact
    answer. An episode ends where the model terminates; it is never truncated from within (see
    `max_episode_steps` of `gymnasium.make`). `info` has the drone's `row` and `column`, and
    `collected`, the number of one-time cells it has emptied; after a step also its `parts`, what
    each source of reward has paid.

    Args:
        map: the name of a built-in map, a map file, or a map.
        slip: the probability of moving sideways instead, in place of the map's own.
        treasure: what every treasure pays, in place of the map's own value.
        observation: `index` or `pixels`.
        exploring_starts: whether episodes begin in any state that can be reached and in which
            they are not over, each as likely, rather than at the map's start: so that rare states
            are seen as often as others (Sutton and Barto, section 5.3).
        render_mode: `rgb_array` for pictures, `ansi` for text.
        cell_pixels: the side of a cell in the pictures.

    Raises:
        MapError: the map cannot be read or played, or has no treasure to revalue.
        InputError: an unknown render mode or observation, or a map too large for pixels.

    >>> env = GridworldEnv("drone")
    >>> state, info = env.reset(seed=0)
    >>> state, reward, terminated, truncated, info = env.step(1)
    >>> int(state), reward, info
    (2, 0.0, {'row': 2, 'column': 0, 'collected': 0, 'parts': {'coin': 0.0, 'treasure': 0.0}})
    """

    metadata = {"render_modes": ["rgb_array", "ansi"], "render_fps": 4}  # noqa: RUF012
    action_names = ACTIONS

    def __init__(
        self,
        map: str | Path | GridMap = "drone",  # noqa: A002
        *,
        slip: float | None = None,
        treasure: float | None = None,
        observation: Observed = "index",
        exploring_starts: bool = False,
        render_mode: str | None = None,
        cell_pixels: int = 64,
    ) -> None:
        grid = map if isinstance(map, GridMap) else load_map(map)
        grid = grid.changed(slip=slip, treasure=treasure)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(
                f"The render mode is '{render_mode}'.",
                closest(str(render_mode), self.metadata["render_modes"]),
            )
        if observation not in get_args(Observed):
            raise InputError(
                f"The observation is '{observation}'.", closest(observation, get_args(Observed))
            )
        self.world = Gridworld(grid)
        self._pictures = pictures_of(self.world) if observation == "pixels" else None
        self.observation_space = (
            gym.spaces.Discrete(self.mdp.num_states)
            if self._pictures is None
            else gym.spaces.Box(0, 255, (SIDE, SIDE), np.uint8)
        )
        self.action_space = gym.spaces.Discrete(self.mdp.num_actions)
        self._starts = np.flatnonzero(reachable(self.mdp) & ~self.mdp.terminal_states)
        self.exploring_starts = exploring_starts
        self.render_mode = render_mode
        self.cell_pixels = cell_pixels
        self._state: int | None = None  # None before the first reset
        self._terminated = False

    @property
    def mdp(self) -> MDP:
        """The exact model that transitions are drawn from."""
        return self.world.mdp

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins an episode; in `options["state"]`, if given: an index, or `"row,column"`.

        Raises:
            InputError: there is no such state, or the episode is already over in it.
        """
        super().reset(seed=seed)
        state = self.mdp.start
        if self.exploring_starts:
            state = int(self._starts[self.np_random.integers(len(self._starts))])
        if options is not None and "state" in options:
            state = self.world.find_state(str(options["state"]))
            if self.world.is_terminal(state):
                raise InputError(
                    f"The episode is over in state {state} ({self.world.states[state]}).",
                    "Start in a state that is not terminal.",
                )
        self._state, self._terminated = state, False
        return self._observe(state), self._info(state)

    def step(self, action: np.int64 | int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Takes an action: 0 up, 1 down, 2 left, 3 right.

        Raises:
            InputError: there is no such action.
            TrdlabError: no episode is running.
        """
        if not self.action_space.contains(action):
            names = ", ".join(f"{i} {name}" for i, name in enumerate(ACTIONS))
            raise InputError(
                f"There is no action {action!r}.", f"Actions are whole numbers: {names}."
            )
        state = self._running_state()
        if self._terminated:
            raise TrdlabError("The episode is over.", "Call reset() before the next step().")
        drawn = self._draw(state * self.mdp.num_actions + int(action))
        following = int(self.mdp.next_states[drawn])
        self._state, self._terminated = following, bool(self.mdp.terminated[drawn])
        reward = float(self.mdp.rewards[drawn])
        parts = {name: float(paid[drawn]) for name, paid in self.world.parts.items()}
        info = {**self._info(following), "parts": parts}
        return self._observe(following), reward, self._terminated, False, info

    def render(self) -> Any:
        """Returns a picture `[H, W, 3]` or a text, as `render_mode` says.

        Raises:
            TrdlabError: there is nothing to show before the first reset.
        """
        if self.render_mode is None:
            gym.logger.warn(
                "render() has nothing to return without a render mode. "
                'Make the environment with render_mode="rgb_array" or "ansi".'
            )
            return None
        state = self._running_state()
        if self.render_mode == "ansi":
            from trdlab.gridworld.ansi import ansi

            return ansi(self.world, state)
        from trdlab.gridworld.render import frame  # here: matplotlib is slow to import

        return frame(self.world, state, self.cell_pixels)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Returns an environment in the same state, with the same world: that never changes."""
        twin = copy(self)
        kept = (self.world, self._pictures)
        memo |= {id(self): twin, **{id(shared): shared for shared in kept}}
        twin.__dict__ |= deepcopy(self.__dict__, memo)
        return twin

    def _observe(self, state: int) -> Observation:
        return np.int64(state) if self._pictures is None else self._pictures[state].copy()

    def _draw(self, row: int) -> int:
        """Returns one of the transitions of a row of the model, by their probabilities."""
        first, end = self.mdp.offsets[row], self.mdp.offsets[row + 1]
        cumulative = np.cumsum(self.mdp.probabilities[first:end])
        level = self.np_random.random() * cumulative[-1]  # < the last, which may not be quite 1
        return int(first + np.searchsorted(cumulative, level, side="right"))

    def _running_state(self) -> int:
        if self._state is None:
            raise TrdlabError("There is no episode yet.", "Call reset() first.")
        return self._state

    def _info(self, state: int) -> dict[str, Any]:
        at = self.world.states[state]
        return {"row": at.row, "column": at.column, "collected": len(at.collected)}
