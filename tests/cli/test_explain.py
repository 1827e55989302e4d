"""`trdlab explain` as its users see it."""

import html
import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import trdlab
from trdlab.rollouts.playing import Playing


@pytest.fixture
def explain(trdlab) -> Callable[..., tuple[int, str, str]]:
    """Returns a function that runs `trdlab explain`: exit code, stdout, stderr."""
    return partial(trdlab, "explain")


def test_without_options_it_says_what_matters_most_and_where_pictures_went(explain, tmp_path):
    code, out, err = explain("gridworld:drone", "--episodes", 40)
    assert code == 0
    assert out.startswith("drone · step 0 of the episode with seed 0\nγ = 0.95 · N = 4 · w = 1\n")
    assert out.splitlines()[-5:] == [
        "The agent scored 4: its episodes are all the same.",
        "Down gives more immediate rewards: 2.71 in the first 4 steps, while up gives nothing.",
        "Both pay 4 in total, but each step of waiting makes a reward count 5 % less: "
        "down is worth 3.52, up 3.26.",
        "As forecast, down was worth 0.266 more than up.",
        "For what comes in the first 4 steps, the agent's forecasts are better than a guess.",
    ]
    moments = ["forecast-seed-0-step-0.png", "contrast-seed-0-step-0.png"]
    names = [*moments, "episode-seed-0.png", "calibration.png"]
    paths = [Path("explanations") / "drone" / name for name in names]
    *told, hint = err.splitlines()
    assert told == [f"Picture: {path}" for path in paths]
    assert hint == "To go through the episode in a browser: trdlab report gridworld:drone"
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)
    explain("gridworld:drone", "--episodes", 40)
    assert (tmp_path / "explanations" / "drone-2" / "calibration.png").exists()


def test_actions_are_called_as_the_user_says(explain):
    names = ("--action-names", "hoch,runter,links,rechts")
    _, out, _ = explain("gridworld:drone", "--episodes", 0, "--what", "contrast", *names)
    assert "Runter gives more immediate rewards" in out
    code, _, err = explain("gridworld:drone", "--action-names", "hoch,runter")
    assert (code, err) == (
        2,
        "error: There are 2 names for 4 actions: hoch, runter. Give one for each action.\n",
    )


