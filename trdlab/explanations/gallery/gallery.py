"""The reward gallery: rewards that really came, by value and by what changed on the screen."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trdlab.arrays import BoolArray, FloatArray, IntArray
from trdlab.decomposition import TimeAxis
from trdlab.explanations.gallery.places import Box, Change, changes
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.realised import next_flag
from trdlab.rollouts.reel import Reel

LEVELS = (0.1, 0.3, 0.6)
"""From which share of a usual reward on a forecast is of the next level; those of one are alike."""
MOST_GROUPS = 24
"""Of rewards; all others are told together."""
EXAMPLES = 2
"""Rewards that are shown for a forecast."""

_MOST_PAID = 0.5  # of all steps: where more pay, what changes on the screen says nothing


@dataclass(frozen=True, eq=False)
class Recorded:
    """An episode, with what was seen of it.

    Args:
        episode: of T steps.
        seed: of the episode.
        pictures: `[T+1]`, numbers of pictures in a reel; empty where there is nothing to see.
        parts: `[T]`, the names of what paid in each step; empty where nobody tells.
    """

    episode: Episode
    seed: int
    pictures: tuple[int, ...] = ()
    parts: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Came:
    """A reward that really came.

    Args:
        episode: the number of the recorded episode.
        step: of that episode.
        reward: as the agent's forecasts count it.
        parts: the names of what paid, if the environment tells them.
        place: where on the screen something changed for good, in words; empty if that says nothing.
        box: the same as top, left, bottom and right, in pixels.
    """

    episode: int
    step: int
    reward: float
    parts: tuple[str, ...] = ()
    place: str = ""
    box: Box | None = None


@dataclass(frozen=True)
class Group:
    """Rewards that look alike.

    Args:
        reward: what each of them is.
        parts: the names of what paid.
        place: where on the screen something changed.
        members: the numbers of the rewards, in the order in which they came.
    """

    reward: float
    parts: tuple[str, ...]
    place: str
    members: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Alike:
    """Recorded forecasts of one component that are alike, and what followed them.

    Args:
        component: the component.
        level: how high they are (see `LEVELS`), below 0 where a cost is forecast.
        moments: how many there are, of which it is known what followed.
        followed: after how many of them a reward came, or a cost, when it was forecast.
        groups: after how many of them one of each group came.
        examples: the numbers of some of those rewards.
    """

    component: int
    level: int
    moments: int
    followed: int
    groups: dict[int, int]
    examples: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Gallery:
    """Rewards that came in recorded episodes, and the forecasts that were made before.

    Args:
        recorded: the episodes.
        came: every reward other than 0, and every cost, in order.
    """

    recorded: tuple[Recorded, ...]
    came: tuple[Came, ...]

    @property
    def time_axis(self) -> TimeAxis:
        """Of the forecasts."""
        return self.recorded[0].episode.time_axis

    @property
    def steps(self) -> int:
        """Of all recorded episodes together."""
        return sum(len(of.episode) for of in self.recorded)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Rewards that look alike, the commonest first, and `MOST_GROUPS` at most."""
        found: dict[tuple[float, tuple[str, ...], str], list[int]] = {}
        for number, one in enumerate(self.came):
            value = float(f"{one.reward:.9g}")
            key = (value, one.parts, "" if one.parts else one.place)
            found.setdefault(key, []).append(number)
        told = (Group(*key, tuple(members)) for key, members in found.items())
        return tuple(sorted(told, key=lambda of: (-len(of.members), -abs(of.reward)))[:MOST_GROUPS])

    @cached_property
    def usual(self) -> float:
        """The median size of a reward that came; 0 where none did."""
        return float(np.median([abs(one.reward) for one in self.came])) if self.came else 0.0

    @cached_property
    def edges(self) -> FloatArray:
        """`[N, levels]`: from which size on a component is of the next level."""
        discounts = self.time_axis.discounts[:-1, None]
        return np.asarray(self.usual * discounts * np.array(LEVELS))

    def level(self, component: int, value: float) -> int:
        """Returns the level of a forecast, below 0 where it is one of a cost."""
        size = int((abs(value) >= self.edges[component]).sum())
        return size if value >= 0.0 else -size

    @cached_property
    def alike(self) -> dict[tuple[int, int], Alike]:
        """By component and level, all forecasts of actions that were taken, and what followed."""
        if not self.came:
            return {}
        found = [self._told(i) for i in range(self.time_axis.horizon)]
        return {(of.component, of.level): of for each in found for of in each}

    def _told(self, component: int) -> list[Alike]:
        """Returns the forecasts of a component, by their level."""
        parts = [self._followed(component, number) for number in range(len(self.recorded))]
        levels, nearest = (np.concatenate(column) for column in zip(*parts, strict=True))
        return [
            self._alike(component, level, nearest[levels == level])
            for level in np.unique(levels).tolist()
        ]

    def _followed(self, component: int, number: int) -> tuple[IntArray, IntArray]:
        """Returns `[K]` twice: the level of each forecast, and the reward that followed, or −1.

        That is the one nearest to the middle of the component, of those that came within it, or a
        step before or after. What a cut hides is left out.
        """
        episode, axis = self.recorded[number].episode, self.time_axis
        slack, t, total = self.slack(component), np.arange(len(episode)), len(episode)
        first = t + component * axis.width - slack
        last = t + (component + 1) * axis.width - 1 + slack
        end = next_flag(episode.ends, np.iinfo(np.int64).max)  # [T]
        known = (last < total) | (end < total)
        predicted = episode.predicted[:, component].astype(np.float64)
        size = (np.abs(predicted)[:, None] >= self.edges[component]).sum(axis=1)
        levels = np.where(predicted < 0.0, -size, size)
        own = [i for i, one in enumerate(self.came) if one.episode == number]
        steps = np.array([self.came[i].step for i in own], dtype=np.int64)
        signs = np.sign([self.came[i].reward for i in own])
        nearest = np.full(total, -1)
        for k in np.flatnonzero(known).tolist() if own else ():
            wanted = -1.0 if levels[k] < 0 else 1.0
            low, high = np.searchsorted(steps, (first[k], min(last[k], end[k]) + 1))
            there = np.arange(low, high)[signs[low:high] == wanted]
            if len(there):
                middle = (first[k] + last[k]) / 2.0
                nearest[k] = own[int(there[np.abs(steps[there] - middle).argmin()])]
        return levels[known], nearest[known]

    def slack(self, component: int) -> int:
        """Returns by how many steps a reward may miss a component and still count as foreseen."""
        return 1 if component else 0

    def _alike(self, component: int, level: int, nearest: IntArray) -> Alike:
        followed = nearest[nearest >= 0]
        group_of = {member: i for i, of in enumerate(self.groups) for member in of.members}
        counts: dict[int, int] = {}
        for one in followed.tolist():
            if (group := group_of.get(one)) is not None:
                counts[group] = counts.get(group, 0) + 1
        ordered = dict(sorted(counts.items(), key=lambda pair: (-pair[1], pair[0])))
        those = list(dict.fromkeys(followed.tolist()))
        # one of each group, the commonest first
        shown = [next(i for i in those if group_of.get(i) == group) for group in ordered]
        shown += [i for i in those if i not in shown]
        return Alike(
            component, level, len(nearest), len(followed), ordered, tuple(shown[:EXAMPLES])
        )


def gallery_of(recorded: Sequence[Recorded], reel: Reel) -> Gallery:
    """Returns the rewards of recorded episodes.

    Where at most half of all steps pay, rewards are told apart by where on the screen something
    changed for good. Where the environment names what paid, its words do.

    Args:
        recorded: at least one episode.
        reel: their pictures.
    """
    paid: list[BoolArray] = [of.episode.rewards != 0.0 for of in recorded]
    share = float(np.concatenate(paid).mean())
    places: list[tuple[int, int]] = [
        (number, step)
        for number, flags in enumerate(paid)
        for step in np.flatnonzero(flags).tolist()
    ]
    seen: Sequence[Change | None] = [None] * len(places)
    if share <= _MOST_PAID and all(of.pictures for of in recorded):
        seen = changes([(recorded[number].pictures, step) for number, step in places], reel)
    came = []
    for (number, step), change in zip(places, seen, strict=True):
        of = recorded[number]
        parts = of.parts[step] if of.parts else ()
        where = ("", None) if change is None else (change.place, change.box)
        came.append(Came(number, int(step), float(of.episode.rewards[step]), parts, *where))
    return Gallery(tuple(recorded), tuple(came))
