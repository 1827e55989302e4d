"""A run in its folder: begun, resumed, and refused with nothing lost where something is wrong."""

import builtins
import errno
import hashlib
import json
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.envs.classic_control import CartPoleEnv
from safetensors.torch import save_file

import trdlab.runs.folder as folder_module
from trdlab.agents.naming import find_agent
from trdlab.cli import main
from trdlab.deep.settings import TrainSettings
from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.runs import (
    RunFolder,
    best_step,
    checkpoint_steps,
    list_runs,
    load_checkpoint,
    read_metrics,
    to_toml,
)
from trdlab.training.loading import load
from trdlab.training.run import begin, carry_on, resume

Outcome = tuple[int, str, str]
Trdlab = Callable[..., Outcome]

LINES = {
    "agent_steps": 120,
    "N": 2,
    "w": 2,
    "hidden": [8],
    "batch_size": 4,
    "learning_starts": 20,
    "capacity": 50,
    "checkpoint_every": 30,
    "log_every": 10,
    "evaluate_episodes": 0,
}


class Faulty(CartPoleEnv):
    """Pays a number of its choice, or fails, in one of its steps, counted over episodes."""

    def __init__(self, at: int = 10**9, pays: str = "nan", fails: str = "") -> None:
        super().__init__()
        self.steps, self.at, self.pays, self.fails = 0, at, float(pays), fails

    def step(self, action: Any) -> Any:
        observation, reward, *rest = super().step(action)
        self.steps += 1
        if self.steps == self.at and self.fails:
            raise getattr(builtins, self.fails)(errno.EPIPE, "the simulator has gone")
        return observation, self.pays if self.steps == self.at else reward, *rest


class NotReady(CartPoleEnv):
    """Shows what is no number in the fifth of its episodes that this process begins."""

    begun = 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        seen, info = super().reset(seed=seed)
        NotReady.begun += 1
        return seen * np.nan if NotReady.begun == 5 else seen, info


class Grown(CartPoleEnv):
    """Has gained an action."""

    def __init__(self) -> None:
        super().__init__()
        self.action_space = gym.spaces.Discrete(3)


class Wayward(CartPoleEnv):
    """Takes no notice of its seed."""

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        return super().reset(seed=int.from_bytes(os.urandom(4), "big"), options=options)


@pytest.fixture(autouse=True, scope="module")
def _registered() -> Iterator[None]:
    gym.register("Faulty-v0", Faulty)
    gym.register("NotReady-v0", NotReady, max_episode_steps=20)
    gym.register("Wayward-v0", Wayward)
    yield
    del gym.registry["Faulty-v0"], gym.registry["NotReady-v0"], gym.registry["Wayward-v0"]


def settings(env: str = "CartPole-v1", **lines: Any) -> TrainSettings:
    return TrainSettings("gym", env).changed(LINES | lines)


def written(folder: Path, settings: TrainSettings) -> Path:
    (folder / "run.toml").write_text(to_toml(settings.to_config()))
    return folder / "run.toml"


def train(out: Path, env: str = "CartPole-v1", **lines: Any) -> Path:
    with begin(settings(env, **lines), out) as run:
        carry_on(run)
    return out


def train_until(steps: int, out: Path, **lines: Any) -> Path:
    """Trains a run that is killed then: nothing is saved."""
    with begin(settings(**lines), out) as run, pytest.raises(KeyboardInterrupt):
        carry_on(run, on_step=lambda trainer: stop(trainer.agent_steps >= steps))
    return out


def stop(now: bool) -> None:
    if now:
        raise KeyboardInterrupt


def finish(out: Path, step: int | None = None) -> Path:
    with resume(out, step) as run:
        assert carry_on(run)
    return out


def result(out: Path) -> str:
    """Returns all that a run has come to, but for the time that it took, as text."""
    checkpoint = load_checkpoint(RunFolder.open(out))
    state = {key: value for key, value in checkpoint.state.items() if key != "run"}
    rows = [{**row, "seconds": 0} for row in read_metrics(out / "metrics.jsonl")]
    with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
        return repr((checkpoint.step, state, checkpoint.blocks, rows))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """Returns a run that came to its end undisturbed; not to be changed."""
    return train(tmp_path_factory.mktemp("whole") / "run")


