"""The pages that explain and teach: what they point to is there, and adds up."""

import ast
import io
import json
import re
import shlex
import zipfile
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mkdocs")
import yaml
from mkdocs.exceptions import PluginError

import trdlab
from browser import Visit, chromium
from loading import loaded
from trdlab.teach.checking import EXERCISES

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
WHY = [DOCS / "why" / f"{name}.md" for name in ("theorem", "saliency", "calibration")]
TEACH = sorted((DOCS / "teach").glob("*.md"))


teaching = loaded(DOCS / "teaching.py")


def text(page: Path) -> str:
    return page.read_text(encoding="utf-8")


# ---- the tests that pages name -------------------------------------------------------------------


@pytest.mark.parametrize("page", [*WHY, DOCS / "errata.md"], ids=lambda page: page.stem)
def test_the_tests_that_a_page_names_exist(page: Path) -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", text(page))
    assert len(named) >= 5
    assert text(page).count("tests/") == len(named) + text(page).count("pytest tests/")
    missing = []
    for path, name in named:
        tree = ast.parse(text(ROOT / path))
        known = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        missing += [f"{path}::{name}"] if name not in known else []
    assert not missing


def test_every_statement_and_every_row_names_a_test() -> None:
    statements = re.split(r"(?m)^## (?=\d)", text(DOCS / "why" / "theorem.md"))[1:]
    assert len(statements) == 9
    for statement in statements:
        assert "**Statement.**" in statement
        assert "∎" in statement
        assert "::test_" in statement.split("**Held by**")[1]
        assert 'exec="on"' in statement
    rows = re.split(r"(?m)^### ", text(DOCS / "errata.md"))[1:]
    assert len(rows) == 21
    assert all("::test_" in row.split("**Tests.**")[1] for row in rows)


# ---- plans ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("page", "minutes"),
    [("lecture-50.md", 50), ("lecture-90.md", 90), ("lab.md", 90), ("../study.md", 20)],
)
def test_a_plan_fills_its_time(page: str, minutes: int) -> None:
    spans = re.findall(r"(?m)^\| (\d+)–(\d+) \|", text(DOCS / "teach" / page))
    assert spans[0][0] == "0"
    assert [end for _, end in spans] == [*(begin for begin, _ in spans[1:]), str(minutes)]


def test_the_plans_name_slides_that_there_are() -> None:
    count = len(re.findall(r"(?m)^---$", text(DOCS / "teach" / "slides.md"))) + 1
    for plan in ("lecture-50.md", "lecture-90.md"):
        named = re.findall(r"\bslides? (\d+(?:, \d+)*)", text(DOCS / "teach" / plan))
        numbers = {int(number) for group in named for number in group.split(", ")}
        assert numbers <= set(range(1, count + 1))
        assert numbers >= set(range(1, 13))
        assert plan != "lecture-90.md" or numbers == set(range(1, count + 1))


def shown_commands() -> list[str]:
    code = [
        line
        for page in TEACH
        for part in re.findall(r"(?s)```console\n(.*?)```|`(trdlab [^`]+)`", text(page))
        for line in "".join(part).splitlines()
    ]
    told = {line.removeprefix("$ ") for line in code} | {of for _, of in teaching.FIGURES.values()}
    return sorted(of for of in told if of.startswith("trdlab ") and of != "trdlab --version")


@pytest.mark.parametrize("command", shown_commands())
def test_every_command_of_a_plan_is_one(command: str) -> None:
    from typer.main import get_command

    from trdlab.cli.app import new_app

    words = shlex.split(command)[1:]
    group: Any = get_command(new_app(words))
    context = group.make_context("trdlab", words)
    while hasattr(group, "resolve_command"):
        rest = [*context._protected_args, *context.args]
        name, group, rest = group.resolve_command(context, rest)
        context = group.make_context(name, rest, parent=context)  # raises for an unknown option


# ---- slides --------------------------------------------------------------------------------------

PICTURES = {"figures/drone.svg": b"<svg/>"}


def test_the_parts_of_a_page_become_slides_that_stand_alone() -> None:
    content = (
        '<h1>A<a class="headerlink" href="#a">¶</a></h1><hr />'
        '<h2>B</h2><img alt="b" src="../figures/drone.svg" class="figure" /><hr>\n'
    )
    page = teaching.deck("A & B", content, PICTURES)
    assert page.count("<section>") == 2
    assert "<section><h1>A</h1></section>" in page
    assert 'src="data:image/svg+xml;base64,PHN2Zy8+"' in page
    assert "<title>A &amp; B</title>" in page
    assert "{{" not in page
    assert not re.search(r'(?:src|href)="(?!data:)', page)  # nothing is loaded


