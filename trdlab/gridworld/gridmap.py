"""Reading gridworld maps: a header of `key: value` lines, a line `---`, then the map itself."""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple

from trdlab.errors import MapError, closest

Kind = Literal["floor", "wall", "one-way", "coin", "treasure", "hazard", "fountain", "exit"]

ACTIONS = ("up", "down", "left", "right")
MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1))
MAX_CELLS = 10_000
MAX_WIND = 9
_MAX_CHARACTERS = 100_000
_FOLDER = Path(__file__).parent / "maps"

_DEFAULT_VALUES = {"coin": 1.0, "treasure": 4.0, "hazard": -1.0, "fountain": 1.0, "exit": 0.0}


class Cell(NamedTuple):
    """What a symbol on the map means.

    Coins and treasures pay once, hazards and fountains each time they are entered. A terminal
    cell ends the episode on entering it. A one-way cell is left only along its arrow and never
    entered against it.
    """

    kind: Kind
    value: float = 0.0
    terminal: bool = False
    arrow: int | None = None  # an index into ACTIONS

    @property
    def once(self) -> bool:
        """Whether it pays only the first time."""
        return self.kind in ("coin", "treasure")


LEGEND: dict[str, Cell] = {
    "S": Cell("floor"),
    ".": Cell("floor"),
    "#": Cell("wall"),
    "c": Cell("coin", 1.0),
    "C": Cell("coin", 1.0, terminal=True),
    "t": Cell("treasure", 4.0),
    "T": Cell("treasure", 4.0, terminal=True),
    "h": Cell("hazard", -1.0),
    "H": Cell("hazard", -1.0, terminal=True),
    "f": Cell("fountain", 1.0),
    "E": Cell("exit", 0.0, terminal=True),
    **{symbol: Cell("one-way", arrow=i) for i, symbol in enumerate("^v<>")},
}


class Wind(NamedTuple):
    """Pushes the drone after each of its moves, by the strength at the column (or row) it left.

    Args:
        direction: an index into ACTIONS.
        strengths: cells per step, for each column if it blows up or down, else for each row.
    """

    direction: int
    strengths: tuple[int, ...]


@dataclass(frozen=True)
class GridMap:
    """A map as it is written, with the rules that its header sets.

    Args:
        name: how it is called, for example `drone`.
        rows: the lines of the map, all of one length.
        title: one line on what it teaches.
        legend: the meaning of each symbol.
        step_cost: what each step costs, in reward.
        slip: the probability of moving sideways instead, half to each side.
        wind: what pushes the drone, if anything.
    """

    name: str
    rows: tuple[str, ...]
    title: str = ""
    legend: dict[str, Cell] = field(default_factory=lambda: dict(LEGEND))
    step_cost: float = 0.0
    slip: float = 0.0
    wind: Wind | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.rows), len(self.rows[0])

    @property
    def start(self) -> tuple[int, int]:
        """The cell marked S."""
        row = next(i for i, line in enumerate(self.rows) if "S" in line)
        return row, self.rows[row].index("S")

    def cell(self, row: int, column: int) -> Cell:
        """Returns what is at a row and column, counted from 0; outside the map there is wall."""
        rows, columns = self.shape
        if 0 <= row < rows and 0 <= column < columns:
            return self.legend[self.rows[row][column]]
        return LEGEND["#"]

    def changed(self, *, slip: float | None = None, treasure: float | None = None) -> "GridMap":
        """Returns the map with another slip, or each `treasure` worth another value."""
        grid = self if slip is None else self.with_slip(slip)
        return grid if treasure is None else grid.with_value("treasure", treasure)

    def with_slip(self, slip: float) -> "GridMap":
        """Returns the map with another slip probability."""
        return replace(self, slip=_probability("slip", slip))

    def with_value(self, kind: str, value: float) -> "GridMap":
        """Returns the map with another value for every cell of one kind, such as `treasure`.

        Raises:
            MapError: the map has no such cell, or the value is not finite.
        """
        present = {self.legend[symbol].kind for row in self.rows for symbol in row}
        if kind not in present & set(_DEFAULT_VALUES):
            raise MapError(
                f"The map '{self.name}' has no {kind}.",
                closest(kind, present & set(_DEFAULT_VALUES))
                if present & set(_DEFAULT_VALUES)
                else "",
            )
        value = _finite(kind, value)
        legend = {
            symbol: cell._replace(value=value) if cell.kind == kind else cell
            for symbol, cell in self.legend.items()
        }
        return replace(self, legend=legend)