@pytest.fixture
def trained(whole, tmp_path) -> Path:
    """Returns a copy of it."""
    return Path(shutil.copytree(whole, tmp_path / "run"))


@pytest.fixture
def trdlab(capsys) -> Trdlab:
    """Returns a function that runs a command line: exit code, stdout, stderr."""

    def run(*words: object) -> Outcome:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main([str(word) for word in words])
        return int(end.value.code or 0), *capsys.readouterr()

    return run


def refused(outcome: Outcome, code: int, message: str) -> None:
    """Checks that a command has said in one line why it does nothing."""
    errors = [line for line in outcome[2].splitlines() if line.startswith("error: ")]
    assert outcome[0] == code
    assert errors == outcome[2].splitlines()[-1:]
    assert message in errors[0]
    assert "Traceback" not in outcome[2]


# ---- begun and resumed ---------------------------------------------------------------------------


def test_a_run_tells_what_happens_and_keeps_it(tmp_path):
    rows, steps = [], []
    with begin(settings(), tmp_path / "run") as run:
        assert carry_on(run, on_metrics=rows.append, on_step=lambda of: steps.append(of))
    assert [row.agent_steps for row in rows] == list(range(10, 121, 10))
    assert len(steps) == 120
    kept = read_metrics(run.folder.metrics)
    assert [row["agent_steps"] for row in kept] == list(range(10, 121, 10))
    assert all(kept[at]["loss"] == rows[at].loss for at in range(12))
    assert checkpoint_steps(run.folder) == [60, 90, 120]
    assert best_step(run.folder) == 60  # of the best score, and so not too old
    scores = {row["agent_steps"]: row["score"] or 0 for row in kept}
    assert max((scores[at], at) for at in (30, 60, 90, 120))[1] == 60
    assert kept[-1]["seconds"] > kept[0]["seconds"] > 0
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["environment"]["observation"] == {"shape": [4], "dtype": "float32"}
    assert manifest["environment"]["num_actions"] == 2
    assert {"packages", "command", "trdlab", "started"} <= manifest.keys()
    config = (tmp_path / "run" / "config.toml").read_text()
    assert 'device = "cpu"' in config  # what `auto` stood for
    assert "threads = 1" in config


@pytest.mark.parametrize("num_envs", [1, 8])
def test_the_same_seed_is_the_same_run_to_the_bit(tmp_path, num_envs):
    one, same = (result(train(tmp_path / name, num_envs=num_envs)) for name in ("a", "b"))
    assert one == same
    assert one != result(train(tmp_path / "c", num_envs=num_envs, seed=2))


def test_a_run_that_should_stop_is_saved_where_it_stands(tmp_path, whole):
    with begin(settings(), tmp_path / "run") as run:
        assert not carry_on(run, should_stop=lambda: run.trainer.agent_steps == 47)
    assert checkpoint_steps(run.folder) == [30, 47]
    assert result(finish(tmp_path / "run")) == result(whole)


def test_a_run_stopped_before_its_first_step_goes_on(tmp_path, whole):
    with begin(settings(), tmp_path / "run") as run:
        assert not carry_on(run, should_stop=lambda: True)
    assert checkpoint_steps(run.folder) == [0]
    assert result(finish(tmp_path / "run")) == result(whole)


@pytest.mark.parametrize("steps", [0, 7, 29])
def test_a_run_without_a_checkpoint_begins_again(tmp_path, whole, steps):
    out = train_until(steps, tmp_path / "run")
    assert checkpoint_steps(RunFolder.open(out)) == []
    assert result(finish(out)) == result(whole)


def test_the_precision_that_was_measured_is_kept(tmp_path, monkeypatch):
    quicker = "trdlab.deep.precision.quicker_precision"
    monkeypatch.setattr(quicker, lambda *_: "bfloat16")
    whole = train(tmp_path / "whole", precision="auto")
    out = train_until(50, tmp_path / "run", precision="auto")
    monkeypatch.setattr(quicker, lambda *_: "float32")  # on another day, or machine
    assert result(finish(out)) == result(whole)
    assert RunFolder.open(out).config["precision"] == "bfloat16"
    exact = train(tmp_path / "exact", precision="float32")
    assert result(exact) != result(whole)


def test_an_older_checkpoint_can_be_gone_back_to(trained, whole):
    assert result(finish(trained, step=90)) == result(whole)
    with pytest.raises(InputError, match=r"no checkpoint at step 70\. There are: 60, 90, 120\."):
        finish(trained, step=70)


