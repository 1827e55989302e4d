"""The playground as its readers use it: its numbers, its page, and the command that serves it."""

import json
import re
import shlex
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest

from browser import Visit, chromium
from trdlab.cli import main
from trdlab.decomposition import TimeAxis
from trdlab.explanations.moment.sensitivity import flips
from trdlab.explanations.solved import solve_state
from trdlab.gridworld import Gridworld, load_map
from trdlab.playground import page, script

HERE = Path(__file__).parent
SOURCES = Path(__file__).parents[2] / "trdlab" / "playground"
EACH = "document.querySelector('trdlab-playground')"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("playground") / "playground.html"
    path.write_text(page(), encoding="utf-8")
    return path


@pytest.fixture
def visit(browser, file) -> Iterator[Callable[..., Visit]]:
    """Returns a function that opens the page at a hash; nothing may go wrong with it."""
    opened: list[Visit] = []

    def opening(hashed: str = "", **how: Any) -> Visit:
        opened.append(Visit(browser, file, **how))
        if hashed:
            opened[-1].page.goto(f"{file.as_uri()}#{hashed}")
        opened[-1].page.wait_for_selector("#bars svg")
        return opened[-1]

    yield opening
    for one in opened:
        assert one.faults == []
        one.page.context.close()


def expected(of: Visit) -> dict[str, list[float]]:
    """Returns the components of each action, as the page holds them."""
    vectors = of.page.evaluate(f"{EACH}.vectors()")
    return dict(zip(("up", "down", "left", "right"), vectors, strict=True))


def row(of: Visit, name: str) -> list[str]:
    """Returns what the table says in the row of an action."""
    cells = of.page.locator("#table tr").filter(has=of.page.locator("th", has_text=name))
    return [text.strip() for text in cells.first.locator("td").all_text_contents()]


def cell(of: Visit, row: int, column: int) -> Any:
    return of.page.locator(f'.cell[data-row="{row}"][data-column="{column}"]')