def map_names() -> tuple[str, ...]:
    """Returns the names of the built-in maps, the paper's first."""
    found = sorted(path.stem for path in _FOLDER.glob("*.txt"))
    return ("drone", *(name for name in found if name != "drone"))


def map_text(name: str) -> str:
    """Returns a built-in map as it is written."""
    return (_FOLDER / f"{name}.txt").read_text(encoding="utf-8")


def load_map(name_or_file: str | Path) -> GridMap:
    r"""Returns a built-in map by its name, or reads one from a file: `name_or_file`.

    Raises:
        MapError: there is no such map or file, or it cannot be read.

    >>> print("\n".join(load_map("drone").rows))
    >...T
    S####
    >cccC
    """
    text = str(name_or_file)
    if text in map_names():
        return parse_map(map_text(text), name=text)
    path = Path(text)
    try:
        with path.open(encoding="utf-8-sig") as file:
            content = file.read(_MAX_CHARACTERS + 1)
    except UnicodeDecodeError as error:
        cause = f"'{text}' is no map: it is not UTF-8 text, as maps are."
        raise MapError(cause, "For a run, name its folder; save a map as UTF-8.") from error
    except (OSError, ValueError) as error:
        if not path.suffix and len(path.parts) == 1 and isinstance(error, FileNotFoundError):
            raise MapError(
                f"There is no map '{text}'.",
                closest(text, map_names()),
            ) from error
        reason = getattr(error, "strerror", None) or error
        raise MapError(
            f"The map file '{text}' cannot be read: {reason}.",
            "Give the path of a text file, or the name of a built-in map.",
        ) from error
    if len(content) > _MAX_CHARACTERS:
        raise MapError(
            f"The map file '{text}' has more than {_MAX_CHARACTERS} characters.",
            f"A map may have {MAX_CELLS} cells.",
        )
    return parse_map(content, name=path.stem)


def parse_map(text: str, name: str = "map") -> GridMap:
    r"""Reads a map from text.

    The header may set `title`, `step_cost`, `slip`, `wind` (a direction and a strength per column
    or row, such as `up 0 0 1 1`), and symbols of its own (`X = coin 5 terminal`).

    Raises:
        MapError: the map is empty, ragged, too large, without exactly one start, or has an
            unknown symbol or header line; the message names the line and the cure.

    >>> parse_map("slip: 0.1\nX = coin 5 terminal\n---\nS.X").cell(0, 2).value
    5.0
    """
    lines = [line.rstrip() for line in text.splitlines()]
    head, body = _split(lines)
    grid = _with_header(GridMap(name, ()), head)
    rows = _trimmed(body)
    if not rows:
        raise MapError(f"The map '{name}' is empty.", "Draw at least a start S and a neighbour.")
    lengths = [len(row) for row in rows]
    if len(rows) * max(lengths) > MAX_CELLS:
        raise MapError(
            f"The map '{name}' has {len(rows)} rows of up to {max(lengths)} cells.",
            f"A map may have {MAX_CELLS} cells.",
        )
    for i, row in enumerate(rows):
        if len(row) != lengths[0]:
            raise MapError(
                f"Row {i} of the map '{name}' has {len(row)} cells, row 0 has {lengths[0]}.",
                "Make all rows equally long; fill with '#' (wall) or '.' (floor).",
            )
        for j, symbol in enumerate(row):
            if symbol not in grid.legend:
                raise MapError(
                    f"Unknown symbol {symbol!r} at row {i}, column {j} of the map '{name}'.",
                    f"Known symbols: {' '.join(grid.legend)}. "
                    f"Define more in the header: {symbol} = coin 5",
                )
    starts = sum(row.count("S") for row in rows)
    if starts != 1:
        raise MapError(
            f"The map '{name}' has {starts or 'no'} start{'s' if starts else ''}.",
            "Mark exactly one cell with S.",
        )
    grid = replace(grid, rows=tuple(rows))
    _check_wind(grid)
    return grid


