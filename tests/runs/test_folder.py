"""The folder of a run: made whole, opened with care, written by one process."""

import json
import os
import signal
import subprocess
import sys
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.runs import (
    MetricsFile,
    RunFolder,
    list_runs,
    read_config,
    save_checkpoint,
    to_toml,
)

CONFIG = {"kind": "atari", "env": "Breakout", "gamma": 0.99, "hidden": [128, 64], "double": True}

# ---- making ------------------------------------------------------------------------------------


def test_a_run_is_made_and_opened(tmp_path):
    path = tmp_path / "runs" / "breakout"
    made = RunFolder.create(path, CONFIG, {"teacher": {"sha256": "ab"}})
    opened = RunFolder.open(path)
    assert made == opened
    assert opened.config == CONFIG
    assert opened.manifest["teacher"] == {"sha256": "ab"}
    assert opened.manifest["packages"]["numpy"] == __import__("numpy").__version__
    assert opened.manifest["command"].split()[0] in os.path.realpath(sys.argv[0])
    assert sorted(entry.name for entry in path.iterdir()) == [
        "checkpoints", "config.toml", "evaluations", "manifest.json", "replay",
    ]  # fmt: skip


def test_what_is_there_is_never_replaced(tmp_path):
    path = tmp_path / "run"
    path.mkdir()
    RunFolder.create(path, {})  # an empty folder is welcome
    with pytest.raises(OutputError) as caught:
        RunFolder.create(path, CONFIG)
    assert str(caught.value) == (
        f"'{path}' holds a run already. Go on with it: trdlab resume {path}, or choose another "
        "`out`."
    )
    assert RunFolder.open(path).config == {}
    with pytest.raises(OutputError, match=r"' is not empty\. Choose another `out`\."):
        RunFolder.create(tmp_path, {})
    file = tmp_path / "file"
    file.write_text("mine")
    with pytest.raises(OutputError, match=r"' is a file\. Choose another `out`\."):
        RunFolder.create(file, {})
    with pytest.raises(OutputError, match=r"Cannot make '.*/run': .*Choose another `out`\."):
        RunFolder.create(file / "run", {})
    assert file.read_text() == "mine"


def test_a_run_that_appears_meanwhile_is_not_replaced(tmp_path, monkeypatch):
    path = tmp_path / "run"

    def overtaken(config: object) -> str:
        monkeypatch.undo()
        RunFolder.create(path, CONFIG)
        return ""

    monkeypatch.setattr("trdlab.runs.folder.new_manifest", lambda: overtaken(None) or {})
    with pytest.raises(OutputError, match="holds a run already"):
        RunFolder.create(path, {"seed": 2})
    assert RunFolder.open(path).config == CONFIG


def test_a_failure_leaves_nothing_that_blocks_a_retry(tmp_path, monkeypatch):
    path = tmp_path / "run"
    with monkeypatch.context() as patch:
        patch.setattr("trdlab.runs.folder.MANIFEST", "no/manifest.json")
        with pytest.raises(OutputError, match="Cannot write"):
            RunFolder.create(path, CONFIG)
    with pytest.raises(InputError, match="leave out what is not set"):
        RunFolder.create(path, {"seed": None})
    assert not list(tmp_path.iterdir())
    RunFolder.create(path, CONFIG)


# ---- opening -----------------------------------------------------------------------------------


@pytest.fixture
def run(tmp_path) -> RunFolder:
    return RunFolder.create(tmp_path / "breakout", CONFIG)


def test_a_misspelt_run_gets_a_suggestion(run):
    path = run.path.with_name("braekout")
    with pytest.raises(InputError, match=r"There is no '.*'\. Did you mean 'breakout'\?"):
        RunFolder.open(path)
    path.mkdir()
    with pytest.raises(InputError, match=r"holds no run\. Did you mean 'breakout'\?"):
        RunFolder.open(path)
    with pytest.raises(InputError, match=r"Name the folder that `trdlab train` made\."):
        RunFolder.open(run.path / "nowhere" / "run")


@pytest.mark.parametrize(
    ("name", "text", "error"),
    [
        ("manifest.json", '{"format": 1, "trd', r"manifest\.json' is torn: "),
        ("manifest.json", '{"format": 1}', r"torn: it does not say what the run was told\.$"),
        ("manifest.json", "[]", r"manifest\.json' is torn: it does not say its format"),
        ("manifest.json", None, r"manifest\.json' cannot be read: No such file"),
        ("config.toml", "env = Break", r"config\.toml' is not valid TOML: .*line 1"),
        ("config.toml", None, r"config\.toml' cannot be read: No such file or directory\. Put it"),
        (
            "manifest.json",
            '{"format": 99, "trdlab": "7.1"}',
            r"has format 99, written by trdlab 7\.1; this is trdlab 0\.\d\.\d, which reads format 1"
            r"\. Use trdlab 7\.1 or newer\.",
        ),
        ("manifest.json", '{"format": 0, "trdlab": "0.0.1"}', r"Use trdlab 0\.0\.1\.$"),
    ],
)
def test_a_torn_run_and_one_of_another_version(run, name, text, error):
    if text is None:
        (run.path / name).unlink()
    else:
        (run.path / name).write_text(text)
    with pytest.raises(TrdlabError, match=error) as caught:
        RunFolder.open(run.path)
    assert caught.value.exit_code == 1
    [row] = list_runs(run.path.parent)
    assert row.path == run.path
    assert row.fault == str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("gamma = 0.99", "gamma = 0.5", "says gamma = 0.5, and the run began with 0.99."),
        ("gamma = 0.99", "", "says gamma = nothing, and the run began with 0.99."),
        ("double = true", "double = true\nw = 3", "says w = 3, and the run began with nothing."),
        ("[128, 64]", "[128]", "says hidden = [128], and the run began with [128, 64]."),
    ],
)
def test_a_run_was_told_what_it_was_told(run, old, new, message):
    path = run.path / "config.toml"
    text = path.read_text()
    path.write_text("# my first\n" + text.replace(" = ", "   =  "))
    assert RunFolder.open(run.path) == run  # people may write comments
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as caught:
        RunFolder.open(run.path)
    cure = "Put it back, or begin another run with that file."
    assert str(caught.value) == f"'{path}' {message} {cure}"


