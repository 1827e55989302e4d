"""Recording: an episode of an agent, what it expects at each step, and what people see."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.explanations.assessment import moment_of_play
from trdlab.explanations.calibration.report import CalibrationReport
from trdlab.explanations.gallery.gallery import Recorded
from trdlab.explanations.moment.moment import Moment
from trdlab.gridworld import Gridworld
from trdlab.rollouts.film import Filmed
from trdlab.rollouts.playing import Watch, unwatched
from trdlab.rollouts.reel import Reel
from trdlab.show.report.pictures import MOST_PIXELS, shrunk
from trdlab.tabular.named import TabularWorld

_CELL = 64  # pixels
_MOST_SHOWN = 40  # numbers of an observation that is shown as such


@dataclass(frozen=True, eq=False)
class Take:
    """An episode that was recorded.

    Args:
        recorded: what happened, and its pictures.
        moments: `[T]`, what was expected at each step; empty where nobody asked.
        observations: `[T, ...]`, what the agent's forecasts are about; likewise.
        texts: `[T+1]`, what is seen in words and signs, where there are no pictures.
    """

    recorded: Recorded
    moments: tuple[Moment, ...]
    observations: Any
    texts: tuple[str, ...]

    def judged(self, report: CalibrationReport) -> "Take":
        """Returns the same, with how good its forecasts are; a moment that came twice stays one."""
        known = {
            id(of): replace(of, calibration=report.calibration, foils=report.foils)
            for of in self.moments
        }
        return replace(self, moments=tuple(known[id(of)] for of in self.moments))


def record(
    agent: Agent,
    reel: Reel,
    *,
    seed: int,
    max_steps: int,
    with_moments: bool = False,
    watch: Watch = unwatched,
) -> Take:
    """Plays an episode of an agent, and keeps what is to be seen of it.

    Args:
        agent: whose.
        reel: where its pictures go.
        seed: of the episode.
        max_steps: after which it is cut off, if not before.
        with_moments: whether to keep what is expected of every action.
        watch: told how far it is, after every step.
    """
    films: list[Filmed] = []

    def film(environments: Any) -> Any:
        films.append(Filmed(environments, lambda picture: reel.add(shrunk(picture))))
        return films[0]

    known: dict[int, Moment] = {}  # of a model: a state may come up again
    moments, seen = [], []
    with agent.begin(seed=seed, film=film, max_steps=max_steps) as recording:
        playing = recording.playing
        while playing.running[0]:
            if with_moments:
                here = np.array(playing.stack.observations[0])
                moments.append(_moment(agent, playing, here, known))
                seen.append(here)
            recording.play(playing.steps + 1, watch=watch, what="an episode to show")
        (episode,) = recording.episodes()
    pictures, states, texts = tuple(films[0].pictures), episode.states, tuple[str, ...]()
    if agent.world is not None and not agent.is_away and states is not None:
        pictures, texts = _of_states(agent.world, states.tolist(), reel)
    elif not pictures and seen and seen[0].size <= _MOST_SHOWN:
        texts = tuple(map(_as_text, seen))
        texts = (*texts, texts[-1])
    recorded = Recorded(episode, seed, pictures, tuple(films[0].parts))
    return Take(recorded, tuple(moments), np.array(seen), texts)


def _moment(agent: Agent, playing: Any, seen: Any, known: dict[int, Moment]) -> Moment:
    """Returns what is expected now; of a model, what is known already where a state comes again."""
    is_exact = agent.world is not None and not agent.is_away
    if is_exact and int(seen) in known:
        return known[int(seen)]
    moment = moment_of_play(agent, playing)
    if is_exact:
        known[int(seen)] = moment
    return moment


def _of_states(
    world: Gridworld | TabularWorld, states: list[int], reel: Reel
) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Returns the pictures of states of a map, or else the same in signs and words."""
    if isinstance(world, TabularWorld):
        return (), tuple(_in_words(world, state) for state in states)
    from trdlab.gridworld.render import frame  # matplotlib is slow to import

    side = max(1, min(_CELL, MOST_PIXELS // max(world.grid.shape)))
    drawn = {state: reel.add(frame(world, state, side)) for state in dict.fromkeys(states)}
    return tuple(drawn[state] for state in states), ()


def _in_words(world: TabularWorld, state: int) -> str:
    told = [world.draw(state), world.describe(state) or f"state {state}"]
    return "\n\n".join(part for part in told if part)


def _as_text(seen: Any) -> str:
    values = np.ravel(seen)
    if len(values) == 1:
        return f"it sees {values[0]:.4g}"
    width = len(str(len(values) - 1))
    return "\n".join(f"{i:>{width}}  {value: .4g}" for i, value in enumerate(values))
