"""The contract of everything that decomposes: an exact table, a learned one, a network."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import product
from typing import Any, Literal, Protocol, Self, get_args, runtime_checkable

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError

MapMethod = Literal["gradcam", "hirescam"]
"""How maps of where a network looks are made: as in the paper, or by the gradient at each place."""
MAP_METHODS: tuple[MapMethod, ...] = get_args(MapMethod)


@dataclass(frozen=True)
class Future:
    """Whose future a decomposition speaks of, in which reward, and what ends it.

    What it says in words and how rewards are counted follow from the same fields, so that a
    decomposition is judged by what it claims to tell.

    Args:
        policy: who acts after the first action, for example `the optimal policy`.
        clip_rewards: whether the sign of each reward counts in place of the reward.
        life_loss_ends: whether nothing is left to come where a life is lost.
        time_limit_ends: whether nothing is left to come where the environment cuts an episode off.

    Raises:
        InputError: a field is of another type.

    >>> lives = Future("the greedy policy", clip_rewards=True, life_loss_ends=True)
    >>> lives.reward, lives.ending
    ('sign of each reward', 'a lost life, or the end of the game')
    >>> lives.count(np.array([10.0, 0.0, -2.0])).tolist()
    [1.0, 0.0, -1.0]
    """

    policy: str
    clip_rewards: bool = False
    life_loss_ends: bool = False
    time_limit_ends: bool = False

    def __post_init__(self) -> None:
        for of, kind in zip(fields(self), (str, bool, bool, bool), strict=True):
            value = getattr(self, of.name)
            if not isinstance(value, kind):
                wanted = "It must be True or False." if kind is bool else "Say in words who acts."
                raise InputError(f"The {of.name} of a Future is {value!r}.", wanted)

    @property
    def reward(self) -> str:
        """The reward it counts, in words."""
        return "sign of each reward" if self.clip_rewards else "reward as the environment pays it"

    @property
    def ending(self) -> str:
        """What ends it, in words."""
        return {
            (False, False): "the end of the episode",
            (True, False): "a lost life, or the end of the game",
            (False, True): "the end of the episode, or the time limit",
            (True, True): "a lost life, the end of the game, or the time limit",
        }[self.life_loss_ends, self.time_limit_ends]

    def count(self, rewards: FloatArray) -> FloatArray:
        """Returns rewards `[...]` as they are counted."""
        return np.sign(rewards) if self.clip_rewards else rewards

    def ends(self, terminated: BoolArray, truncated: BoolArray, life_lost: BoolArray) -> BoolArray:
        """Returns `[B]`: where nothing is left to come after a step.

        Args:
            terminated: `[B]`, whether the episode ended for good.
            truncated: `[B]`, whether the environment cut it off.
            life_lost: `[B]`, whether a life was lost and the episode goes on.
        """
        lost, cut = life_lost & self.life_loss_ends, truncated & self.time_limit_ends
        return np.asarray(terminated | lost | cut)

    def to_dict(self) -> dict[str, str]:
        """Returns its words, for JSON."""
        return {"policy": self.policy, "reward": self.reward, "ending": self.ending}

    @classmethod
    def from_dict(cls, words: dict[str, str]) -> Self:
        """Returns the future that `to_dict` wrote.

        Raises:
            InputError: no future has such words.
        """
        for flags in product((False, True), repeat=3):
            future = cls(words["policy"], *flags)
            if future.to_dict() == words:
                return future
        raise InputError(
            f"No future counts the '{words['reward']}' and ends at '{words['ending']}'.",
            "Write it with to_dict.",
        )


@dataclass(frozen=True, eq=False)
class Outlook:
    """What an estimator expects of a batch beside the mean of the reward.

    Args:
        variance: `[..., A, N]`, of the discounted reward of each explicit component. That of the
            residual does not follow the law, and is not told.
        survival: `[..., A, N+1]`, how likely the episode still runs when each component begins.
        chances: `[..., A, N]` for each reward that ever came, how likely each step pays it; empty
            where many did, or w > 1.
        parts: `[..., A, N+1]` each, the parts that add up to the reward, discounted.
        events: `[..., A, N]` each, how likely something happens in each component.
        amounts: `[..., A, N+1]` each, of something else that is counted, discounted.
        survival_reach: how many components in a row, from the first on, survival was surely told
            better than by a constant guess; 0 if that has not been judged.
        reach: the same of each part, event and amount.
        endings: the names of the events that never came but with the end of an episode, so that
            they come once at most.
    """

    variance: FloatArray
    survival: FloatArray
    chances: Mapping[float, FloatArray]
    parts: Mapping[str, FloatArray]
    events: Mapping[str, FloatArray]
    amounts: Mapping[str, FloatArray]
    survival_reach: int = 0
    reach: Mapping[str, int] = field(default_factory=dict)
    endings: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of all parts, events and amounts."""
        return (*self.parts, *self.events, *self.amounts)

    @property
    def untold(self) -> tuple[str, ...]:
        """The names of those of which nothing can be told."""
        return tuple(name for name in self.names if not self.reach.get(name))

    def told(self, kind: str, *, together: bool = False) -> dict[str, FloatArray]:
        """Returns `[..., A, K]` each: as many components, from the first on, as can be told.

        What has none of them is left out.

        Args:
            kind: `parts`, `events` or `amounts`.
            together: whether only components count that can be told of all of them.
        """
        of: Mapping[str, FloatArray] = getattr(self, kind)
        reach = {name: self.reach.get(name, 0) for name in of}
        if together:
            reach = dict.fromkeys(reach, min(reach.values(), default=0))
        cut = {name: of[name][..., :count] for name, count in reach.items() if count}
        return {name: array.astype(np.float64) for name, array in cut.items()}

    def __getitem__(self, index: Any) -> "Outlook":
        """Selects states and actions; the time axis stays whole."""

        def one(of: Mapping[Any, FloatArray]) -> dict[Any, FloatArray]:
            return {name: array[index] for name, array in of.items()}

        return replace(
            self,
            variance=self.variance[index],
            survival=self.survival[index],
            chances=one(self.chances),
            parts=one(self.parts),
            events=one(self.events),
            amounts=one(self.amounts),
        )


class Unfitted:
    """What stands for an estimator while nobody knows what an agent expects.

    It can act, and be scored; whoever asks what it expects is told how to find out.

    >>> Unfitted().time_axis
    Traceback (most recent call last):
    trdlab.errors.InputError: Nobody knows yet what this agent expects. Fit it first: \
trdlab.fit(agent), or trdlab fit.
    """

    @property
    def time_axis(self) -> TimeAxis:
        """Nothing yet: raises `InputError`."""
        raise self._unknown()

    @property
    def future(self) -> Future:
        """Nothing yet: raises `InputError`."""
        raise self._unknown()

    def decompose(self, observations: Any) -> RewardDecomposition:
        """Raises `InputError`: there is nothing to decompose yet."""
        raise self._unknown()

    def _unknown(self) -> InputError:
        return InputError(
            "Nobody knows yet what this agent expects.",
            "Fit it first: trdlab.fit(agent), or trdlab fit.",
        )


@runtime_checkable
class Estimator(Protocol):
    """Decomposes the future of a batch of observations."""

    @property
    def time_axis(self) -> TimeAxis:
        """What the components mean."""

    @property
    def future(self) -> Future:
        """Whose future it is."""

    def decompose(self, observations: Any) -> RewardDecomposition:
        """Returns the components `[B, A, N+1]` of a batch of B observations."""
