"""Windows of w steps, cut from the stream of one or many environments, episode by episode."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError


@dataclass(frozen=True, eq=False)
class Windows:
    """K finished windows, ready for `trdlab.bellman.target`.

    Args:
        observations: `[K, ...]`, s_t.
        actions: `[K]`, a_t.
        rewards: `[K]`, Σ_(i<w) γ^i R_(t+i); after the end of an episode steps pay 0.
        discounts: `[K]`, γ^w, or 0 where the episode terminated within the window.
        next_observations: `[K, ...]`, s_(t+w) where to bootstrap; where the episode terminated,
            its last observation, which nothing should depend on.
        terminated: `[K]`, whether the episode terminated within the window.
        tail_greedy: `[K]`, whether all the actions after the first were greedy.
        steps: `[K]`, the steps really taken: w, or fewer where the episode terminated sooner.
        environments: `[K]`, which environment each window comes from.
    """

    observations: npt.NDArray[Any]
    actions: IntArray
    rewards: FloatArray
    discounts: FloatArray
    next_observations: npt.NDArray[Any]
    terminated: BoolArray
    tail_greedy: BoolArray
    steps: IntArray
    environments: IntArray

    def __len__(self) -> int:
        return len(self.actions)

    def where(self, mask: BoolArray) -> "Windows":
        """Returns the windows that `mask [K]` selects."""
        return Windows(*(getattr(self, field.name)[mask] for field in fields(self)))


class WindowBuilder:
    """Cuts the steps of B environments into overlapping windows; one begins at every step.

    The rules that keep each component of a decomposition at its own steps (errata C1 to C3):

    - s_(t+w) is the observation exactly w steps later.
    - No window crosses the end of an episode.
    - Where an episode *terminates*, its unfinished windows are exact, for zeros follow: they are
      returned with discount 0.
    - Where it is *truncated*, the window that is just full is returned with the true last
      observation. Those still unfinished are dropped and counted: a shortened window would
      bootstrap too early and shift every component.

    Dropping has a price. Of the windows begun in the last w−1 steps before a time limit, only
    those that terminate can be finished, so an end looks likelier than it is. With a known
    `time_limit` no window is begun there, and what is left is unbiased.

    Args:
        width: w, the steps in a window, at least 1.
        gamma: the discount factor.
        num_envs: B, the environments that step together.
        time_limit: the step at which every episode is truncated, if it is known.

    Raises:
        InputError: w or B is less than 1, or no window fits into the time limit.

    Source: the paper's Eq. trd-loss, corrected (errata P2, C1, C2, C3).

    >>> builder, no = WindowBuilder(width=2, gamma=0.5, num_envs=1), np.array([False])
    >>> state, action, reward = np.array([7]), np.array([1]), np.array([4.0])
    >>> len(builder.add(state, action, reward, no, no, np.array([8])))  # not full yet
    0
    >>> window = builder.add(np.array([8]), action, reward, no, no, np.array([9]))
    >>> window.observations.tolist(), window.rewards.tolist(), window.next_observations.tolist()
    ([7], [6.0], [9])
    """

    def __init__(
        self, width: int, gamma: float, num_envs: int, *, time_limit: int | None = None
    ) -> None:
        for name, count in (("width w", width), ("number of environments", num_envs)):
            if count < 1:
                raise InputError(f"The {name} is {count}.", "It must be at least 1.")
        if time_limit is not None and time_limit < width:
            raise InputError(
                f"Episodes end after {time_limit} steps, so no window of {width} steps fits in.",
                f"Choose a width w of at most {time_limit}, or a longer time limit.",
            )
        self.width, self.gamma, self.num_envs = width, float(gamma), num_envs
        self.time_limit = time_limit
        self.dropped = 0
        """The windows that truncation has cut short so far, or would have (see `time_limit`)."""
        self.elapsed = np.zeros(num_envs, dtype=np.int64)
        """`[B]`: the steps taken so far in each running episode."""
        # A window begun at step t of its episode lives in slot t mod w.
        self._observations: npt.NDArray[Any] | None = None  # [w, B, ...], made at the first step
        self._actions = np.zeros((width, num_envs), dtype=np.int64)
        self._rewards = np.zeros((width, num_envs))
        self._steps = np.zeros((width, num_envs), dtype=np.int64)
        self._tail_greedy = np.zeros((width, num_envs), dtype=np.bool_)
        self._open = np.zeros((width, num_envs), dtype=np.bool_)

    def add(
        self,
        observations: npt.ArrayLike,
        actions: npt.ArrayLike,
        rewards: npt.ArrayLike,
        terminated: npt.ArrayLike,
        truncated: npt.ArrayLike,
        next_observations: npt.ArrayLike,
        *,
        greedy: npt.ArrayLike = True,
        begins: npt.ArrayLike = True,
        active: npt.ArrayLike = True,
    ) -> Windows:
        """Takes one step of every environment, and returns the windows that it finishes.

        Observations are only copied about, so they may be anything that fits into an array: state
        indices, pictures, or the numbers of frames that are stored elsewhere.

        Args:
            observations: `[B, ...]`, in which the actions were taken.
            actions: `[B]`.
            rewards: `[B]`.
            terminated: `[B]`, whether the episode ended for good; wins over `truncated`.
            truncated: `[B]`, whether it was cut off.
            next_observations: `[B, ...]`, to which the step led; at the end of an episode its
                true last observation, not the first one of the next.
            greedy: `[B]`, whether the actions were greedy.
            begins: `[B]`, whether a window may begin with this step.
            active: `[B]`, false where no step was taken, for example because the environment was
                only reset.

        Returns:
            The finished windows, by environment, the oldest first.

        Raises:
            InputError: an array does not have one entry per environment.
        """
        observations = self._checked("observations", observations)
        next_observations = self._checked("next observations", next_observations)
        actions = self._checked("actions", actions, 1)
        rewards = self._checked("rewards", rewards, 1)
        ended = self._checked("terminated", terminated, 1).astype(np.bool_)
        cut = self._checked("truncated", truncated, 1).astype(np.bool_)
        active = np.broadcast_to(active, self.num_envs)

        running = self._open & active  # [w, B]
        self._rewards += np.where(running, self.gamma**self._steps * rewards, 0.0)
        self._tail_greedy &= ~running | greedy
        self._steps += running
        self._begin(active & begins, observations, actions, rewards)

        ended, cut = active & ended, active & cut & ~ended
        finished = self._open & ((self._steps == self.width) | ended)  # [w, B]
        windows = self._taken(finished, ended, next_observations)
        self._open &= ~finished
        self.dropped += int(np.count_nonzero(self._open & cut))
        self._open &= ~cut
        self.elapsed = np.where(ended | cut, 0, self.elapsed + active)
        return windows

    def _begin(
        self,
        begins: BoolArray,
        observations: npt.NDArray[Any],
        actions: npt.NDArray[Any],
        rewards: npt.NDArray[Any],
    ) -> None:
        """Opens a window in each environment that `begins [B]` selects."""
        if self._observations is None:
            shape = (self.width, *observations.shape)
            self._observations = np.empty(shape, dtype=observations.dtype)
        if self.time_limit is not None:
            fits = self.elapsed + self.width <= self.time_limit
            self.dropped += int(np.count_nonzero(begins & ~fits))
            begins = begins & fits
        here = np.flatnonzero(begins)
        slots = self.elapsed[here] % self.width
        self._observations[slots, here] = observations[here]
        self._actions[slots, here] = actions[here]
        self._rewards[slots, here] = rewards[here]
        self._steps[slots, here] = 1
        self._tail_greedy[slots, here] = True
        self._open[slots, here] = True

    def _taken(
        self, finished: BoolArray, terminated: BoolArray, next_observations: npt.NDArray[Any]
    ) -> Windows:
        """Returns the windows in the slots that `finished [w, B]` selects."""
        slots, envs = np.nonzero(finished)
        order = np.lexsort((-self._steps[slots, envs], envs))
        slots, envs = slots[order], envs[order]
        assert self._observations is not None  # made when the first window began
        return Windows(
            observations=self._observations[slots, envs],
            actions=self._actions[slots, envs],
            rewards=self._rewards[slots, envs],
            discounts=np.where(terminated[envs], 0.0, self.gamma**self.width),
            next_observations=next_observations[envs],
            terminated=terminated[envs],
            tail_greedy=self._tail_greedy[slots, envs],
            steps=self._steps[slots, envs],
            environments=envs,
        )

    def _checked(self, name: str, values: npt.ArrayLike, rank: int = 0) -> npt.NDArray[Any]:
        """Returns the array if it has one entry per environment, and the rank if one is given."""
        array = np.asarray(values)
        fits = array.ndim == rank if rank else array.ndim > 0
        if not fits or len(array) != self.num_envs:
            raise InputError(
                f"The {name} have shape {array.shape}, there are {self.num_envs} environments.",
                "Give one entry for each environment.",
            )
        return array