def test_a_notebook_shows_what_the_command_prints(explain, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = explain("gridworld:drone", "--episodes", 40)
    explained = trdlab.explain("gridworld:drone", episodes=40)
    assert f"{explained}\n" == out
    assert max(map(len, out.splitlines())) <= 80
    assert len(out.splitlines()) <= 24
    assert repr(explained) == "<Explanation: drone · step 0 of the episode with seed 0>"
    shown = html.unescape(explained._repr_html_())
    assert all(claim.sentence in shown for claim in explained.answer)


def test_the_first_lines_of_the_readme_print_what_the_command_prints(explain, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert f"{trdlab.explain('gridworld:drone')}\n" == explain("gridworld:drone")[1]


def test_the_details_are_all_there_is_to_tell(explain):
    words = ("gridworld:ledge", "--episodes", 40)
    _, brief, _ = explain(*words, "--out", "a")
    _, out, _ = explain(*words, "--out", "b", "--details")
    data = json.loads(explain(*words, "--json")[1])
    answer = [claim["sentence"] for claim in data["answer"]]
    assert brief.splitlines()[-len(answer) :] == answer
    assert len(answer) == 5
    told = [(part["heading"], part["findings"]) for part in data["sections"]]
    lines = [line for heading, found in told for line in (heading, *map(indented, found))]
    *told_lines, guide = out.splitlines()
    assert told_lines[-len(lines) :] == lines
    assert guide == "Every word is explained in “How to read the output” (docs/output.md)."
    headings = ["Why right, not down", "What would change that", "What to expect of right"]
    assert [heading for heading, _ in told][:3] == headings
    assert [heading for heading, _ in told][-1] == "What this rests on"


def indented(finding: dict[str, Any]) -> str:
    return f"  {finding['sentence']}"


def test_a_contrast_at_a_step_with_named_and_numbered_actions(explain):
    code, out, err = explain(
        "gridworld:ledge", "--what", "contrast", "--step", 1, "--action", "up", "--foil", 3
    )
    assert (code, err) == (0, "")
    assert out.startswith("ledge · step 1 of the episode with seed 0\n")
    assert "\nHow up differs from right\n" in out
    assert "up − right   [" in out
    assert "right is worth 0.838, up 0.797." in out
    assert "Tried out" in out
    assert "What to expect of" not in out  # that is the forecast
    _, out, _ = explain("gridworld:ledge", "--what", "forecast", "--step", 1, "--episodes", 0)
    assert "What to expect of right" in out
    assert " − " not in out  # that is the contrast


def test_the_story_of_an_episode_as_text_as_json_and_as_a_picture(explain):
    words = ("gridworld:loop,slip=0.2", "--what", "episode", "--seed", 3, "--episodes", 20)
    code, out, err = explain(*words, "--out", "pictures")
    assert code == 0
    assert "loop,slip=0.2 · the episode with seed 3" in out
    assert "At the start, all that the agent expected was worth 1.14, most of it after" in out
    assert "The episode was cut off after 100 steps." in out
    assert err == "Picture: pictures/episode-seed-3.png\n"
    _, out, _ = explain(*words, "--json")
    data = json.loads(out)
    assert data["moment"] is None
    assert (data["episode"]["seed"], data["episode"]["steps"]) == (3, 100)
    (section,) = data["sections"]
    assert (section["name"], section["findings"][-1]["kind"]) == ("episode", "cut-off")


def test_a_calibration_as_text_and_as_json(explain):
    _, out, err = explain("gridworld:ledge", "--what", "calibration", "--N", 3, "--gamma", 0.9)
    assert out.startswith("ledge\nγ = 0.9 · N = 3 · w = 1\n")
    assert "The forecasts were checked on 300 episodes, 952 steps altogether." in out
    assert err == ""
    code, out, _ = explain("gridworld:ledge", "--what", "calibration", "--json", "--episodes", 50)
    data = json.loads(out)
    assert code == 0
    assert data["schema"] == "trdlab.explain/2"
    assert data["calibration"]["schema"] == "trdlab.trust/2"
    assert data["calibration"]["judged"]["episodes"] == 50
    assert not Path("explanations").exists()


def test_a_map_file_is_an_agent_too(explain, tmp_path):
    file = tmp_path / "mine.txt"
    file.write_text("S..C\n", encoding="utf-8")
    code, out, _ = explain(file, "--what", "forecast", "--N", 3, "--episodes", 0)
    assert code == 0
    assert "With right, the first reward comes 2 steps later: it is 1." in out
    assert "How far to trust it" not in out


def test_a_run_is_explained_by_its_own_rewards(explain, trained):
    code, out, _ = explain(trained, "--what", "forecast,calibration", "--json", "--episodes", 30)
    data = json.loads(out)
    assert code == 0
    assert data["agent"] == "drone"
    assert data["future"]["policy"] == "the greedy policy of the network"
    assert data["future"]["reward"] == "sign of each reward"
    assert list(data["moment"]["actions"]) == ["up", "down", "left", "right"]
    chances = [action["probability"] for action in data["moment"]["actions"].values()]
    assert sorted(chances) == [0.0, 0.0, 0.0, 1.0]
    assert max(data["calibration"]["calibration"]["mean"]) <= 1.0  # and not 4, the treasure
    assert data["calibration"]["ceiling"]["num_moments"] > 20
    _, again, _ = explain(trained, "--what", "forecast,calibration", "--json", "--episodes", 30)
    assert again == out


def test_a_run_says_how_long_a_step_is(explain, trained):
    _, out, _ = explain(trained, "--episodes", 12, "--out", "pictures", "--details")
    assert "a step is 0.25 s of play" in out
    assert "Of each reward only the sign counts." in out
    assert len(list(Path("pictures").iterdir())) == 4


def test_a_run_in_another_environment(explain, trained):
    same = ("--env", "trdlab/DroneGridworld-v0", "--env-arg", "slip=0.9")
    code, out, _ = explain(trained, *same, "--what", "calibration", "--episodes", 12)
    assert code == 0
    assert "The forecasts were checked on 12 episodes" in out
    for env, why in (
        ("trdlab/LedgeGridworld-v0", "it has 8 states, and the agent knows 14 states"),
        ("CartPole-v1", "it has 4 float32, and the agent knows 14 states"),
        ("Acrobt-v1", "There is no environment 'Acrobt-v1'. Did you mean 'Acrobot-v1'?"),
    ):
        code, _, err = explain(trained, "--env", env)
        assert (code, err.count("\n")) == (2, 1)
        assert why in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--step", "99"], "There is no step 99: the episode is over after 5 steps."),
        (["--action", "dwn"], "There is no action 'dwn'. Did you mean 'down'?"),
        (["--foil", "7"], "There is no action '7'. Known: down, left, right, up."),
        (["--action", "up", "--foil", "0"], "Action and foil are both 'up'."),
        (["--what", "contrst"], "There is no explanation 'contrst'. Did you mean 'contrast'?"),
        (["--what", "calibration", "--episodes", "0"], "A calibration needs episodes."),
        (["--env", "CartPole-v1"], "'CartPole-v1' does not fit the agent: it has 4 float32"),
        (["--env-arg", "slip=0.2"], "Write gridworld:drone,slip=0.2"),
        (["--N", "-1"], "horizon N"),
    ],
)
def test_refusals_are_one_clear_line(explain, words, message):
    code, out, err = explain("gridworld:drone", *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert not Path("explanations").exists()


def test_nothing_is_overwritten(explain):
    Path("pictures").mkdir()
    Path("pictures/calibration.png").write_text("mine", encoding="utf-8")
    code, out, err = explain("gridworld:drone", "--what", "calibration", "--out", "pictures")
    assert (code, out) == (2, "")
    assert "The picture 'pictures/calibration.png' exists." in err
    assert Path("pictures/calibration.png").read_text(encoding="utf-8") == "mine"
    code, _, err = explain("gridworld:drone", "--out", "pictures/calibration.png")
    assert (code, "is a file" in err) == (2, True)


def test_a_gridworld_is_explained_without_pytorch(tmp_path):
    code = (
        "import sys; from trdlab.cli import main\n"
        "try: main(['explain', 'gridworld:drone', '--episodes', '20'])\n"
        "except SystemExit as end: assert not end.code\n"
        "assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path, capture_output=True)


def test_episodes_are_cut_off_and_it_says_so(explain, trained):
    words = (trained, "--episodes", 12, "--what", "episode")
    _, out, _ = explain(*words, "--max-steps", 2)
    assert "episodes are cut off after 2 steps" in out
    assert "The episode was cut off after 2 steps" in out
    _, out, _ = explain(*words, "--max-steps", 2, "--json")
    data = json.loads(out)
    assert (data["max_steps"], data["episode"]["steps"]) == (2, 2)
    _, out, _ = explain("gridworld:ledge", "--episodes", 12, "--what", "episode")
    assert "cut off after" not in out
    judged = (trained, "--episodes", 12, "--what", "calibration")
    assert (
        "episodes are cut off after 1 step" in explain(*judged, "--max-steps", 1)[1].splitlines()[1]
    )
    code, _, err = explain(trained, "--max-steps", 2, "--step", 2)
    assert code == 2
    assert "There is no step 2 in 2 steps. Choose another --max-steps." in err


def test_a_moment_as_json_tells_its_errors_and_its_only_reward(explain, trained):
    _, out, _ = explain(trained, "--what", "forecast", "--json", "--episodes", 30)
    data = json.loads(out)
    assert data["seconds_per_step"] == 0.25
    assert len(data["moment"]["error"]) == 7
    assert data["moment"]["only_reward"] == 1.0  # the sign of each
    _, out, _ = explain(trained, "--what", "forecast", "--json", "--episodes", 0)
    assert json.loads(out)["moment"]["error"] is None


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("explain", "gridworld:drone"), "drone"),
        (("compare", "gridworld:drone", "gridworld:drone"), "drone-against-drone"),
    ],
)
def test_what_began_at_once_gets_a_folder_of_its_own(trdlab, monkeypatch, words, name):
    """Another process makes its folder while this one plays."""
    folder, original = Path("explanations") / name, Playing.take

    def take(self: Playing, *arguments: Any) -> Any:
        folder.mkdir(parents=True, exist_ok=True)
        return original(self, *arguments)

    monkeypatch.setattr(Playing, "take", take)
    code, _, err = trdlab(*words, "--episodes", 2)
    told = [line for line in err.splitlines() if line.startswith("Picture: ")]
    pictures = [Path(line.removeprefix("Picture: ")) for line in told]
    assert code == 0
    assert {path.parent for path in pictures} == {Path("explanations") / f"{name}-2"}
    assert all(path.exists() for path in pictures)
    assert list(folder.iterdir()) == []


