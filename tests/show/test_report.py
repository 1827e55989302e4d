"""The report as its readers use it: in a browser, without a network, by mouse and by keyboard."""

import json
import re
import subprocess
import sys
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import trdlab
from browser import Visit, chromium
from doors import Doors
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError, OutputError
from trdlab.estimator import Future
from trdlab.runs.pretrained import pretrained_names

EVIL = "<script>alert(1)</script>"


class Guess:
    """Expects of each CartPole state what its numbers are, in single precision."""

    time_axis, future = TimeAxis(0.9, 3), Future(EVIL)

    def decompose(self, seen: np.ndarray) -> RewardDecomposition:
        rows = np.stack([seen, 1.0 - seen], axis=1).astype(np.float32)
        return RewardDecomposition(rows, self.time_axis)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def drone(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("reports") / "drone.html"
    return trdlab.report("gridworld:drone", out=out, episodes=40)


@pytest.fixture(scope="module")
def evil(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("reports") / "evil.html"
    agent = trdlab.agent(Guess(), "CartPole-v1", name=EVIL, action_names=[EVIL, "</script><b>"])
    return trdlab.report(agent, out=out, episodes=0, max_steps=30, others=1)


def held(file: Path) -> dict[str, Any]:
    """Returns what the script of a page reads."""
    found = re.search(
        r'<script type="application/json" id="data">(.*?)</script>', file.read_text("utf-8"), re.S
    )
    assert found is not None
    page = json.loads(found[1])
    return page | {of: unpacked(page[of]) for of in ("components", "probabilities", "chances")}


def unpacked(of: dict[str, Any] | None) -> Any:
    """Returns the numbers that a page holds, in lists; what is no number is None."""
    if of is None:
        return None
    kind = {"single": "<f4", "double": "<f8", "share": "<u2"}[of["type"]]
    values = np.frombuffer(b64decode(of["bytes"]), kind).astype(np.float64)
    if of["type"] == "share":
        values = np.where(values > 65534, np.nan, values / 65534)
    return np.where(np.isnan(values), None, values).reshape(of["shape"]).tolist()


def test_the_answer_comes_first_and_the_bars_say_when(browser, drone):
    visit = Visit(browser, drone)
    assert "With down, the first reward comes 1 step later: it is 1." in visit.text("header")
    assert "For what comes in the first 4 steps" in visit.text(".trusted")
    assert visit.text("#says").startswith("Down gives more immediate rewards: 2.71")
    assert visit.text("#where") == "Step 0 of 4."
    assert visit.page.locator("#bars .bar-one:not(.pale)").count() == 3
    assert visit.text("#look-when") == "The largest step: 1 step later"
    assert (
        "4 of 4 forecasts as high as this one were followed by a reward 1 step later"
        in visit.text("#look-alike")
    )
    assert visit.page.locator("#look-clips canvas").count() >= 4
    assert "A reward of 1 came 4 times from coin." in visit.text("#gallery")
    assert visit.faults == []


def test_scrubbing_action_and_foil(browser, drone):
    visit = Visit(browser, drone)
    visit.page.fill("#step", "2")
    assert visit.text("#where") == "Step 2 of 4."
    visit.page.fill("#step", "0")
    visit.page.select_option("#action", label="up")
    assert "up" in visit.text("#legend")
    assert visit.text("#legend").startswith("up: 3.3 in alldown: 3.5 in all")
    visit.page.select_option("#foil", label="nothing else")
    assert visit.page.locator("#bars .bar-other").count() == 0
    visit.page.select_option("#action", label="what it does: down")
    visit.page.select_option("#foil", label="left")
    assert "left" in visit.text("#legend")
    visit.page.click("#strip button >> nth=3")
    assert visit.text("#where") == "Step 3 of 4."
    visit.page.click(".key a")
    assert visit.text("#where") == "Step 3 of 4."
    assert visit.faults == []


def test_by_keyboard_alone(browser, drone):
    visit = Visit(browser, drone)
    keys = visit.page.keyboard
    keys.press("ArrowRight")
    keys.press("ArrowRight")
    assert visit.text("#where") == "Step 2 of 4."
    keys.press("End")
    assert visit.text("#where") == "Step 4 of 4."
    keys.press("Home")
    assert visit.text("#where") == "Step 0 of 4."
    for _ in range(20):
        keys.press("Tab")
        if visit.page.evaluate("document.activeElement.id") == "bars":
            break
    assert visit.page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    keys.press("ArrowRight")
    assert visit.text("#look-when") == "2 steps later"
    assert visit.text("#where") == "Step 0 of 4."
    keys.press("Escape")
    assert visit.text("#look-when") == "The largest step: 1 step later"
    keys.press(" ")
    assert visit.text("#play") == "Pause"
    visit.page.get_by_text("Step 4 of 4.").wait_for()
    visit.page.get_by_role("button", name="Play").wait_for()
    assert visit.faults == []


def test_pointing_at_a_bar_says_what_such_rewards_looked_like(browser, drone):
    visit = Visit(browser, drone)
    visit.page.hover("[data-component='3']")
    assert visit.text("#look-when") == "3 steps later"
    assert "down 0.86" in visit.text("#look-what")
    visit.page.hover("h1")
    assert visit.text("#look-when") == "The largest step: 1 step later"


@pytest.mark.parametrize("width", [320, 390])
@pytest.mark.parametrize("name", ["drone", "evil"])
def test_on_a_phone_nothing_is_wider_than_the_screen(browser, width, name, request):
    file = request.getfixturevalue(name)
    visit = Visit(browser, file, viewport={"width": width, "height": 800}, has_touch=True)
    visit.page.click("#numbers summary")
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
    visit.page.tap("[data-component='2']")
    assert visit.text("#look-when") == "2 steps later"
    assert visit.faults == []


def test_in_the_dark_it_is_dark(browser, drone):
    for scheme, is_dark in (("dark", True), ("light", False)):
        visit = Visit(browser, drone, color_scheme=scheme)
        shade = visit.page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (max(map(int, re.findall(r"\d+", shade)[:3])) < 80) == is_dark


def test_every_control_has_a_name(browser, drone):
    page = Visit(browser, drone).page
    unnamed = page.evaluate(
        """[...document.querySelectorAll('button, select, input, [tabindex="0"]')].filter((e) =>
        !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length)).length"""
    )
    assert unnamed == 0


def test_hostile_names_are_shown_as_they_are_and_do_nothing(browser, evil):
    visit = Visit(browser, evil)
    assert visit.text("h1") == EVIL
    assert EVIL in visit.text("#legend")
    assert visit.page.locator("h1 script, #legend script, b, dd b").count() == 0
    visit.page.fill("#step", "3")
    visit.page.select_option("#action", label="</script><b>")
    visit.page.click("#numbers summary")
    visit.page.locator("#table td").first.wait_for()
    assert "</script><b>" in visit.text("#table")
    assert visit.faults == []
    assert evil.read_text("utf-8").count("<script") == 2


def test_numbers_are_those_of_the_json(evil, drone):
    agent = trdlab.agent(Guess(), "CartPole-v1", name=EVIL, action_names=[EVIL, "</script><b>"])
    for file, what, steps in ((evil, agent, (0, 7)), (drone, "gridworld:drone", (0, 3))):
        page = held(file)
        for step in steps:
            how = {"parts": "forecast", "episodes": 0, "step": step, "max_steps": 30}
            told = trdlab.explain(what, **how).to_dict()
            for name, row in zip(page["actions"], page["components"][step], strict=True):
                known = told["moment"]["actions"][name]
                assert row == known["components"]
                chance = page["probabilities"][step][page["actions"].index(name)]
                assert chance == known["probability"]
            usual = [page["actions"][i] for i in page["usual"][step]]
            assert usual == [told["moment"]["action"], told["moment"]["foil"]]
            answer = [claim["sentence"] for claim in told["answer"]]
            numbers = page["told"][step][",".join(map(str, page["usual"][step]))]
            if file == drone:
                assert [page["sentences"][i] for i in numbers][: len(answer)] == answer[:4]
    assert '"type":"single"' in evil.read_text("utf-8")


@pytest.mark.parametrize("game", pretrained_names())
def test_where_it_looks_is_shown_for_the_bar_that_is_pointed_at(browser, tmp_path, game):
    how = {"episodes": 0, "others": 0, "max_steps": 30}
    out = trdlab.report(f"pretrained:{game}", out=tmp_path / "b.html", **how)
    visit = Visit(browser, out)
    assert visit.page.locator("#looks").is_hidden()
    assert visit.text("#look-where") == "Tap or point at a bar to see where the agent looks for it."
    visit.page.hover("[data-component='5']")
    visit.page.locator("#looks").wait_for()
    visit.page.wait_for_timeout(300)  # until the maps are unpacked
    painted = "(c) => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some((x) => x)"
    assert visit.page.locator("#looks").evaluate(painted)
    assert visit.page.locator("#frame").evaluate("(c) => [c.width, c.height]") == [160, 210]
    page = held(out)
    other = next(i for i in range(9) if i != page["usual"][page["step"]][0])
    visit.page.select_option("#action", str(other))
    visit.page.hover("[data-component='4']")
    known = "Where it looks is known only of the action that it usually takes."
    assert visit.text("#look-where") == known
    assert visit.faults == []


@pytest.mark.parametrize("how", [{"horizon": 0}, {"horizon": 2, "width": 3, "gamma": 0.0}])
def test_other_time_axes(browser, tmp_path, how):
    out = trdlab.report("gridworld:bridge", out=tmp_path / "a.html", episodes=0, **how)
    visit = Visit(browser, out)
    for component in range(how["horizon"] + 1):
        visit.page.hover(f"[data-component='{component}']")
    visit.page.click("#numbers summary")
    visit.page.locator("#table td").first.wait_for()
    assert visit.page.locator("#table tbody tr").count() == how["horizon"] + 1
    assert visit.faults == []


class Toll(gym.Env):
    """Pays 1, costs 1, or does nothing, as its action says."""

    observation_space, action_space = gym.spaces.Box(0, 99, (1,)), gym.spaces.Discrete(3)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return np.float32([0]), {}

    def step(self, action):
        self.steps += 1
        return np.float32([self.steps]), (1.0, -1.0, 0.0)[action], False, False, {}


class Posted:
    """Expects of each action the same at every step."""

    time_axis, future = TimeAxis(0.5, 2), Future("nobody")

    def decompose(self, seen: np.ndarray) -> RewardDecomposition:
        rows = [[0.5, 0.5, 0.0], [-2.0, 0.0, 4.0], [0.0, 0.0, 1.001]]
        return RewardDecomposition(np.tile(rows, (len(seen), 1, 1)), self.time_axis)


@pytest.fixture(scope="module")
def toll(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("reports") / "toll.html"
    agent = trdlab.agent(
        Posted(),
        env=Toll,
        policy=lambda seen: np.tile([0.6, 0.2, 0.2], (len(seen), 1)),
        action_names=["earn", "pay", "rest"],
    )
    return trdlab.report(agent, out=out, episodes=0, others=0, max_steps=30, step=0)


def test_what_is_drawn_and_what_is_usual_are_told_apart(browser, toll):
    visit, page = Visit(browser, toll), held(toll)
    name = page["actions"]
    for taken in range(3):
        visit.page.fill("#step", str(page["taken"].index(taken)))
        first = f"{'what it does' if taken == 0 else 'usual action'}: earn"
        assert visit.text("#action option >> nth=0") == first
        here = "" if taken == 0 else " (taken here)"
        assert visit.text(f"#foil option >> nth={taken + 1}") == name[taken] + here
        said = (
            "The agent takes earn (chosen with 60 %)."
            if taken == 0
            else f"Here it takes {name[taken]}, by a random draw; usually earn (60 %)."
        )
        assert visit.text("#doing").startswith(said)
    # pay is worth more, and is not called the next best
    assert visit.text("#foil option >> nth=0") == "another action: pay"
    prefers = "It takes what its policy prefers. Of these values, that of pay is larger by 1."
    assert prefers in visit.text("#more")
    visit.page.select_option("#foil", "0")
    visit.page.select_option("#action", "0")
    assert visit.text("#says") == "Both are earn: the bars show it alone."
    assert visit.page.locator("#bars .bar-other").count() == 0
    assert visit.text("#legend").startswith("earn: 1 in all")
    visit.page.select_option("#action", "2")
    assert visit.text("#legend").startswith("rest: 1.001 in allearn: 1 in all")
    assert visit.text("#look-when") == "No step stands out"
    assert visit.page.locator("#look-clips canvas").count() == 0
    visit.page.fill("#step", "27")
    assert "The recording ends 2 steps later" not in visit.text("#doing")
    visit.page.fill("#step", "28")
    assert "The recording ends 1 step later: what came then is not known." in visit.text("#doing")
    assert visit.faults == []


def test_costs_have_the_scale_of_rewards_and_what_came_is_marked(browser, toll):
    visit, page = Visit(browser, toll), held(toll)
    numbers = visit.page.locator("#bars text").all_text_contents()
    assert {"0.5", "−0.5", "−2", "4"} <= set(numbers)
    assert visit.page.locator("#bars .gap").count() == 2
    signs = np.sign(page["rewards"]).tolist()
    for action in (0, 1):
        step = page["taken"].index(action)
        visit.page.fill("#step", str(step))
        came = [signs[step] > 0, signs[step + 1] > 0, max(signs[step + 2 :]) > 0]
        cost = [signs[step] < 0, signs[step + 1] < 0, min(signs[step + 2 :]) < 0]
        assert visit.page.locator("#bars .paid").count() == sum(came)
        assert visit.page.locator("#bars .cost").count() == sum(cost)
        legend = f"what really came in this episode, after {page['actions'][action]}"
        assert legend in visit.text("#legend")
    visit.page.fill("#step", str(page["taken"].index(2)))
    assert visit.page.locator("#bars .paid, #bars .cost").count() == 0  # rest is not shown
    for kind, sign in (("paid", 1), ("cost", -1)):
        assert visit.page.locator(f"#line .{kind}").count() == page["rewards"].count(sign)
    assert f"score {sum(page['rewards']):.3g}" in visit.text("dl")
    assert visit.faults == []


def test_a_chosen_bar_and_the_address_are_let_go(browser, drone):
    visit = Visit(browser, drone)
    visit.page.click("[data-component='2']")
    visit.page.hover("h1")
    assert visit.text("#look-when") == "2 steps later"
    assert "down 0.9, up 0, discounted. Without the discount: 1, 0." in visit.text("#look-what")
    assert "With down, the chance of a reward then is 100 %." in visit.text("#look-what")
    visit.page.keyboard.press("Escape")
    assert visit.text("#look-when") == "The largest step: 1 step later"
    visit.page.click("[data-component='2']")
    visit.page.hover("h1")
    visit.page.click(".key a")
    assert visit.text("#where") == "Step 3 of 4."
    assert visit.text("#look-when") != "2 steps later"
    assert visit.page.evaluate("location.hash") == "#step-3"
    visit.page.keyboard.press("End")
    assert visit.text("#doing").endswith("The episode ends here.")
    assert visit.page.evaluate("location.hash") == ""
    framed = visit.page.locator("#strip .here")
    assert framed.get_attribute("aria-label") == "Go to step 4"
    assert visit.faults == []


class Flat:
    """Expects the number of a door of going through it."""

    time_axis, future = TimeAxis(0.9, 2), Future("nobody")

    def decompose(self, seen: np.ndarray) -> RewardDecomposition:
        doors = np.tile([[0.0, 0, 0], [1, 0, 0], [2, 1, 0]], (len(seen), 1, 1))
        return RewardDecomposition(doors, self.time_axis)


def test_actions_that_are_forbidden_have_no_bars(browser, tmp_path):
    agent = trdlab.agent(Flat(), env=Doors)
    visit = Visit(browser, trdlab.report(agent, out=tmp_path / "d.html", episodes=0))
    page = held(tmp_path / "d.html")
    closed = [(t, a) for t in range(6) for a in range(3) if page["components"][t][a][0] is None]
    assert closed
    for step, action in closed:
        visit.page.fill("#step", str(step))
        visit.page.select_option("#action", str(action))
        assert f"{page['actions'][action]}:" not in visit.text("#legend")
    assert visit.faults == []


def test_an_explanation_begins_where_it_is_about(browser, tmp_path):
    explained = trdlab.explain("gridworld:ledge", step=1, episodes=12)
    out = explained.to_html(tmp_path / "ledge.html")
    assert Visit(browser, out).text("#where") == "Step 1 of 2."
    asked = trdlab.explain("gridworld:ledge", step=1, episodes=0, action="up", foil="left")
    visit = Visit(browser, asked.to_html(tmp_path / "asked.html"))
    assert re.match(r"up: .* in allleft: ", visit.text("#legend"))
    with pytest.raises(OutputError, match="exists"):
        explained.to_html(out)
    explained.to_html(out, overwrite=True)


def test_a_world_without_a_map_is_shown_in_words(browser, tmp_path):
    out = trdlab.report("tabular:Taxi-v4", out=tmp_path / "t.html", episodes=0, max_steps=10)
    visit = Visit(browser, out)
    assert "row" in visit.text("#words")
    assert visit.page.locator("#strip button").count() == 0
    assert visit.faults == []


def test_where_no_reward_came_it_says_so(browser, tmp_path):
    out = trdlab.report("tabular:FrozenLake-v1", out=tmp_path / "f.html", episodes=0, max_steps=3)
    told = Visit(browser, out).text("#gallery")
    assert "In 4 episodes with 12 steps, no reward came." in told
    assert "That has not been tested" in Visit(browser, out).text("#trust")


def test_nothing_is_left_where_it_cannot_be_written(tmp_path):
    for out, why in (("a.txt", "known ending"), ("no/a.html", "does not exist")):
        with pytest.raises(OutputError, match=why):
            trdlab.report("gridworld:drone", out=tmp_path / out)
    with pytest.raises(InputError, match="no step 99"):
        trdlab.report("gridworld:drone", out=tmp_path / "a.html", step=99, episodes=0)
    assert list(tmp_path.iterdir()) == []


def test_an_exact_table_needs_no_torch(tmp_path):
    code = (
        "import sys; from trdlab.cli import main\n"
        "try: main(['report', 'gridworld:drone', '--episodes', '20', '-o', 'd.html'])\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        "assert 'torch' not in sys.modules"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "Report: d.html\n")
    assert (tmp_path / "d.html").exists()
