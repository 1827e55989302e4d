"""The machinery of the documentation: what is kept, lists of the reference, docstrings."""

import re
import subprocess
import sys
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("mkdocs")
from mkdocs.config import load_config
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import Files

from loading import loaded
from trdlab.playground import script

ROOT = Path(__file__).parents[1]


hooks, catalogue, kept, blocks_of, docstrings = (
    loaded(ROOT / "docs" / f"{name}.py")
    for name in ("hooks", "catalogue", "kept", "executed", "docstrings")
)


def test_the_playground_of_the_site_is_that_of_the_package(tmp_path: Path) -> None:
    for folder in ("docs", "tutorials"):
        (tmp_path / folder).mkdir()
    (tmp_path / "mkdocs.yml").write_text("site_name: trdlab\n", encoding="utf-8")
    config = load_config(str(tmp_path / "mkdocs.yml"))
    config.plugins._current_plugin = "docs/hooks.py"  # as while MkDocs calls a hook
    files = hooks.on_files(Files([]), config)
    made = files.get_file_from_path("assets/playground.js")
    assert made is not None
    assert made.content_string == script()
    assert 'src="assets/playground.js"' in (ROOT / "docs" / "playground.md").read_text("utf-8")


@pytest.mark.parametrize("content", [b"", b"PK", None], ids=["empty", "no archive", "cut"])
def test_a_torn_result_is_made_again(tmp_path: Path, content: bytes | None) -> None:
    made: list[str] = []

    def make() -> dict[str, bytes]:
        made.append("|")
        return {"page.md": b"hello"}

    for _ in range(2):
        assert kept.made(tmp_path, "a", lambda: "hash", make) == {"page.md": b"hello"}
    [file] = tmp_path.glob("*.zip")
    file.write_bytes(file.read_bytes()[:-30] if content is None else content)
    for _ in range(2):
        assert kept.made(tmp_path, "a", lambda: "hash", make) == {"page.md": b"hello"}
    assert len(made) == 2


def test_a_changed_byte_in_a_result_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "a-1.zip"
    kept.keep(path, {"page.md": b"0123456789" * 9})
    whole = path.read_bytes()
    assert kept.kept(path) == {"page.md": b"0123456789" * 9}
    for place in range(30, 60):  # in the name or in the content
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        assert kept.kept(path) in (None, {"page.md": b"0123456789" * 9})


