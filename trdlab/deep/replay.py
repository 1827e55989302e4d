"""The replay memory: each frame stored once, and windows of w steps read from it, any w."""

from collections.abc import Mapping
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from trdlab.arrays import IntArray
from trdlab.deep.batch import Batch, checked
from trdlab.deep.device_frames import frame_store
from trdlab.deep.frames import BLANK
from trdlab.deep.ring import RUNS, TERMINATED, TRUNCATED, Ring
from trdlab.errors import InputError, TrdlabError, closest

__all__ = ["Batch", "Padding", "ReplayBuffer"]

Padding = Literal["reset", "zero"]
Images = npt.NDArray[Any]


class ReplayBuffer:
    """A ring of the newest transitions of B environments, sampled as windows of w steps.

    The windows follow the rules of `trdlab.tabular.windows` (errata C1 to C3): s_(t+w) is the
    observation exactly w steps later, and no window crosses the end of an episode. Where an
    episode terminates, its unfinished windows are exact; where it is truncated, the window that
    is just full bootstraps from the true last observation, and unfinished ones are never sampled.
    With a known `time_limit` no window is begun in the last w − 1 steps before it: of those, only
    the ones that terminate could be finished, and an end would look likelier than it is.

    Frames are given singly and stored once; stacks are put together as they are read. Before the
    first frame of an episode a stack is padded as by Gymnasium's `FrameStackObservation`:
    `reset` repeats the first frame (Gymnasium's default), `zero` puts zeros (and so does
    ale-py's `AtariVectorEnv`). Use what the agent sees when it acts.

    Args:
        capacity: the transitions to hold, rounded up to a multiple of B.
        shape: of a frame.
        dtype: of a frame; frames are given back exactly.
        width: w, at least 1.
        gamma: γ, the discount factor of one step.
        num_envs: B.
        stack: k, the frames in an observation; without it, an observation is a single frame and
            has no axis for the stack.
        padding: see above.
        time_limit: the step at which every episode is truncated, if it is known.
        compress: whether to compress frames; without it, images of bytes are and others are not.
        extras: shape and type of what else is stored with a transition, by name, for example
            the logits of a teacher: `{"logits": ((num_actions,), np.float32)}`.
        device: where the frames lie, and observations are read as tensors; without it they lie in
            the memory of the CPU, and are read as arrays.

    Raises:
        InputError: an option is out of its range.
        TrdlabError: frames are to be compressed and lz4 is not installed.

    Source: the paper's Eq. trd-loss, corrected (errata P2, C1, C2, C3).

    >>> memory = ReplayBuffer(100, (1,), np.int64, width=2, gamma=0.5)
    >>> for state in (7, 8, 9):
    ...     memory.add([[state]], [0], [4.0], [False], [state == 9], [[state + 1]])
    >>> batch = memory.sample(2, np.random.default_rng(0))
    >>> batch.observations.tolist(), batch.rewards.tolist(), batch.next_observations.tolist()
    ([[8], [7]], [6.0, 6.0], [[10], [9]])
    """

    def __init__(
        self,
        capacity: int,
        shape: tuple[int, ...],
        dtype: npt.DTypeLike = np.uint8,
        *,
        width: int,
        gamma: float,
        num_envs: int = 1,
        stack: int | None = None,
        padding: Padding = "reset",
        time_limit: int | None = None,
        compress: bool | None = None,
        extras: Mapping[str, tuple[tuple[int, ...], npt.DTypeLike]] | None = None,
        device: str | None = None,
    ) -> None:
        if stack is not None and stack < 1:
            raise InputError(f"The stack is {stack}.", "It must be at least 1.")
        if padding not in get_args(Padding):
            raise InputError(f"The padding is '{padding}'.", closest(padding, get_args(Padding)))
        self._ring = Ring(capacity, num_envs, width, float(gamma), time_limit, extras or {})
        self.capacity, self.num_envs = self._ring.capacity, num_envs
        self.width, self.gamma, self.time_limit = width, float(gamma), time_limit
        self.stack, self.padding = stack, padding
        self._frames = frame_store(
            shape,
            dtype,
            num_envs,
            length=self._ring.length,
            stack=stack or 1,
            compress=compress,
            device=device,
        )
        self._ages = np.full(num_envs, -1, dtype=np.int64)
        # [B]: how many frames came before the newest since the reset; −1 where none runs

    def __len__(self) -> int:
        """The transitions that are held."""
        return len(self._ring)

    @property
    def num_windows(self) -> int:
        """The windows that can be sampled."""
        return self._ring.num_windows

    @property
    def nbytes(self) -> int:
        """The memory taken: the frames held, and the numbers of all `capacity` transitions."""
        return self._frames.nbytes + sum(array.nbytes for array in self._ring.arrays().values())

    @property
    def bytes_per_transition(self) -> float:
        """The memory that a transition takes on average, of those held."""
        numbers = (self.nbytes - self._frames.nbytes) / self.capacity
        return numbers + self._frames.nbytes / max(1, len(self))

    @property
    def bytes_per_frame(self) -> float:
        """The memory that a frame takes on average, of those held."""
        return self._frames.nbytes / max(1, self._frames.num_frames)

    def add(
        self,
        observations: npt.ArrayLike,
        actions: npt.ArrayLike,
        rewards: npt.ArrayLike,
        terminated: npt.ArrayLike,
        truncated: npt.ArrayLike,
        next_observations: npt.ArrayLike,
        *,
        active: npt.ArrayLike = True,
        goes_on: npt.ArrayLike = False,
        extras: Mapping[str, npt.ArrayLike] | None = None,
    ) -> None:
        """Stores one step of every environment.

        Args:
            observations: `[B, *shape]`, the newest frame of s_t. Read only where an episode
                begins: otherwise it is the frame that the step before led to.
            actions: `[B]`.
            rewards: `[B]`, stored as float32.
            terminated: `[B]`, whether the episode ended for good; wins over `truncated`.
            truncated: `[B]`, whether it was cut off.
            next_observations: `[B, *shape]`, the newest frame of what the step led to; at the end
                of an episode its true last one, not the first one of the next.
            active: `[B]`, false where no step was taken, because the environment was only reset.
            goes_on: `[B]`, true where the end is one for learning only (a life is lost) and the
                environment was not reset: stacks then reach back over the end, as those of the
                acting agent do, while windows do not.
            extras: `[B, ...]` each, what the buffer was told to store.

        Raises:
            InputError: an array does not fit.
        """
        frames = self._checked_frames("observations", observations)
        next_frames = self._checked_frames("next observations", next_observations)
        each = (self.num_envs,)
        actions, rewards = checked("actions", actions, each), checked("rewards", rewards, each)
        ends = checked("terminated", terminated, each).astype(np.bool_)
        cuts = checked("truncated", truncated, each).astype(np.bool_)
        endings = np.where(ends, TERMINATED, np.where(cuts, TRUNCATED, RUNS))  # [B]
        goes_on = np.broadcast_to(goes_on, self.num_envs)
        extras = self._checked_extras(extras or {})
        for env in np.flatnonzero(np.broadcast_to(active, self.num_envs)).tolist():
            if self._ages[env] < 0:
                self._frames.append(env, frames[env])
                self._ages[env] = 0
            frame, ending = int(self._frames.counts[env]) - 1, int(endings[env])
            row = {name: values[env] for name, values in extras.items()}
            age, action, reward = int(self._ages[env]), actions[env], rewards[env]
            self._ring.add(env, frame, age, action, reward, ending, row)
            self._frames.append(env, next_frames[env])
            self._ages[env] = age + 1 if ending == RUNS or goes_on[env] else -1
            stacked = self._ring.oldest_frame(env) - (self.stack or 1) + 1
            self._frames.forget_before(env, stacked)

    def interrupt(self) -> None:
        """Truncates the running episodes where they stand: the environments are begun afresh."""
        for env in range(self.num_envs):
            self._ring.truncate(env)
        self._ages[:] = -1

    def sample(self, batch_size: int, rng: np.random.Generator) -> Batch:
        """Draws windows, each as likely as any other, with replacement.

        Args:
            batch_size: K.
            rng: where the chance comes from: the same state draws the same windows.

        Raises:
            TrdlabError: not one window is finished.
        """
        if not self.num_windows:
            raise TrdlabError(
                f"The replay memory holds {len(self)} transitions and no finished window of "
                f"{self.width} steps.",
                "Take more steps first; where every episode is truncated sooner, choose a smaller "
                "width.",
            )
        return self.windows(self._ring.draw(batch_size, rng))

    def windows(self, places: IntArray) -> Batch:
        """Returns the windows that begin at these `places [K]` in the memory."""
        rewards, steps, terminated = self._ring.outcomes(places)
        observations, next_observations = self._observations(places, steps)
        return Batch(
            observations=observations,
            actions=self._ring.fields["action"][places].astype(np.int64),
            rewards=rewards.astype(np.float32),
            discounts=np.where(terminated, 0.0, self.gamma**self.width).astype(np.float32),
            next_observations=next_observations,
            steps=steps,
            indices=places,
            extras={name: values[places] for name, values in self._ring.extras.items()},
        )

    def state_dict(self) -> dict[str, Any]:
        """Returns everything as plain numbers, arrays and bytes: a later run samples the same.

        A block under `frames`, `sealed` never changes: saved once under its name, it need not be
        saved again. All the rest is small, and copied.
        """
        return {
            "settings": self._settings(),
            "arrays": {name: array.copy() for name, array in self._arrays().items()},
            "frames": self._frames.state_dict(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Takes over what `state_dict` returned.

        Raises:
            InputError: it is from a memory with other settings, or something is torn or missing.
        """
        for name, value in self._settings().items():
            saved = state["settings"].get(name)
            if saved != value:
                raise InputError(
                    f"The saved replay memory has {name} = {saved}, this one has {value}.",
                    "Resume with the options that the run began with.",
                )
        self._frames.load_state_dict(state["frames"])
        for name, array in self._arrays().items():
            array[...] = state["arrays"][name]

    def _observations(self, places: IntArray, steps: IntArray) -> tuple[Images, Images]:
        """Returns `[K, k, ...]` twice: the stacks at s_t, and so many steps `[K]` later."""
        stack = self.stack or 1
        begin, age = self._ring.fields["frame"][places], self._ring.fields["age"][places]
        begin, end, first = begin[:, None], (begin + steps)[:, None], (begin - age)[:, None]
        if self.width < stack and (steps == self.width).all():  # each frame they share, read once
            numbers = end - np.arange(stack + self.width - 1, -1, -1)  # [K, k + w]
        else:
            back = np.arange(stack - 1, -1, -1)
            numbers = np.concatenate([begin - back, end - back], axis=1)  # [K, 2·k]
        before = first if self.padding == "reset" else BLANK
        numbers = np.where(numbers < first, before, numbers)
        rows = self._frames.read(places[:, None] % self.num_envs, numbers)
        if self.stack is None:
            return rows[:, 0], rows[:, -1]
        return rows[:, :stack], rows[:, -stack:]

    def _arrays(self) -> dict[str, npt.NDArray[Any]]:
        return {**self._ring.arrays(), "ages": self._ages}

    def _settings(self) -> dict[str, Any]:
        names = ("capacity", "width", "gamma", "num_envs", "stack", "padding", "time_limit")
        extras = {
            f"extras/{name}": [list(of.shape[1:]), of.dtype.str]
            for name, of in self._ring.extras.items()
        }
        return {name: getattr(self, name) for name in names} | self._frames.settings | extras

    def _checked_frames(self, name: str, values: npt.ArrayLike) -> npt.NDArray[Any]:
        dtype = self._frames.dtype
        frames = checked(name, values, (self.num_envs, *self._frames.shape))
        if not np.can_cast(frames.dtype, dtype, "safe"):
            raise InputError(
                f"The {name} have type {frames.dtype}, and would not fit into {dtype} exactly.",
                "Convert them, or make the replay memory for their type.",
            )
        return frames.astype(dtype, copy=False)

    def _checked_extras(self, extras: Mapping[str, npt.ArrayLike]) -> dict[str, npt.NDArray[Any]]:
        if extras.keys() != self._ring.extras.keys():
            raise InputError(
                f"The extras are {sorted(extras)}, the replay memory stores "
                f"{sorted(self._ring.extras)}.",
                "Give those that it was made for.",
            )
        return {
            name: checked(name, values, (self.num_envs, *self._ring.extras[name].shape[1:]))
            for name, values in extras.items()
        }
