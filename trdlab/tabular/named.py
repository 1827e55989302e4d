"""A model in words: names for its actions, coordinates for its states, and a map as text."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from trdlab.arrays import BoolArray, FloatArray
from trdlab.errors import InputError
from trdlab.tabular.mdp import MDP
from trdlab.tabular.reach import reachable

AGENT = "@"


@dataclass(frozen=True)
class Coordinate:
    """One of the numbers that the index of a state is made of.

    Args:
        name: what it says, such as `row`.
        size: it runs from 0 to size − 1.
        values: what each of its values is called, if they have names.
    """

    name: str
    size: int
    values: tuple[str, ...] = ()

    def say(self, value: int) -> str:
        """Returns a value in words.

        >>> Coordinate("row", 4).say(2), Coordinate("goal", 2, ("at R", "at G")).say(1)
        ('row 2', 'goal at G')
        """
        return f"{self.name} {self.values[value] if self.values else value}"

    def read(self, text: str) -> int:
        """Returns the value that a user names: its number, or the last word of its name.

        Raises:
            InputError: there is no such value.
        """
        words = [value.split()[-1].lower() for value in self.values]
        if text.lower() in words:
            return words.index(text.lower())
        if text.isdecimal() and len(text) < 10 and int(text) < self.size:
            return int(text)
        known = [f"{i} ({value})" for i, value in enumerate(self.values)]
        raise InputError(
            f"There is no {self.name} '{text}'.",
            f"Known: {', '.join(known)}." if known else f"It runs from 0 to {self.size - 1}.",
        )


@dataclass(frozen=True, eq=False)
class TabularWorld:
    """An environment's model, and how to speak of it.

    Args:
        mdp: the model.
        name: what it is called.
        action_names: A names.
        coordinates: what the index of a state is made of, the last one running fastest; empty
            where it has no meaning.
        grid: the lines of its map without the agent; empty where there is none.
        origin: the line and character of row 0, column 0 in `grid`.
        stride: the lines and characters from one row or column to the next.
        legend: what the symbols of the map mean.
        arguments: what the environment was made with, defaults included.
        starts: `[S]`, how likely episodes begin in each state; None if only in `mdp.start`.
        time_limit: the steps after which episodes are cut off, which the model does not know.
    """

    mdp: MDP
    name: str
    action_names: tuple[str, ...]
    coordinates: tuple[Coordinate, ...] = ()
    grid: tuple[str, ...] = ()
    origin: tuple[int, int] = (0, 0)
    stride: tuple[int, int] = (1, 1)
    legend: tuple[str, ...] = ()
    arguments: Mapping[str, Any] = field(default_factory=dict)
    starts: FloatArray | None = None
    time_limit: int | None = None

    def place(self, state: int) -> tuple[int, ...]:
        """Returns the coordinates of a state, none where it has none."""
        sizes = tuple(coordinate.size for coordinate in self.coordinates)
        return tuple(int(i) for i in np.unravel_index(state, sizes)) if sizes else ()

    def describe(self, state: int) -> str:
        """Returns a state in words, such as `row 2, column 1`; empty where it has no meaning."""
        place = self.place(state)
        return ", ".join(c.say(i) for c, i in zip(self.coordinates, place, strict=True))

    def find_state(self, text: str) -> int:
        """Returns the state that a user names: its number, or its coordinates.

        Raises:
            InputError: there is no such state.
        """
        names = ",".join(coordinate.name for coordinate in self.coordinates)
        parts = [part.strip() for part in text.split(",")]
        if len(parts) == len(self.coordinates) > 1:
            values = [c.read(part) for c, part in zip(self.coordinates, parts, strict=True)]
            return int(np.ravel_multi_index(values, [c.size for c in self.coordinates]))
        if len(parts) != 1 or not parts[0].isdecimal():
            cure = f"Give its number, or {names}." if names else "Give its number."
            raise InputError(f"The state is '{text}'.", cure)
        if len(parts[0]) < 10 and int(parts[0]) < self.mdp.num_states:
            return int(parts[0])
        raise InputError(
            f"There is no state {parts[0]}.", f"States run from 0 to {self.mdp.num_states - 1}."
        )

    def draw(self, state: int) -> str:
        """Returns the map with the agent as `@`; empty where there is none."""
        if not self.grid:
            return ""
        lines = [list(line) for line in self.grid]
        row, column = self.place(state)[:2]
        line, character = (
            o + step * i for o, step, i in zip(self.origin, self.stride, (row, column), strict=True)
        )
        lines[line][character] = AGENT
        return "\n".join(map("".join, lines))

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done to the model before it was solved, in sentences."""
        rows = self.mdp.rounded_rows
        if not rows:
            return ()
        return (
            f"Probabilities come in single precision: {rows} "
            f"{'row was' if rows == 1 else 'rows were'} divided by their sum.",
        )

    @cached_property
    def visited(self) -> BoolArray:
        """`[S]`: the states in which an episode can be that is not over."""
        starts = np.zeros(self.mdp.num_states) if self.starts is None else self.starts
        begin = np.arange(self.mdp.num_states) == self.mdp.start
        return reachable(self.mdp, (starts > 0.0) | begin)
