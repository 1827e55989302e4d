"""Makes the notebooks of the lessons: `python docs/notebooks.py`.

A lesson is a script in `tutorials/`, cut into cells by `# %%` (code), `# %% folded` (code to be
opened) and `# %% [markdown]` (prose in comments). Its notebook has the same cells. Before them it
installs trdlab, and below each exercise it holds the worked solution, folded away. The notebooks go
to `tutorials/notebooks/`.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import nbformat
from nbformat import v4

import trdlab
from trdlab.teach.checking import EXERCISES

TUTORIALS = Path(__file__).parents[1] / "tutorials"
NOTEBOOKS = TUTORIALS / "notebooks"

_MARKER = re.compile(r"^# %%(?P<prose>.*\[markdown\])?(?P<folded> folded$)?.*$")
_INSTALL = """\
# trdlab is not on PyPI yet. In its source, `pip wheel --no-deps .` makes the file named here.
# Put it beside this notebook. Where trdlab is installed already, leave this cell out.
%pip install --quiet "./trdlab-{version}-py3-none-any.whl{extra}\""""
_FOLDED = "<details>\n<summary>Solution</summary>\n\n{}\n\n</details>"


@dataclass(frozen=True)
class Cell:
    """A piece of a lesson: prose or code, and the line of the script on which it begins."""

    text: str
    line: int
    is_prose: bool
    is_folded: bool = False

    @property
    def exercise(self) -> str | None:
        """The name of the exercise that the cell checks."""
        found = None if self.is_prose else re.search(r'^check\("([\d.]+)"', self.text, re.MULTILINE)
        return found[1] if found else None


def lessons(folder: Path = TUTORIALS) -> list[Path]:
    """Returns the scripts of a folder, in their order."""
    return sorted(folder.glob("[0-9]*.py"))


def split_cells(source: str) -> Iterator[Cell]:
    """Yields the cells of a script that are not blank; prose comes without its `# `."""
    lines = source.splitlines()
    marks = [
        (i, bool(m["prose"]), bool(m["folded"]))
        for i, s in enumerate(lines)
        if (m := _MARKER.match(s))
    ]
    if not marks or marks[0][0] > 0:  # code before the first marker
        marks = [(-1, False, False), *marks]
    ends = [*(i for i, *_ in marks[1:]), len(lines)]
    for (start, is_prose, is_folded), end in zip(marks, ends, strict=True):
        body = lines[start + 1 : end]
        while body and not body[0].strip():
            body, start = body[1:], start + 1
        if is_prose:
            body = [line.removeprefix("#").removeprefix(" ") for line in body]
        if text := "\n".join(body).rstrip():
            yield Cell(text, line=start + 2, is_prose=is_prose, is_folded=is_folded)


def notebook(source: str) -> nbformat.NotebookNode:
    """Returns the notebook of a script, the same to the byte each time."""
    extra = "[interop]" if "stable_baselines3" in source else ""
    cells = [v4.new_code_cell(_INSTALL.format(version=trdlab.__version__, extra=extra))]
    for cell in split_cells(source):
        if cell.is_prose:
            cells.append(v4.new_markdown_cell(_linked(cell.text)))
        else:
            hidden = {"jupyter": {"source_hidden": True}} if cell.is_folded else {}
            cells.append(v4.new_code_cell(cell.text, metadata=hidden))
        if cell.exercise:
            cells.append(v4.new_markdown_cell(_FOLDED.format(EXERCISES[cell.exercise].solution)))
    for cell, number in zip(cells, count()):
        cell["id"] = f"cell-{number}"
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return v4.new_notebook(cells=cells, metadata={"kernelspec": kernel})


def _linked(prose: str) -> str:
    """Returns prose that leads to the other notebooks; what it says of other pages has no link."""
    prose = re.sub(r"\]\((\d\d_\w+)\.md", r"](\1.ipynb", prose)
    return re.sub(r"\[([^\]]+)\]\(\.\.?/[^)]*\)", r"*\1*", prose)


def main() -> None:
    """Writes the notebook of each lesson, and removes what belongs to none."""
    NOTEBOOKS.mkdir(exist_ok=True)
    made = {NOTEBOOKS / f"{script.stem}.ipynb": script for script in lessons()}
    for path, script in made.items():
        path.write_text(written(script), encoding="utf-8")
    for path in set(NOTEBOOKS.glob("*.ipynb")) - set(made):
        path.unlink()


def written(script: Path) -> str:
    """Returns the file that holds the notebook of a script."""
    return nbformat.writes(notebook(script.read_text(encoding="utf-8"))) + "\n"


if __name__ == "__main__":
    main()