def printed(command: str, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    """Returns the JSON of a `trdlab` command."""
    name, *words = shlex.split(command)
    assert name == "trdlab"
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        main([*words, "--json"])
    assert end.value.code == 0
    return json.loads(capsys.readouterr().out)


# ---- the numbers ---------------------------------------------------------------------------------


def test_the_solver_agrees_with_python_in_every_number_and_sentence(browser):
    context = browser.new_context()

    def answer(route: Any) -> None:
        name = route.request.url.rpartition("/")[2]
        folder = HERE if name == "agree.js" else SOURCES
        text = (folder / name).read_text("utf-8") if name else "<!doctype html>"
        route.fulfill(body=text, content_type="text/javascript" if name else "text/html")

    context.route("**/*", answer)
    opened = context.new_page()
    opened.goto("http://playground.test/")
    cases = json.loads((HERE / "goldens.json").read_bytes())
    found = opened.evaluate("async (all) => (await import('/agree.js')).faults(all)", cases)
    context.close()
    assert found == []
    assert len(cases) > 60


def test_the_golden_answers_are_what_python_says_today():
    done = subprocess.run(
        [sys.executable, HERE / "goldens.py"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_papers_numbers_and_the_flip_at_all_three_doors(visit, capsys):
    paper = {"up": [0.0, 0.0, 3.258], "down": [0.95, 1.76, 0.815]}
    solved = solve_state(Gridworld(load_map("drone")), TimeAxis(0.95, 2, 2))
    said = printed("trdlab gridworld --gamma 0.95 --N 2 --w 2", capsys)["actions"]
    shown = expected(visit("map=drone&N=2&w=2"))
    for name, vector in paper.items():
        in_python = solved.choice.moment.components(name)
        assert in_python.round(3).tolist() == pytest.approx(vector, abs=6e-4)
        assert said[name]["components"] == pytest.approx(in_python)
        assert shown[name] == pytest.approx(in_python)

    richer = Gridworld(load_map("drone").changed(treasure=5.0))
    [flip] = (
        claim
        for claim in flips(solve_state(richer, TimeAxis(0.95, 4)).choice)
        if claim.quantity == "γ"
    )
    sections = printed("trdlab gridworld --treasure 5", capsys)["sections"]
    [told] = (
        of
        for section in sections
        for of in section["findings"]
        if of["kind"] == "flips" and of["quantity"] == "γ"
    )
    opened = visit("map=drone&treasure=5")
    opened.page.wait_for_selector("#flip-at")
    assert f"{flip.bounds[0]:.5f}" == f"{told['bounds'][0]:.5f}" == "0.86888"
    assert opened.text("#flip-at") == "0.86888"
    assert flip.sentence in opened.text("#flip-words")
    opened.page.click("#flip-try")
    assert opened.page.input_value("#gamma") == "0.868"
    assert opened.text("#action option") == "the best: down"


def test_sweeps_arrive_at_the_solution_and_news_travels_on_the_way(visit):
    opened = visit("map=drone&sweeps=0")
    assert opened.text("#says") == "Before the first sweep nothing is expected anywhere."
    opened.page.click("#sweep")
    assert expected(opened)["down"] == [0, 0, 0, 0, 0]  # the coin is two steps away
    opened.page.click("#sweep")
    assert expected(opened)["down"] == [0, 0.95, 0, 0, 0]
    assert opened.page.locator("#bars .fresh").count() == 1
    assert opened.text("#says") == "After 2 sweeps the values are: down 0.95 and up 0."
    for _ in range(4):
        opened.page.click("#sweep")
    assert "The sweeps have found the solution." in opened.text("#more")
    swept = expected(opened)
    opened.page.click("#solve")
    assert {k: pytest.approx(v) for k, v in expected(opened).items()} == swept
    assert opened.text("#says").startswith("Down gives more immediate rewards: 2.71")


# ---- the page ------------------------------------------------------------------------------------


def test_a_map_is_edited_by_clicks(visit):
    opened = visit()
    opened.page.get_by_role("radio", name="wall").check(force=True)
    cell(opened, 0, 2).click()
    assert opened.text("#fault").startswith("The treasure at row 0, column 4 cannot be reached")
    assert opened.page.locator(".tell").get_attribute("inert") is not None
    opened.page.get_by_role("button", name="Undo").click()
    assert opened.page.locator("#fault").is_hidden()
    assert opened.page.input_value("#map") == "drone"
    opened.page.get_by_role("radio", name="hazard of -1, letter h").check(force=True)
    cell(opened, 2, 1).click()
    assert opened.text("#title") == "Your own map."
    assert expected(opened)["down"] == pytest.approx([0, -0.95, 0.9025, 0.857375, 0.81450625])
    cell(opened, 1, 0).click()
    assert opened.text("#place") == "There has to be a start: put it elsewhere first."
    opened.page.get_by_role("radio", name="choose").check(force=True)
    cell(opened, 2, 2).click()
    assert opened.text("#place") == "The drone is at row 2, column 2."
    assert row(opened, "right")[:2] == ["1", "0.95"]
    opened.page.select_option("#collected", "1")
    assert opened.text("#command").endswith("--state 2,2,1")


def test_settings_by_slider_and_by_number(visit):
    opened = visit()
    opened.page.fill("#gamma-range", "0.5")
    assert expected(opened)["down"][1] == 0.5
    opened.page.fill("#gamma", "0.86888")
    assert expected(opened)["down"][1] == 0.86888
    opened.page.fill("#N", "1")
    opened.page.fill("#w", "4")
    assert row(opened, "down − up")[-1] == "0"
    opened.page.fill("#gamma", "1.5")  # is not taken
    assert opened.page.get_attribute("#gamma", "aria-invalid") == "true"
    assert expected(opened)["down"][0] == pytest.approx(sum(0.86888**k for k in (1, 2, 3)))
    opened.page.fill("#slip", "0.2")
    assert ", on average" in opened.text("#says")
    opened.page.select_option("#action", label="left")
    assert opened.text("#contrast-title").startswith("left minus ")


def test_by_keyboard_alone(visit):
    opened = visit()
    keys = opened.page.keyboard
    focus = f"{EACH}.shadowRoot.activeElement"
    for _ in range(6):
        keys.press("Tab")
        if opened.page.evaluate(f"{focus}?.getAttribute('role')") == "gridcell":
            break
    for key in ("ArrowDown", "ArrowDown", "ArrowRight"):
        keys.press(key)
    assert opened.page.evaluate(f"{focus}.getAttribute('aria-label')") == (
        "row 2, column 1: coin of 1; worth 2.85, best is right"
    )
    assert opened.page.evaluate(f"getComputedStyle({focus}).outlineStyle") == "solid"
    keys.press(".")
    assert cell(opened, 2, 1).get_attribute("aria-label").startswith("row 2, column 1: floor")
    keys.press("f")
    keys.press("Enter")
    assert opened.text("#place") == "The drone is at row 2, column 1."
    assert opened.page.evaluate(f"{focus}.dataset.column") == "1"  # the focus stays
    keys.press("Tab")
    keys.press("ArrowRight")  # the next tool
    assert opened.page.evaluate(f"{focus}.value") == "S"


def test_the_address_holds_all_that_was_chosen(visit):
    opened = visit("map=ledge&gamma=0.9&N=3")
    opened.page.fill("#slip", "0.3")
    opened.page.get_by_role("radio", name="treasure of 4, letter t").check(force=True)
    cell(opened, 1, 2).click()
    opened.page.select_option("#foil", label="up")
    opened.page.fill("#treasure", "2.5")
    opened.page.wait_for_url("**treasure=2.5**")
    hashed = opened.page.evaluate("location.hash").removeprefix("#")
    again = visit(hashed)
    for part in ("#says", "#command", "#table"):
        assert again.text(part) == opened.text(part)
    assert expected(again) == expected(opened)
    opened.page.evaluate("location.hash = '#map=patience'")
    opened.page.get_by_text("A small reward at once").wait_for()


def test_an_address_that_makes_no_sense_still_opens(visit):
    opened = visit("map=nowhere&gamma=7&N=-1&state=x&action=jump&text=nonsense")
    assert "Unknown symbol 'n' at row 0" in opened.text("#fault")
    opened.page.select_option("#map", "loop")
    assert opened.page.locator("#fault").is_hidden()
    assert opened.text("#command") == "trdlab gridworld --map loop --gamma 0.95 --N 4 --w 1"


@pytest.mark.parametrize(
    ("hashed", "edit"),
    [("map=windy&N=5&slip=0.1&state=3,4", None), ("map=drone&treasure=7&N=3&w=2", "C")],
)
def test_the_command_prints_the_same_numbers(visit, capsys, tmp_path, monkeypatch, hashed, edit):
    opened = visit(hashed)
    if edit is not None:
        cell(opened, 0, 1).focus()
        opened.page.keyboard.press("c")
        opened.page.select_option("#foil", label="right")
        with opened.page.expect_download() as saved:
            opened.page.click("#source summary")
            opened.page.get_by_role("button", name="Save as my-map.txt").click()
        saved.value.save_as(tmp_path / saved.value.suggested_filename)
    monkeypatch.chdir(tmp_path)
    said = printed(opened.text("#command"), capsys)
    shown = expected(opened)
    for name, of in said["actions"].items():
        assert shown[name] == pytest.approx(of["components"], abs=1e-9)
    pair = f"{said['action']} − {said['foil']}"
    assert row(opened, pair)
    first, *_ = (of["sentence"] for of in said["answer"])
    assert opened.text("#says") == first


def test_the_link_and_the_command_are_copied(visit):
    opened = visit("map=tie", permissions=["clipboard-read", "clipboard-write"])
    for button, copied in (("Copy command", "trdlab gridworld --map tie"), ("Copy link", "file:")):
        opened.page.get_by_role("button", name=button).click()
        opened.page.get_by_text(f"The {button.split()[1]} is copied").wait_for()
        assert opened.page.evaluate("navigator.clipboard.readText()").startswith(copied)


def test_the_map_is_edited_as_text(visit):
    opened = visit("map=patience")
    opened.page.click("#source summary")
    opened.page.fill("#text", "step_cost: 0.5\n---\nS.T\n")
    opened.page.press("#text", "Tab")
    assert expected(opened)["right"][:2] == pytest.approx([-0.5, 0.95 * 3.5])
    opened.page.fill("#text", "S.T\n..\n")
    opened.page.press("#text", "Tab")
    assert "Row 1 of the map has 2 cells" in opened.text("#fault")


def test_what_a_screen_reader_hears(visit):
    opened = visit("map=drone&treasure=5")
    by_role = opened.page.get_by_role
    for kind, name in (
        ("grid", "The map"),
        ("combobox", "Map"),
        ("combobox", "Action"),
        ("combobox", "Other action"),
        ("spinbutton", "γ"),
        ("slider", "treasure, slider"),
        ("button", "One sweep"),
        ("img", "A bar for each action"),
        ("img", "Bars of up minus down"),
        ("group", "A click on the map"),
        ("region", "Numbers"),
    ):
        assert by_role(kind, name=name).first.is_visible(), (kind, name)
    assert by_role("gridcell").count() == 15
    assert by_role("gridcell", selected=True).get_attribute("aria-label") == (
        "row 1, column 0: start, floor; worth 4.07, best is up; the drone is here"
    )
    assert opened.page.get_attribute("#says", "aria-live") == "polite"
    assert by_role("columnheader").count() == 8
    assert by_role("rowheader").count() == 5
    nameless = """[...document.querySelector('trdlab-playground').shadowRoot
        .querySelectorAll('button, input, select, textarea')]
        .filter((of) => !of.labels?.length && !of.textContent.trim() && !of.ariaLabel)
        .map((of) => of.outerHTML)"""
    assert opened.page.evaluate(nameless) == []


@pytest.mark.parametrize("width", [320, 390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_any_screen_in_both_colours(visit, width, scheme):
    opened = visit(
        "map=windy&N=9",
        viewport={"width": width, "height": 800},
        color_scheme=scheme,
        reduced_motion="reduce",
    )
    assert opened.page.evaluate("document.documentElement.scrollWidth") == width
    small = """[...document.querySelector('trdlab-playground').shadowRoot
        .querySelectorAll('button, select, .tool, .cell, input:not([type=radio])')]
        .map((of) => of.getBoundingClientRect())
        .filter(({ width, height }) => width && (width < 24 || height < 24)).length"""
    assert opened.page.evaluate(small) == 0
    ink, card = (
        [int(part) for part in re.findall(r"\d+", colour)[:3]]
        for colour in opened.page.evaluate(f"""(() => {{
            const of = getComputedStyle({EACH}.shadowRoot.querySelector('.tell'));
            return [of.color, of.backgroundColor];
        }})()""")
    )
    assert abs(np.mean(ink) - np.mean(card)) > 170
    assert (np.mean(ink) < np.mean(card)) == (scheme == "light")
    assert opened.page.evaluate("document.getAnimations().length") == 0


def test_it_stands_on_other_pages_as_a_classic_script_from_disk(browser, tmp_path):
    (tmp_path / "playground.js").write_text(script(), encoding="utf-8")
    page = tmp_path / "page.html"
    page.write_text(
        "<!doctype html><meta charset=utf-8><title>T</title><body style='color-scheme: dark'>"
        "<script src=playground.js defer></script><h2 id=says>Own</h2>"
        "<trdlab-playground>none</trdlab-playground>",
        encoding="utf-8",
    )
    opened = Visit(browser, page)
    inside = opened.page.locator("trdlab-playground #says")
    inside.get_by_text("Down gives more immediate rewards").wait_for()
    assert opened.faults == [f"request: {(tmp_path / 'playground.js').as_uri()}"]
    assert opened.page.evaluate("location.hash") == ""  # nobody has chosen anything


# ---- the command ---------------------------------------------------------------------------------


def test_the_command_serves_the_page_until_it_is_interrupted():
    serving = subprocess.Popen(
        [sys.executable, "-m", "trdlab", "playground", "--port", "0", "--no-open"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert serving.stdout is not None
    address = re.search(r"http://127\.0\.0\.1:\d+/", serving.stdout.readline())
    assert address is not None
    with urlopen(address[0]) as answer:
        assert answer.read().decode() == page()
    with pytest.raises(HTTPError, match="404") as refused:
        urlopen(f"{address[0]}etc/passwd")
    refused.value.close()
    serving.send_signal(signal.SIGINT)
    assert serving.communicate(timeout=60)[1] in ("", "error: Interrupted.\n")  # typer's, or ours
    assert serving.returncode == 130


def test_a_port_that_is_taken_is_told(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(SystemExit) as end:
            main(["playground", "--port", str(port), "--no-open"])
    assert end.value.code == 2
    assert capsys.readouterr().err == (
        f"error: Port {port} cannot be used: Address already in use. Choose another one, or "
        "--port 0 for any that is free.\n"
    )