def test_what_changes_while_it_is_made_is_not_kept(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.write_text("1")

    def make() -> dict[str, bytes]:
        source.write_text("2")
        return {"a": b""}

    kept.made(tmp_path / "cache", "a", lambda: kept.fingerprint(source), make)
    assert list(tmp_path.glob("cache/*.zip")) == []


def test_who_asks_while_another_makes_it_waits_and_gets_the_same(tmp_path: Path) -> None:
    begun = threading.Barrier(2, timeout=60)
    made: list[str] = []

    def make() -> dict[str, bytes]:
        made.append("|")
        time.sleep(0.2)
        return {"a": b"1"}

    def ask() -> dict[str, bytes]:
        begun.wait()
        return kept.made(tmp_path, "a", lambda: "hash", make)

    with ThreadPoolExecutor(2) as pool:
        asked = [pool.submit(ask) for _ in range(2)]
    assert [of.result() for of in asked] == [{"a": b"1"}] * 2
    assert made == ["|"]


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert kept.made(tmp_path / "file" / "cache", "a", lambda: "h", lambda: {"a": b""}) == {
        "a": b""
    }


def test_examples_become_code_and_errata_rows_links() -> None:
    prepared = docstrings.prepared(
        "A sum (errata P1, C5). P2.\n\n>>> f(1)\n2\n>>> f(2)\n\nArgs:\n    x: it."
    )
    assert prepared == (
        "A sum (errata [P1][p1], [C5][c5]). P2.\n\n"
        "```pycon\n>>> f(1)\n2\n>>> f(2)\n```\n\nArgs:\n    x: it."
    )


def test_each_row_of_the_errata_has_an_anchor_and_says_what_trdlab_does() -> None:
    page = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    rows = [*(f"P{i}" for i in range(1, 14)), *(f"C{i}" for i in range(1, 9))]
    parts = re.split(r"^### ", page, flags=re.MULTILINE)[1:]
    assert [part.split(" · ")[0] for part in parts] == rows
    for row, part in zip(rows, parts, strict=True):
        assert f"{{ #{row.lower()} }}" in part
        assert "**There.**" in part
        assert "**trdlab.**" in part


def test_signatures_show_the_default_of_a_setting_and_no_more() -> None:
    griffe = pytest.importorskip("griffe")
    package = griffe.visit(
        "settings",
        filepath=Path("settings.py"),
        code="class Settings:\n    def __init__(self, seed=_option(1, 'Of it.'), n=f(2)): ...\n",
    )
    init = package["Settings.__init__"]
    docstrings.Docstrings().on_object(obj=init)
    assert [str(of.default) for of in init.parameters][1:] == ["1", "f(2)"]


def test_a_named_tuple_is_shown_with_its_signature(tmp_path: Path) -> None:
    griffe = pytest.importorskip("griffe")
    (tmp_path / "pair.py").write_text(
        "from typing import NamedTuple\n"
        "class Pair(NamedTuple):\n    left: int\n    right: int = 2\n"
    )
    extensions = griffe.load_extensions(docstrings.Docstrings())
    package = griffe.load("pair", search_paths=[tmp_path], extensions=extensions)
    shown = [(str(of.name), of.default) for of in package["Pair"].parameters]
    assert shown == [("self", None), ("left", None), ("right", "2")]


PACKAGE = """
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from rooms.kitchen.oven import bake
    from rooms.door import Door
__all__ = ["Door", "bake"]
"""
OVEN = '''
"""Ovens: how hot."""

@COOKING.rule("{dish} needs {time:steps}{much}.")
def needs_long(dish):
    """Where it needs more than an hour (errata P1)."""

@COOKING.rule("{dish} is raw.", kind="raw")
def _raw(dish): ...

_SAYS = "{dish} is %s."

@COOKING.kinds({"done": _SAYS % "done", "burnt": f"{_SAYS % 'burnt'}"})
def outcome(dish):
    """What came of it."""

def bake(dish):
    """Bakes a dish.

    Slowly.
    """

def _warm(): ...
'''


@pytest.fixture
def rooms(tmp_path: Path) -> Path:
    """Returns a folder with a small package."""
    kitchen = tmp_path / "rooms" / "kitchen"
    kitchen.mkdir(parents=True)
    (kitchen / "__init__.py").write_text("")
    (kitchen / "oven.py").write_text(OVEN)
    (kitchen / "_hidden.py").write_text("class Hidden: ...")
    (kitchen.parent / "__init__.py").write_text(PACKAGE)
    (kitchen.parent / "door.py").write_text('class Door:\n    """A door."""\n')
    return tmp_path


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("names: rooms", ["::: rooms.Door"]),
        ("names: rooms.kitchen", ["::: rooms.bake"]),
        ("names: rooms only Door bake", ["::: rooms.Door"]),
        ("modules: rooms.kitchen", ["::: rooms.kitchen.oven"]),
        ("modules: rooms.kitchen except garden", ["::: rooms.kitchen.oven"]),
        ("table: rooms", ["[`Door`][rooms.door.Door] | A door. |", "| Bakes a dish. |"]),
        ("table: rooms.kitchen", ["[`bake`][rooms.kitchen.oven.bake] | Bakes a dish. |"]),
        (
            "sentences: rooms.kitchen",
            [
                "### Ovens: how hot\n",
                "`needs-long`\n\n:   “<var>dish</var> needs <var>time</var> <var>much</var>.”\n",
                "\n    Where it needs more than an hour (errata [P1][p1]).\n",
                "`raw`\n\n:   “<var>dish</var> is raw.”\n",
                "`done`\n\n:   “<var>dish</var> is done.”\n\n    What came of it.\n",
                "`burnt`\n\n:   “<var>dish</var> is burnt.”\n",
            ],
        ),
        ("sentences: rooms", []),
    ],
)
def test_lists_of_the_reference_are_read_from_the_source(
    rooms: Path, line: str, found: list[str]
) -> None:
    page = catalogue.expanded(f"# A\n\n<!-- {line} -->\n", rooms)
    assert all(part in page for part in found)
    assert page.count(":::") == sum(part.startswith(":::") for part in found)
    assert "<!--" not in page


@pytest.mark.parametrize(
    "line",
    ["names: rooms.garden", "table: rooms except Door bake", "modules: rooms.kitchen except oven"],
)
def test_a_list_of_nothing_is_refused(rooms: Path, line: str) -> None:
    with pytest.raises(LookupError, match=line.split()[1]):
        catalogue.expanded(f"<!-- {line} -->", rooms)


def names_of(identifier: str, members: list[str]) -> set[tuple[str, Path]]:
    """Returns the names that a directive of a page documents, each with its file."""
    path = ROOT.joinpath(*identifier.split("."))
    if path.is_dir():
        return set(catalogue.exports(path, ROOT))
    module = path.with_suffix(".py")
    if module.exists():
        names = {name for name, _ in catalogue.public(module)}
        return {(name, module) for name in names if name in members or not members}
    return {of for of in catalogue.exports(path.parent, ROOT) if of[0] == path.name}


def test_every_name_that_a_package_exports_is_documented_once() -> None:
    documented: Counter[tuple[str, Path]] = Counter()
    for page in (ROOT / "docs" / "reference").rglob("*.md"):
        text = catalogue.expanded(page.read_text(encoding="utf-8"), ROOT)
        for directive in re.findall(r"^::: .+(?:\n    .*)*", text, re.MULTILINE):
            members = re.search(r"members: \[(.*)\]", directive)
            documented.update(
                names_of(directive.split()[1], members[1].split(", ") if members else [])
            )
    packages = [file.parent for file in (ROOT / "trdlab").rglob("__init__.py")]
    exported = {name for package in packages for name in catalogue.exports(package, ROOT)}
    counts = {f"{file.stem}.{name}": documented[name, file] for name, file in exported}
    assert [f"{name}: {count} times" for name, count in counts.items() if count != 1] == []