def test_what_is_interrupted_leaves_nothing(explain, tmp_path, monkeypatch):
    taken = 0

    def take(self: Playing, *arguments: Any) -> Any:
        nonlocal taken
        taken += 1
        if taken == 20:
            raise KeyboardInterrupt
        return original(self, *arguments)

    original = Playing.take
    monkeypatch.setattr(Playing, "take", take)
    code, out, _ = explain("gridworld:ledge,slip=0.2")
    assert (code, out) == (130, "")
    assert list(tmp_path.iterdir()) == []


def test_what_matters_for_near_and_far(explain, tmp_path):
    how = ("--what", "saliency", "--component", "0,later", "--episodes", 0)
    code, out, _ = explain("gridworld:drone", *how, "--out", "pictures")
    assert code == 0
    assert "What it expects after the first 4 steps hangs most on row" in out
    assert out.count("adds to") == 2
    assert (tmp_path / "pictures" / "saliency-seed-0-step-0.png").exists()
    data = json.loads(explain("gridworld:drone", *how, "--json")[1])
    assert data["saliency"]["entries"]["method"] == "exchange"
    assert data["moment"] is None
    code, _, err = explain("gridworld:drone", "--what", "saliency", "--component", 9)
    assert (code, err) == (2, "error: There are no components '9'. They run from 0 to 4.\n")
