"""The same Atari games in grey, for an agent, and in colour, for who would see the whole screen."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.atari.environments import AtariEnvironments
from trdlab.environments.protocol import Frames, Padding, Step
from trdlab.errors import TrdlabError

_SHOWN = ("frames", "following", "info", "screens")  # all else of a step must be the same in both


class GreyAndColour:
    """B games that are played twice, in step: `grey` ones that are seen, and the same in `colour`.

    They behave as `AtariEnvironments` does, to the bit, and have the `screens` of the same moments.
    Rewards, ends and lives of both are compared at every step.

    Args:
        game: its name.
        num_envs: B.
        seed: what all seeds are drawn from.
        options: else, as for `AtariEnvironments`.

    Attributes:
        grey: what is seen.
        colour: the other one.
        screens: `[B, H, W, 3]`, the whole screens at which the next action is chosen.

    Raises:
        InputError: there is no such game, or a value is out of its range.

    >>> games = GreyAndColour("Breakout", 2, seed=0)
    >>> games.reset().shape, games.screens.shape
    ((2, 84, 84), (2, 210, 160, 3))
    """

    first_action = 0
    shared_chance = False
    padding: Padding = "zero"

    def __init__(self, game: str, num_envs: int = 1, *, seed: int, **options: Any) -> None:
        self.grey = AtariEnvironments(game, num_envs, seed=seed, **options)
        self.colour = AtariEnvironments(game, num_envs, seed=seed, **options | {"colour": True})
        self._mirror()
        self.screens: Frames = np.zeros((num_envs, *self.screen_shape), dtype=np.uint8)

    def _mirror(self) -> None:
        """Takes over what does not change from the games in grey."""
        grey = self.grey
        self.game, self.num_envs, self.frame_skip = grey.game, grey.num_envs, grey.frame_skip
        self.action_names, self.num_actions = grey.action_names, grey.num_actions
        self.time_limit, self.frames_per_second = grey.time_limit, grey.frames_per_second
        self.stack, self.observation_space = grey.stack, grey.observation_space

    @property
    def screen_shape(self) -> tuple[int, ...]:
        """`(H, W, 3)`."""
        space: gym.Space[Any] = self.colour.observation_space
        return space.shape or ()

    @property
    def allowed(self) -> BoolArray | None:
        """`[B, A]`, which actions can be taken now; None where all can always be."""
        return self.grey.allowed

    def reset(self) -> Frames:
        """Begins a game in every environment, and returns their first frames `[B, 84, 84]`."""
        self.screens = self.colour.reset()
        return self.grey.reset()

    def step(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        """Takes actions `[B]`, of the `active` games; where one ends, the next begins in this call.

        Raises:
            InputError: there are not B actions, or one does not exist.
            TrdlabError: the two did not do the same.
        """
        step, beside = self.grey.step(actions, active), self.colour.step(actions, active)
        for name in _COMPARED:
            one, other = getattr(step, name), getattr(beside, name)
            if not np.array_equal(one, other):
                raise TrdlabError(
                    f"{self.game} went another way in colour than in grey: {name} are "
                    f"{other.tolist()} and {one.tolist()}.",
                    "Play it in one of the two.",
                )
        self.screens = beside.following
        return replace(step, screens=beside.frames)

    def state_dict(self) -> dict[str, Any]:
        """Returns what is needed to restore both.

        Raises:
            TrdlabError: no game has begun.
        """
        return {"grey": self.grey.state_dict(), "colour": self.colour.state_dict()}

    def load_state_dict(self, state: Mapping[str, Any]) -> Frames:
        """Plays the saved games again; returns the frames the next action is chosen at.

        Raises:
            InputError: the state was saved with other settings, or is torn.
            NotReproducible: a game does not do again what it did.
        """
        self.screens = self.colour.load_state_dict(state["colour"])
        return self.grey.load_state_dict(state["grey"])

    def branch(self, which: IntArray, seed: int) -> "GreyAndColour":
        """Returns copies of the games `which [B′]`, as `AtariEnvironments` makes them.

        Raises:
            NotCopyable: actions are sticky, or a game does not do again what it did.
        """
        copies = object.__new__(type(self))
        copies.grey, copies.colour = (of.branch(which, seed) for of in (self.grey, self.colour))
        copies._mirror()
        copies.screens = self.screens[which]
        return copies

    def close(self) -> None:
        """Lets go of both."""
        self.grey.close()
        self.colour.close()


_COMPARED = tuple(of.name for of in fields(Step) if of.name not in _SHOWN)
