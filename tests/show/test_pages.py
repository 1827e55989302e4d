"""Pages: what is printed of each noun, as wide as the terminal is, and what notebooks show."""

import html
import re
from functools import cache
from typing import Any

import numpy as np
import pytest

import trdlab
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations import solve_state
from trdlab.explanations.moment.telling import in_brief
from trdlab.gridworld import Gridworld, load_map
from trdlab.show.document import document
from trdlab.show.text import plain_ascii, text
from trdlab.tabular.toytext import make_world

EVIL = "<script>alert('γ')</script>"


@cache
def nouns() -> dict[str, Any]:
    """One of each that is printed."""
    pair = ("gridworld:ledge", "gridworld:ledge,slip=0.3")
    return {
        "a solved state": solve_state(Gridworld(load_map("drone")), TimeAxis(0.95, 4)),
        "a solved state of random moves": solve_state(
            make_world("FrozenLake-v1", {}), TimeAxis(0.95, 30)
        ),
        "an explanation": trdlab.explain("gridworld:ledge", episodes=12),
        "a forecast": trdlab.explain("gridworld:ledge", parts="forecast", episodes=0),
        "a report": trdlab.calibrate("gridworld:ledge", episodes=12),
        "a comparison": trdlab.compare(*pair, episodes=12),
    }


NAMES = list(nouns())


def numbers(page: str) -> list[str]:
    """Returns the numbers of a page, each as it stands between blanks, commas and brackets."""
    return [word for word in re.split(r"[\s,\[\]()·]+", page) if re.search(r"\d", word)]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("details", [False, True])
@pytest.mark.parametrize("width", [24, 40, 80])
def test_a_narrow_page_is_wrapped_and_cuts_no_number(name, details, width):
    noun = nouns()[name]
    known = text(noun, width=500, details=details).plain
    if (table := document(noun).table) is not None:  # a wide table may leave some out
        known += "\n" + " ".join(cell for row in (table.heading, *table.rows) for cell in row)
    page = text(noun, width=width, details=details).plain
    for line in page.splitlines():
        assert len(line) <= width or " " not in line.strip(), line  # a word is never broken
        assert line == line.rstrip()
    assert set(numbers(page)) <= set(numbers(known))
    assert "…" not in page.replace("…∞", "").replace(", …, ", "").replace("t…t", "")
    assert plain_ascii(text(noun, width=width, details=details)).plain.isascii()


@pytest.mark.parametrize("width", [24, 30])
def test_where_no_table_fits_the_numbers_of_an_action_stand_below_its_name(width):
    page = text(nouns()["a solved state"], width=width).plain.splitlines()
    at = page.index("down  chosen")
    assert page[at + 1 : at + 8] == [
        "  t  0",
        "  t+1  0.95",
        "  t+2  0.90",
        "  t+3  0.86",
        "  t+4…∞  0.81",
        "  Q  3.52",
        "  total  4",
    ]


@pytest.mark.parametrize("name", NAMES)
def test_printing_is_the_page_and_the_representation_one_short_line(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    noun = nouns()[name]
    assert str(noun) == text(noun, width=80).plain
    assert repr(noun).startswith(f"<{type(noun).__name__}: ")
    assert len(repr(noun)) <= 100
    assert "\n" not in repr(noun)


def test_a_report_prints_what_matters_most():
    told = text(nouns()["a report"]).plain.splitlines()
    assert told[:3] == [
        "How far its forecasts can be trusted · 12 episodes",
        "γ = 0.95 · N = 4 · w = 1",
        "",
    ]
    assert told[3] == "Over 12 episodes the agent scored 0.833 each, on average."
    assert 2 <= len(told[3:]) <= 9
    assert told[-1] == "There is more: .details() returns all that there is to tell."
    details = nouns()["a report"].details()
    assert details == text(nouns()["a report"], details=True).plain
    assert ".details()" not in details
    assert "\nWhat this rests on\n  The forecasts were checked on 12 episodes, " in details
    assert "What this rests on" not in "\n".join(told)


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_shows_all_of_it_and_folds_the_details_away(name):
    noun = nouns()[name]
    shown = noun._repr_html_()
    brief, _, folded = shown.partition("<details>")
    page = document(noun)
    for sentence in page.answer if page.folded else ():
        assert html.escape(sentence) in brief
    for section in page.sections:
        told = [section.heading, *section.sentences]
        assert all(html.escape(words) in (folded or brief) for words in told)
    assert bool(folded) == page.folded == (name != "a forecast"), "what was asked for is not folded"
    assert ("<table>" in brief) == ("components:" in str(noun) or "expected at" in str(noun))


class Evil:
    """Expects 1 of either action, and has a name that is no good HTML."""

    time_axis, future = TimeAxis(0.5, 1), Future(EVIL)

    def decompose(self, seen: np.ndarray) -> RewardDecomposition:
        return RewardDecomposition(np.tile([1.0, 0.5], (len(seen), 2, 1)), self.time_axis)


def test_what_users_call_things_is_escaped(tmp_path):
    agent = trdlab.agent(Evil(), env="CartPole-v1", name=EVIL, action_names=[EVIL, "<b>"])
    explained = trdlab.explain(agent, episodes=12, action="<b>")
    comparison = trdlab.compare(agent, agent, episodes=2)
    path = tmp_path / "evil.txt"
    path.write_text(f"title: {EVIL}\n---\nS..T", encoding="utf-8")
    solved = solve_state(Gridworld(load_map(str(path))), TimeAxis(0.9, 2))
    for noun in (explained, comparison, solved):
        shown = noun._repr_html_()
        assert "<script" not in shown
        assert "<b>" not in shown
        assert html.escape(EVIL) in shown


def test_colours_are_only_where_a_terminal_shows_them():
    page = text(nouns()["a solved state"])
    assert "\x1b" not in page.plain
    assert {str(span.style) for span in page.spans} >= {"bold", "dim", "green"}


def test_the_answer_is_all_there_is_without_details():
    solved = nouns()["a solved state"]
    answer = [claim.sentence for claim in in_brief(solved.choice)]
    page = text(solved, width=200).plain.splitlines()
    assert page[-len(answer) - 2 : -2] == answer
