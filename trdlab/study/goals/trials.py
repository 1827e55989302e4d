"""The trials of a goal study: what readers see of one of four agents."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.errors import InputError
from trdlab.rollouts.episodes import Episode
from trdlab.rollouts.playing import usual_limit
from trdlab.study.design import GOAL_STUDY
from trdlab.study.goals.game import CIRCLE, FLAG, GOALS, TIME_AXIS, TRIANGLE, Game, Goal, draw_game
from trdlab.study.goals.known import Clips, Glance, Past, glance, past_of, states_of
from trdlab.study.goals.look import picture
from trdlab.study.trials import times_each

MOST = 16
EPISODES = 4
"""Of the past, in which it is seen what reward looks like."""
_GLANCES = 3  # moments that are shown of one agent


@dataclass(frozen=True, eq=False)
class Trial:
    """What there is to see of an agent, and which goal it has.

    Args:
        letter: of its goal.
        glances: the moments that are shown.
        clips: what reward has looked like.
        reason: what truly pays it; for after the answer.
    """

    letter: str
    glances: tuple[Glance, ...]
    clips: tuple[Clips, ...]
    reason: str

    @property
    def groups(self) -> tuple[str, ...]:
        """The groups of readers for which there is something to see."""
        is_seen = all(of.saliency is not None for of in self.glances)
        return tuple(name for name in GOAL_STUDY.groups if is_seen or name != "saliency")


def draw_trials(seed: int, count: int = 4) -> tuple[Trial, ...]:
    """Returns trials in random order, equally many about each goal.

    Four in a row are about four agents on one map, at the same moments of which each does the same.

    Args:
        seed: of all chance.
        count: of trials.

    Raises:
        InputError: the count is no multiple of four, or out of range.
    """
    each = times_each(count, len(GOALS), MOST)
    rng = np.random.default_rng(seed)
    return tuple(trial for _ in range(each) for trial in _on_one_map(rng))


def _on_one_map(rng: np.random.Generator) -> list[Trial]:
    game = draw_game(rng)
    pasts = draw_pasts(game, rng)
    return [_of_goal(GOALS[i], game, pasts[GOALS[i].candidate.letter]) for i in rng.permutation(4)]


def _of_goal(goal: Goal, game: Game, past: Past) -> Trial:
    letter = goal.candidate.letter
    agent = game.agents[letter]
    glances = tuple(
        glance(agent, np.int64(state), picture(game.world, state), 2 * i, 1.0)
        for i, state in enumerate(game.states)
    )
    wanted, other = ("circle", "square") if goal.pays[CIRCLE] else ("square", "circle")
    cost = f"costs it {-goal.pays[TRIANGLE]:g}" if goal.minds else "costs it nothing"
    reason = (
        f"Each {wanted} pays it 1, the flag {FLAG:g}, and a {other} nothing. Each time that it "
        f"touches a triangle {cost}."
    )
    return Trial(letter, glances, past.clips(), reason)


def draw_pasts(game: Game, rng: np.random.Generator) -> dict[str, Past]:
    """Returns what the four agents have played, in which none has touched a triangle.

    So who minds triangles and who does not have the same past, picture by picture.
    """
    limit = usual_limit(TIME_AXIS)
    while True:
        seeds = [int(of) for of in rng.integers(2**31, size=EPISODES)]
        played = [
            agent.play(1, seed=of, max_steps=limit)[0]
            for agent in game.agents.values()
            for of in seeds
        ]
        if not any(_has_touched(game, episode) for episode in played):
            return {name: past_of(agent, seeds, limit) for name, agent in game.agents.items()}


def _has_touched(game: Game, episode: Episode) -> bool:
    places = {game.world.states[state].place for state in states_of(episode)}
    return any(game.grid.cell(*place).kind == TRIANGLE for place in places)


def trials_of(
    agents: Mapping[str, Agent], seed: int, max_steps: int | None = None
) -> tuple[Trial, ...]:
    """Returns a trial of each of some agents, in random order.

    Args:
        agents: by the letters of their goals.
        seed: of the order and of the episodes.
        max_steps: after which an episode is cut off, if not before.

    Raises:
        InputError: it is not known what an agent expects, there is nothing to see of it, or it sees
            or does something else than the others.
    """
    first = next(iter(agents.values()))
    for letter, agent in agents.items():
        if not agent.is_fitted:
            raise InputError(
                f"Nobody knows what the agent of goal {letter} expects.", "Fit it first."
            )
        first.interface.check_fits(agent.interface, agent.name)
    rng = np.random.default_rng(seed)
    order = rng.permutation([*agents]).tolist()
    seeds = [int(of) for of in rng.integers(2**31, size=EPISODES)]
    return tuple(_of_agent(letter, agents[letter], seeds, max_steps) for letter in order)


def _of_agent(letter: str, agent: Agent, seeds: list[int], max_steps: int | None) -> Trial:
    limit = usual_limit(agent.estimator.time_axis) if max_steps is None else max_steps
    past = past_of(agent, seeds, limit)
    shown, count = past.recorded[0].pictures, len(past.recorded[0].episode)
    if not shown:
        raise InputError(
            f"There is nothing to see of '{agent.name}'.",
            "Its environment has to draw itself, or show images.",
        )
    steps = np.linspace(0, count - 1, _GLANCES + 2)[1:-1].astype(int).tolist()
    glances = tuple(
        glance(agent, past.observations[t], past.picture(shown[t]), t, past.unit) for t in steps
    )
    return Trial(letter, glances, past.clips(), f"It is {agent.name}.")
