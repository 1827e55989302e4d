"""Documents as text for a terminal: wrapped to its width, nothing cut, nothing padded."""

import shutil
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from rich.text import Text

from trdlab.arrays import FloatArray, same
from trdlab.explanations.moment.moment import Choice, Moment
from trdlab.formatting import amount, decimals_for, decimals_to_tell, number
from trdlab.show.document import Document, document

WIDTH = 80
_LEAST_WIDTH = 24  # of a terminal that says less
_ASCII = str.maketrans({"…": "..", "∞": "inf", "γ": "gamma", "·": "-", "−": "-", "✓": "OK:"})
_GAP = "   "
_MOST_COMPONENTS = 16  # that are told of an action in one row


def text(thing: Any, *, width: int | None = None, details: bool = False) -> Text:
    """Returns what there is to read about a noun of trdlab.

    Args:
        thing: what it is about, or the document itself.
        width: of the page, in letters; by default that of the terminal, 80 where there is none.
        details: whether all is told, or what matters most.
    """
    page = thing if isinstance(thing, Document) else document(thing)
    return Text("\n").join(_lines(page, width or columns(), details=details))


def columns() -> int:
    """Returns the width of the terminal in letters; 80 where there is none, or it says nothing."""
    found = shutil.get_terminal_size((WIDTH, 24)).columns
    return max(_LEAST_WIDTH, found if found > 0 else WIDTH)


def plain_ascii(shown: Text) -> Text:
    """Returns a text that any terminal can print."""
    translated = shown.copy()
    translated.plain = fit(shown.plain, ascii_only=True)
    return translated


def fit(line: str, *, ascii_only: bool) -> str:
    """Returns a line that any terminal can print, if it has to be."""
    return line.translate(_ASCII).encode("ascii", "replace").decode() if ascii_only else line


def _lines(page: Document, width: int, *, details: bool) -> Iterator[Text]:
    yield from wrapped(page.heading, width, "bold")
    if page.setting:
        yield from wrapped(" · ".join(page.setting), width, "dim")
    if page.drawing:
        yield from (Text(), *_drawing(page, width))
    for note in page.notes:
        yield from wrapped(note, width, "dim")
    yield Text()
    if page.choice is not None and not page.choice.moment.is_over:
        yield from (*action_table(page.choice, width), Text())
    if page.grid:
        yield from (*grid_lines(page.grid, width), Text())
    if details or not page.folded:
        for section in page.sections:
            yield from wrapped(section.heading, width, "bold")
            for sentence in section.sentences:
                yield from wrapped(sentence, width, indent=2)
    else:
        for i, sentence in enumerate(page.answer):
            yield from wrapped(sentence, width, "bold" if i == 0 else "")
    if page.check is not None:
        said, is_well = page.check
        yield from (Text(), *wrapped("✓ " * is_well + said, width, "green" if is_well else "red"))


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


def _drawing(page: Document, width: int) -> Iterator[Text]:
    """Yields the map, and beside it the legend in as many columns as it needs, or below it."""
    rows = page.drawing.splitlines()
    room = max(map(len, rows)) + 6
    height = max(len(rows), 3)
    blocks = [page.legend[i : i + height] for i in range(0, len(page.legend), height)]
    widths = [max(map(len, block)) for block in blocks]
    beside = [
        _GAP.join(cell.ljust(size) for cell, size in zip(cells, widths, strict=True))
        for cells in zip_longest(*blocks, fillvalue="")
    ]
    if room + max(map(len, beside), default=0) > width:
        yield from (Text(f"  {row}") for row in rows)
        yield from (part for entry in page.legend for part in wrapped(entry, width, indent=2))
        return
    for row, entry in zip_longest(rows, beside, fillvalue=""):
        yield Text(f"  {row.ljust(room - 6)}    {entry}".rstrip())


def action_table(choice: Choice, width: int = WIDTH) -> list[Text]:
    """Returns a row per action: components, Q, undiscounted total; and the contrast below them.

    There are no totals where none are known. Where a row does not fit, components in the middle are
    left out; where the page is too narrow for that, the numbers of an action stand below its name.
    """
    moment, rows = choice.moment, _rows(choice)
    most = min(_MOST_COMPONENTS, moment.time_axis.num_components)
    for shown in range(most, 1, -1):
        cells = [_cells(row, moment, shown) for row in rows]
        for labels in (*range(shown, 1, -1), 0):
            table = [_heading(moment, labels), *cells]
            widths = [max(map(len, column)) for column in zip(*table, strict=True)]
            if sum(widths) + len(_GAP) * (len(widths) - 1) <= width:
                styles = ["bold", *(row.style for row in rows)]
                lines = (_GAP.join(_aligned(cells, widths)).rstrip() for cells in table)
                return [Text(line, style=style) for line, style in zip(lines, styles, strict=True)]
    return [line for row in rows for line in _stacked(row, moment, width)]


