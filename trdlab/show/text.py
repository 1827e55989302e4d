"""Documents as text for a terminal: wrapped to its width, nothing cut, nothing padded."""

import shutil
import textwrap
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Any

from rich.text import Text

from trdlab.show.document import Document, document
from trdlab.show.scenes import Scene
from trdlab.show.tables import Row, Table

WIDTH = 80
_LEAST_WIDTH = 24  # of a terminal that says less
_ASCII = str.maketrans({"…": "..", "∞": "inf", "γ": "gamma", "·": "-", "−": "-", "✓": "OK:"})
_GAP = "   "
_MOST_COMPONENTS = 16  # that are told in one row


def text(thing: Any, *, width: int | None = None, details: bool = False) -> Text:
    """Returns what there is to read about a noun of trdlab.

    Args:
        thing: what it is about.
        width: of the page, in letters; by default that of the terminal, 80 where there is none.
        details: whether all is told, or what matters most.
    """
    return Text("\n").join(_lines(document(thing), width or columns(), details=details))


def columns() -> int:
    """Returns the width of the terminal in letters; 80 where there is none, or it says nothing."""
    found = shutil.get_terminal_size((WIDTH, 24)).columns
    return max(_LEAST_WIDTH, found if found > 0 else WIDTH)


def plain_ascii(shown: Text) -> Text:
    """Returns a text that any terminal can print."""
    translated = shown.copy()
    translated.plain = shown.plain.translate(_ASCII).encode("ascii", "replace").decode()
    return translated


def wrapped(line: str, width: int, style: str = "", *, indent: int = 0) -> list[Text]:
    """Returns a paragraph as lines no longer than the page is wide."""
    space = " " * indent
    parts = textwrap.wrap(
        line,
        width,
        initial_indent=space,
        subsequent_indent=space,
        break_on_hyphens=False,
        break_long_words=False,  # a path is to be copied whole
    )
    return [Text(part, style=style) for part in parts] or [Text()]


def table_lines(table: Table, width: int) -> list[Text]:
    """Returns a line per row; where the page is too narrow, the numbers of a row below its name.

    Before that, components in the middle are left out.
    """
    for rows, sides in _layouts(table):
        lines = _aligned(rows, sides)
        if max(map(len, lines)) <= width:
            styles = ["bold", *(table.styles.get(row[0], "") for row in table.rows)]
            return [line for line in map(Text, lines, styles) if line]
    return [*_stacked(table, width)]


def _aligned(rows: Sequence[Row], sides: str) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        _GAP.join(f"{c:{side}{w}}" for c, side, w in zip(row, sides, widths, strict=True)).rstrip()
        for row in rows
    ]


def _layouts(table: Table) -> Iterator[tuple[list[Row], str]]:
    """Yields the rows of a table, its heading first, and the sides of their cells.

    Of components fewer and fewer are shown, and of their labels, at last none.
    """
    count = table.components
    if not count:
        yield [table.heading, *table.rows], table.sides
    least = min(2, count)
    for shown in range(min(_MOST_COMPONENTS, count), least - 1, -1):
        vectors = [f"[{_shortened(row[1 : count + 1], shown)}]" for row in table.rows]
        for labels in (*range(shown, least - 1, -1), 0):
            told = f": {_shortened(table.heading[1 : count + 1], labels)}" if labels else ""
            parts = (f"components{told}", *vectors)
            rows = zip((table.heading, *table.rows), parts, strict=True)
            folded = [(row[0], part, *row[count + 1 :]) for row, part in rows]
            yield folded, f"<<{table.sides[count + 1 :]}"


def _shortened(parts: Row, shown: int) -> str:
    return ", ".join(parts if len(parts) <= shown else (*parts[: shown - 1], "…", parts[-1]))


def _stacked(table: Table, width: int) -> Iterator[Text]:
    """Yields the cells of each row one below the other; those without a heading by its name."""
    for row in table.rows:
        told = [*zip(table.heading[1:], row[1:], strict=True)]
        beside = [row[0], *(cell for head, cell in told if cell and not head)]
        yield from wrapped("  ".join(beside), width, "bold")
        for head, cell in told:
            if cell and head:
                yield from wrapped(f"{head}  {cell}", width, table.styles.get(row[0], ""), indent=2)


def _lines(page: Document, width: int, *, details: bool) -> Iterator[Text]:
    yield from wrapped(page.heading, width, "bold")
    if page.setting:
        yield from wrapped(" · ".join(page.setting), width, "dim")
    if page.scene is not None:
        yield from _scene(page.scene, width)
    yield Text()
    if page.table is not None:
        yield from (*table_lines(page.table, width), Text())
    if details or not page.folded:
        for section in page.sections:
            yield from wrapped(section.heading, width, "bold")
            for sentence in section.sentences:
                yield from wrapped(sentence, width, indent=2)
    else:
        for i, sentence in enumerate(page.answer):
            yield from wrapped(sentence, width, "" if i else "bold")
        if page.more:
            yield from wrapped(page.more, width, "dim")
    if page.check is not None:
        said, is_well = page.check
        yield from (Text(), *wrapped("✓ " * is_well + said, width, "green" if is_well else "red"))


def _scene(scene: Scene, width: int) -> Iterator[Text]:
    """Yields the map, and beside it the legend in as many columns as it needs, or below it."""
    rows, legend = scene.drawing.splitlines(), scene.legend
    if rows:
        height = max(len(rows), 3)
        blocks = [legend[i : i + height] for i in range(0, len(legend), height)]
        cells = [*zip_longest((f"  {row} " for row in rows), *blocks, fillvalue="")]
        lines = _aligned(cells, "<" * len(cells[0]))
        yield Text()
        if max(map(len, lines)) <= width:
            yield from map(Text, lines)
        else:
            yield from (Text(f"  {row}") for row in rows)
            yield from (part for entry in legend for part in wrapped(entry, width, indent=2))
    for note in scene.notes:
        yield from wrapped(note, width, "dim")