def test_a_run_at_its_end_is_only_evaluated_again(trained, whole, trdlab):
    before = contents(trained / "checkpoints")
    code, out, err = trdlab("resume", trained)
    assert (code, out) == (0, "")
    assert "Trained 120 agent steps" in err
    assert contents(trained / "checkpoints") == before
    assert result(trained) == result(whole)


def test_where_the_environment_cannot_be_restored_new_episodes_begin(tmp_path, trdlab):
    with begin(settings("Wayward-v0"), tmp_path / "run") as run:
        carry_on(run, should_stop=lambda: run.trainer.agent_steps >= 50)
    code, _, err = trdlab("resume", tmp_path / "run")
    assert code == 0
    [line] = [line for line in err.splitlines() if "Wayward-v0 did something else" in line]
    assert line.endswith("New episodes are begun in their place.")
    assert load_checkpoint(RunFolder.open(tmp_path / "run")).step == 120


def test_runs_that_begin_at_once_get_names_of_their_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    create = RunFolder.create

    def overtaken(path: Path, *words: Any) -> RunFolder:
        monkeypatch.setattr(RunFolder, "create", create)
        with begin(settings(learning_rate=0.1)) as quicker:
            assert quicker.folder.path == path
        return create(path, *words)

    monkeypatch.setattr(RunFolder, "create", overtaken)
    with begin(settings(learning_rate=0.2)) as run, begin(settings(learning_rate=0.3)) as third:
        pass
    assert run.folder.path == Path("runs/CartPole-v1-N2-w2-seed1-2")
    assert third.folder.path == Path("runs/CartPole-v1-N2-w2-seed1-3")
    assert [run.config["learning_rate"] for run in list_runs(Path("runs"))] == [0.1, 0.2, 0.3]
    with (
        pytest.raises(OutputError, match="holds a run already"),
        begin(settings(), third.folder.path),
    ):
        pass
    Path("runs").rename("elsewhere")
    Path("runs").touch()
    with pytest.raises(OutputError, match="Cannot make"), begin(settings()):
        pass


# ---- longer --------------------------------------------------------------------------------------


@pytest.mark.parametrize("stopped", [47, 120])
def test_a_run_that_is_made_longer_is_the_run_that_was_to_be_so_long(tmp_path, stopped):
    whole = train(tmp_path / "whole", agent_steps=200)
    with begin(settings(), tmp_path / "run") as run:
        carry_on(run, should_stop=lambda: run.trainer.agent_steps == stopped)
    comment = "# mine\n"
    config = tmp_path / "run" / "config.toml"
    config.write_text(config.read_text() + comment)
    with resume(tmp_path / "run", agent_steps=200) as run:
        assert carry_on(run)
    assert result(tmp_path / "run") == result(whole)
    folder = RunFolder.open(tmp_path / "run")
    assert folder.config["agent_steps"] == 200
    assert config.read_text().endswith(comment)
    [told] = folder.manifest["extended"]
    assert (told["agent_steps"], told["at"]) == (200, stopped)
    assert folder.manifest["config"]["agent_steps"] == 120  # as it began
    finish(tmp_path / "run")
    before = contents(tmp_path / "run")
    with resume(tmp_path / "run", agent_steps=200) as run:  # nothing new
        assert run.trainer.done
    assert contents(tmp_path / "run") == before


def test_a_learning_rate_that_falls_falls_to_the_new_end(tmp_path, trdlab):
    out = train(tmp_path / "run", learning_rate=1.0, learning_rate_end=0.0)
    code, _, err = trdlab("resume", out, "--agent-steps", 240)
    assert (code, err.splitlines()[1]) == (
        0,
        "It takes 240 agent steps now; its learning rate is 0.5 again, and falls to 0 by then.",
    )
    rates = {
        row["agent_steps"]: row["learning_rate"] for row in read_metrics(out / "metrics.jsonl")
    }
    told = [rates[at] for at in (60, 120, 180, 240)]
    assert told == pytest.approx([0.5, 0.0, 0.25, 0.0])


def test_a_run_does_not_become_shorter(trained, trdlab):
    before = contents(trained)
    message = "--agent-steps is 60, and the run takes 120 already. Choose more: a run can become"
    refused(trdlab("resume", trained, "--agent-steps", 60), 2, message)
    assert contents(trained) == before


