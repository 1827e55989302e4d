"""The machinery of the lessons: scripts become notebooks, and runs of these become pages."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("nbclient")
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(Path(__file__).parents[1] / "docs")
    import lesson as lessons
    import notebooks

EVERYTHING = r"""# %% [markdown]
# # Try
#
# Of [lesson 2](02_derive_it.md), and [errata C1](../errata.md#c1).

# %%
import sys

print("a  ")
print("b", file=sys.stderr)
x = 20

# %% folded
x + 1

# %%
class Told:
    def _repr_markdown_(self):
        return "| a |\n|---|\n| b |"


Told()

# %%
[x].sort()

# %%
from trdlab.decomposition import RewardDecomposition, TimeAxis

RewardDecomposition([1, 2], TimeAxis(0.5, 1))

# %%
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

print("drawn")
plt.subplots(figsize=(1, 1))
_ = plt.subplots(figsize=(2, 1))

# %%
figure = Figure(figsize=(3, 1))
figure.subplots()
figure

# %% [markdown]
# > **The formula.** It is
# >
# > $$x=1$$

# %%
from trdlab.teach import check

answer_1 = None  # replace with a number
check("1.1", answer_1)
"""
PAGE = r"""# Try

Of [lesson 2](02_derive_it.md), and [errata C1](../errata.md#c1).

Do it yourself: [notebook](03_try.ipynb){ download } or [script](03_try.py){ download }.

```python
import sys

print("a  ")
print("b", file=sys.stderr)
x = 20
```

```{.text .output}
a
```

??? example "Code"

    ```python
    x + 1
    ```

```{.text .output}
21
```

```python
class Told:
    def _repr_markdown_(self):
        return "| a |\n|---|\n| b |"


Told()
```

<div class="told" markdown>

| a |
|---|
| b |

</div>

```python
[x].sort()
```

```python
from trdlab.decomposition import RewardDecomposition, TimeAxis

RewardDecomposition([1, 2], TimeAxis(0.5, 1))
```

<div class="output"><table>…</table></div>

```python
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

print("drawn")
plt.subplots(figsize=(1, 1))
_ = plt.subplots(figsize=(2, 1))
```

```{.text .output}
drawn
```

![Drawn by the cell above](03_try-1.svg){ .output }

![Drawn by the cell above](03_try-2.svg){ .output }

```python
figure = Figure(figsize=(3, 1))
figure.subplots()
figure
```

![Drawn by the cell above](03_try-3.svg){ .output }

!!! abstract "The formula"

    It is

    $$x=1$$

```python
from trdlab.teach import check

answer_1 = None  # replace with a number
check("1.1", answer_1)
```

```{.text .output}
Exercise 1.1: not answered yet. Replace None, then run this cell again.
```

??? success "Solution"

    Component 2 is …
"""


@pytest.fixture
def script(tmp_path: Path) -> Callable[[str], Path]:
    """Returns a function that writes a lesson."""
    path = tmp_path / "tutorials" / "03_try.py"
    path.parent.mkdir()

    def write(source: str) -> Path:
        path.write_text(source, encoding="utf-8")
        return path

    return write


def test_cells_are_prose_or_code_and_know_their_line() -> None:
    source = "import os\n\n# %% [markdown]\n# # Title\n#\n# Text.\n\n# %% folded\n\nx = 1\n\n# %%\n"
    assert list(notebooks.split_cells(source)) == [
        notebooks.Cell("import os", 1, is_prose=False),
        notebooks.Cell("# Title\n\nText.", 4, is_prose=True),
        notebooks.Cell("x = 1", 10, is_prose=False, is_folded=True),
    ]
    assert list(notebooks.split_cells("x = 1\n")) == [notebooks.Cell("x = 1", 1, is_prose=False)]
    assert list(notebooks.split_cells("")) == []


def test_a_notebook_installs_trdlab_leads_to_notebooks_and_folds_solutions_away() -> None:
    book = notebooks.notebook(EVERYTHING)
    assert book == notebooks.notebook(EVERYTHING)
    assert '%pip install --quiet "./trdlab-' in book.cells[0].source
    assert "[interop]" in notebooks.notebook("import stable_baselines3\n").cells[0].source
    assert book.cells[1].source.endswith("Of [lesson 2](02_derive_it.ipynb), and *errata C1*.")
    assert [cell.source for cell in book.cells if cell.cell_type == "code"][1:] == [
        cell.text for cell in notebooks.split_cells(EVERYTHING) if not cell.is_prose
    ]
    assert book.cells[-1].source.startswith(
        "<details>\n<summary>Solution</summary>\n\nComponent 2 is the reward at t+2,"
    )
    assert not any(cell.get("outputs") for cell in book.cells)
    [folded] = [cell for cell in book.cells if cell.metadata]
    assert (folded.source, folded.metadata.jupyter.source_hidden) == ("x + 1", True)


def test_a_page_shows_what_came_of_each_cell_the_same_each_time(
    script: Callable[[str], Path], tmp_path: Path
) -> None:
    path = script(EVERYTHING)
    files = lessons.lesson_page(path, lessons.run(path))
    page = files["page.md"].decode()
    page = re.sub(r"<table>.*</table>", "<table>…</table>", page)
    assert re.sub(r"Component 2 is .*", "Component 2 is …", page) == PAGE
    assert list(files) == ["page.md", *(f"03_try-{i}.svg" for i in (1, 2, 3))]
    widths = [re.search(rb'<svg [^>]*width="(\d+)pt"', files[f"03_try-{i}.svg"]) for i in (1, 2, 3)]
    assert [found and found[1] for found in widths] == [b"72", b"144", b"216"]
    assert lessons.lesson_page(path, lessons.run(path)) == files  # to the byte


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("# %%\ndef f():\n    raise ValueError('no')\n\n# %%\n\nf()\n", "line 3: ValueError: no"),
        ("# %% [markdown]\n# Hi.\n\n# %%\nx = 1\n\n# %%\nx = = 2\n", "line 8: SyntaxError"),
        ("# %%\nimport warnings\nwarnings.warn('ouch')\n", "line 3: UserWarning: ouch"),
    ],
)
def test_an_error_names_script_and_line_and_is_not_kept(
    script: Callable[[str], Path], tmp_path: Path, source: str, message: str
) -> None:
    with pytest.raises(lessons.LessonError, match=re.escape(f"tutorials/03_try.py, {message}")):
        lessons.lesson_run(script(source), tmp_path / "cache")
    assert list(tmp_path.glob("cache/*.zip")) == []


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("# %%\nopen('left.txt', 'w').close()\n", "tutorials/03_try.py leaves left.txt behind"),
        ("# %%\nimport os\nos._exit(7)\n", "tutorials/03_try.py: the kernel died"),
    ],
)
def test_a_lesson_that_leaves_files_or_dies_is_refused(
    script: Callable[[str], Path], source: str, message: str
) -> None:
    with pytest.raises(lessons.LessonError, match=f"^{message}$"):
        lessons.run(script(source))


def test_a_lesson_is_run_again_only_if_its_source_has_changed(
    script: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[str] = []

    def run(path: Path) -> object:
        ran.append(path.read_text(encoding="utf-8"))
        return notebooks.notebook(ran[-1])

    monkeypatch.setattr(lessons, "run", run)
    for source in ("x = 1\n", "x = 1\n", "x = 2\n"):
        book = lessons.lesson_run(script(source), tmp_path / "cache")
        assert book.cells[1].source == source.strip()
    assert ran == ["x = 1\n", "x = 2\n"]
    assert len(list(tmp_path.glob("cache/*.zip"))) == 1  # what is out of date is gone