def test_a_deck_is_shown_by_keyboard_and_printed_whole(tmp_path: Path) -> None:
    file = tmp_path / "deck.html"
    content = "<h1>One</h1><blockquote>Say this.</blockquote><hr><h2>Two</h2><hr><h2>Three</h2>"
    file.write_text(teaching.deck("Deck", content, {}), encoding="utf-8")
    with chromium() as browser:
        visit = Visit(browser, file)

        def seen() -> list[str]:
            return [of for of in ("One", "Two", "Three") if visit.page.is_visible(f"text={of}")]

        assert seen() == ["One"]
        assert not visit.page.is_visible("text=Say this.")
        visit.page.keyboard.press("n")
        assert visit.page.is_visible("text=Say this.")
        for key, shown, where in (
            ("ArrowRight", ["Two"], "2 / 3"),
            ("End", ["Three"], "3 / 3"),
            ("ArrowRight", ["Three"], "3 / 3"),  # there is no slide after it
            ("ArrowLeft", ["Two"], "2 / 3"),
        ):
            visit.page.keyboard.press(key)
            assert (seen(), visit.text("#where")) == (shown, where)
        assert visit.page.url.endswith("#2")
        visit.page.emulate_media(media="print")
        assert seen() == ["One", "Two", "Three"]
        assert not visit.faults


def test_a_picture_that_would_have_to_be_loaded_is_refused() -> None:
    with pytest.raises(PluginError, match=r"slide shows figures/none\.svg"):
        teaching.deck("A", '<img src="figures/none.svg">', PICTURES)


# ---- figures -------------------------------------------------------------------------------------


def test_figures_come_packed_with_licence_and_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    drawing = {"one": ("One.", "echo 1 > one.svg"), "two": ("Two.", "echo 2 > two.svg")}
    monkeypatch.setattr(teaching, "FIGURES", drawing)
    found = teaching.drawn(b"the licence")
    assert found["figures/two.svg"] == b"2\n"
    with zipfile.ZipFile(io.BytesIO(found["figures.zip"])) as packed:
        files = {Path(name).name: packed.read(name) for name in packed.namelist()}
    assert files.keys() == {"one.svg", "two.svg", "LICENSE.txt", "README.txt"}
    assert files["LICENSE.txt"] == b"the licence"
    assert b"one.svg: echo 1 > one.svg" in files["README.txt"]
    assert teaching.drawn(b"the licence") == found
    assert "![One.](figures/one.svg)" in teaching.gallery()


def test_a_figure_that_cannot_be_drawn_fails_the_build(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(teaching, "FIGURES", {"one": ("One.", "echo no >&2; false")})
    with pytest.raises(PluginError, match=r"^The figure one could not be drawn: no$"):
        teaching.drawn(b"")


# ---- exercises -----------------------------------------------------------------------------------


def test_every_exercise_of_the_lessons_is_found_with_its_whole_question() -> None:
    asked = dict(teaching.questions())
    assert asked.keys() == EXERCISES.keys()
    assert asked["2.2"].endswith("How many outputs does\nit need for each action?")
    assert asked["9.4"].count("\n|") == 6  # a table belongs to it


def test_sheet_and_solutions_have_the_same_exercises_and_the_sheet_no_answer() -> None:
    sheet, solved = teaching.exercises(), teaching.solutions()
    names = [name for group in teaching.SHEET.values() for name in group]
    for page in (sheet, solved):
        assert re.findall(r"(?m)^\*\*(\d\.\d)\.\*\*", page) == names
    for name in names:
        assert EXERCISES[name].solution in solved
        assert EXERCISES[name].solution not in sheet
    assert "- Not [0.5, 0.5, 1, 2]: " in solved


# ---- how to cite ---------------------------------------------------------------------------------


def test_the_citation_is_true() -> None:
    own = yaml.safe_load(text(ROOT / "CITATION.cff"))
    assert own["version"] == trdlab.__version__
    assert own["license"] == "MIT"
    shown = teaching.bibliography()
    paper = own["preferred-citation"]
    for one in paper["authors"]:
        assert f"{one['family-names']}, {one['given-names']}" in shown
        assert f"{one['given-names']} {one['family-names']}" in text(DOCS / "index.md")
    assert paper["title"].split(" through")[0] in text(DOCS / "index.md")
    assert json.dumps(own["title"])[1:-1] in shown
