"""What all agents of other libraries become here: a policy, and what is known about it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import prod
from typing import Any, Self

import gymnasium as gym
import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.decomposition import RewardDecomposition
from trdlab.environments.interface import Interface
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.policies.ready import Greedy, greedy
from trdlab.time_axis import TimeAxis

NEAREST = (
    "A decomposition has one row per action. Let the environment take a few by their numbers "
    "(gymnasium.wrappers.TransformAction), and give trdlab.agent a function from an observation to "
    "the number that comes nearest to what the agent would do."
)
"""What to do about an agent whose actions cannot be counted."""


@dataclass(frozen=True)
class About:
    """What is known about an agent that was trained elsewhere.

    Args:
        algorithm: what trained it, such as `PPO`, or what it is.
        library: whose it is.
        version: of the library, if that is said.
        seen: the shape of an observation, images channels first; None where nothing says it. States
            by number are n numbers, of which one is 1.
        num_actions: A; None where nothing says it.
        layers: the sizes of what it computes, from what it sees to what it says.
        activation: between its layers.
        memory: how many numbers it remembers from step to step.
        gamma: γ that it was trained with, if that is said.
        draws: whether it draws its actions from probabilities, rather than taking the best.
        parts: the shapes of what it sees by name, in order, where it sees a Dict; all of them
            together make one vector then (see `FlatSpace`).
        games: how Atari games are to be played for it, as arguments of `AtariEnvironments`; with
            `screens` it is shown whole screens in colour (see `GreyAndColour`).

    >>> About("PPO", "Stable-Baselines3", "2.0", (4,), 2).title
    'PPO of Stable-Baselines3 2.0'
    """

    algorithm: str
    library: str = ""
    version: str = ""
    seen: tuple[int, ...] | None = None
    num_actions: int | None = None
    layers: str = ""
    activation: str = ""
    memory: int = 0
    gamma: float | None = None
    draws: bool = True
    parts: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    games: Mapping[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """What it is, and whose."""
        of = f"{self.library} {self.version}".strip()
        return f"{self.algorithm} of {of}" if of else self.algorithm

    @property
    def needs(self) -> str:
        """What would fit, in words."""
        parts = ", ".join(f"'{name}' {shape}" for name, shape in self.parts.items())
        seen = f"observations of shape {self.seen}" if self.seen else "any observations"
        seen = f"a Dict of {parts}" if parts else seen
        return f"{seen} and {self.num_actions or 'any'} actions"

    def check_fits(self, there: Interface, place: str, name: str) -> None:
        """Checks that it can act somewhere.

        Args:
            there: what is seen and can be done there.
            place: what that is called.
            name: what the agent is called.

        Raises:
            InputError: it cannot; the message names what was found, and what would fit.
        """
        seen = self.seen is None or _fits(there.space, self.seen)
        parts = getattr(there.space, "parts", {})
        if parts and self.parts and list(parts.items()) != list(self.parts.items()):
            found = ", ".join(f"'{name}' {shape}" for name, shape in parts.items())
            raise InputError(
                f"'{place}' does not fit '{name}': it has a Dict of {found} to see.",
                f"This {self.algorithm} needs {self.needs}.",
            )
        if not seen or self.num_actions not in (None, len(there.action_names)):
            raise InputError(
                f"'{place}' does not fit '{name}': it has {there.seen} to see and {there.done}.",
                f"This {self.algorithm} needs {self.needs}.",
            )

    def to_dict(self) -> dict[str, Any]:
        """Returns plain data, for JSON."""
        parts = {name: list(shape) for name, shape in self.parts.items()}
        seen = None if self.seen is None else list(self.seen)
        return {**asdict(self), "seen": seen, "parts": parts, "games": dict(self.games)}


def games_for(who: Any) -> Mapping[str, Any]:
    """Returns how Atari games are to be played for somebody, if that is said (see `About`)."""
    return getattr(getattr(who, "about", None), "games", {})


def sees_screens(who: Any) -> bool:
    """Returns whether somebody looks at whole screens, rather than at what is seen."""
    return bool(games_for(who).get("screens"))


@dataclass(frozen=True, eq=False)
class Valuing:
    """Takes the action of largest value, of equals the first.

    Args:
        about: what is known about it.
        values: from observations `[B, ...]` to the value of each action `[B, A]`.
    """

    about: About
    values: Callable[[Any], FloatArray]

    @property
    def gamma(self) -> float | None:
        """γ that it was trained with, if that is said."""
        return self.about.gamma

    def seeing(self, change: Callable[[Any], Any]) -> Self:
        """Returns the same, that sees observations changed."""
        return replace(self, values=lambda observations: self.values(change(observations)))

    def paid(self, unit: float) -> Self:
        """Returns the same, its values in the reward of the environment: so many times as large."""
        return replace(self, values=lambda observations: self.values(observations) * unit)

    def state_values(
        self, observations: Any, state: Any, begins: BoolArray, likely: FloatArray
    ) -> tuple[FloatArray, Any]:
        """Returns the value of what is done `[B]` (see `StateValues`): the mean over actions."""
        return (self.q_values(observations) * likely).sum(axis=1), None

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns 1 for that action `[B, A]`; there is nothing to remember."""
        return self.act_within(observations, state, begins, None)

    def act_within(
        self, observations: Any, state: Any, begins: BoolArray, allowed: BoolArray | None
    ) -> tuple[FloatArray, Any]:
        """Returns the same, of the actions that are `allowed [B, A]`."""
        return greedy(self.q_values(observations), allowed), None

    def q_values(self, observations: Any) -> FloatArray:
        """Returns the value of each action `[B, A]`.

        Raises:
            InputError: one is no number.
        """
        values = np.asarray(self.values(observations))
        if (wrong := np.isnan(values).any(axis=1)).any():
            row = int(np.argmax(wrong))
            raise InputError(
                f"The policy's values at observation {row} of {len(values)} are no numbers: "
                f"{values[row].tolist()}.",
                "Look whether that observation holds one.",
            )
        return values