def test_a_run_that_is_killed_while_it_is_made_longer_stays_whole(trained, whole, monkeypatch):
    write = folder_module.write_whole

    def fail(path: Path, write_to: Any) -> None:
        if path.name == "config.toml":
            raise OutputError("killed")
        write(path, write_to)

    with monkeypatch.context() as patch:
        patch.setattr(folder_module, "write_whole", fail)
        with pytest.raises(OutputError, match="killed"), resume(trained, agent_steps=200):
            pass
    assert RunFolder.open(trained).config["agent_steps"] == 120
    assert result(finish(trained)) == result(whole)
    with resume(trained, agent_steps=200) as run:
        assert not run.trainer.done
    assert RunFolder.open(trained).config["agent_steps"] == 200


@pytest.mark.parametrize("spoilt", [3, [3], [{}]])
def test_a_manifest_that_tells_of_nothing_readable_is_torn(trained, trdlab, spoilt):
    manifest = json.loads((trained / "manifest.json").read_text())
    (trained / "manifest.json").write_text(json.dumps(manifest | {"extended": spoilt}))
    refused(trdlab("resume", trained), 1, "manifest.json' is torn: its 'extended' is no list of")


# ---- the best ------------------------------------------------------------------------------------


def test_the_best_checkpoint_is_named_by_all(trained, trdlab):
    assert trdlab("resume", trained)[2].splitlines()[-1] == (
        f"Its score was better at 60 agent steps: that checkpoint is kept as {trained}@best."
    )
    code, _, err = trdlab("evaluate", f"{trained}@best", "--episodes", 1)
    assert (code, "step-60-episodes-1" in err) == (0, True)
    message = f"'{trained}@best' names a checkpoint, as --checkpoint does. Use one of them."
    refused(trdlab("evaluate", f"{trained}@best", "--checkpoint", 90), 2, message)
    assert find_agent(f"{trained}@best").name == "run@60"
    assert trdlab("resume", f"{trained}@best")[0] == 0


PLAYED = {"checkpoint_episodes": 3, "evaluate_epsilon": 0.5}


def played(out: Path) -> dict[int, float]:
    """Returns the mean return of each checkpoint that was evaluated."""
    kept = [json.loads(file.read_text()) for file in (out / "evaluations").iterdir()]
    assert {(each["episodes"], each["epsilon"], each["seed"]) for each in kept} == {(3, 0.5, 2000)}
    return {each["agent_steps"]: each["mean"]["value"] for each in kept}


def test_episodes_that_choose_the_agent_change_nothing_else(tmp_path):
    plain, out = train(tmp_path / "plain"), train(tmp_path / "run", **PLAYED)
    assert result(out) == result(plain)
    means = played(out)
    assert sorted(means) == [30, 60, 90, 120]
    best = max((mean, step) for step, mean in means.items())[1]
    assert best_step(RunFolder.open(out)) == best
    assert not list((plain / "evaluations").iterdir())


def test_the_agent_is_the_best_where_checkpoints_are_played(tmp_path, trdlab):
    lines = LINES | {"checkpoint_episodes": 3, "evaluate_episodes": 2, "checkpoint_every": 20}
    file = written(tmp_path, TrainSettings("gym", "CartPole-v1").changed(lines))
    out = tmp_path / "run"
    words = ("train", "gym", "CartPole-v1", "--config", file, "--out", out)
    err = trdlab(*words, "--learning-rate", 0.1)[2]
    best = best_step(RunFolder.open(out))
    assert best is not None
    assert best < 120
    assert (
        f"Its agent is that of {best} agent steps, the best in 3 episodes; the last is {out}@120."
    ) in err.splitlines()
    assert (out / "evaluations" / f"step-{best}-episodes-2-epsilon-0-seed-1000.json").exists()
    agents = [load(out, step) for step in (None, best, 120)]
    seen = np.zeros((1, 4), dtype=np.float32)
    own, of_best, last = (agent.decompose(seen).components for agent in agents)
    assert np.array_equal(own, of_best)
    assert not np.array_equal(own, last)
    with resume(out) as run:  # which goes on with the last
        assert run.trainer.agent_steps == 120