def build(config: Path, site: Path) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", config, "-d", site]
    return subprocess.run(command, cwd=config.parent, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "loaded",
    [
        '<script defer src="https://x.org/a.js">',
        '<img alt="a" src="http://x.org/a.png">',
        '<link rel="stylesheet" href="https://x.org/a.css">',
    ],
)
def test_a_page_that_loads_from_the_network_fails_the_build(loaded: str) -> None:
    page = SimpleNamespace(file=SimpleNamespace(src_uri="a.md"))
    with pytest.raises(PluginError, match=r"a\.md loads from the network: <.*x\.org"):
        hooks.on_post_page(f"<p>a</p>{loaded}", page=page)


def test_a_page_may_link_to_the_network_and_load_its_own_files() -> None:
    html = '<a href="https://x.org"></a><script src="../a.js"></script><img src="a.png">'
    assert hooks.on_post_page(html, page=None) == html


def test_the_page_for_missing_pages_finds_its_files_on_disk_too() -> None:
    html = '<head></head><link href="/assets/a.css"><script src="/assets/a.js"></script>'
    html += '<script>{"search": "/assets/search.js"}</script>'
    shown = hooks.on_post_template(html, template_name="404.html")
    assert '<link href="assets/a.css"><script src="assets/a.js">' in shown
    assert '{"search": "assets/search.js"}' in shown
    assert "if (location.protocol !== 'file:')" in shown  # a server has a root
    assert hooks.on_post_template(html, template_name="sitemap.xml") == html


def test_what_blocks_print_takes_their_place() -> None:
    page = """A.

```bash exec="on" source="above" result="{.text .output}"
cd . # hide
echo '``` b'
```

- C

    ```python exec="on" session="s"
    x = 1
    ```

    ```python exec="on" session="s"
    print(f"**{x + 1}**")
    ```

```python
print("is only shown")
```

```bash exec="on" html="on"
echo '<p>D</p>'
```
"""
    assert (
        blocks_of.executed(page, blocks_of.outputs)
        == """A.

````bash
echo '``` b'
````

````{.text .output}
``` b
````

- C



    **2**

```python
print("is only shown")
```

<div class="made">
<p>D</p>
</div>
"""
    )


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ('bash exec="on"\nexit 3\n', "exit code 3"),
        ('python exec="on"\nmissing\n', "NameError: name 'missing'"),
        ('bash exec="on" tabs="a"\ntrue\n', "no such option: tabs"),
        ('ruby exec="on"\ntrue\n', "only bash and python are run"),
    ],
)
def test_a_block_that_fails_says_why(block: str, message: str) -> None:
    with pytest.raises(blocks_of.BlockError, match=message):
        blocks_of.executed(f"```{block}```\n", blocks_of.outputs)


@pytest.mark.parametrize(("command", "ok"), [("trdlab --help", True), ("trdlab nonsense", False)])
def test_a_command_that_fails_on_a_page_fails_the_build(
    tmp_path: Path, command: str, ok: bool
) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text(f'# T\n\n```bash exec="on"\n{command}\n```\n')
    (tmp_path / "mkdocs.yml").write_text(
        f"site_name: T\nhooks: ['{ROOT / 'docs' / 'hooks.py'}']\n"
        "markdown_extensions: [pymdownx.superfences]\n"
        "theme: {name: mkdocs, highlightjs: false}\n"
    )
    done = build(tmp_path / "mkdocs.yml", tmp_path / "site")
    assert (done.returncode == 0) == ok, done.stderr
    assert ok or "trdlab nonsense" in done.stderr
    assert len(list((tmp_path / ".cache").rglob("*.zip"))) == ok


@pytest.mark.parametrize(("code", "ok"), [("print('hello')", True), ("1 / 0", False)])
def test_a_lesson_becomes_a_page_with_its_downloads(tmp_path: Path, code: str, ok: bool) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("# T\n")
    (tmp_path / "tutorials" / "notebooks").mkdir(parents=True)
    (tmp_path / "tutorials" / "notebooks" / "01_try.ipynb").write_text("{}")
    script = tmp_path / "tutorials" / "01_try.py"
    script.write_text(f"# %% [markdown]\n# # Try\n\n# %%\n{code}\n")
    (tmp_path / "mkdocs.yml").write_text(
        f"site_name: T\nhooks: ['{ROOT / 'docs' / 'hooks.py'}']\nuse_directory_urls: false\n"
        "markdown_extensions: [attr_list, pymdownx.superfences]\nplugins: []\n"
        "theme: {name: mkdocs, highlightjs: false}\n"
    )
    site = tmp_path / "site"
    done = build(tmp_path / "mkdocs.yml", site)
    assert (done.returncode == 0) == ok, done.stderr
    if not ok:
        assert "tutorials/01_try.py, line 5: ZeroDivisionError: division by zero" in done.stderr
        return
    page = (site / "lessons" / "01_try.html").read_text(encoding="utf-8")
    assert "hello" in page
    for name in re.findall(r'href="(01_try\.\w+)"', page):
        assert (site / "lessons" / name).exists()
    assert page.count(" download") == 2
