"""The numbers of the newest transitions of many environments, and where finished windows begin."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError

RUNS, TERMINATED, TRUNCATED = 0, 1, 2
"""How a step leaves its episode."""

FIELDS: dict[str, npt.DTypeLike] = {
    "frame": np.int64,  # the number of s_t's newest frame in its stream
    "age": np.int32,  # how many frames there were before it since the environment was reset
    "action": np.int32,
    "reward": np.float32,
    "ending": np.uint8,
    "gain": np.float64,  # the discounted rewards so far of the window that begins here
    "steps": np.int32,  # how many these are
    "valid": np.bool_,  # whether that window is finished
}
"""What is kept of each transition."""
TRANSITION_NBYTES = sum(np.dtype(kind).itemsize for kind in FIELDS.values())


class Ring:
    """A ring of L transitions for each of B environments; the oldest are overwritten.

    The transition with the number n of environment b has the place (n mod L)·B + b. Each step adds
    its reward to the windows that it belongs to, and marks those that it finishes: so what became
    of a window only needs to be looked up, and drawing one costs the same however many there are.

    Args:
        capacity: L·B, rounded up to a multiple of B.
        num_envs: B.
        width: w, the steps in a window, at most L.
        gamma: γ, the discount factor of one step.
        time_limit: the step at which every episode is truncated, if it is known: no window is
            begun in the last w − 1 steps before it.
        extras: shape and type of what else is kept of a transition, by name.

    Raises:
        InputError: an option is out of its range.
    """

    def __init__(
        self,
        capacity: int,
        num_envs: int,
        width: int,
        gamma: float,
        time_limit: int | None,
        extras: Mapping[str, tuple[tuple[int, ...], npt.DTypeLike]],
    ) -> None:
        _check(capacity, num_envs, width, time_limit)
        self.length, self.num_envs, self.width = -(-capacity // num_envs), num_envs, width
        self.capacity, self.time_limit = self.length * num_envs, time_limit
        self.fields = {name: np.zeros(self.capacity, kind) for name, kind in FIELDS.items()}
        """`[L·B]` each, see `FIELDS`."""
        self.extras = {
            name: np.zeros((self.capacity, *shape), kind) for name, (shape, kind) in extras.items()
        }
        """`[L·B, ...]` each."""
        self.counts = np.zeros(num_envs, dtype=np.int64)
        """`[B]`: the transitions so far."""
        self._discounts = gamma ** np.arange(width)  # [w]
        self._since_end = np.zeros(num_envs, dtype=np.int64)  # [B], of the running episode
        self._num_valid = np.zeros((), dtype=np.int64)

    def __len__(self) -> int:
        """How many transitions are held."""
        return int(np.minimum(self.counts, self.length).sum())

    @property
    def num_windows(self) -> int:
        """How many finished windows begin at a transition that is held."""
        return int(self._num_valid)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Returns the whole state, by name; the arrays themselves."""
        extras = {f"extras/{name}": values for name, values in self.extras.items()}
        totals = {"since_end": self._since_end, "num_valid": self._num_valid}
        return {**self.fields, **extras, "counts": self.counts, **totals}

    def add(
        self,
        env: int,
        frame: int,
        age: int,
        action: int,
        reward: float,
        ending: int,
        extras: Mapping[str, npt.NDArray[Any]],
    ) -> None:
        """Keeps a transition in the place of the oldest, and adds it to the windows it belongs to.

        Args:
            env: whose transition it is.
            frame: see `FIELDS`; likewise `age`, `action`, `reward` and `ending`.
            age: see there.
            action: see there.
            reward: see there.
            ending: see there.
            extras: `[...]` each, what else to keep.
        """
        place = self.counts[env] % self.length * self.num_envs + env
        self._num_valid -= self.fields["valid"][place]
        values = (frame, age, action, reward, ending, 0.0, 0, False)
        for array, value in zip(self.fields.values(), values, strict=True):
            array[place] = value
        for name, row in extras.items():
            self.extras[name][place] = row
        self.counts[env] += 1
        self._since_end[env] += 1
        self._add_to_windows(env, ending)
        if ending != RUNS:
            self._since_end[env] = 0

    def truncate(self, env: int) -> None:
        """Truncates an episode that still runs after the transition that ended last."""
        if self._since_end[env]:
            self.fields["ending"][self._places(env, np.array([0]))] = TRUNCATED
            self._since_end[env] = 0

    def oldest_frame(self, env: int) -> int:
        """Returns the number of the frame in which the oldest transition of `env` began."""
        held = min(int(self.counts[env]), self.length)
        return int(self.fields["frame"][self._places(env, np.array([held - 1]))][0])

    def draw(self, size: int, rng: np.random.Generator) -> IntArray:
        """Returns `[size]` places where a finished window begins, uniformly, with replacement."""
        valid = self.fields["valid"]
        used = min(max(self.counts.tolist()), self.length) * self.num_envs
        if self.num_windows * 4 < used:
            return rng.choice(np.flatnonzero(valid[:used]), size)
        places = np.zeros(0, dtype=np.int64)
        while len(places) < size:  # once or twice, seldom more often
            drawn = (rng.random(2 * size) * used).astype(np.int64)  # rng.integers takes longer
            places = np.concatenate([places, drawn[valid[drawn]]])
        return places[:size]

    def outcomes(self, places: IntArray) -> tuple[FloatArray, IntArray, BoolArray]:
        """Returns what became of the windows that begin at `places [K]`.

        Returns:
            `[K]` each: the discounted reward Σ_(i<w) γ^i R_(t+i), the steps really taken (w, or
            fewer where the episode terminated sooner), and whether it terminated.
        """
        steps = self.fields["steps"][places]
        last = places + (steps - 1) * self.num_envs
        terminated = self.fields["ending"].take(last, mode="wrap") == TERMINATED
        return self.fields["gain"][places], steps, terminated

    def _add_to_windows(self, env: int, ending: int) -> None:
        """Adds the newest step to the windows that it belongs to, and marks the finished ones."""
        size = min(self.width, int(self._since_end[env]))
        places = self._places(env, np.arange(size))
        self.fields["gain"][places] += self._discounts[:size] * self.fields["reward"][places[0]]
        self.fields["steps"][places] += 1
        finished = places if ending == TERMINATED else places[self.width - 1 :]
        if self.time_limit is not None:
            finished = finished[self.fields["age"][finished] + self.width <= self.time_limit]
        self.fields["valid"][finished] = True
        self._num_valid += len(finished)

    def _places(self, env: int, back: IntArray) -> IntArray:
        """Returns the places of the transitions so many steps `back` from the newest."""
        return np.asarray((self.counts[env] - 1 - back) % self.length * self.num_envs + env)


def _check(capacity: int, num_envs: int, width: int, time_limit: int | None) -> None:
    for name, count in (("width w", width), ("number of environments", num_envs)):
        if count < 1:
            raise InputError(f"The {name} is {count}.", "It must be at least 1.")
    if capacity < width * num_envs:
        raise InputError(
            f"A replay memory of {capacity} transitions of {num_envs} environments does not hold "
            f"a window of {width} steps of each.",
            f"Choose a capacity of at least {width * num_envs}.",
        )
    if time_limit is not None and time_limit < width:
        raise InputError(
            f"Episodes end after {time_limit} steps, so no window of {width} steps fits in.",
            f"Choose a width w of at most {time_limit}, or a longer time limit.",
        )
