"""What a trainer asks of the environments it acts in."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy.typing as npt

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.errors import InputError, TrdlabError

if TYPE_CHECKING:
    import gymnasium as gym

Frames = npt.NDArray[Any]
Padding = Literal["reset", "zero"]


class NotReproducible(TrdlabError):  # noqa: N818  it says what an environment is, not what failed
    """An environment did something else when the same seed and actions were given again."""


class NotCopyable(InputError):  # noqa: N818  it says what an environment is, not what failed
    """An environment of which no copies can be made."""


class NotParallel(InputError):  # noqa: N818  it says what an environment is, not what failed
    """An environment that cannot be made once more while there is another (see `in_batches`)."""


def _no_info(env: int) -> Mapping[str, Any]:
    return {}


@dataclass(frozen=True, eq=False)
class Step:
    """What one step of B environments led to.

    Args:
        frames: `[B, ...]`, the newest frame of what the step led to; where an episode ended, its
            true last one.
        rewards: `[B]` as float64, as the environment pays them.
        terminated: `[B]`, whether the episode ended for good.
        truncated: `[B]`, whether it was cut off; never both.
        life_lost: `[B]`, whether a life was lost and the episode goes on.
        following: `[B, ...]`, the frame that the next action is chosen at: that of `frames`, or
            the first one of the next episode where one ended.
        allowed: `[B, A]`, which actions could be taken at `frames`; None where all can always be.
        screens: `[B, H, W, 3]`, what `frames` shows as a whole screen in colour; None where the
            environments do not show that, too.
        info: from an environment's number to what else it tells of the step, for as long as no
            other step has been taken.
    """

    frames: Frames
    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    life_lost: BoolArray
    following: Frames
    allowed: BoolArray | None = None
    screens: Frames | None = None
    info: Callable[[int], Mapping[str, Any]] = _no_info

    @property
    def ended(self) -> BoolArray:
        """`[B]`: where an episode ended, and the next one has begun."""
        return self.terminated | self.truncated


class Environments(Protocol):
    """B environments that step together and begin their next episode by themselves.

    Attributes:
        num_envs: B.
        observation_space: of one frame: a Box (images channels first) or a Discrete space.
        num_actions: A; the actions given to `step` run from 0 to A − 1.
        first_action: what the environment itself calls action 0.
        action_names: A names; where the environment tells none, the numbers it gives them.
        stack: how many frames an observation holds; None where it is one frame without an axis
            for the stack.
        padding: what stands in a stack before the first frame (see `ReplayBuffer`).
        time_limit: the agent steps after which every episode is truncated, if that is known.
        frame_skip: how many frames of the environment make one agent step.
        frames_per_second: of the environment as people see it, if it is known.
    """

    num_envs: int
    observation_space: "gym.Space[Any]"
    num_actions: int
    first_action: int
    action_names: tuple[str, ...]
    stack: int | None
    padding: Padding
    time_limit: int | None
    frame_skip: int
    frames_per_second: float | None

    def reset(self) -> Frames:
        """Begins an episode in every environment, and returns their first frames `[B, ...]`."""
        ...

    def step(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        """Takes actions `[B]`; where an episode ends, the next one begins in the same call.

        Args:
            actions: `[B]`.
            active: `[B]`, which environments act; by default all. The others cost nothing, or
                little: they are paid 0, nothing ends, and their frames are of no moment. They must
                stay inactive until `reset` or `load_state_dict`, and are not saved or copied.
        """
        ...

    def state_dict(self) -> dict[str, Any]:
        """Returns what is needed to restore the environments: plain numbers and small arrays."""
        ...

    def load_state_dict(self, state: Mapping[str, Any]) -> Frames:
        """Restores to the bit; returns `[B, ...]`, the frames the next action is chosen at.

        Raises:
            NotReproducible: an environment does not do again what it did.
        """
        ...

    def close(self) -> None:
        """Lets go of what the environments hold."""
        ...


class MaskedEnvironments(Environments, Protocol):
    """Environments in which some actions cannot be taken at times.

    Attributes:
        allowed: `[B, A]`, which can be taken now; None where all can, as far as was ever told.
    """

    allowed: BoolArray | None


class ScreenedEnvironments(Environments, Protocol):
    """Environments that show whole screens beside what is seen, for agents that look at those.

    Attributes:
        screens: `[B, H, W, 3]`, in colour, at which the next action is chosen.
    """

    screens: Frames


class CopyableEnvironments(Environments, Protocol):
    """Environments that can be asked for copies, in the middle of their episodes.

    Attributes:
        shared_chance: of copies: whether it was seen that episodes know chance which is not the
            copies' own, so that copies of one state do the same where the environment need not.
    """

    shared_chance: bool

    def branch(self, which: IntArray, seed: int) -> "CopyableEnvironments":
        """Returns copies that go on from where these are, each by a chance of its own.

        Args:
            which: `[B′]`, the number of the environment that each copy is made of.
            seed: of the chance from here on.

        Raises:
            NotCopyable: they cannot be copied; it says why.
        """
        ...
