"""What people see at every step of an episode that was played: it is played again, and drawn."""

from collections.abc import Iterator
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.environments.protocol import NotReproducible
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError
from trdlab.gridworld import Gridworld
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.film import Filmed, as_picture
from trdlab.show.video.canvas import Frame, text_frame

_HEIGHT, _LEAST_CELL = 300, 40  # pixels: how high a map is about, and how wide a cell is at least


class Sight(NamedTuple):
    """One step of an episode.

    Args:
        picture: `[H, W, 3]`, as people see it.
        observation: `[...]`, as the estimator is asked about it.
        is_whole: whether the picture shows just what the observation shows, from corner to corner.
    """

    picture: Frame
    observation: Any
    is_whole: bool = False

    @property
    def seen(self) -> Frame:
        """`[H, W, 3]`: a picture of just what the agent sees.

        Raises:
            InputError: it sees no picture.
        """
        found = self.picture if self.is_whole else as_picture(self.observation)
        if found is None:
            raise InputError(
                "The agent sees no picture.", "Ask for one of an agent that sees images."
            )
        return found


def sights(agent: Agent, episode: Episode, seed: int) -> Iterator[Sight]:
    """Yields T+1 sights of an episode, from the first observation to the true last one.

    An exact model is drawn state by state. Elsewhere the actions are taken again.

    Args:
        agent: whose episode it is.
        episode: as it was played.
        seed: that it was played with.

    Raises:
        InputError: there is nothing to see of the environment.
        NotReproducible: other rewards came than before.
    """
    if agent.world is None or agent.is_away or episode.states is None:
        yield from _played_again(agent, episode, seed)
        return
    drawn: dict[int, Frame] = {}
    for state in episode.states.tolist():
        if state not in drawn:
            drawn[state] = _drawn(agent.world, state)
        yield Sight(drawn[state], state)


def _drawn(world: Any, state: int) -> Frame:
    if isinstance(world, Gridworld):
        from trdlab.gridworld.render import frame

        return frame(world, state, max(_LEAST_CELL, -(-_HEIGHT // world.grid.shape[0])))
    return text_frame((world.draw(state) or world.describe(state)).splitlines())


def _played_again(agent: Agent, episode: Episode, seed: int) -> Iterator[Sight]:
    latest: list[Frame] = []

    def keep(picture: Frame) -> None:
        latest[:] = [picture]

    with closing(Filmed(agent.make(1, seed), keep)) as environments:
        stack = FrameStack(environments.reset(), environments.stack, environments.padding)
        if not latest:
            raise InputError(
                "There is nothing to see of the environment: it draws no frames.",
                'Make it with render_mode="rgb_array", and install what it draws with.',
            )
        is_whole = getattr(environments, "game", None) is not None  # Atari games are seen whole
        yield Sight(latest[0], stack.observations[0].copy(), is_whole)
        for at, (action, before) in enumerate(zip(episode.actions, episode.rewards, strict=True)):
            step = environments.step(np.array([action]))
            (reward,) = agent.estimator.future.count(step.rewards)
            if reward != before:
                raise NotReproducible(
                    f"Step {at} of the episode paid {before:g}, and {reward:g} when it was played "
                    f"again.",
                    "Only what does the same again can be drawn.",
                )
            stack.push(step.frames)
            yield Sight(latest[0], stack.observations[0].copy(), is_whole)
