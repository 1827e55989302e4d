"""Results are written whole or not at all, and never over an old one by accident."""

import errno
import os
from pathlib import Path

import pytest

from trdlab.errors import OutputError, TrdlabError
from trdlab.files import (
    check_output,
    free_name,
    is_leftover,
    new_folder,
    read_json,
    write_json,
    write_whole,
)

SUFFIXES = (".png", ".svg")


def refused(path: Path, **options: bool) -> str:
    """Returns the message with which a file is refused."""
    with pytest.raises(OutputError) as caught:
        check_output(path, SUFFIXES, **options)
    return str(caught.value)


def test_a_new_file_in_a_folder_is_fine(tmp_path):
    check_output(tmp_path / "a.png", SUFFIXES)
    check_output(tmp_path / "a.PNG", SUFFIXES)
    assert not list(tmp_path.iterdir())


def test_each_obstacle_is_named_once(tmp_path):
    old, folder = tmp_path / "old.png", tmp_path / "folder.png"
    old.write_text("old")
    folder.mkdir()
    assert refused(tmp_path / "no" / "a.png") == (
        f"The folder '{tmp_path / 'no'}' does not exist. Create it first."
    )
    assert refused(old) == f"The file '{old}' exists. Choose another name, or `overwrite=True`."
    assert refused(folder, overwrite=True) == f"'{folder}' is a folder. Name a file."
    check_output(old, SUFFIXES, overwrite=True)
    assert old.read_text() == "old"


def test_an_unknown_ending_gets_a_suggestion(tmp_path):
    assert "'.pngg' is no known ending. Did you mean '.png'?" in refused(tmp_path / "a.pngg")
    assert "'' is no known ending. Known: .png, .svg." in refused(tmp_path / "a")


def test_names_that_no_file_can_have(tmp_path):
    for name in ("a" * 300 + ".png", "a\0.png"):
        assert "Cannot write" in refused(tmp_path / name)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_is_not_writable(tmp_path):
    tmp_path.chmod(0o500)
    assert "is not writable" in refused(tmp_path / "a.png")


def test_a_folder_that_says_it_is_not_writable(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert (
        refused(tmp_path / "a.png")
        == f"The folder '{tmp_path}' is not writable. Choose another one."
    )


def test_a_free_name(tmp_path):
    for name in ("breakout", "breakout-2", "breakout-3"):
        assert free_name(tmp_path, "breakout") == tmp_path / name
        (tmp_path / name).mkdir()
    assert free_name(tmp_path / "new", "pong") == tmp_path / "new" / "pong"


def test_a_new_folder_is_made_for_one_alone(tmp_path):
    assert new_folder(tmp_path / "new", "pong") == tmp_path / "new" / "pong"
    assert new_folder(tmp_path / "new", "pong") == tmp_path / "new" / "pong-2"
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=r"Cannot make the folder .*pong'"):
        new_folder(tmp_path / "file", "pong")
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    with pytest.raises(OutputError, match="Cannot make the folder"):
        new_folder(tmp_path / "nowhere", "pong")


# ---- writing -----------------------------------------------------------------------------------


def full_disk(path: Path) -> None:
    path.write_text("half of")
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def interrupted(path: Path) -> None:
    path.write_text("half of")
    raise KeyboardInterrupt


def test_a_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "a.png"

    def write(temporary: Path) -> None:
        assert temporary.suffix == ".png"  # writers choose their format by it
        assert temporary.parent == tmp_path  # so that renaming cannot fail between disks
        temporary.write_text("half of")
        assert not path.exists()
        temporary.write_text("whole")

    write_whole(path, write)
    assert path.read_text() == "whole"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_leaves_nothing_behind(tmp_path):
    with pytest.raises(OutputError, match=r"Cannot write .*a.png': No space left on device\."):
        write_whole(tmp_path / "a.png", full_disk)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("writer", "error"), [(full_disk, OutputError), (interrupted, KeyboardInterrupt)]
)
def test_an_old_file_survives_a_failure(tmp_path, writer, error):
    path = tmp_path / "a.png"
    path.write_text("old")
    with pytest.raises(error):
        write_whole(path, writer)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_and_a_file_for_a_folder(tmp_path):
    file = tmp_path / "file"
    file.touch()
    for folder in (tmp_path / "gone", file):
        with pytest.raises(OutputError, match="Cannot write"):
            write_whole(folder / "a.png", lambda path: path.write_text("x"))


def test_the_longest_name_can_be_written(tmp_path):
    path = tmp_path / ("a" * 251 + ".png")  # 255, the limit of most file systems
    write_whole(path, lambda temporary: temporary.write_text("x"))
    assert list(tmp_path.iterdir()) == [path]


def a_folder(text: str):
    """Returns what writes a folder with a folder in it."""

    def write(folder: Path) -> None:
        (folder / "inner").mkdir(parents=True)
        (folder / "inner" / "file").write_text(text)

    return write


def test_a_folder_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "folder"
    path.mkdir()  # an empty one may be there
    write_whole(path, a_folder("x"))
    assert (path / "inner" / "file").read_text() == "x"
    with pytest.raises(OutputError, match=r"folder': Directory not empty\."):
        write_whole(path, a_folder("y"))
    assert (path / "inner" / "file").read_text() == "x"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_fails_leaves_nothing_behind(tmp_path):
    def write(folder: Path) -> None:
        a_folder("x")(folder)
        full_disk(folder / "file")

    with pytest.raises(OutputError, match="No space left on device"):
        write_whole(tmp_path / "folder", write)
    assert not list(tmp_path.iterdir())


def test_what_a_killed_process_left_is_recognised_and_no_obstacle(tmp_path):
    seen = []

    def killed(folder: Path) -> None:
        a_folder("old")(folder)
        seen.append(folder)
        folder.rename(tmp_path / "kept")  # out of reach of any clearing up

    with pytest.raises(OutputError):
        write_whole(tmp_path / "folder", killed)
    (tmp_path / "kept").rename(seen[0])
    assert is_leftover(seen[0])
    write_whole(tmp_path / "folder", a_folder("new"))
    assert sorted(tmp_path.iterdir()) == [seen[0], tmp_path / "folder"]
    assert not is_leftover(tmp_path / ".gitkeep")


def test_everything_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    path, synced = tmp_path / "folder", []

    def fsync(number: int) -> None:
        synced.append((Path(f"/proc/self/fd/{number}").readlink().name, path.exists()))

    if not Path("/proc/self/fd").exists():
        pytest.skip("this system does not tell which file is synced")
    monkeypatch.setattr(os, "fsync", fsync)
    write_whole(path, a_folder("x"))
    *inside, parent = synced
    assert [name for name, _ in inside][:2] == ["file", "inner"]
    assert not any(visible for _, visible in inside)
    assert parent == (tmp_path.name, True)


def test_json_files(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"a": [1, "é"]})
    assert read_json(path) == {"a": [1, "é"]}
    for torn in ('{"a": [1', "", "\x00", "[" * 100_000):
        path.write_text(torn)
        with pytest.raises(TrdlabError, match=r"a\.json' is torn: "):
            read_json(path)
    with pytest.raises(TrdlabError, match=r"b\.json' cannot be read: No such file or directory\."):
        read_json(tmp_path / "b.json")
