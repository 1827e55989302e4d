"""A checkpoint is whole or not there, and what comes back is what was saved."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from trdlab.errors import InputError, OutputError, TrdlabError
from trdlab.runs import (
    RunFolder,
    best_step,
    checkpoint_steps,
    find_checkpoint,
    load_checkpoint,
    read_arrays,
    save_checkpoint,
)
from trdlab.runs.index import Index
from trdlab.runs.state import DTYPES, pack, unpack


@pytest.fixture
def run(tmp_path) -> RunFolder:
    return RunFolder.create(tmp_path / "run", {"seed": 1})


def a_state(step: int) -> dict:
    """Returns a state all of whose parts tell the step."""
    return {
        "q_network": {"head.weight": np.full((3, 2), step, np.float32), "bias": np.array(step)},
        "memory": {"frames": {"open": {"0-000001": bytes([step % 256]) * 5}}},
        "progress": {"agent_steps": step, "rng": {"state": 2**127 + step}, "losses": [0.5, None]},
    }


def some_blocks(*numbers: int) -> dict[str, bytes]:
    return {f"0-{number:06d}": bytes([number]) * 1000 for number in numbers}


def same(a: object, b: object) -> bool:
    """Returns whether two states are equal to the bit, types included."""
    if isinstance(a, np.ndarray):
        return (
            isinstance(b, np.ndarray)
            and (a.dtype, a.shape) == (b.dtype, b.shape)
            and a.tobytes() == b.tobytes()
        )
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and repr(a) == repr(b)


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# ---- what comes back ---------------------------------------------------------------------------

ARRAYS = hnp.arrays(st.sampled_from(sorted(DTYPES, key=str)), hnp.array_shapes(min_dims=0))
PLAIN = st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary()
NAMES = st.text(max_size=5).filter(lambda name: not name.startswith("$"))
NESTED = st.recursive(
    PLAIN | ARRAYS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=8,
)
STATES = st.dictionaries(st.from_regex(r"[a-z][a-z0-9_]{0,9}", fullmatch=True), NESTED, max_size=4)


@settings(max_examples=30, deadline=None)
@given(STATES)
def test_any_state_comes_back_to_the_bit(tmp_path_factory, state):
    run = RunFolder.create(tmp_path_factory.mktemp("runs") / "run", {})
    save_checkpoint(run, 1, state)
    assert same(load_checkpoint(run).state, state)


@given(STATES)
def test_the_plain_part_is_valid_json(state):
    tree, arrays = pack(state)
    assert same(unpack(json.loads(json.dumps(tree, allow_nan=False)), arrays), state)


def test_arrays_in_any_memory_order_and_names_that_meet(run):
    order = np.arange(6.0).reshape(2, 3).T
    state = {"x": {"a/b": order, "a": {"b": order[::2]}, "__metadata__": np.zeros(0)}}
    save_checkpoint(run, 1, state)
    loaded = load_checkpoint(run).state
    assert same(loaded, state)
    loaded["x"]["a/b"][0] = 7  # what is loaded can be gone on with
    assert order[0, 0] == 0


def test_one_part_is_read_alone(run):
    save_checkpoint(run, 5, a_state(5))
    (run.checkpoints / "000000005" / "memory.safetensors").unlink()
    step, weights = read_arrays(run, "q_network")
    assert step == 5
    assert list(weights) == ["bias", "head.weight"]
    assert weights["head.weight"].tolist() == [[5, 5]] * 3
    with pytest.raises(InputError, match=r"step 5 has no 'q_net'\. Did you mean 'q_network'\?"):
        read_arrays(run, "q_net")


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        ((1, 2), "tuple"),
        (np.zeros(2, np.complex64), "array of complex64"),
        (np.zeros(2, ">f4"), "array of >f4"),
        (np.array([None]), "array of object"),
        ({1: 2}, "dict"),
        ({"$array": "x"}, "dict"),
        (np.float32(1), "float32"),
        (object(), "object"),
    ],
)
def test_what_would_not_come_back_is_refused_before_anything_is_written(run, value, kind):
    with pytest.raises(InputError, match=rf"'a/b/0' is of type {kind}, which cannot be saved\."):
        save_checkpoint(run, 1, {"a": {"b": [value]}})
    assert not files(run.checkpoints)


@pytest.mark.parametrize("name", ["../x", "", ".x", "a/b", "x" * 101, "a\n"])
def test_names_that_lead_elsewhere_are_refused(run, name):
    with pytest.raises(InputError, match="cannot name a file"):
        save_checkpoint(run, 1, {name: np.zeros(2)})
    with pytest.raises(InputError, match="cannot name a file"):
        save_checkpoint(run, 1, {}, {name: b"x"})


# ---- what is kept ------------------------------------------------------------------------------


def test_blocks_are_written_once_and_deleted_with_the_last_checkpoint_that_needs_them(run):
    save_checkpoint(run, 1, a_state(1), some_blocks(1, 2))
    times = {path: path.stat().st_mtime_ns for path in run.replay.iterdir()}
    save_checkpoint(run, 2, a_state(2), some_blocks(2, 3))
    assert len(times) == 2
    assert all(path.stat().st_mtime_ns == time for path, time in times.items())
    assert len(files(run.replay)) == 3
    save_checkpoint(run, 3, a_state(3), some_blocks(3, 4))
    assert checkpoint_steps(run) == [2, 3]
    assert [name.split("-")[1] for name in files(run.replay)] == ["000002", "000003", "000004"]
    for step, numbers in ((2, (2, 3)), (3, (3, 4))):
        loaded = load_checkpoint(run, step)
        assert loaded.step == step
        assert loaded.blocks == some_blocks(*numbers)
        assert same(loaded.state, a_state(step))


def test_the_best_is_kept_however_old_it_is(run):
    assert best_step(run) is None
    for step, score in enumerate((None, 3.0, 7.0, 7.0, -1.0, 2.0, None), start=1):
        save_checkpoint(run, step, a_state(step), some_blocks(step), score=score)
    assert (checkpoint_steps(run), best_step(run)) == ([4, 6, 7], 4)  # of tied ones the newest
    assert same(load_checkpoint(run, 4).state, a_state(4))
    assert load_checkpoint(run, 4).blocks == some_blocks(4)
    save_checkpoint(run, 8, a_state(8), score=8.0)
    assert (checkpoint_steps(run), best_step(run)) == ([7, 8], 8)
    save_checkpoint(run, 7, a_state(9), score=1.0)  # the run went back: that past did not happen
    assert (checkpoint_steps(run), best_step(run)) == ([7], 7)


def test_a_torn_score_is_none(run):
    for step, score in ((1, 5.0), (2, 4.0)):
        save_checkpoint(run, step, a_state(step), score=score)
    path = run.checkpoints / "000000001" / "score.json"
    path.write_text("9.0")
    assert best_step(run) == 2
    save_checkpoint(run, 3, a_state(3), score=1.0)
    assert checkpoint_steps(run) == [2, 3]


def test_a_checkpoint_has_a_name(run):
    save_checkpoint(run, 1, a_state(1))
    assert find_checkpoint(str(run.path)) == (run.path, None)
    assert find_checkpoint(f"{run.path}@7") == (run.path, 7)
    with pytest.raises(
        InputError, match=r"No checkpoint of '.*' has a score: no episode had ended"
    ):
        find_checkpoint(f"{run.path}@best")
    with pytest.raises(InputError, match=r"'bets' is no step of .*\. There are: 1, and best\."):
        find_checkpoint(f"{run.path}@bets")
    save_checkpoint(run, 2, a_state(2), score=-3.5)
    assert find_checkpoint(f"{run.path}@best") == (run.path, 2)
    odd = run.path.with_name("odd@best")  # a name that is there names itself
    odd.mkdir()
    assert find_checkpoint(str(odd)) == (odd, None)


def test_going_back_replaces_what_came_after(run):
    for step in (1, 2):
        save_checkpoint(run, step, a_state(step), some_blocks(step))
    other = {"0-000002": b"another past"}  # under the same name as before
    save_checkpoint(run, 2, a_state(9), other)
    assert checkpoint_steps(run) == [1, 2]
    assert load_checkpoint(run).blocks == other
    assert load_checkpoint(run).state["progress"]["agent_steps"] == 9
    assert load_checkpoint(run, 1).blocks == some_blocks(1)
    save_checkpoint(run, 1, a_state(1), some_blocks(1))
    assert checkpoint_steps(run) == [1]
    assert len(files(run.checkpoints)) == len(files(run.replay)) == 1


def test_a_run_without_a_checkpoint_says_so(run):
    with pytest.raises(InputError, match=r"has no checkpoint yet\. Train on: trdlab resume"):
        load_checkpoint(run)
    save_checkpoint(run, 1, {})
    with pytest.raises(InputError, match=r"no checkpoint at step 3\. There are: 1\."):
        load_checkpoint(run, 3)


def test_who_reads_the_newest_while_it_is_thinned_out_gets_a_newer_one(run, monkeypatch):
    def overtaken(folder: Path) -> Index:
        monkeypatch.undo()
        newest = checkpoint_steps(run)[-1]
        for step in (newest + 1, newest + 2):
            save_checkpoint(run, step, a_state(step))
        return Index.read(folder)  # which is gone

    save_checkpoint(run, 1, a_state(1))
    monkeypatch.setattr(Index, "read", overtaken)
    assert load_checkpoint(run).step == 3
    monkeypatch.setattr(Index, "read", overtaken)
    assert read_arrays(run, "q_network")[0] == 5
    monkeypatch.setattr(Index, "read", overtaken)
    with pytest.raises(TrdlabError, match="The checkpoint at step 4 cannot be used"):
        load_checkpoint(run, 4)


# ---- what is torn ------------------------------------------------------------------------------


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("damage", [cut, flip, Path.unlink], ids=lambda damage: damage.__name__)
@pytest.mark.parametrize(
    "name",
    ["index.json", "state.json", "q_network.safetensors", "memory.safetensors", "block"],
)
def test_a_torn_checkpoint_is_named_and_never_skipped(run, name, damage):
    for step in (1, 2):
        save_checkpoint(run, step, a_state(step), some_blocks(step))
    folder = run.checkpoints / "000000002"
    path = next(run.replay.glob("0-000002*")) if name == "block" else folder / name
    damage(path)
    with pytest.raises(TrdlabError) as caught:
        load_checkpoint(run)
    assert str(caught.value).startswith("The checkpoint at step 2 cannot be used: '")
    assert path.name[:8] in str(caught.value)
    assert "The one at step 1 is whole: `checkpoint=1`, or" in str(caught.value)
    assert same(load_checkpoint(run, 1).state, a_state(1))
    save_checkpoint(run, 2, a_state(2), some_blocks(2))  # the run goes on from there
    assert same(load_checkpoint(run).state, a_state(2))


def test_no_block_is_deleted_while_nobody_knows_who_needs_it(run):
    for step in (1, 2):
        save_checkpoint(run, step, a_state(step), some_blocks(step))
    index = run.checkpoints / "000000001" / "index.json"
    text = index.read_bytes()
    cut(index)
    save_checkpoint(run, 3, a_state(3), some_blocks(3), keep=3)
    assert len(files(run.replay)) == 3
    index.write_bytes(text)  # somebody has put it right
    assert load_checkpoint(run, 1).blocks == some_blocks(1)


def test_advice_is_given_only_where_it_holds(run):
    for step in (1, 2):
        save_checkpoint(run, step, a_state(step))
        cut(run.checkpoints / f"00000000{step}" / "state.json")
    with pytest.raises(TrdlabError, match=r"state\.json' has \d+ bytes instead of \d+\. No other"):
        load_checkpoint(run)


def test_a_doctored_index_leads_nowhere(run, tmp_path):
    save_checkpoint(run, 1, a_state(1))
    (tmp_path / "secret").write_bytes(b"")
    index = run.checkpoints / "000000001" / "index.json"
    for part in ("files", "blocks"):
        doctored = {"files": {}, "blocks": {}, part: {"../../secret": [0, 0]}}
        index.write_text(json.dumps(doctored))
        with pytest.raises(TrdlabError, match=r"has a file named '\.\./\.\./secret'"):
            load_checkpoint(run)
    for doctored in ("[]", "{}", '{"files": {"a": 1}}', "[" * 100_000, '{"files": 1}'):
        index.write_text(doctored)
        with pytest.raises(TrdlabError, match=r"index\.json' is torn"):
            load_checkpoint(run)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> RunFolder:
    """A run that tests damage and restore."""
    run = RunFolder.create(tmp_path_factory.mktemp("runs") / "whole", {})
    save_checkpoint(run, 1, a_state(1), some_blocks(1, 2))
    return run


@given(st.data())
def test_a_byte_that_changes_is_noticed(whole, data):
    paths = sorted(path for path in whole.path.rglob("0*/*") if path.is_file())
    path = data.draw(st.sampled_from(paths + sorted(whole.replay.iterdir())))
    before = path.read_bytes()
    after = bytearray(before)
    place = data.draw(st.integers(0, len(before) - 1))
    after[place] = data.draw(st.integers(0, 255))
    path.write_bytes(after)
    try:
        loaded = load_checkpoint(whole)
    except TrdlabError:
        assert after != before
    else:
        assert same(loaded.state, a_state(1))
        assert loaded.blocks == some_blocks(1, 2)
    finally:
        path.write_bytes(before)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("state.json", b"[]"),
        ("state.json", b'{"x": {"$float": []}}'),
        ("state.json", b'{"x": {"$array": "missing"}}'),
        ("state.json", b'{"x": {"$array": ["y"]}}'),
        ("state.json", b'{"x": ' + b"[" * 100_000),
        ("x.safetensors", b"cos\nsystem\n(S'true'\ntR."),  # a pickle
        ("x.safetensors", (2**62).to_bytes(8, "little")),
    ],
)
def test_files_that_were_never_ours_are_refused_although_their_sums_are_right(run, name, content):
    save_checkpoint(run, 1, {"x": np.zeros(2)})
    folder = run.checkpoints / "000000001"
    (folder / name).write_bytes(content)
    index = json.loads((folder / "index.json").read_text())
    index["files"][name] = [len(content), crc32(content)]
    (folder / "index.json").write_text(json.dumps(index))
    with pytest.raises(TrdlabError, match=r"step 1 cannot be used: .*No other"):
        load_checkpoint(run)


# ---- what cannot be written --------------------------------------------------------------------


def test_whatever_write_fails_the_checkpoint_before_is_whole(run, monkeypatch):
    save_checkpoint(run, 1, a_state(1), some_blocks(1))
    before = files(run.replay), files(run.checkpoints)
    write_bytes, left = Path.write_bytes, 0

    def failing(path: Path, data: bytes) -> int:
        nonlocal left
        left -= 1
        if left >= 0:
            return write_bytes(path, data)
        write_bytes(path, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", failing)
    # the index of what comes, two blocks, the state, the weights, the memory, the index
    for allowed in range(7):
        left = allowed
        with pytest.raises(OutputError) as caught:
            save_checkpoint(run, 2, a_state(2), some_blocks(1, 2, 3))
        assert "step 2 cannot be saved: Cannot write '" in str(caught.value)
        assert "No space left on device." in str(caught.value)
        assert str(caught.value).endswith(f"trdlab resume {run.path} goes on from step 1.")
        assert (files(run.replay), files(run.checkpoints)) == before
        assert same(load_checkpoint(run).state, a_state(1))
    left = 7
    save_checkpoint(run, 2, a_state(2), some_blocks(1, 2, 3))
    assert load_checkpoint(run).blocks == some_blocks(1, 2, 3)


@pytest.fixture
def small_disk(tmp_path):
    """A real disk of one megabyte."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("a disk can be mounted only by root, and not everywhere")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_a_disk_that_fills_up(small_disk):
    run = RunFolder.create(small_disk / "run", {})
    save_checkpoint(run, 1, a_state(1), {"a": bytes(300_000)})
    taken = sorted(run.path.rglob("*"))
    for state, blocks in (
        (a_state(2), {"a": bytes(300_000), "b": bytes(400_000), "c": bytes(400_000)}),
        ({"big": np.zeros(100_000)}, {}),
    ):
        with pytest.raises(
            OutputError, match=r"step 2 cannot be saved: .* No space left on device"
        ):
            save_checkpoint(run, 2, state, blocks)
        assert sorted(run.path.rglob("*")) == taken
        assert same(load_checkpoint(run).state, a_state(1))
    save_checkpoint(run, 2, a_state(2), {"a": bytes(300_000), "b": bytes(400_000)})
    assert checkpoint_steps(run) == [1, 2]


def test_a_first_checkpoint_that_fails(run):
    run.checkpoints.rmdir()
    run.checkpoints.touch()
    with pytest.raises(OutputError, match=r"File exists\. When .* goes on from the beginning\."):
        save_checkpoint(run, 1, a_state(1))


def test_old_checkpoints_that_cannot_be_deleted_are_no_failure_to_save(run, monkeypatch):
    def failing(*_: object, **__: object) -> None:
        raise OSError(errno.EACCES, os.strerror(errno.EACCES))

    for step in (1, 2):
        save_checkpoint(run, step, a_state(step))
    monkeypatch.setattr(Path, "unlink", failing)
    with pytest.raises(OutputError, match=r"step 3 is saved, but an old one .*: Permission denied"):
        save_checkpoint(run, 3, a_state(3))
    assert same(load_checkpoint(run).state, a_state(3))


# ---- what is killed ----------------------------------------------------------------------------


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.parametrize("when", ["next", "again", "random"])
def test_kill_9_at_any_moment_leaves_the_newest_checkpoint_whole(tmp_path, when):
    command = [sys.executable, Path(__file__).with_name("crash.py"), when, tmp_path / "run"]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert int(ended.stdout) >= 30  # kills
