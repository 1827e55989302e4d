"""Atari games that step together, restorable to the bit."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from trdlab.arrays import BoolArray, IntArray
from trdlab.atari.names import find_game
from trdlab.atari.vector import (
    FRAME,
    FRAMES_PER_SECOND,
    STACK,
    action_names,
    make_vector,
    screen_shape,
)
from trdlab.environments.history import Histories, checked_actions
from trdlab.environments.protocol import Frames, NotCopyable, Padding, Step
from trdlab.environments.stack import FrameStack, stacked

RESEED_AFTER = 5000
"""Steps after which a game is seeded anew at the end of its episode.

A seeded reset costs about 95 ms, because the ROM is loaded again, another one 6 ms; to restore the
games costs all the steps since it.
"""

_UNSEEDED = -1  # to ale-py: the game's own chance goes on


class AtariEnvironments:
    """B games of one kind on ale-py's vector environment.

    A frame is `(84, 84)` in grey; the agent stacks four, with zeros before the first one of an
    episode, as the vector environment does it. Rewards are the game's own. An episode is a whole
    game: a lost life is told in `life_lost`, and the game goes on.

    Args:
        game: its name, such as `Breakout`, `space_invaders` or `ALE/Breakout-v5`.
        num_envs: B.
        seed: what all seeds are drawn from.
        sticky: the probability that the last action is repeated in place of the one given.
        noop_max: episodes begin with fewer than so many idle frames (and FIRE, where there is one).
        max_frames: of the emulator, after which an episode is truncated.
        frame_skip: for how many frames an action is held; a frame shows the maximum of the last
            two of them.
        full_action_space: all 18 actions, in place of those that the game knows.
        colour: a frame is the whole screen in colour, such as `(210, 160, 3)`, the last of those
            for which an action is held; nothing is stacked.
        separate_lives: each life begins as a game does: with FIRE, whatever is chosen (where there
            is one; nothing else is `allowed` then), and with a stack of zeros. A frame is the whole
            stack then.

    Raises:
        InputError: there is no such game, or a value is out of its range.

    >>> import numpy as np
    >>> games = AtariEnvironments("Breakout", 2, seed=0)
    >>> games.reset().shape, games.action_names
    ((2, 84, 84), ('NOOP', 'FIRE', 'RIGHT', 'LEFT'))
    >>> games.step(np.array([1, 3])).rewards.tolist()
    [0.0, 0.0]
    """

    first_action = 0
    shared_chance = False
    padding: Padding = "zero"
    frames_per_second: float | None = FRAMES_PER_SECOND

    def __init__(
        self,
        game: str,
        num_envs: int = 1,
        *,
        seed: int,
        sticky: float = 0.0,
        noop_max: int = 30,
        max_frames: int = 108_000,
        frame_skip: int = 4,
        full_action_space: bool = False,
        colour: bool = False,
        separate_lives: bool = False,
    ) -> None:
        self.game, self.num_envs, self.frame_skip = find_game(game), num_envs, frame_skip
        self.colour, self.separate_lives = colour, separate_lives
        options: dict[str, Any] = {
            "sticky": sticky,
            "noop_max": noop_max,
            "max_frames": max_frames,
            "frame_skip": frame_skip,
            "full_action_space": full_action_space,
        }
        views = {"colour": colour, "separate_lives": separate_lives}
        self._options = {**options, **views}
        told = {name: on for name, on in views.items() if on}  # those of older runs have neither
        settings = {"game": self.game, **options, **told}
        self._seed = seed
        self._histories = Histories(
            settings, num_envs=num_envs, seed=seed, reseed_after=RESEED_AFTER
        )
        self._envs = make_vector(self.game, num_envs, stack=1, colour=colour, **options)
        self.action_names = action_names(self._envs)
        self.num_actions = len(self.action_names)
        self.stack: int | None = None if colour or separate_lives else STACK
        self.observation_space: gym.Space[Any] = FRAME
        if colour:
            self.observation_space = gym.spaces.Box(0, 255, screen_shape(self.game), np.uint8)
        elif separate_lives:
            self.observation_space = stacked(FRAME, STACK)
        self.time_limit: int | None = -(-max_frames // frame_skip)
        self._lives = np.zeros(num_envs, dtype=np.int64)
        self._fire = self.action_names.index("FIRE") if "FIRE" in self.action_names else None
        self._opens = np.zeros(num_envs, dtype=np.bool_)  # [B], whether a life has just begun
        self._stack: FrameStack | None = None  # what is seen of lives that are apart

    @property
    def allowed(self) -> BoolArray | None:
        """`[B, A]`, which actions can be taken now; None where all can always be."""
        if not self.separate_lives or self._fire is None:
            return None
        is_fire = np.arange(self.num_actions) == self._fire
        return np.asarray(is_fire | ~self._opens[:, None])

    def reset(self) -> Frames:
        """Begins a game in every environment, and returns their first frames `[B, 84, 84]`."""
        everyone = np.ones(self.num_envs, dtype=np.bool_)
        return self._begin(everyone, [self._histories.begin(env) for env in range(self.num_envs)])

    def step(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        """Takes actions `[B]`; where a game ends, the next one begins in the same call.

        Args:
            actions: `[B]`.
            active: `[B]`, which games act; by default all. ale-py plays the others too, but nothing
                is told of them, and none of their resets is a seeded one.

        Raises:
            InputError: there are not B actions, or one does not exist.
        """
        # checked here: an action that does not exist would hang ale-py's threads
        return self._act(checked_actions(actions, self.num_envs, self.num_actions), active)

    def state_dict(self) -> dict[str, Any]:
        """Returns the seeds of the last seeded resets, and the actions taken since.

        Raises:
            TrdlabError: no game has begun.
        """
        return self._histories.state_dict()

    def load_state_dict(self, state: Mapping[str, Any]) -> Frames:
        """Plays the saved games again; returns the frames the next action is chosen at.

        Raises:
            InputError: the state was saved with other settings, or is torn.
            NotReproducible: a game does not do again what it did.
        """
        past = self._histories.saved(state)
        following = self._play_again(
            [actions for _, actions in past],
            lambda env: self._histories.begin(env, past[env][0]),
        )
        self._histories.verify(state, self.game)
        return following

    def branch(self, which: IntArray, seed: int) -> "AtariEnvironments":
        """Returns copies of the games `which [B′]`: they play again what was played.

        Without sticky actions there is no chance in a game, so only what the agent does can make
        two copies differ.

        Raises:
            NotCopyable: actions are sticky, so that a copy would repeat the chance of the game; or
                a game does not do again what it did.
        """
        if self._options["sticky"]:
            raise NotCopyable(
                f"{self.game} has sticky actions, whose chance a copy would repeat.",
                "Play without them, or judge it without copies of its states.",
            )
        copies = AtariEnvironments(self.game, len(which), seed=seed, **self._options)
        past = [self._histories.past(env) for env in which.tolist()]

        def begin(copy: int) -> int:
            copies._histories.begin(copy)
            return past[copy][0]

        copies._play_again([actions for _, actions in past], begin)
        for copy, env in enumerate(which.tolist()):
            if not copies._histories.same(copy, self._histories, env):
                raise NotCopyable(
                    f"{self.game} did something else when it was played again.",
                    "Judge it without copies of its states.",
                )
        return copies

    def screened(self) -> Any:
        """Returns others that do the same, have not begun, and show whole `screens` in colour."""
        from trdlab.atari.views import GreyAndColour

        if self.colour:  # these show nothing else
            return self
        options = {name: of for name, of in self._options.items() if name != "colour"}
        return GreyAndColour(self.game, self.num_envs, seed=self._seed, **options)

    @property
    def has_lives(self) -> bool:
        """Whether lives can be lost in the game; known once it has begun."""
        return bool(self._lives.any())

    def close(self) -> None:
        """Nothing: ale-py's threads end with the object."""

    def _act(self, actions: IntArray, active: BoolArray | None = None) -> Step:
        if self._fire is not None:
            actions = np.where(self._opens, self._fire, actions)
        observations, paid, terminated, truncated, info = self._envs.step(actions)
        frames, rewards = observations[:, 0], paid.astype(np.float64)  # [B, 84, 84], [B]
        acts = np.ones(self.num_envs, dtype=np.bool_) if active is None else active
        rewards, terminated, truncated = (
            np.where(acts, rewards, 0.0),
            terminated & acts,
            truncated & acts,
        )
        acting = np.flatnonzero(acts)
        self._histories.record_step(acting.tolist(), actions[acting].tolist(), frames, rewards)
        ended, lives = terminated | truncated, info["lives"]
        life_lost = (
            (lives < self._lives) & (lives > 0) & ~ended & acts
        )  # [B]; lives can also be won
        self._lives, self._opens = lives, life_lost & self.separate_lives
        frames = following = self._seen(frames, life_lost)
        if ended.any():
            following = self._begin(
                ended, [self._next_seed(e) for e in np.flatnonzero(ended).tolist()]
            )
        told = rewards, terminated, truncated, life_lost
        return Step(frames, *told, following, self.allowed)

    def _play_again(self, past: Sequence[IntArray], begin: Callable[[int], int]) -> Frames:
        """Plays games again, side by side; returns the frames the next action is chosen at.

        Args:
            past: of each game, the actions to take.
            begin: from the number of a game to the seed to begin it with.
        """
        lengths = np.array([len(actions) for actions in past])
        waits = lengths.max() - lengths  # [B]: they begin apart, and come to the present together
        padded = [np.pad(actions, (wait, 0)) for actions, wait in zip(past, waits, strict=True)]
        following: Frames = self._envs.reset()[0]  # those that wait play something meanwhile
        for moment in range(int(lengths.max()) + 1):
            begins = waits == moment
            if begins.any():
                following = self._begin(begins, [begin(e) for e in np.flatnonzero(begins).tolist()])
            if moment < lengths.max():
                actions = np.array([row[moment] for row in padded])
                following = self._act(actions).following
        return following

    def _next_seed(self, env: int) -> int:
        return self._histories.begin(env) if self._histories.is_due(env) else _UNSEEDED

    def _begin(self, where: BoolArray, seeds: list[int]) -> Frames:
        """Begins a game `where [B]`; returns `[B, 84, 84]`, the present frames of all."""
        observations, info = self._envs.reset(seed=np.array(seeds), options={"reset_mask": where})
        frames: Frames = observations[:, 0]  # [B, 84, 84]
        self._lives, self._opens = info["lives"], self._opens & ~where
        for env in np.flatnonzero(where).tolist():
            self._histories.record_reset(env, frames)
        if self._stack is None and self.stack is None and not self.colour:
            self._stack = FrameStack(frames, STACK, self.padding)
        if self._stack is None:
            return frames
        self._stack.begin(frames, where)
        return self._stack.observations.copy()

    def _seen(self, frames: Frames, begins: BoolArray) -> Frames:
        """Returns what is seen where the next frames are `[B, ...]`, and a life `begins [B]`."""
        if self._stack is None:
            return frames
        self._stack.push(frames, begins)
        return self._stack.observations.copy()