@dataclass(frozen=True, eq=False)
class Student:
    """An estimator in a file, that acts by the largest Σ components.

    Args:
        about: what is known about it.
        network: from observations `[B, ...]` to components `[B, A·(N+1)]`.
        time_axis: γ, N and w.
        future: whose future it tells.
    """

    about: About
    network: Callable[[Any], FloatArray]
    time_axis: TimeAxis
    future: Future

    @property
    def gamma(self) -> float:
        """γ."""
        return self.time_axis.gamma

    def decompose(self, observations: Any) -> RewardDecomposition:
        """Returns the components `[B, A, N+1]`."""
        flat = self.network(observations)
        shape = len(flat), self.about.num_actions or 1, self.time_axis.num_components
        return RewardDecomposition(flat.reshape(shape), self.time_axis)

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns 1 for the action of largest Σ components `[B, A]`; nothing is remembered."""
        return Greedy(self).act(observations, state, begins)


Scores = Callable[[Any, Any, BoolArray], tuple[FloatArray, Any]]
"""From observations, what is remembered and where episodes begin to logits `[B, A]` and memory."""

StateValues = Callable[[Any, Any, BoolArray, FloatArray], tuple[FloatArray, Any]]
"""What a policy's own critic says: from observations, what the critic remembers, where episodes
begin, and how likely each action is `[B, A]`, to what states are worth `[B]`, and its memory.

A policy that has a critic offers this as `state_values`. It is asked at every step of an episode,
in order, as the policy is, and has a memory of its own."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """Draws its actions from the softmax of logits.

    Args:
        about: what is known about it.
        scores: the logits, and what to remember.
        state_values: what its critic says; None where there is none.
    """

    about: About
    scores: Scores
    state_values: StateValues | None = None

    @property
    def gamma(self) -> float | None:
        """γ that it was trained with, if that is said."""
        return self.about.gamma

    def seeing(self, change: Callable[[Any], Any]) -> Self:
        """Returns the same, that sees observations changed."""
        own, critic = self.scores, self.state_values
        seeing = replace(self, scores=lambda seen, *asked: own(change(seen), *asked))
        if critic is None:
            return seeing
        return replace(seeing, state_values=lambda seen, *asked: critic(change(seen), *asked))

    def paid(self, unit: float) -> Self:
        """Returns the same, its critic in the reward of the environment: so many times as large."""
        if (critic := self.state_values) is None:
            return self

        def paid(*asked: Any) -> tuple[FloatArray, Any]:
            values, state = critic(*asked)
            return values * unit, state

        return replace(self, state_values=paid)

    def act(self, observations: Any, state: Any, begins: BoolArray) -> tuple[FloatArray, Any]:
        """Returns the probabilities `[B, A]`, and what to remember."""
        logits, state = self.scores(observations, state, begins)
        return softmax(logits), state


Found = Drawing | Valuing | Student
"""What the agent in a file becomes."""


def critic_of(told: Scores) -> StateValues:
    """Returns the critic that a network with one output `[B, 1]` is; it minds no actions."""

    def state_values(
        observations: Any, state: Any, begins: BoolArray, likely: FloatArray
    ) -> tuple[FloatArray, Any]:
        values, state = told(observations, state, begins)
        return values[:, 0], state

    return state_values


def combined(parts: Sequence[FloatArray]) -> FloatArray:
    """Returns the logits of all combinations of choices `[B, A]`, the last part's fastest.

    Args:
        parts: the logits of the choices of each part, `[B, n]`.

    >>> told = softmax(combined([np.log([[0.3, 0.7]]), np.log([[0.5, 0.5]])]))
    >>> told.round(2).tolist()
    [[0.15, 0.15, 0.35, 0.35]]
    """
    first, *others = parts
    for other in others:
        first = (first[:, :, None] + other[:, None]).reshape(len(first), -1)
    return first


def softmax(logits: FloatArray) -> FloatArray:
    """Returns the probabilities `[B, A]` of logits `[B, A]`.

    >>> softmax(np.log([[1.0, 3.0]])).tolist()
    [[0.25, 0.75]]
    """
    up = np.asarray(logits, dtype=np.float64)
    odds = np.exp(up - up.max(axis=1, keepdims=True))
    return np.asarray(odds / odds.sum(axis=1, keepdims=True))


def _fits(space: gym.Space[Any], seen: tuple[int, ...]) -> bool:
    """Returns whether observations of a space are what an agent sees."""
    if isinstance(space, gym.spaces.Discrete):
        return seen == (space.n,)
    shape = space.shape or ()
    flat = len(seen) == 1 and prod(shape) == seen[0]
    return flat or [size for size in shape if size != 1] == [size for size in seen if size != 1]
