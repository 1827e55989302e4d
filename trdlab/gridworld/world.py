"""A gridworld's exact dynamics: its reachable states and their transitions."""

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np

from trdlab.arrays import FloatArray
from trdlab.errors import InputError, MapError
from trdlab.gridworld.gridmap import ACTIONS, MOVES, Cell, GridMap
from trdlab.tabular.mdp import MDP

MAX_STATES = 50_000

_SIDEWAYS = ((2, 3), (2, 3), (0, 1), (0, 1))  # the two directions that a move slips to
_OPPOSITE = (1, 0, 3, 2)

Place = tuple[int, int]


class State(NamedTuple):
    """Where the drone is, and which one-time cells it has emptied."""

    row: int
    column: int
    collected: frozenset[Place] = frozenset()

    @property
    def place(self) -> Place:
        """Row and column."""
        return self.row, self.column

    def __str__(self) -> str:
        taken = f", {len(self.collected)} collected" if self.collected else ""
        return f"row {self.row}, column {self.column}{taken}"


class Source(NamedTuple):
    """Where reward comes from: the cells of one kind and value, or the cost of each step."""

    kind: str
    value: float


class _Outcome(NamedTuple):
    """One result of an action: the next state, what it earned from each source, and the end."""

    next_state: int
    earned: tuple[int, ...]
    terminated: bool


