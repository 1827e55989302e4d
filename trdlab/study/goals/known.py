"""What is known of an agent: what it expects at a moment, what that depends on, what has come."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition
from trdlab.errors import InputError
from trdlab.explanations.gallery.claims import group_claims
from trdlab.explanations.gallery.gallery import Gallery, Recorded, gallery_of
from trdlab.explanations.moment.exact import exact_moment
from trdlab.explanations.moment.moment import Choice, Moment, moment_of
from trdlab.explanations.saliency.groups import Group
from trdlab.explanations.saliency.maps import SaliencyMaps, shares_of_largest
from trdlab.gridworld import Gridworld
from trdlab.gridworld.world import State
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.reel import Picture, Reel
from trdlab.show.report.recording import record
from trdlab.study.goals.look import picture
from trdlab.tabular import ExactTable

_MOST_GROUPS, _EXAMPLES = 4, 2
"""Kinds of reward whose clips are shown, and how many of each."""
_APART = 4  # steps between the pictures of a clip; on a map, where each step tells, 1

Strip = tuple[Picture, Picture, Picture | None]
"""What was to be seen before a reward, when it came, and after; None if the episode was over."""


@dataclass(frozen=True, eq=False)
class Glance:
    """A moment as readers see it.

    Args:
        step: of its episode.
        picture: `[H, W, 3]`.
        choice: what the agent does, and the next best action, in units of its largest reward.
        saliency: `[h, w]`, by how much what is expected depends on what is seen at each place, as
            shares of the largest, above 0 where it raises it; None where nobody can tell.
    """

    step: int
    picture: Picture
    choice: Choice
    saliency: FloatArray | None


@dataclass(frozen=True, eq=False)
class Clips:
    """What a kind of reward has looked like.

    Args:
        caption: what came, and how often.
        strips: examples.
    """

    caption: str
    strips: tuple[Strip, ...]


@dataclass(frozen=True, eq=False)
class Past:
    """Episodes that an agent has played.

    Args:
        recorded: the episodes.
        observations: `[T, ...]`, what it observed in the first of them.
        picture: returns one of their pictures by its number.
        gallery: the rewards that came.
        apart: the steps between the pictures of a clip.
    """

    recorded: tuple[Recorded, ...]
    observations: Any
    picture: Callable[[int], Picture]
    gallery: Gallery
    apart: int

    @property
    def unit(self) -> float:
        """The largest reward that came, or cost if there was none."""
        came = [one.reward for one in self.gallery.came]
        return max(came) if max(came, default=0.0) > 0.0 else max(map(abs, came), default=1.0)

    def clips(self) -> tuple[Clips, ...]:
        """Returns clips of the commonest kinds of reward."""
        in_units = _in_units(self.gallery, self.unit)
        captions = [claim.sentence for claim in group_claims(in_units)][:_MOST_GROUPS]
        groups = in_units.groups[: len(captions)] or (None,)
        return tuple(
            Clips(caption, () if group is None else self._strips(group.members))
            for caption, group in zip(captions, groups, strict=True)
        )

    def _strips(self, members: Sequence[int]) -> tuple[Strip, ...]:
        """Returns clips of some rewards, each of which looks different."""
        found: dict[int, Strip] = {}
        for one in (self.gallery.came[member] for member in members):
            shown, at = self.recorded[one.episode].pictures, one.step + 1
            if not shown:
                return ()
            before, after = max(0, at - self.apart), at + self.apart
            if shown[at] not in found and len(found) < _EXAMPLES:
                last = self.picture(shown[after]) if after < len(shown) else None
                found[shown[at]] = self.picture(shown[before]), self.picture(shown[at]), last
        return tuple(found.values())


def past_of(agent: Agent, seeds: Sequence[int], max_steps: int) -> Past:
    """Plays episodes of an agent, one of each seed.

    On maps kinds of reward are told apart by their value alone; elsewhere also by where the screen
    changed.
    """
    reel, world = Reel(), _world(agent)
    if world is None:
        how: Any = {"max_steps": max_steps}
        takes = [
            record(agent, reel, seed=of, with_moments=not i, **how) for i, of in enumerate(seeds)
        ]
        seen = tuple(replace(of.recorded, parts=()) for of in takes)  # names would tell the goal
        return Past(seen, takes[0].observations, reel.__getitem__, gallery_of(seen, reel), _APART)
    plain = [Recorded(agent.play(1, seed=of, max_steps=max_steps)[0], of) for of in seeds]
    recorded = tuple(replace(of, pictures=tuple(states_of(of.episode))) for of in plain)
    states = np.array(recorded[0].pictures[:-1])
    return Past(recorded, states, cache(partial(picture, world)), gallery_of(plain, reel), 1)


def glance(agent: Agent, seen: Any, shown: Picture, step: int, unit: float) -> Glance:
    """Returns a moment as readers see it.

    Args:
        agent: whose.
        seen: what it observes.
        shown: what people see.
        step: of its episode.
        unit: what amounts are told in.
    """
    choice = moment_at(agent, seen, unit).choice()
    action = agent.action_names.index(choice.action)
    return Glance(step, shown, choice, saliency_at(agent, seen, action))


def moment_at(agent: Agent, seen: Any, unit: float = 1.0) -> Moment:
    """Returns what an agent expects where it observes something, in some unit.

    Of a solved model in whose own unit is asked, chances are known, too.
    """
    table = agent.estimator
    if agent.world is not None and isinstance(table, ExactTable) and unit == 1.0:
        return exact_moment(agent.world, table, int(seen))
    moment = moment_of(table, seen, agent.action_names)
    components = moment.decomposition.components / unit
    return replace(moment, decomposition=RewardDecomposition(components, table.time_axis))


def saliency_at(agent: Agent, seen: Any, action: int) -> FloatArray | None:
    """Returns what all that is expected of an action depends on, at each place of the picture.

    On a map, each thing that can be taken is thought away. A network's map is GradCAM.
    """
    world, estimator = _world(agent), agent.estimator
    if world is not None:
        return shares_of_largest(_by_hiding(world, estimator, int(seen), action))
    asked = getattr(estimator, "saliency", None)
    if asked is None or np.ndim(seen) < 2:
        return None
    try:
        signed = asked(np.asarray(seen)[None], np.array([action]))[0]  # [N+1, h, w]
    except InputError:  # a network without convolutions
        return None
    axis = estimator.time_axis
    return SaliencyMaps(signed, axis).of(Group(0, axis.horizon)).scaled


def _by_hiding(world: Gridworld, table: Any, state: int, action: int) -> FloatArray:
    """Returns `[rows, columns]`: how much less is expected without the thing at each place."""
    here, found = world.states[state], np.zeros(world.grid.shape)
    numbers = {of: number for number, of in enumerate(world.states)}
    worth = table.decompose(np.array([state])).value[0, action]
    for row, column in np.ndindex(*found.shape):
        without = State(*here.place, here.collected | {(row, column)})
        if without in numbers and without != here:
            other = table.decompose(np.array([numbers[without]])).value[0, action]
            found[row, column] = worth - other
    return found


def states_of(episode: Episode) -> list[int]:
    """Returns `[T+1]`, the states of an episode of a model."""
    assert episode.states is not None
    return [int(state) for state in episode.states]


def _in_units(gallery: Gallery, unit: float) -> Gallery:
    came = tuple(replace(one, reward=one.reward / unit) for one in gallery.came)
    return Gallery(gallery.recorded, came)


def _world(agent: Agent) -> Gridworld | None:
    """Returns the map that an agent acts on, which it also knows."""
    is_there = isinstance(agent.world, Gridworld) and not agent.is_away
    return agent.world if is_there else None  # type: ignore[return-value]
