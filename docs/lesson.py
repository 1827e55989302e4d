"""Runs a lesson and turns it into a page: `python docs/lesson.py SCRIPT FOLDER`.

A lesson is a script in `tutorials/`, cut into cells by `# %%` (code) and `# %% [markdown]` (prose
in comments). Its page shows prose, code, what the code printed, the value of a cell's last
expression, and the figures it drew. FOLDER gets the page, `page.md`, and the pictures.
"""

import ast
import io
import re
import sys
import traceback
from collections.abc import Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_MARKER = re.compile(r"^# %%(?P<prose>.*\[markdown\])?.*$")


class LessonError(Exception):
    """A cell raised; the message names the script and the line."""


@dataclass(frozen=True)
class Cell:
    """A piece of a lesson: prose or code, and the line of the script on which it begins."""

    text: str
    line: int
    is_prose: bool


@dataclass(frozen=True)
class Output:
    """What a code cell leaves behind: printed text, a last value as HTML, pictures as SVG."""

    text: str = ""
    html: str = ""
    figures: tuple[bytes, ...] = ()


def lesson_page(script: Path) -> tuple[str, dict[str, bytes]]:
    """Runs a lesson and returns its page in Markdown, and its pictures by file name.

    Raises:
        LessonError: a cell raises; the message names the script and the line.
    """
    import matplotlib as mpl
    from matplotlib import pyplot as plt

    namespace: dict[str, Any] = {"__name__": "__main__", "__file__": str(script)}
    blocks: list[str] = []
    pictures: dict[str, bytes] = {}
    sys.path.insert(0, str(script.parent))
    try:
        with mpl.rc_context():
            plt.style.use("default")  # whatever the user's settings say
            mpl.rcParams["svg.hashsalt"] = "trdlab"  # the same bytes each time
            for cell in split_cells(script.read_text(encoding="utf-8")):
                if cell.is_prose:
                    blocks.append(cell.text)
                    continue
                output = run_cell(cell, namespace, script)
                first = len(pictures) + 1
                names = [f"{script.stem}-{first + i}.svg" for i in range(len(output.figures))]
                pictures |= dict(zip(names, output.figures, strict=True))
                blocks += [f"```python\n{cell.text}\n```", *_shown(output, names)]
    finally:
        sys.path.remove(str(script.parent))
        plt.close("all")
    return "\n\n".join(blocks) + "\n", pictures


def split_cells(source: str) -> Iterator[Cell]:
    """Yields the cells of a script that are not blank; prose comes without its `# `."""
    lines = source.splitlines()
    marks = [(i, bool(m["prose"])) for i, s in enumerate(lines) if (m := _MARKER.match(s))]
    ends = [i for i, _ in marks[1:]] + [len(lines)]
    if marks and marks[0][0] > 0:  # code before the first marker
        marks, ends = [(-1, False), *marks], [marks[0][0], *ends]
    for (start, is_prose), end in zip(marks or [(-1, False)], ends, strict=True):
        body = lines[start + 1 : end]
        while body and not body[0].strip():
            body, start = body[1:], start + 1
        if is_prose:
            body = [line.removeprefix("#").removeprefix(" ") for line in body]
        if text := "\n".join(body).rstrip():
            yield Cell(text, line=start + 2, is_prose=is_prose)


def run_cell(cell: Cell, namespace: dict[str, Any], script: Path) -> Output:
    """Runs a code cell and returns its output.

    Raises:
        LessonError: the cell raises; the message names the script and the line.
    """
    printed = io.StringIO()
    try:
        tree = ast.parse("\n" * (cell.line - 1) + cell.text, filename=str(script))
        value, last = None, tree.body[-1] if tree.body else None
        with redirect_stdout(printed):
            if isinstance(last, ast.Expr):
                tree.body.pop()
            exec(compile(tree, str(script), "exec"), namespace)
            if isinstance(last, ast.Expr):
                expression = compile(ast.Expression(last.value), str(script), "eval")
                value = eval(expression, namespace)
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno for frame in frames if frame.filename == str(script)]
        line = error.lineno if isinstance(error, SyntaxError) else (lines or [cell.line])[-1]
        where = f"{script.parent.name}/{script.name}, line {line}"
        raise LessonError(f"{where}: {type(error).__name__}: {error}") from error
    figures = _take_figures(value)
    text = printed.getvalue()
    if value is None or figures:
        return Output(text, figures=figures)
    if hasattr(value, "_repr_html_"):
        return Output(text, html=value._repr_html_())
    return Output(f"{text}{value!r}\n")


def _take_figures(value: Any) -> tuple[bytes, ...]:
    """Returns the pictures of the figures that pyplot holds, and of a figure given; closes them."""
    from matplotlib import pyplot as plt
    from matplotlib.figure import Figure

    figures = [plt.figure(number) for number in plt.get_fignums()]
    if isinstance(value, Figure) and value not in figures:
        figures.append(value)
    pictures = []
    for figure in figures:
        file = io.BytesIO()
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
        pictures.append(file.getvalue())
        plt.close(figure)
    return tuple(pictures)


def _shown(output: Output, pictures: list[str]) -> Iterator[str]:
    """Yields the Markdown blocks of an output."""
    if output.text.strip():
        lines = [line.rstrip() for line in output.text.splitlines()]
        yield "\n".join(["```{.text .output}", *lines, "```"])
    if output.html:
        yield f'<div class="output">{output.html}</div>'
    for name in pictures:
        yield f"![Drawn by the cell above]({name}){{ .output }}"


def main(script: Path, folder: Path) -> None:
    """Writes a lesson's page and its pictures into a folder, or ends with a line that says why."""
    try:
        page, pictures = lesson_page(script)
    except LessonError as error:
        sys.exit(str(error))
    (folder / "page.md").write_text(page, encoding="utf-8")
    for name, picture in pictures.items():
        (folder / name).write_bytes(picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