def test_where_a_run_was_stopped_does_not_choose_its_agent(tmp_path):
    with begin(settings(**PLAYED), tmp_path / "run") as run:
        assert not carry_on(run, should_stop=lambda: run.trainer.agent_steps == 47)
    assert checkpoint_steps(run.folder) == [30, 47]
    assert sorted(played(run.folder.path)) == [30]
    assert best_step(run.folder) == 30
    whole = train(tmp_path / "whole", **PLAYED)
    assert result(finish(run.folder.path)) == result(whole)
    assert played(run.folder.path) == played(whole)


# ---- refused -------------------------------------------------------------------------------------


def test_a_folder_that_holds_something_is_left_alone(trained, tmp_path, trdlab):
    before = contents(tmp_path)
    words = ("train", "gym", "CartPole-v1", "--preset", "smoke", "--out")
    refused(trdlab(*words, trained), 2, f"'{trained}' holds a run already. Go on with it: trdlab")
    refused(trdlab(*words, tmp_path), 2, f"'{tmp_path}' is not empty. Choose another --out.")
    refused(trdlab(*words, trained / "config.toml"), 2, "is a file. Choose another --out.")
    refused(trdlab(*words, trained / "config.toml" / "x"), 2, "Choose another --out.")
    assert contents(tmp_path) == before


@pytest.mark.parametrize("command", ["resume", "evaluate"])
def test_what_is_no_run_is_refused(trained, tmp_path, trdlab, command):
    refused(trdlab(command, tmp_path / "runs"), 2, "runs'. Did you mean 'run'?")
    refused(trdlab(command, trained / "replay"), 2, "holds no run")


@pytest.mark.parametrize("command", ["resume", "evaluate"])
@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("manifest.json", "{", "manifest.json' is torn"),
        ("manifest.json", "[]", "manifest.json"),
        ("manifest.json", '{"format": 99, "trdlab": "9.1"}', "Use trdlab 9.1 or newer."),
        ("config.toml", "kind = ", "is not valid TOML"),
        (
            "config.toml",
            'kind = "gym"',
            "says env = nothing, and the run began with",
        ),
    ],
)
def test_a_torn_run_and_one_of_another_version(trained, trdlab, command, name, content, message):
    (trained / name).write_text(content)
    before = contents(trained)
    outcome = trdlab(command, trained)
    refused(outcome, outcome[0], message)
    assert outcome[0] in (1, 2)
    assert contents(trained).items() >= before.items()


def test_a_manifest_that_lost_the_environment_is_torn(trained, trdlab):
    manifest = json.loads((trained / "manifest.json").read_text())
    for spoilt in ({}, {"environment": 3}, {"environment": {"observation": {"shape": 1}}}):
        kept = {key: value for key, value in manifest.items() if key != "environment"}
        (trained / "manifest.json").write_text(json.dumps(kept | spoilt))
        refused(trdlab("evaluate", trained), 1, "does not say what its agent sees")


def test_a_torn_checkpoint_is_named_with_one_that_is_whole(trained, whole, trdlab):
    torn = trained / "checkpoints" / "000000120" / "memory.safetensors"
    torn.write_bytes(torn.read_bytes()[:-1])
    before = contents(trained)
    message = "The one at step 90 is whole: --checkpoint 90, or"
    refused(trdlab("resume", trained), 1, message)
    assert contents(trained).items() >= before.items()
    assert trdlab("resume", trained, "--checkpoint", 90)[0] == 0
    assert result(trained) == result(whole)


def test_a_changed_configuration_is_refused_by_all(trained, whole, trdlab):
    config = (trained / "config.toml").read_text()
    (trained / "config.toml").write_text(config.replace("gamma = 0.99", "gamma = 0.5"))
    before = contents(trained)
    message = "says gamma = 0.5, and the run began with 0.99. Put it back, or begin another run"
    for words in (["resume"], ["evaluate"], ["explain"], ["compare", whole]):
        refused(trdlab(*words, trained), 2, message)
    with pytest.raises(InputError, match=r"says gamma = 0\.5, and the run began with 0\.99"):
        load(trained)
    assert message in " ".join(trdlab("runs", trained.parent)[1].split())
    assert contents(trained) == before


