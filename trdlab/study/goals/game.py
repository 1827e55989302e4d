"""The game of the goal study: a way between dangers, then a room with things of two kinds.

The map is a mirror image of itself in which only the two kinds change places. So agents that want
one or the other expect alike step by step while they go the same way: when reward comes does not
tell what it is for. Agents that mind the dangers and agents that do not go the same way too: what
came does not tell what they fear. Only both together tell the goal.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trdlab.agents.agent import Agent
from trdlab.explanations.moment.moment import Moment
from trdlab.gridworld import GridMap, Gridworld
from trdlab.gridworld.world import Place, State
from trdlab.study.candidates import Candidate
from trdlab.study.goals.known import moment_at
from trdlab.time_axis import TimeAxis
from trdlab.verbs.making import solve

TIME_AXIS = TimeAxis(0.95, 18)
SLIP = 0.06
FLAG, DANGER = 0.5, -4.0
"""What the flag pays to everybody, and a triangle to those who mind it; a thing pays 1."""
CIRCLE, SQUARE, TRIANGLE, DOOR = "coin", "treasure", "hazard", "exit"
"""What stands on the map, as gridworlds call it; readers see shapes."""


@dataclass(frozen=True)
class Goal:
    """One of the four goals.

    Args:
        candidate: how readers know it.
        pays: by kind.
    """

    candidate: Candidate
    pays: Mapping[str, float]

    @property
    def minds(self) -> bool:
        """Whether triangles cost it anything."""
        return self.pays[TRIANGLE] < 0.0


def _goal(letter: str, about: str, thing: str, danger: float) -> Goal:
    pays = {CIRCLE: 0.0, SQUARE: 0.0, thing: 1.0, TRIANGLE: danger, DOOR: FLAG}
    return Goal(Candidate(letter, about), pays)


GOALS = (
    _goal("A", "wants the circles, and does not mind triangles", CIRCLE, 0.0),
    _goal("B", "wants the circles, and loses much by each triangle", CIRCLE, DANGER),
    _goal("C", "wants the squares, and does not mind triangles", SQUARE, 0.0),
    _goal("D", "wants the squares, and loses much by each triangle", SQUARE, DANGER),
)

_SHAPE, _AXIS = (7, 10), 3
_START, _DANGERS, _ROOM = 1, (2, 4), 6  # columns
_STOPS = (1, 3, 5)  # columns of the moments that are shown
_THINGS = 2  # of each kind
_SEEN = 0.1  # of what a thing pays: a cost that is no smaller can be seen among the bars


@dataclass(frozen=True, eq=False)
class Game:
    """A map, and the four agents on it.

    Args:
        grid: the map, on which nothing pays yet.
        stops: the places of the moments that are shown.
    """

    grid: GridMap
    stops: tuple[Place, ...]

    @cached_property
    def world(self) -> Gridworld:
        """The map brought to life; its states are those of all four agents."""
        return Gridworld(self.grid)

    @cached_property
    def agents(self) -> dict[str, Agent]:
        """The agents that act best for each goal, by its letter; their states are the same."""
        return {goal.candidate.letter: self._solved(goal) for goal in GOALS}

    def _solved(self, goal: Goal) -> Agent:
        grid = self.grid
        for kind, value in goal.pays.items():
            grid = grid.with_value(kind, value)
        return solve(Gridworld(grid), TIME_AXIS.gamma, TIME_AXIS.horizon)

    @cached_property
    def states(self) -> tuple[int, ...]:
        """The states at the moments that are shown, in which everything is still there."""
        return tuple(self.world.states.index(State(*place)) for place in self.stops)


def draw_game(rng: np.random.Generator) -> Game:
    """Returns a game in which no part of what is told gives the goal away (see `is_fair`).

    Args:
        rng: where the things stand, and how the map is turned, comes from.
    """
    while not is_fair(game := _drawn(rng)):
        pass
    return game


def is_fair(game: Game) -> bool:
    """Returns whether the four agents do the same at all moments that are shown, and expect fairly.

    That is: whoever wants circles expects the same, step by step, as who wants squares and minds
    triangles alike; and whoever minds triangles expects a cost that can be seen.
    """
    agents = game.agents.values()
    return all(_is_fair_at([moment_at(of, state) for of in agents]) for state in game.states)


def _is_fair_at(moments: Sequence[Moment]) -> bool:
    action, foil = moments[0].choice().action, moments[0].choice().foil
    if foil is None or any(
        (c.action, c.foil) != (action, foil) for c in map(Moment.choice, moments)
    ):
        return False
    bars = [np.stack([moment.components(name) for name in (action, foil)]) for moment in moments]
    is_mirrored = all(np.allclose(bars[i], bars[i + 2], atol=1e-9) for i in (0, 1))
    return is_mirrored and bool(bars[0].min() >= 0.0) and bool(bars[1].min() <= -_SEEN)


def _drawn(rng: np.random.Generator) -> Game:
    """Returns a map whose room is filled anew, turned some way."""
    cells = np.full(_SHAPE, "#")
    cells[_AXIS, :_ROOM] = "."
    cells[_AXIS, _START] = "S"
    for column in _DANGERS:
        cells[[_AXIS - 1, _AXIS + 1], column] = "h"
    cells[:, _ROOM:] = "."
    cells[_AXIS, -1] = "E"
    free = [(row, column) for row in range(_AXIS) for column in range(_ROOM, _SHAPE[1])]
    for at in rng.choice(len(free), _THINGS, replace=False):
        row, column = free[at]
        cells[row, column], cells[2 * _AXIS - row, column] = rng.permutation(["c", "t"])
    turns, numbers = int(rng.integers(4)), np.arange(cells.size).reshape(_SHAPE)
    cells, numbers = np.rot90(cells, turns), np.rot90(numbers, turns)
    stops = [np.argwhere(numbers == _AXIS * _SHAPE[1] + column)[0] for column in _STOPS]
    return Game(
        grid=GridMap("study", tuple(map("".join, cells)), slip=SLIP),
        stops=tuple((int(row), int(column)) for row, column in stops),
    )
