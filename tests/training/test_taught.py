"""A run that learns from a teacher: refused, begun, picked up, loaded; and it learns."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import trdlab
from trdlab.agents.teachers import find_teacher
from trdlab.cli import main
from trdlab.deep.lessons import Levels
from trdlab.deep.settings import TrainSettings
from trdlab.deep.trainer import Trainer
from trdlab.errors import InputError, TrdlabError
from trdlab.estimator import Estimator
from trdlab.policies import Policy
from trdlab.runs import RunFolder, best_step, checkpoint_steps, list_runs, read_metrics
from trdlab.show.plots.training import learning_curves
from trdlab.show.training import runs_page
from trdlab.training.loading import evaluate_run, load
from trdlab.training.run import Run, begin, carry_on, resume
from trdlab.training.setup import read_settings

AGENTS = """
import numpy as np

def pole():
    return lambda seen: int(seen[2] + seen[3] > 0.0)

def careless():
    return lambda seen: 1

def three():
    return lambda seen: np.full((len(seen), 3), 1 / 3)

class Wide:
    '''Sees eight numbers.'''

    def act(self, observations, state, begins):
        if observations.shape[1] != 8:
            raise ValueError("I see eight numbers")
        return np.full((len(observations), 2), 0.5), None

class Valued:
    '''Balances the pole by values of actions.'''

    def q_values(self, observations):
        falls = observations[:, 2:3] + observations[:, 3:4]
        return 50.0 + np.concatenate([-falls, falls], axis=1)

    def act(self, observations, state, begins):
        return np.eye(2)[self.q_values(observations).argmax(axis=1)], None
