"""`trdlab report` as its users see it."""

import json
import re
from pathlib import Path

import pytest


def test_a_run_gets_a_page_of_its_own_each_time(trdlab, trained):
    words = ("report", trained, "--episodes", 12, "--others", 1)
    for name in ("drone", "drone-2"):
        code, out, err = trdlab(*words)
        path = Path("reports") / f"{name}.html"
        assert (code, out, err) == (0, "", f"Report: {path}\n")
        page = path.read_text("utf-8")
        assert page.count("data:image/") >= 1  # it is drawn as the environment draws
        found = re.search(r'id="data">(.*?)</script>', page, re.S)
        assert found is not None
        held = json.loads(found[1])
        assert held["actions"] == ["up", "down", "left", "right"]
        assert len(held["pictures"]["at"]) == len(held["taken"]) + 1
        assert held["components"]["type"] == "single"


def test_a_file_is_replaced_only_if_that_is_asked_for(trdlab):
    words = ("report", "gridworld:drone", "--episodes", 0, "-o", "a.html")
    assert trdlab(*words) == (0, "", "Report: a.html\n")
    code, _, err = trdlab(*words)
    assert (code, err.count("\n")) == (2, 1)
    assert "The file 'a.html' exists." in err
    assert "--overwrite" in err
    assert trdlab(*words, "--overwrite") == (0, "", "Report: a.html\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("gridworld:dron",), "Did you mean 'drone'"),
        (("gridworld:drone", "--step", "99", "--episodes", "0"), "There is no step 99"),
        (("gridworld:drone", "-o", "a.pdf"), "'.pdf' is no known ending"),
        (("gridworld:drone", "-o", "no/a.html"), "The folder 'no' does not exist."),
    ],
)
def test_what_is_wrong_is_said_in_one_line(trdlab, words, message):
    code, out, err = trdlab("report", *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert not [*Path().rglob("*.html")]