def _split(lines: list[str]) -> tuple[list[str], list[str]]:
    if "---" in lines:
        cut = lines.index("---")
        return lines[:cut], lines[cut + 1 :]
    return [], lines


def _trimmed(lines: list[str]) -> list[str]:
    filled = [i for i, line in enumerate(lines) if line]
    return lines[filled[0] : filled[-1] + 1] if filled else []


def _with_header(grid: GridMap, lines: list[str]) -> GridMap:
    legend, seen = dict(grid.legend), set()
    for line in filter(None, map(str.strip, lines)):
        if line[1:].lstrip().startswith("="):
            symbol, meaning = line[0], line[1:].lstrip()[1:].split()
            if symbol in LEGEND and LEGEND[symbol].kind in ("floor", "wall", "one-way"):
                raise MapError(f"The symbol '{symbol}' has a fixed meaning.", "Choose another one.")
            if symbol in seen:
                raise MapError(f"The header defines '{symbol}' twice.", "Keep one of the lines.")
            seen.add(symbol)
            legend[symbol] = _parse_cell(symbol, meaning)
            continue
        key, colon, value = (part.strip() for part in line.partition(":"))
        known = ("title", "step_cost", "slip", "wind")
        if not colon or key not in known:
            raise MapError(
                f"Cannot read the header line '{line}'.",
                f"{closest(key, known)} A symbol is defined as: X = coin 5 terminal",
            )
        if key in seen:
            raise MapError(f"The header sets {key} twice.", "Keep one of the lines.")
        seen.add(key)
        if key == "title":
            grid = replace(grid, title=value)
        elif key == "step_cost":
            grid = replace(grid, step_cost=_finite(key, value))
        elif key == "slip":
            grid = replace(grid, slip=_probability(key, value))
        else:
            grid = replace(grid, wind=_parse_wind(value))
    return replace(grid, legend=legend)


def _parse_cell(symbol: str, words: list[str]) -> Cell:
    terminal = "terminal" in words
    rest = [word for word in words if word != "terminal"]
    if not rest or rest[0] not in _DEFAULT_VALUES or len(rest) > 2:
        raise MapError(
            f"Cannot read the symbol '{symbol} = {' '.join(words)}'.",
            f"Write a kind ({', '.join(_DEFAULT_VALUES)}), a value, and 'terminal' where it ends "
            "the episode.",
        )
    kind = rest[0]
    value = _finite(kind, rest[1]) if len(rest) == 2 else _DEFAULT_VALUES[kind]
    return Cell(kind, value, terminal or kind == "exit")  # type: ignore[arg-type]


def _parse_wind(text: str) -> Wind:
    direction, *strengths = text.split() or [""]
    if direction not in ACTIONS:
        raise MapError(f"The wind blows '{direction}'.", closest(direction, ACTIONS))
    if not all(len(s) < 9 and s.isdecimal() and int(s) <= MAX_WIND for s in strengths):
        raise MapError(
            f"Cannot read the wind strengths '{' '.join(strengths)}'.",
            f"Write a whole number from 0 to {MAX_WIND} for each column (or row).",
        )
    return Wind(ACTIONS.index(direction), tuple(map(int, strengths)))


def _check_wind(grid: GridMap) -> None:
    if grid.wind is None:
        return
    vertical = grid.wind.direction in (0, 1)
    needed = grid.shape[1] if vertical else grid.shape[0]
    if len(grid.wind.strengths) != needed:
        raise MapError(
            f"The wind has {len(grid.wind.strengths)} strengths.",
            f"Blowing {ACTIONS[grid.wind.direction]} it needs one for each of the {needed} "
            f"{'columns' if vertical else 'rows'}.",
        )


def _finite(name: str, value: str | float) -> float:
    try:
        result = float(value)
    except ValueError:
        result = math.nan
    if not math.isfinite(result):
        raise MapError(f"The value of {name} is '{value}'.", "It must be a finite number.")
    return result


def _probability(name: str, value: str | float) -> float:
    result = _finite(name, value)
    if not 0.0 <= result <= 1.0:
        raise MapError(f"The {name} probability is {value}.", "It must lie between 0 and 1.")
    return result