class Gridworld:
    """A map brought to life: its states, and the exact model of its dynamics.

    States are numbered in the order a breadth-first search meets them; 0 is the start.

    Args:
        grid: the map and its rules.

    Raises:
        MapError: a cell that pays cannot be reached, or there are too many states.

    >>> from trdlab.gridworld.gridmap import load_map
    >>> world = Gridworld(load_map("drone"))
    >>> str(world.states[0]), world.mdp.num_states
    ('row 1, column 0', 14)
    """

    action_names = ACTIONS

    def __repr__(self) -> str:
        return f"<Gridworld: {self.grid.name or 'a map'} · {len(self.states)} states>"

    def __str__(self) -> str:
        return "\n".join(self.grid.rows)

    def _repr_html_(self) -> str:
        from html import escape

        from trdlab.gridworld.ansi import legend

        lines = "\n".join([str(self), "", *legend(self)[1:]])  # the drone is not drawn
        return f"<pre>{escape(lines)}</pre>"

    def __init__(self, grid: GridMap) -> None:
        self.grid = grid
        self.sources = _sources(grid)
        self.states: list[State] = [State(*grid.start)]
        self._index = {self.states[0]: 0}
        self._entered: set[Place] = {grid.start}  # at rest, or in passing
        self._outcomes: list[
            dict[_Outcome, float]
        ] = []  # row s·A + a: the probability of each outcome
        for state in self._growing_states():
            self._outcomes += [self._act(state, action) for action in range(len(ACTIONS))]
        self._check_reachable()

    @cached_property
    def mdp(self) -> MDP:
        """The exact model."""
        flat = [(o, p) for row in self._outcomes for o, p in row.items()]
        return MDP(
            offsets=np.cumsum([0, *map(len, self._outcomes)]),
            next_states=np.array([o.next_state for o, _ in flat], dtype=np.int64),
            probabilities=np.array([p for _, p in flat], dtype=np.float64),
            rewards=self._earned @ np.array([source.value for source in self.sources]),
            terminated=np.array([o.terminated for o, _ in flat], dtype=np.bool_),
            num_actions=len(ACTIONS),
        )

    def mdp_if(self, source: Source, value: float) -> MDP:
        """Returns the model in which one source of reward pays another value.

        Raises:
            InputError: this world has no such source, or the value is not finite.
        """
        if source not in self.sources:
            raise InputError(
                f"No {source.kind} pays {source.value:g} here.", "Name one of the sources."
            )
        if not np.isfinite(value):
            raise InputError(f"The value of the {source.kind} is {value}.", "Give a finite one.")
        values = [value if other == source else other.value for other in self.sources]
        return self.mdp.with_rewards(self._earned @ np.array(values))

    @cached_property
    def parts(self) -> dict[str, FloatArray]:
        """`[K]` each: what every transition is paid by each source of reward, by its name.

        >>> from trdlab.gridworld.gridmap import load_map
        >>> list(Gridworld(load_map("ledge")).parts)
        ['coin', 'hazard']
        """
        names = [source.kind for source in self.sources]
        return {
            kind if names.count(kind) == 1 else f"{kind} of {value:g}": value * paid
            for (kind, value), paid in zip(self.sources, self._earned.T, strict=True)
        }

    def is_terminal(self, state: int) -> bool:
        """Whether the episode is over in a state."""
        return self.grid.cell(*self.states[state].place).terminal

    def find_state(self, text: str) -> int:
        """Returns the state that a user names: its number, or `row,column` with least collected.

        A third number says how many have been collected there; of several such states, which
        differ in what was collected, the first is meant.

        Raises:
            InputError: there is no such state.

        >>> from trdlab.gridworld.gridmap import load_map
        >>> world = Gridworld(load_map("drone"))
        >>> world.find_state("0,0"), str(world.states[world.find_state("2,2,2")])
        (1, 'row 2, column 2, 2 collected')
        """
        parts = text.split(",")
        if not 1 <= len(parts) <= 3 or not all(p.strip().isdecimal() for p in parts):
            raise InputError(
                f"The state is '{text}'.", "Give its number, row,column or row,column,collected."
            )
        if len(parts) == 1:
            if len(parts[0]) < 10 and int(text) < len(self.states):
                return int(text)
            raise InputError(
                f"There is no state {text}.", f"States run from 0 to {len(self.states) - 1}."
            )
        *place, count = [int(p) if len(p) < 10 else -1 for p in [*parts, "0"][:3]]
        here = [s for s in self.states if s.place == tuple(place)]
        if not here:
            rows, columns = self.grid.shape
            raise InputError(
                f"The drone can never be at row {parts[0]}, column {parts[1]}.",
                f"The map has rows 0 to {rows - 1} and columns 0 to {columns - 1}; "
                "name a cell it can reach.",
            )
        known = sorted({len(state.collected) for state in here})
        if len(parts) == 3:
            here = [state for state in here if len(state.collected) == count]
        if not here:
            raise InputError(
                f"At row {parts[0]}, column {parts[1]} no state has {parts[2]} collected.",
                f"Say one of {', '.join(map(str, known))}.",
            )
        return self._index[min(here, key=lambda s: (len(s.collected), self._index[s]))]

    @cached_property
    def _earned(self) -> FloatArray:
        """`[K, sources]`: how often each transition is paid by each source."""
        earned = [outcome.earned for row in self._outcomes for outcome in row]
        return np.array(earned, dtype=np.float64).reshape(len(earned), len(self.sources))

    def _growing_states(self) -> Iterator[State]:
        """Yields the states while their successors are being added."""
        done = 0
        while done < len(self.states):
            if len(self.states) > MAX_STATES:
                once = sum(self.grid.legend[s].once for row in self.grid.rows for s in row)
                places = len({state.place for state in self.states})
                raise MapError(
                    f"The map '{self.grid.name}' has more than {MAX_STATES} reachable states "
                    f"({len(self.states)} counted before giving up, on {places} cells; its {once} "
                    f"one-time cells can multiply them by up to 2^{once}).",
                    "Use fewer coins and treasures, or fountains, which pay each time.",
                )
            yield self.states[done]
            done += 1

    def _act(self, state: State, action: int) -> dict[_Outcome, float]:
        if self.grid.cell(*state.place).terminal:
            nothing = (0,) * len(self.sources)
            return {_Outcome(self._index[state], nothing, terminated=True): 1.0}
        outcomes: dict[_Outcome, float] = {}
        slip = self.grid.slip
        for direction, chance in (
            (action, 1.0 - slip),
            *((d, slip / 2) for d in _SIDEWAYS[action]),
        ):
            if chance > 0.0:
                outcome = self._arrive(state, self._path(state.place, direction))
                outcomes[outcome] = outcomes.get(outcome, 0.0) + chance
        return outcomes

    def _path(self, place: Place, direction: int) -> list[Place]:
        """Returns the cells that one step enters in turn: its own move, then the wind's."""
        moves, wind = [direction], self.grid.wind
        if wind is not None:
            along = place[1] if wind.direction in (0, 1) else place[0]
            moves += [wind.direction] * wind.strengths[along]
        path: list[Place] = []
        for move in moves:
            following = self._neighbour(place, move)
            if following != place:
                path.append(following)
            place = following
        return path

    def _neighbour(self, place: Place, direction: int) -> Place:
        """Returns the next cell in a direction, or the same one where the way is barred."""
        following = place[0] + MOVES[direction][0], place[1] + MOVES[direction][1]
        here, there = self.grid.cell(*place), self.grid.cell(*following)
        against = there.arrow is not None and _OPPOSITE[there.arrow] == direction
        barred = there.kind == "wall" or here.arrow not in (None, direction) or against
        return place if barred else following

    def _arrive(self, state: State, path: list[Place]) -> _Outcome:
        place, collected, earned = state.place, state.collected, [0] * len(self.sources)
        if self.grid.step_cost:
            earned[self.sources.index(Source("step", -self.grid.step_cost))] += 1
        terminated = False
        for place in path:
            self._entered.add(place)
            cell = self.grid.cell(*place)
            if place not in collected and _pays(cell):
                earned[self.sources.index(Source(cell.kind, cell.value))] += 1
            if cell.once:
                collected = collected | {place}
            if cell.terminal:
                terminated = True
                break
        following = State(*place, collected)
        if following not in self._index:
            self._index[following] = len(self.states)
            self.states.append(following)
        return _Outcome(self._index[following], tuple(earned), terminated)

    def _check_reachable(self) -> None:
        for row, line in enumerate(self.grid.rows):
            for column, symbol in enumerate(line):
                cell = self.grid.legend[symbol]
                wanted = cell.kind in ("coin", "treasure", "fountain", "exit")
                if wanted and (row, column) not in self._entered:
                    raise MapError(
                        f"The {cell.kind} at row {row}, column {column} of the map "
                        f"'{self.grid.name}' cannot be reached from the start.",
                        "Open a way to it, or remove it.",
                    )
        if self._entered == {self.grid.start}:
            raise MapError(
                f"The start of the map '{self.grid.name}' is walled in.", "Open a way out of it."
            )


def _pays(cell: Cell) -> bool:
    return cell.kind in ("coin", "treasure", "hazard", "fountain", "exit")


def _sources(grid: GridMap) -> list[Source]:
    cells = {symbol: grid.legend[symbol] for row in grid.rows for symbol in row}
    paying = {Source(cell.kind, cell.value) for cell in cells.values() if _pays(cell)}
    step = [Source("step", -grid.step_cost)] if grid.step_cost else []
    return sorted(paying, key=lambda source: (source.kind, source.value)) + step