"""

FEW = {
    "agent_steps": 240,
    "num_envs": 2,
    "N": 2,
    "hidden": [16],
    "batch_size": 8,
    "learning_starts": 16,
    "teacher_steps": 200,
    "offline_updates": 60,
    "checkpoint_every": 70,
    "log_every": 20,
    "evaluate_episodes": 4,
    "epsilon_start": 0.1,
}


@pytest.fixture(scope="module")
def named(tmp_path_factory) -> Callable[[str], str]:
    """Returns a function from the name of one of the agents above to what names it outside."""
    file = tmp_path_factory.mktemp("agents") / "agents.py"
    file.write_text(AGENTS)
    return lambda function: f"python:{file}:{function}"


def train(out: Path, teacher: str, env: str = "CartPole-v1", **lines: Any) -> Path:
    settings = TrainSettings("gym", env).changed(FEW | {"teacher": teacher} | lines)
    with begin(settings, out, find=find_teacher) as run:
        carry_on(run)
    return out


@pytest.fixture(scope="module")
def poled(named, tmp_path_factory) -> Path:
    return train(tmp_path_factory.mktemp("runs") / "poled", named("pole"))


# ---- what a run keeps ----------------------------------------------------------------------------


def test_the_manifest_has_the_teacher_and_the_two_levels(poled, named):
    run = RunFolder.open(poled)
    noted = run.manifest["teacher"]
    assert noted["name"] == run.config["teacher"] == named("pole")
    assert re.fullmatch("[0-9a-f]{64}", noted["sha256"])
    assert noted["episodes"] == 30
    assert 150 < noted["score"] <= 500
    assert 15 < noted["random"] < 30
    assert run.config["distil"] == "policy"  # a function has no values


def test_the_metrics_tell_of_each_phase(poled):
    rows = read_metrics(poled / "metrics.jsonl")
    assert [row["clock"] for row in rows] == list(range(20, 501, 20))
    of = {phase: [row for row in rows if row["phase"] == phase] for phase in
          ("teacher", "offline", "online")}  # fmt: skip
    assert [len(rows) for rows in of.values()] == [9, 3, 13]
    assert all(row["distance"] is None and row["loss"] is None for row in of["teacher"])
    assert all(row["weight"] == 1 for row in of["teacher"] + of["offline"])
    assert all(row["score"] is None for row in of["offline"])
    told = [row["distance"] for row in rows if row["distance"] is not None]
    assert told[-1] < told[0]
    assert rows[-1]["updates"] == 60 + (240 - 16) // 4


def test_checkpoints_stand_at_the_ends_of_phases_and_only_the_students_have_scores(named, tmp_path):
    settings = TrainSettings("gym", "CartPole-v1").changed(FEW | {"teacher": named("pole")})
    seen: dict[int, Any] = {}

    def look(trainer: Any) -> None:
        run = RunFolder.open(tmp_path / "run")
        seen[max(checkpoint_steps(run), default=0)] = best_step(run)

    with begin(settings, tmp_path / "run", find=find_teacher) as run:
        carry_on(run, on_step=look)
    assert list(seen) == [0, 70, 140, 200, 210, 260, 280, 350, 420, 490]
    assert {seen[at] for at in (70, 140, 200, 210)} == {None}


def test_a_run_among_others_shows_how_far_it_is_by_its_clock(poled):
    shown = runs_page(list_runs(poled.parent), width=100).plain
    assert re.search(r"poled +CartPole-v1 +2 +1 +500 .* done", shown)


def test_a_learning_curve_is_that_of_the_student(poled):
    rows = read_metrics(poled / "metrics.jsonl")
    ax = learning_curves(Figure().subplots(), {"poled": rows}, value="epsilon")
    (line,) = ax.get_lines()
    assert line.get_xdata().tolist() == [0, *range(20, 241, 20)]


# ---- picked up -----------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [1, 80, 200, 230, 260, 300])
def test_it_is_picked_up_in_every_phase(poled, named, tmp_path, at):
    def run_until(run: Run, clock: int) -> None:
        carry_on(run, should_stop=lambda: run.trainer.clock >= clock)

    settings = TrainSettings("gym", "CartPole-v1").changed(FEW | {"teacher": named("pole")})
    out = tmp_path / "run"
    with begin(settings, out, find=find_teacher) as run:
        run_until(run, at)
    with resume(out, find=find_teacher, teacher=named("pole")) as run:
        run_until(run, 10_000)
    lines = [[{**row, "seconds": 0} for row in read_metrics(of / "metrics.jsonl")]
             for of in (out, poled)]  # fmt: skip
    assert lines[0] == lines[1]
    one, other = (load(of).network.state_dict() for of in (out, poled))
    assert all(np.array_equal(one[name], other[name]) for name in one | other)


def test_code_is_not_executed_because_a_run_says_so(poled, named, capsys):
    with (
        pytest.raises(InputError, match=r"teacher of the run is code.*name it again as `teacher`"),
        resume(poled, find=find_teacher),
    ):
        pass
    assert "--teacher" in RunFolder.open(poled).resume_command
    with pytest.raises(SystemExit) as end:
        main(["resume", str(poled)])
    assert end.value.code == 2
    assert "If you trust it, name it again as --teacher." in capsys.readouterr().err


def test_a_teacher_may_have_been_moved_but_not_changed(poled, named, tmp_path):
    elsewhere = tmp_path / "elsewhere.py"
    elsewhere.write_text(AGENTS)
    run = Path(shutil.copytree(poled, tmp_path / "run"))
    with resume(run, find=find_teacher, teacher=f"python:{elsewhere}:pole") as held:
        assert held.trainer.done
    elsewhere.write_text(AGENTS + "\n# mended\n")
    with (
        pytest.raises(InputError, match="began with another teacher than"),
        resume(run, find=find_teacher, teacher=f"python:{elsewhere}:pole"),
    ):
        pass


def test_a_torn_manifest_is_told(poled, named, tmp_path):
    run = Path(shutil.copytree(poled, tmp_path / "run"))
    manifest = json.loads((run / "manifest.json").read_text())
    del manifest["teacher"]["score"]
    (run / "manifest.json").write_text(json.dumps(manifest))
    with (
        pytest.raises(TrdlabError, match="does not say what its teacher reached"),
        resume(run, find=find_teacher, teacher=named("pole")),
    ):
        pass


# ---- refused, with nothing written ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (
            "careless",
            r"is not clearly better than random actions: in 30 episodes each, with intervals of "
            r"95 %, it reaches 9\.\d+ \[.*\], and they 2\d\.?\d* \[.*\]\. Choose a better teacher, "
            r"or train without one\.",
        ),
        ("three", r"It must return an action's number|3 probabilities|answers 2 observations"),
        ("Wide", r"I see eight numbers"),
        ("nobody", r"nobody"),
    ],
)
def test_teachers_that_will_not_do(named, tmp_path, function, message):
    with pytest.raises((InputError, ValueError), match=message):
        train(tmp_path / "run", named(function))
    assert not (tmp_path / "run").exists()


def test_a_teacher_of_another_place_is_refused_by_what_it_sees_or_does(poled, tmp_path):
    with pytest.raises(InputError, match="'Acrobot-v1' does not fit the agent: it has 6 float32"):
        train(tmp_path / "run", str(poled), "Acrobot-v1")
    with pytest.raises(InputError, match=r"it has 16 states and|it has .*4 actions|does not fit"):
        train(tmp_path / "run", "gridworld:drone", "FrozenLake-v1")
    assert list(tmp_path.iterdir()) == []


def test_the_command_says_what_is_wrong_in_a_line(named, tmp_path, capsys):
    words = ["train", "gym", "CartPole-v1", "--teacher", named("careless")]
    with pytest.raises(SystemExit) as end:
        main([*words, "--out", str(tmp_path / "run")])
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: The teacher 'python:")


# ---- what comes of it ----------------------------------------------------------------------------

LAKE = "tabular:FrozenLake-v1,is_slippery=false", "FrozenLake-v1"
ENOUGH = {
    "teacher_steps": 2_000,
    "offline_updates": 1_500,
    "agent_steps": 400,
    "batch_size": 32,
    "hidden": [64],
    "learning_rate": 1e-3,
    "evaluate_episodes": 10,
}


@pytest.fixture(scope="module")
def learned(named, tmp_path_factory) -> Path:
    return train(tmp_path_factory.mktemp("runs") / "learned", named("pole"), **ENOUGH)


def test_the_policy_head_reaches_its_teacher(learned):
    reached = evaluate_run(learned)[0].returns.mean()
    assert reached >= 0.9 * RunFolder.open(learned).manifest["teacher"]["score"]


def test_a_run_with_a_policy_head_is_an_estimator_that_acts(learned):
    estimator = trdlab.load(learned)
    assert isinstance(estimator, Estimator)
    assert isinstance(estimator, Policy)
    head = "the policy head of the network (its likeliest action each time)"
    assert estimator.future.policy == head
    seen = np.random.default_rng(0).normal(scale=0.1, size=(50, 4)).astype(np.float32)
    likely, memory = estimator.act(seen, None, np.ones(50, dtype=np.bool_))
    assert memory is None
    assert set(likely.ravel()) == {0.0, 1.0}
    falls = seen[:, 2] + seen[:, 3] > 0
    assert (likely.argmax(axis=1) == falls).mean() > 0.9
    assert estimator.decompose(seen).components.shape == (50, 2, 3)
    agents = trdlab.agent(str(learned)), trdlab.agent(estimator, "CartPole-v1")
    for agent in agents:
        assert agent.policy is not None
        assert (
            agent.evaluate(3, seed=5).returns.tolist()
            == agents[0].evaluate(3, seed=5).returns.tolist()
        )
    page = str(trdlab.explain(agents[0], seed=1, step=3, episodes=3))
    assert "chosen" in page


def test_what_is_drawn_is_told_and_drawn(named, tmp_path):
    estimator = load(train(tmp_path / "run", named("pole"), draw=True))
    assert estimator.future.policy == "the policy head of the network (drawing its actions)"
    likely, _ = estimator.act(np.zeros((1, 4), np.float32), None, np.array([True]))
    assert 0 < likely.min() < likely.max() < 1


def test_values_are_taken_over_where_the_teacher_has_some(named, tmp_path):
    out = train(tmp_path / "run", named("Valued"), **ENOUGH)
    run = RunFolder.open(out)
    assert run.config["distil"] == "values"
    estimator = load(out)
    assert not isinstance(estimator, Policy)
    assert estimator.future.policy == "the greedy policy of the network"
    assert evaluate_run(out)[0].returns.mean() >= 0.9 * run.manifest["teacher"]["score"]


def test_an_exact_table_teaches_its_values(tmp_path):
    lines = ENOUGH | {"gamma": 0.95, "teacher_epsilon": 0.3, "env_arg": ["is_slippery=false"]}
    lines["temperature"] = 0.02  # values in [0, 1] differ by little
    out = train(tmp_path / "run", *LAKE, **lines)
    run = RunFolder.open(out)
    noted = run.manifest["teacher"]
    assert (run.config["distil"], noted["sha256"], noted["score"]) == ("values", None, 1.0)
    assert evaluate_run(out)[0].returns.tolist() == [1.0] * 10


def test_values_on_another_scale_are_not_taken_over_unasked(tmp_path):
    lines = {"offline_updates": 10, "agent_steps": 20, "env_arg": ["is_slippery=false"]}
    out = train(tmp_path / "run", *LAKE, **lines)
    assert RunFolder.open(out).config["distil"] == "policy"  # γ = 0.99 here, and 0.95 there


def test_a_run_teaches_by_the_checkpoint_that_it_was_then(learned, tmp_path):
    out = train(tmp_path / "run", str(learned))
    run = RunFolder.open(out)
    assert run.config["teacher"] == f"{learned}@3900"
    assert run.config["distil"] == "policy"
    assert re.fullmatch("[0-9a-f]{64}", run.manifest["teacher"]["sha256"])
    with resume(out, find=find_teacher) as held:
        assert held.trainer.done


# ---- games ---------------------------------------------------------------------------------------

PLAYERS = """
import numpy as np
from trdlab.policies.adapted import About