def without(*lost: int) -> Callable[[Path], None]:
    """Returns what deletes lines of metrics."""

    def delete(path: Path) -> None:
        lines = path.read_bytes().splitlines(keepends=True)
        path.write_bytes(b"".join(line for at, line in enumerate(lines) if at not in lost))

    return delete


@pytest.mark.parametrize("harm", [Path.unlink, without(3), without(*range(8)), without(10, 11)])
@pytest.mark.parametrize("step", [90, 120])
def test_metrics_are_a_record_and_no_condition(trained, whole, harm, step):
    harm(trained / "metrics.jsonl")
    there = trained / "metrics.jsonl"
    kept = {row["agent_steps"] for row in read_metrics(there)} if there.exists() else set()
    finish(trained, step)
    told = [row["agent_steps"] for row in read_metrics(there)]
    assert told == [at for at in range(10, 121, 10) if at in kept or at > step]
    there.write_bytes((whole / "metrics.jsonl").read_bytes())  # but for them, it is the same
    assert result(trained) == result(whole)


@pytest.mark.parametrize("failing", range(1, 30, 3))
def test_a_disk_that_fills_up(tmp_path, whole, trdlab, monkeypatch, failing):
    """The disk is full when so many files have been written, and says so at last."""
    out, sync, count = tmp_path / "run", os.fsync, iter(range(1, 1000))

    def fail(number: int) -> None:
        if next(count) >= failing:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(number)

    config = written(tmp_path, settings())
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        outcome = trdlab("train", "gym", "CartPole-v1", "--config", config, "--out", out)
    assert outcome[0] == 2
    assert "Traceback" not in outcome[2]
    assert list(tmp_path.glob(".*")) == []
    if not out.exists():  # it could not even be made
        refused(outcome, 2, "run': No space left on device.")
        return
    code, _, err = trdlab("resume", out)
    assert (code, "error" in err) == (0, False)
    assert result(out) == result(whole)


def test_a_first_observation_that_is_no_number_is_refused_and_the_run_goes_on(tmp_path, trdlab):
    NotReady.begun, out = 0, tmp_path / "run"
    config = written(tmp_path, settings("NotReady-v0"))
    outcome = trdlab("train", "gym", "NotReady-v0", "--config", config, "--out", out)
    refused(outcome, 1, "The environment gave the observation nan after ")
    assert outcome[2].endswith(f"Correct the environment. Go on: trdlab resume {out}\n")
    state = load_checkpoint(RunFolder.open(out)).state
    assert np.isfinite(state["stack"]).all()
    assert trdlab("resume", out)[0] == 0
    assert result(out) == result(train(tmp_path / "whole", "NotReady-v0"))
    NotReady.begun = 4
    outcome = trdlab("train", "gym", "NotReady-v0", "--config", config, "--out", tmp_path / "no")
    refused(outcome, 1, "gave the observation nan when it was reset.")
    assert not (tmp_path / "no").exists()
    NotReady.begun = 4
    refused(trdlab("evaluate", out), 2, "The observations hold nan.")


@pytest.mark.parametrize(
    "fails", ["BrokenPipeError", "ConnectionResetError", "FileNotFoundError", "ZeroDivisionError"]
)
def test_an_environment_that_fails_is_blamed(tmp_path, whole, trdlab, fails):
    out, config = tmp_path / "run", written(tmp_path, settings("Faulty-v0"))
    words = ["train", "gym", "Faulty-v0", "--config", config, "--out", out]
    outcome = trdlab(*words, "--env-arg", "at=75", "--env-arg", f"fails={fails}")
    refused(outcome, 1, f"The environment failed at agent step 75 ({fails}: ")
    assert "the simulator has gone" in outcome[2]
    assert outcome[2].endswith(f"). Correct it. Go on: trdlab resume {out}\n")
    assert checkpoint_steps(RunFolder.open(out)) == [30, 60]


def test_an_environment_that_fails_in_an_evaluation_is_blamed(tmp_path, trdlab):
    told = settings("Faulty-v0", env_arg=["at=5", "fails=BrokenPipeError"])
    with begin(told, tmp_path / "run") as run:
        carry_on(run, should_stop=lambda: True)
    outcome = trdlab("evaluate", tmp_path / "run", "--episodes", 1)
    refused(outcome, 1, "The environment failed at step 5 of an episode (BrokenPipeError: ")