def grid_lines(grid: Sequence[Sequence[str]], width: int) -> list[Text]:
    """Returns a table, its heading first; each row by itself where the page is too narrow."""
    widths = [max(map(len, column)) for column in zip(*grid, strict=True)]
    if sum(widths) + len(_GAP) * (len(widths) - 1) <= width:
        lines = [
            _GAP.join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])])
            for row in grid
        ]
        return [Text(line, style="" if i else "bold") for i, line in enumerate(lines)]
    heading, *rows = grid
    return [
        line
        for name, *cells in rows
        for line in (
            *wrapped(name, width, "bold"),
            *(
                part
                for of, cell in zip(heading[1:], cells, strict=True)
                for part in wrapped(f"{of}  {cell}", width, indent=2)
            ),
        )
    ]


def table_cells(choice: Choice) -> list[list[str]]:
    """Returns the cells of the table of actions, its heading first."""
    moment, shown = choice.moment, choice.time_axis.num_components
    return [_heading(moment, shown), *(_cells(row, moment, shown) for row in _rows(choice))]


@dataclass(frozen=True)
class _Row:
    """What a row of the table shows of an action, or of the difference of two."""

    name: str
    components: FloatArray
    q_value: float
    total: float
    note: str
    style: str
    decimals: int


def _rows(choice: Choice) -> list[_Row]:
    moment, action, foil = choice.moment, choice.action, choice.foil
    q_decimals = decimals_to_tell(moment.q_values)
    decimals = max(decimals_for(moment.decomposition.components.ravel()), q_decimals)
    rows = [
        _Row(
            name,
            moment.components(name),
            moment.q_value(name),
            moment.total(name),
            _note(moment, i),
            "" if name in (action, foil) else "dim",
            decimals,
        )
        for i, name in enumerate(moment.action_names)
    ]
    if foil is not None:
        gap = moment.difference(action, foil)
        apart = moment.q_value(action) - moment.q_value(foil)
        q_gap = 0.0 if same(moment.q_value(action), moment.q_value(foil)) else apart
        total = moment.total(action) - moment.total(foil)
        decimals = max(decimals, decimals_for(gap), decimals_for([q_gap]))
        rows.append(_Row(f"{action} − {foil}", gap, q_gap, total, "", "italic", decimals))
    return rows


def _heading(moment: Moment, shown: int) -> list[str]:
    """Returns the cells of the heading; of the labels of its components only so many are shown."""
    labels = f": {', '.join(_shortened(moment.time_axis.labels, shown))}" if shown else ""
    return ["action", f"components{labels}", "Q", *["total"] * (moment.totals is not None), ""]


def _cells(row: _Row, moment: Moment, shown: int) -> list[str]:
    """Returns the cells of a row; of its components only so many are shown."""
    parts = _shortened([number(float(c), row.decimals) for c in row.components], shown)
    return [
        row.name,
        f"[{', '.join(parts)}]",
        number(row.q_value, row.decimals),
        *[amount(row.total)] * (moment.totals is not None),
        row.note,
    ]


def _stacked(row: _Row, moment: Moment, width: int) -> Iterator[Text]:
    """Yields the numbers of an action one below the other."""
    yield from wrapped(f"{row.name}  {row.note}".rstrip(), width, "bold")
    told = [*zip(moment.time_axis.labels, row.components.tolist(), strict=True), ("Q", row.q_value)]
    for label, value in told:
        yield from wrapped(f"{label}  {number(value, row.decimals)}", width, row.style, indent=2)
    if moment.totals is not None:
        yield from wrapped(f"total  {amount(row.total)}", width, row.style, indent=2)


def _shortened(parts: Sequence[str], shown: int) -> Sequence[str]:
    return parts if len(parts) <= shown else (*parts[: shown - 1], "…", parts[-1])


def _aligned(cells: Sequence[str], widths: Sequence[int]) -> list[str]:
    """Returns cells of one width each: names and vectors to the left, numbers to the right."""
    last = len(cells) - 1
    return [
        cell.rjust(width) if 1 < i < last else cell.ljust(width)
        for i, (cell, width) in enumerate(zip(cells, widths, strict=True))
    ]


def _note(moment: Moment, action: int) -> str:
    chance = 0.0 if moment.policy is None else float(moment.policy[action])
    if chance > 0.0:
        return "chosen" if chance > 0.9995 else f"chosen {100 * chance:.0f} %"
    stays = 0.0 if moment.stays is None else moment.stays[action]
    return "stays here" if stays >= 1.0 - 1e-9 else "mostly stays" if stays > 0.5 else ""