class Player:
    def __init__(self, seen, **games):
        self.about, self.seen = About("a player", seen=seen, num_actions=4, games=games), []

    def act(self, observations, state, begins):
        self.seen.append(np.shape(observations))
        return np.tile([0.0, 0.4, 0.3, 0.3], (len(observations), 1)), None

def looks_at_screens():
    return Player((210, 160, 3), screens=True)

def separates_lives():
    return Player((4, 84, 84), separate_lives=True)
"""


def test_a_teacher_is_shown_what_it_looks_at_and_the_student_what_it_knows(tmp_path):
    (tmp_path / "players.py").write_text(PLAYERS)
    lines = FEW | {"teacher": f"python:{tmp_path / 'players.py'}:looks_at_screens"}
    lines |= {"teacher_steps": 24, "offline_updates": 2, "distil": "policy", "device": "cpu"}
    settings = TrainSettings("atari", "Breakout").changed(lines)
    found = find_teacher(settings)
    assert (found.needs, found.beside) == ((), ("screens=true",))
    assert found.settled(settings).env_arg == ()  # evaluations do without the screens

    def begun() -> Trainer:
        environments = found.make(settings)
        return Trainer(settings, environments, (found.teacher(settings), Levels(9.0, 1.0)))

    whole, first, second = begun(), begun(), begun()
    found.policy.seen.clear()  # type: ignore[attr-defined]
    for _ in range(5):
        first.step()
    assert set(found.policy.seen) == {(2, 210, 160, 3)}  # type: ignore[attr-defined]
    assert first.memory.sample(1, np.random.default_rng(0)).observations.shape == (1, 4, 84, 84)
    second.load_state_dict(first.state_dict())
    for run in (whole, second):
        while run.agent_steps < 8:
            run.step()
    assert np.array_equal(whole.stack.observations, second.stack.observations)
    assert np.array_equal(whole.environments.screens, second.environments.screens)


def test_a_game_is_played_as_the_teacher_knows_it(tmp_path):
    (tmp_path / "players.py").write_text(PLAYERS)
    name = f"python:{tmp_path / 'players.py'}:separates_lives"
    settings = TrainSettings("atari", "Breakout").changed(FEW | {"teacher": name})
    found = find_teacher(settings)
    settled = found.settled(settings)
    assert settled.env_arg == ("separate_lives=true",)
    assert find_teacher(settled).settled(settled).env_arg == settled.env_arg


# ---- settings and commands -----------------------------------------------------------------------


def test_with_a_teacher_the_presets_do_not_begin_at_random(tmp_path):
    taught = read_settings("atari", "Breakout", "paper", None, {"teacher": "a.pt"})
    assert (taught.epsilon_start, taught.learning_starts) == (0.01, 10_000)
    assert (taught.teacher_steps, taught.offline_updates) == (1_000_000, 1_000_000)
    on_a_card = read_settings("atari", "Breakout", "gpu", None, {"teacher": "a.pt"})
    assert (on_a_card.teacher_steps, on_a_card.offline_updates) == (100_000, 30_000)
    small = read_settings(
        "gym", "CartPole-v1", "smoke", None, {"teacher": "a", "teacher_steps": 99}
    )
    assert (small.teacher_steps, small.offline_updates) == (99, 1_250)
    assert read_settings("atari", "Breakout", "paper", None, {}).epsilon_start == 1.0
    (tmp_path / "lines.toml").write_text('teacher = "a"\nepsilon_start = 0.5\n')
    told = read_settings("gym", "CartPole-v1", None, tmp_path / "lines.toml", {})
    assert (told.epsilon_start, told.teacher_steps) == (0.5, 20_000)


def options(lines: dict[str, Any]) -> list[str]:
    words = [(f"--{key.replace('_', '-')}", value) for key, value in lines.items()]
    return [str(of[0] if isinstance(of, list) else of) for word in words for of in word]


def test_the_command_tells_whom_it_learns_from_and_how_far_it_has_come(named, tmp_path, capsys):
    words = ["train", "gym", "CartPole-v1", "--teacher", named("pole"), *options(FEW)]
    with pytest.raises(SystemExit) as end:
        main([*words, "--out", str(tmp_path / "run")])
    out, err = capsys.readouterr()
    assert end.value.code == 0
    assert re.search(r"Teacher: agents\.py:pole reaches [\d.]+, random actions 2[\d.]+\. A policy "
                     r"head learns what it does\.", err)  # fmt: skip
    assert re.search(r"Of the way from random actions \(2[\d.]+\) to its teacher \([\d.]+\) it has "
                     r"come -?\d+ % \(by the interquartile mean -?\d+ %\)\.", err)  # fmt: skip
    assert "4 episodes, by its policy head, seed 1000" in out


def test_a_dry_run_times_all_phases_and_writes_nothing(named, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("trdlab.training.setup._MEASURED_SECONDS", 0.05)
    monkeypatch.chdir(tmp_path)
    words = ["train", "gym", "CartPole-v1", "--teacher", named("pole"), *options(FEW)]
    with pytest.raises(SystemExit) as end:
        main([*words, "--dry-run"])
    out, _ = capsys.readouterr()
    assert end.value.code == 0
    assert 'distil = "policy"' in out
    assert re.search(r"Time: about \d", out)
    assert list(tmp_path.iterdir()) == []


def test_in_python(named, tmp_path):
    lines = {key: value for key, value in FEW.items() if key != "N"} | {"horizon": 2}
    agent = trdlab.train("CartPole-v1", out=tmp_path / "run", teacher=named("pole"), **lines)
    assert agent.policy is agent.estimator