@pytest.mark.parametrize("pays", ["nan", "inf", "-inf"])
def test_a_reward_that_is_no_number_stops_the_run(tmp_path, trdlab, pays):
    out, config = tmp_path / "run", written(tmp_path, settings("Faulty-v0"))
    words = ["train", "gym", "Faulty-v0", "--config", config, "--out", out]
    outcome = trdlab(*words, "--env-arg", "at=75", "--env-arg", f"pays={pays}")
    refused(outcome, 1, f"gave the reward {pays} after 74 agent steps. Nothing was learned")
    assert checkpoint_steps(RunFolder.open(out)) == [30, 60]
    assert np.isfinite(load(out).decompose(np.zeros((1, 4), np.float32)).components).all()


def test_a_loss_that_is_not_finite_stops_the_run(tmp_path, trdlab):
    out, config = tmp_path / "run", written(tmp_path, settings("Faulty-v0"))
    words = ["train", "gym", "Faulty-v0", "--config", config, "--out", out]
    outcome = trdlab(*words, "--env-arg", "at=32", "--env-arg", "pays=1e30")
    refused(outcome, 1, "The loss is inf at update ")
    assert checkpoint_steps(RunFolder.open(out))[0] == 30
    assert np.isfinite(load(out).decompose(np.zeros((1, 4), np.float32)).components).all()


HOLD = """
import sys, time
from pathlib import Path
from trdlab.runs import RunFolder
with RunFolder.open(Path(sys.argv[1])).held():
    print("held", flush=True)
    time.sleep(600)
"""


def test_two_processes_do_not_train_one_run(trained, whole, trdlab):
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(trained)], stdout=subprocess.PIPE, text=True
    )
    with other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        before = contents(trained)
        refused(trdlab("resume", trained), 1, f"is being trained by process {other.pid}")
        assert contents(trained) == before
        assert trdlab("evaluate", trained, "--episodes", 1)[0] == 0  # which changes nothing
        other.kill()
    assert result(finish(trained, step=90)) == result(whole)


def test_an_environment_that_gained_an_action_is_refused_by_all(tmp_path, trdlab):
    gym.register("Growing-v0", CartPoleEnv)
    run = train(tmp_path / "run", "Growing-v0")
    gym.registry["Growing-v0"].entry_point = Grown
    for command in ("resume", "evaluate", "explain"):
        message = (
            "'Growing-v0' does not fit the agent: it has 3 actions, and the agent knows 2 actions."
        )
        refused(trdlab(command, run), 2, message)
    del gym.registry["Growing-v0"]


def test_a_memory_that_does_not_fit_is_refused_before_anything_is_done(tmp_path, trdlab):
    words = ("train", "gym", "CartPole-v1", "--capacity", 10**13, "--out", tmp_path / "run")
    message = "A replay memory of 10000000000000 transitions takes about"
    refused(trdlab(*words), 1, message)
    refused(trdlab(*words, "--dry-run"), 1, message)
    assert not (tmp_path / "run").exists()


def test_a_device_that_is_not_there_is_refused(tmp_path, trdlab):
    words = ("train", "gym", "CartPole-v1", "--device", "tpu", "--out", tmp_path / "run")
    refused(trdlab(*words), 2, "PyTorch finds no device 'tpu' here. Use one of: auto, cpu")
    assert not (tmp_path / "run").exists()


# ---- weights from elsewhere ----------------------------------------------------------------------