# ---- configurations ----------------------------------------------------------------------------

SCALARS = st.text() | st.integers() | st.floats(allow_nan=False) | st.booleans()
VALUES = SCALARS | st.lists(SCALARS, max_size=3)
CONFIGS = st.dictionaries(st.text(), VALUES | st.dictionaries(st.text(), VALUES, max_size=3))


@given(CONFIGS)
def test_any_configuration_comes_back(config):
    back = tomllib.loads(to_toml(config))
    assert back == config
    assert repr(sorted(back.items(), key=str)) == repr(sorted(config.items(), key=str))


def test_people_may_write_comments(tmp_path):
    path = tmp_path / "run.toml"
    path.write_text('# mine\nenv = "Pong"  # easy\n')
    assert read_config(path) == {"env": "Pong"}
    path.write_text("env = Pong\n")
    with pytest.raises(InputError, match=r"is not valid TOML: .*\(at line 1, column 7\)\. Correct"):
        read_config(path)
    path.write_bytes(b'env = "\xff"')
    with pytest.raises(InputError, match="is not valid TOML"):
        read_config(path)


@pytest.mark.parametrize("value", [None, {"a": {"b": 1}}, [None], b"x", object()])
def test_what_toml_cannot_hold_is_refused(value):
    with pytest.raises(InputError, match=r"which TOML cannot hold\. Use text, numbers"):
        to_toml({"value": value})


# ---- one process -------------------------------------------------------------------------------

HOLD = """
import sys, time
from pathlib import Path
from trdlab.runs import RunFolder
with RunFolder.open(Path(sys.argv[1])).held():
    print("held", flush=True)
    time.sleep(60)
"""


def test_one_process_trains_and_kill_9_sets_the_run_free(run, monkeypatch):
    monkeypatch.setattr("trdlab.runs.lock.PATIENCE", 0.1)
    other = subprocess.Popen([sys.executable, "-c", HOLD, run.path], stdout=subprocess.PIPE)
    with other:
        try:
            assert other.stdout.readline() == b"held\n"
            with pytest.raises(TrdlabError) as caught, run.held():
                pass
            assert str(caught.value) == (
                f"The run '{run.path}' is being trained by process {other.pid}. "
                f"Wait until it ends, or end it: kill {other.pid}."
            )
            assert RunFolder.open(run.path) == run  # whoever only reads may
            assert list_runs(run.path.parent)[0].pid == other.pid
        finally:
            other.send_signal(signal.SIGKILL)
    assert list_runs(run.path.parent)[0].pid is None
    with run.held():
        assert list_runs(run.path.parent)[0].pid == os.getpid()
        with pytest.raises(TrdlabError, match=f"process {os.getpid()}"), run.held():
            pass
    with run.held():
        (run.path / ".holder.json").unlink()
        assert list_runs(run.path.parent)[0].pid == 0
        with pytest.raises(TrdlabError, match=r"by a process\. Wait until it ends\."), run.held():
            pass


# ---- all runs ----------------------------------------------------------------------------------


def test_all_runs_are_listed_and_a_torn_one_says_so(tmp_path):
    assert list_runs(tmp_path / "nowhere") == list_runs(tmp_path) == []
    run = RunFolder.create(tmp_path / "b", {"seed": 1})
    RunFolder.create(tmp_path / "c", {"seed": 2})
    torn = RunFolder.create(tmp_path / "a", {})
    torn.metrics.write_text("{}\n[1\n")
    (tmp_path / "no run").mkdir()
    (tmp_path / "file").touch()
    with MetricsFile(run.metrics) as metrics:
        for step in range(5000):
            metrics.append({"agent_steps": step, "loss": 0.5})
    for step in (1, 2000):
        save_checkpoint(run, step, {})
    first, second, third = list_runs(tmp_path)
    assert "metrics.jsonl', the last line, is torn. Delete that line." in first.fault
    assert second.config == {"seed": 1}
    assert second.metrics == {"agent_steps": 4999, "loss": 0.5}
    assert (second.step, second.pid, second.fault) == (2000, None, None)
    assert second.started == run.manifest["started"]
    assert (third.step, third.metrics) == (None, {})
    assert json.loads((run.path / "manifest.json").read_text())["format"] == 1
