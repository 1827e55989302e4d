"""Films: what people see at every step of an episode, kept while it is played."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.environments import Environments, Step
from trdlab.environments.protocol import Frames
from trdlab.environments.screens import screened


class Filmed:
    """One environment of which every picture is kept; it does as the one within.

    Pictures are the `screens` that environments show, or else what is observed, where that is one.

    Args:
        environments: one, which has not begun.
        keep: is given each picture `[H, W, 3]`; what it returns is kept, by default the picture.

    Attributes:
        pictures: `[T+1]`, what was kept, from the first observation to the true last one; empty
            where there is nothing to see.
        parts: `[T]`, the names of what paid in each step, as far as the environment tells them.

    >>> from trdlab.environments import GymEnvironments
    >>> filmed = Filmed(GymEnvironments("CartPole-v1", 1, seed=0))
    >>> _ = filmed.reset(), filmed.step(np.array([0]))
    >>> [picture.shape for picture in filmed.pictures], filmed.parts
    ([(400, 600, 3), (400, 600, 3)], [()])
    """

    def __init__(
        self, environments: Environments, keep: Callable[[Frames], Any] = lambda picture: picture
    ) -> None:
        self._within, self._keep = screened(environments), keep
        self.pictures: list[Any] = []
        self.parts: list[tuple[str, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._within, name)

    def reset(self) -> Frames:
        """Begins an episode, and returns its first frame `[1, ...]`."""
        frames, self.pictures, self.parts = self._within.reset(), [], []
        self._look(getattr(self._within, "screens", None), frames)
        return frames

    def step(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        """Takes an action `[1]`."""
        step = self._within.step(actions, active)
        if self.pictures:
            self._look(step.screens, step.frames)
        self.parts.append(_paid(step.info(0)))
        return step

    def _look(self, screens: Frames | None, frames: Frames) -> None:
        picture = screens[0] if screens is not None else as_picture(frames[0])
        if picture is not None:
            self.pictures.append(self._keep(picture))


def _paid(info: Mapping[str, Any]) -> tuple[str, ...]:
    """Returns the names of what paid, or cost, anything in a step."""
    parts = info.get("parts")
    if not isinstance(parts, Mapping):
        return ()
    try:
        return tuple(str(name) for name, of in parts.items() if float(of) != 0.0)
    except (TypeError, ValueError):  # it means something else by that word
        return ()


def as_picture(frame: Any) -> Frames | None:
    """Returns an observed frame as a picture `[H, W, 3]`; None where it is none."""
    seen = np.asarray(frame)
    if seen.dtype != np.uint8 or seen.ndim not in (2, 3) or min(seen.shape[-2:]) < 8:
        return None
    if seen.ndim == 3:
        seen = np.moveaxis(seen, 0, -1) if seen.shape[0] == 3 else seen[-1]
    return np.repeat(seen[..., None], 3, axis=2) if seen.ndim == 2 else seen
