"""What an agent sees and can do in its environments, described and compared in one place."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import gymnasium as gym
import numpy as np

from trdlab.environments.naming import are_own, is_numbered, numbered
from trdlab.environments.protocol import Environments
from trdlab.environments.stack import observation_space
from trdlab.errors import InputError

_MANY, _FEW = 20, 8  # actions that are named in a sentence, and of more than those


@dataclass(frozen=True, eq=False)
class Interface:
    """Observations and actions, as an agent meets them.

    Args:
        space: of what is seen: a frame, or a stack `[k, ...]` of them.
        action_names: A names; where there are none, the numbers that the environment gives them.
        first_action: what the environment itself calls action 0.
        seconds_per_step: how long a step takes as people play, if that is known.

    >>> lake = Interface(gym.spaces.Discrete(16), ("left", "down", "right", "up"))
    >>> lake.seen, lake.done
    ('16 states', '4 actions (left, down, right, up)')
    >>> lake.unlike(Interface(gym.spaces.Discrete(14), ("up", "down", "left", "right")))
    ('16 states', '14 states')
    """

    space: gym.spaces.Space[Any]
    action_names: tuple[str, ...]
    first_action: int = 0
    seconds_per_step: float | None = None

    @classmethod
    def of(cls, environments: Environments) -> Self:
        """Returns what is seen and can be done in environments."""
        names = environments.action_names or numbered(environments.num_actions)
        rate = environments.frames_per_second
        return cls(
            observation_space(environments),
            tuple(names),
            environments.first_action,
            environments.frame_skip / rate if rate else None,
        )

    @property
    def seen(self) -> str:
        """What is seen, in words."""
        space: Any = self.space
        if isinstance(space, gym.spaces.Discrete):
            return f"{space.n} states" + (f" from {space.start} on" if space.start else "")
        return f"{'×'.join(map(str, space.shape or ())) or '1'} {space.dtype}"

    @property
    def done(self) -> str:
        """What can be done, in words."""
        names, count = self.action_names, len(self.action_names)
        if is_numbered(names):
            return f"{count} actions"
        shown = names if count <= _MANY else (*names[:_FEW], "…", names[-1])
        return f"{count} actions ({', '.join(shown)})"

    def unlike(self, other: "Interface") -> tuple[str, str] | None:
        """Returns the words for what differs between the two, None where all is the same.

        Names of actions are compared where both have some of their own.
        """
        if self.seen != other.seen:
            return self.seen, other.seen
        if len(self.action_names) != len(other.action_names):
            return self.done, other.done
        named = are_own(self.action_names) and are_own(other.action_names)
        if named and self.action_names != other.action_names:
            return self.done, other.done
        return None

    def named(self, action_names: Sequence[str]) -> "Interface":
        """Returns the same, its actions called as people say.

        Args:
            action_names: A names.

        Raises:
            InputError: there are more or fewer.
        """
        count = len(self.action_names)
        if len(action_names) != count:
            raise InputError(
                f"There are {len(action_names)} names for {count} actions: "
                f"{', '.join(action_names)}.",
                "Give one for each action.",
            )
        return replace(self, action_names=tuple(action_names))

    def check_fits(self, there: "Interface", name: str) -> None:
        """Checks that an agent which knows this sees and does the same in other environments.

        Args:
            there: what those show.
            name: what they are called.

        Raises:
            InputError: something differs.
        """
        if differs := there.unlike(self):
            raise InputError(
                f"'{name}' does not fit the agent: it has {differs[0]}, and the agent knows "
                f"{differs[1]}.",
                "Give an environment with the same ones.",
            )

    def to_dict(self) -> dict[str, Any]:
        """Returns plain data, from which it can be known without the environments."""
        space: Any = self.space
        if isinstance(space, gym.spaces.Discrete):
            seen: dict[str, Any] = {"states": int(space.n), "first_state": int(space.start)}
        else:
            seen = {"shape": list(space.shape or ()), "dtype": np.dtype(space.dtype).name}
        return {
            "observation": seen,
            "num_actions": len(self.action_names),
            "first_action": self.first_action,
            "action_names": list(self.action_names),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Returns what `to_dict` wrote; the bounds of observations are not kept.

        Raises:
            LookupError: a field is missing.
            TypeError: a field holds something else; likewise ValueError.
        """
        seen, count = data["observation"], int(data["num_actions"])
        space: gym.spaces.Space[Any]
        if "states" in seen:
            space = gym.spaces.Discrete(seen["states"], start=seen["first_state"])
        else:
            dtype = np.dtype(seen["dtype"])
            low, high = (0, 255) if dtype == np.uint8 else (-np.inf, np.inf)
            space = gym.spaces.Box(low, high, tuple(seen["shape"]), dtype=dtype.type)
        first = int(data.get("first_action", 0))
        return cls(space, tuple(data.get("action_names") or numbered(count, first)), first)
