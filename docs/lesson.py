"""Runs the notebooks of the lessons, and turns what came of it into pages.

Tests and documentation take the same run: it is kept in `.cache/docs/`, and is made again when the
lesson or the package has changed. A page shows prose, code, what the code printed, the value of a
cell's last expression, the figures it drew, and the solutions of the exercises.
"""

import logging
import os
import re
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import indent
from time import perf_counter

import nbformat
from kept import Files, fingerprint, made
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, DeadKernelError
from nbformat import NotebookNode, v4
from notebooks import Cell, notebook, split_cells

import trdlab
from trdlab.teach.checking import EXERCISES

_DOCS = Path(__file__).parent
_PACKAGE = Path(trdlab.__file__).parent
_ENVIRONMENT = {
    "NO_COLOR": "1",
    "COLUMNS": "80",
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",
    "OMP_NUM_THREADS": "1",  # lessons share the cores
    "OPENBLAS_NUM_THREADS": "1",
}
_SETUP = """\
%matplotlib inline
%config InlineBackend.figure_formats = ["svg"]
undated = {"Date": None, "Creator": None}
%config InlineBackend.print_figure_kwargs = {"bbox_inches": None, "metadata": undated}
import matplotlib, warnings
matplotlib.style.use("default")  # whatever the user's settings say
matplotlib.rcParams["svg.hashsalt"] = "trdlab"  # the same bytes each time
warnings.simplefilter("error")
warnings.filterwarnings("ignore", module="ipykernel")  # which warns while it ends
del matplotlib, undated, warnings"""
_QUIET = ["--Application.log_level=ERROR"]  # of the kernel
_BOX = re.compile(r"^> \*\*(The formula|An open question)[^*]*\*\*((?:.*\n> ?)*.*)", re.MULTILINE)
_KINDS = {"The formula": "abstract", "An open question": "question"}

_log = logging.getLogger("mkdocs.hooks.trdlab")


class LessonError(Exception):
    """A cell raised; the message names the script and the line."""


def lesson_run(script: Path, cache: Path) -> NotebookNode:
    """Returns the notebook of a lesson with its outputs, run if it has to be.

    The cell that installs trdlab is left out.

    Raises:
        LessonError: a cell raises; the message names the script and the line.
    """

    def hashed() -> str:
        maker = [_DOCS / "lesson.py", _DOCS / "notebooks.py"]
        return fingerprint(script, *maker, _PACKAGE)

    def make() -> Files:
        _log.info("Lesson %s: running", script.stem)
        begun = perf_counter()
        ran = run(script)
        _log.info("Lesson %s: done in %.0f s", script.stem, perf_counter() - begun)
        return {"lesson.ipynb": nbformat.writes(ran).encode()}

    return nbformat.reads(made(cache, script.stem, hashed, make)["lesson.ipynb"], as_version=4)


def run(script: Path) -> NotebookNode:
    """Runs the notebook of a lesson in a folder of its own, warnings being errors.

    Raises:
        LessonError: a cell raises, or leaves a file behind; the message names the script.
    """
    source = script.read_text(encoding="utf-8")
    book = notebook(source)
    book.cells[0] = v4.new_code_cell(_SETUP)  # in place of the cell that installs trdlab
    where = f"{script.parent.name}/{script.name}"
    with TemporaryDirectory() as folder, TemporaryDirectory() as settings:
        client = NotebookClient(
            book,
            timeout=None,
            record_timing=False,
            extra_arguments=_QUIET,
            resources={"metadata": {"path": folder}},
        )
        try:
            client.execute(env=os.environ | _ENVIRONMENT | {"IPYTHONDIR": settings})
        except CellExecutionError as error:
            line = _line(
                error.traceback, [cell for cell in split_cells(source) if not cell.is_prose]
            )
            said = f"{where}, line {line}: {error.ename}: {error.evalue}"
            raise LessonError(said) from error
        except DeadKernelError as error:
            raise LessonError(f"{where}: the kernel died") from error
        if left := sorted(path.name for path in Path(folder).iterdir()):
            raise LessonError(f"{where} leaves {', '.join(left)} behind")
    del book.cells[0]
    return book


def _line(told: str, code: list[Cell]) -> int:
    """Returns the line of the script that a traceback of IPython speaks of."""
    plain = re.sub(r"\x1b\[[\d;]*m", "", told)
    number, line = re.findall(r"Cell In\[(\d+)\], line (\d+)", plain)[-1]
    return code[int(number) - 2].line + int(line) - 1  # the first one prepares


def lesson_page(script: Path, ran: NotebookNode) -> Files:
    """Returns the page of a lesson, `page.md`, and its pictures by file name."""
    outputs = iter([cell.outputs for cell in ran.cells if cell.cell_type == "code"])
    blocks: list[str] = []
    pictures: Files = {}
    for cell in split_cells(script.read_text(encoding="utf-8")):
        if cell.is_prose:
            blocks.append(_BOX.sub(_admonition, cell.text))
            if len(blocks) == 1:
                blocks.append(_downloads(script.stem))
            continue
        shown = next(outputs)
        first = len(pictures) + 1
        drawn = {f"{script.stem}-{i}.svg": svg for i, svg in enumerate(figures(shown), first)}
        pictures |= {name: svg.encode() for name, svg in drawn.items()}
        code = f"```python\n{cell.text}\n```"
        blocks.append(_folded("example", "Code", code) if cell.is_folded else code)
        blocks += _shown(shown, list(drawn))
        if cell.exercise:
            blocks.append(_folded("success", "Solution", EXERCISES[cell.exercise].solution))
    return {"page.md": ("\n\n".join(blocks) + "\n").encode(), **pictures}


def printed(outputs: list[NotebookNode]) -> str:
    """Returns what a cell printed."""
    return "".join(of.text for of in outputs if of.get("name") == "stdout")


def figures(outputs: list[NotebookNode]) -> list[str]:
    """Returns the figures that a cell shows, as SVG."""
    return [of.data["image/svg+xml"] for of in outputs if "image/svg+xml" in of.get("data", ())]


def _shown(outputs: list[NotebookNode], pictures: list[str]) -> Iterator[str]:
    """Yields the Markdown blocks of what came of a cell."""
    values = [of.data for of in outputs if of.output_type == "execute_result"]
    value = {"image/svg+xml": ""} if pictures or not values else values[0]
    text = printed(outputs)
    if not value.keys() & {"image/svg+xml", "text/html", "text/markdown"}:
        text += value["text/plain"]
    if text.strip():
        lines = [line.rstrip() for line in text.splitlines()]
        yield "\n".join(["```{.text .output}", *lines, "```"])
    if "text/html" in value:
        yield f'<div class="output">{value["text/html"]}</div>'
    if "text/markdown" in value:
        yield f'<div class="told" markdown>\n\n{value["text/markdown"]}\n\n</div>'
    for name in pictures:
        yield f"![Drawn by the cell above]({name}){{ .output }}"


def _folded(kind: str, title: str, text: str) -> str:
    return f'??? {kind} "{title}"\n\n{indent(text, "    ")}'


def _admonition(box: re.Match[str]) -> str:
    """Returns a quotation with a title as an admonition."""
    text = re.sub(r"^> ?", "", box[2], flags=re.MULTILINE).strip()
    return f'!!! {_KINDS[box[1]]} "{box[1]}"\n\n{indent(text, "    ")}'


def _downloads(stem: str) -> str:
    return (
        f"Do it yourself: [notebook]({stem}.ipynb){{ download }} or "
        f"[script]({stem}.py){{ download }}."
    )