class Mark:
    """Pickled code: whoever executes the file leaves a mark."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return os.system, (f"touch '{self.path}'",)


@pytest.mark.parametrize("as_", ["torch", "pickle"])
@pytest.mark.parametrize("part", ["q_network", "learner", "memory"])
def test_code_in_place_of_a_checkpoint_is_not_executed(trained, tmp_path, trdlab, part, as_):
    mark, target = tmp_path / "mark", trained / "checkpoints" / "000000120" / f"{part}.safetensors"
    if as_ == "torch":
        torch.save({"head.bias": Mark(mark)}, target)
    else:
        target.write_bytes(pickle.dumps(Mark(mark)))
    refused(trdlab("resume", trained), 1, f"{part}.safetensors' ")
    if part == "q_network":
        refused(trdlab("evaluate", trained), 1, f"{part}.safetensors' ")
        with pytest.raises(TrdlabError, match="The one at step 90 is whole"):
            load(trained)
    assert not mark.exists()


def test_code_in_place_of_weights_is_not_executed(tmp_path, trdlab):
    mark, out = tmp_path / "mark", tmp_path / "run"
    torch.save({"head.bias": Mark(mark)}, tmp_path / "weights.pt")
    words = ("train", "gym", "CartPole-v1", "--weights", tmp_path / "weights.pt", "--out", out)
    refused(trdlab(*words), 2, "weights.pt' holds code (posix.system), or is no file of weights.")
    refused(trdlab(*words, "--dry-run"), 2, "weights.pt' holds code")
    assert not mark.exists()
    assert not out.exists()


@pytest.mark.parametrize("value", ["nan", "-inf"])
def test_weights_that_are_no_numbers_are_refused(whole, tmp_path, trdlab, value):
    state = load(whole).network.state_dict()
    state["head.bias"][1] = float(value)
    torch.save(state, tmp_path / "weights.pt")
    words = ("train", "gym", "CartPole-v1", "--weights", tmp_path / "weights.pt", "--out")
    message = f"weights.pt' has {value} in 'head.bias'. Name other weights."
    refused(trdlab(*words, tmp_path / "run"), 2, message)
    assert not (tmp_path / "run").exists()


def test_a_run_begins_with_the_weights_of_another(whole, tmp_path):
    given = whole / "checkpoints" / "000000120" / "q_network.safetensors"
    state = load(whole).network.state_dict()
    torch.save(state, tmp_path / "same.pt")
    for file in (given, tmp_path / "same.pt"):
        out = tmp_path / f"from {file.name}"
        with begin(settings(weights=str(file), seed=7), out) as run:
            network = run.trainer.learner.q_network.state_dict()
            assert all(torch.equal(network[name], state[name]) for name in state)
            carry_on(run, should_stop=lambda: True)
        digest = hashlib.sha256(file.read_bytes()).hexdigest()
        assert RunFolder.open(out).manifest["weights"] == {"file": str(file), "sha256": digest}


def test_weights_of_another_network_are_refused(whole, tmp_path, trdlab):
    file = whole / "checkpoints" / "000000120" / "q_network.safetensors"
    words = ("train", "gym", "CartPole-v1", "--hidden", 8, "--out", tmp_path / "run", "--weights")
    message = "The weights are of another network: 'head.bias' has shape (6,), not (8,). Build"
    refused(trdlab(*words, file, "--N", 3), 2, message)
    save_file({"head.bias": torch.zeros(6)}, tmp_path / "few.safetensors")
    refused(trdlab(*words, tmp_path / "few.safetensors", "--N", 2), 2, "has shape None, not (")
    refused(trdlab(*words, tmp_path / "none.pt"), 2, "none.pt' cannot be read: No such file")
    assert not (tmp_path / "run").exists()


def test_a_run_with_given_weights_begins_again_only_with_the_same(
    whole, tmp_path, trdlab, monkeypatch
):
    state = load(whole).network.state_dict()
    monkeypatch.chdir(tmp_path)
    torch.save(state, "weights.pt")
    end = result(train(Path("whole"), weights="weights.pt"))
    out = train_until(7, Path("run"), weights="weights.pt")
    torch.save({name: value + 1 for name, value in state.items()}, "weights.pt")
    refused(trdlab("resume", out), 2, "'run' began with other weights than those in '")
    torch.save(state, "weights.pt")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")  # the run remembers where they are
    out = Path("..") / out
    with resume(out) as run:
        assert not carry_on(run, should_stop=lambda: run.trainer.agent_steps >= 40)
    (tmp_path / "weights.pt").unlink()  # a checkpoint needs them no more
    assert result(finish(out)) == end


def test_an_error_while_saving_leaves_the_checkpoint_before(tmp_path, monkeypatch, whole):
    write = Path.write_bytes

    def fail(path: Path, data: Any) -> int:
        if path.name == "memory.safetensors" and "000000060" in str(path):
            write(path, bytes(data)[:100])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, data)

    with monkeypatch.context() as patch, begin(settings(), tmp_path / "run") as run:
        patch.setattr(Path, "write_bytes", fail)
        with pytest.raises(OutputError, match=r"The checkpoint at step 60 .*No space left.*30"):
            carry_on(run)
    assert checkpoint_steps(run.folder) == [30]
    assert result(finish(tmp_path / "run")) == result(whole)
