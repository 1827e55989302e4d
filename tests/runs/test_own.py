"""What is not the run's own is neither deleted, nor cut, nor written to."""

import os
from pathlib import Path

import pytest

from trdlab.errors import OutputError
from trdlab.runs import MetricsFile, RunFolder, checkpoint_steps, list_runs, save_checkpoint


@pytest.fixture
def run(tmp_path) -> RunFolder:
    run = RunFolder.create(tmp_path / "runs" / "mine", {"seed": 1})
    for step in (1, 2):
        save_checkpoint(run, step, {"step": step}, {str(step): b"x"})
    with MetricsFile(run.metrics) as metrics:
        metrics.append({"agent_steps": 2})
    return run


@pytest.fixture
def elsewhere(tmp_path) -> Path:
    """Returns a folder of files that look like another run's, and like anything."""
    other = RunFolder.create(tmp_path / "elsewhere", {"seed": 2})
    for step in (1, 2):
        save_checkpoint(other, step, {"step": step}, {str(step): b"y"})
    other.metrics.write_text('{"agent_steps": 5}\nnotes')
    for folder in (other.path, other.replay, other.checkpoints, other.checkpoints / "000000001"):
        (folder / "thesis.tex").write_text("my only copy")
        (folder / ".hidden").write_text("mine")
    return other.path


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def go_on(run: RunFolder) -> None:
    with run.held():
        with MetricsFile(run.metrics) as metrics:
            metrics.append({"agent_steps": 3})
        for step in (3, 4, 5):
            save_checkpoint(run, step, {"step": step}, {str(step): b"x"})


@pytest.mark.parametrize(
    "part",
    ["replay", "checkpoints", "evaluations", "tensorboard", "metrics.jsonl", ".lock",
     "checkpoints/000000001", "checkpoints/000000001.old"],
)  # fmt: skip
@pytest.mark.parametrize("relative", [True, False])
def test_a_link_is_refused_by_name_and_what_lies_behind_it_stays(run, elsewhere, part, relative):
    link, target = run.path / part, elsewhere / part.removesuffix(".old")
    target = target if target.exists() else elsewhere / "thesis.tex"
    if link.exists():
        link.rename(run.path / "aside")
    link.symlink_to(os.path.relpath(target, link.parent) if relative else target)
    before = contents(elsewhere)
    with pytest.raises(OutputError) as caught:
        go_on(run)
    assert str(caught.value) == (
        f"'{link}' is a link, and is not written through. "
        "Put a copy of what it leads to in its place."
    )
    list_runs(run.path.parent)
    assert contents(elsewhere) == before


@pytest.mark.parametrize("part", ["metrics.jsonl", ".lock"])
def test_a_file_with_another_name_elsewhere_is_refused(run, elsewhere, part):
    (run.path / part).unlink(missing_ok=True)
    (run.path / part).hardlink_to(elsewhere / "metrics.jsonl")
    before = contents(elsewhere)
    with pytest.raises(OutputError, match=rf"{part}' is a hard link: it has another name"):
        go_on(run)
    list_runs(run.path.parent)
    assert contents(elsewhere) == before


def test_a_link_in_place_of_a_part_of_a_checkpoint_loses_only_its_name(run, elsewhere):
    foreign = elsewhere / "thesis.tex"
    parts = [run.checkpoints / "000000001" / "state.json", *run.replay.iterdir()]
    for part in parts:
        part.unlink()
        part.symlink_to(foreign)
    (run.path / ".holder.json").symlink_to(foreign)
    before = contents(elsewhere)
    go_on(run)
    assert contents(elsewhere) == before
    assert not any(part.is_symlink() for part in parts)


def test_other_files_among_its_own_stay(run):
    folders = (run.path, run.replay, run.checkpoints, run.checkpoints / "000000001")
    names = ("thesis.tex", ".snapshot", ".nfs0001", "0-000001-1a2b3c4d", "2024", "holiday-20240101")
    for folder in folders:
        for name in names[:-1]:
            (folder / name).write_text("mine")
        (folder / names[-1]).mkdir()
        (folder / names[-1] / "photo").write_text("mine")
    go_on(run)
    assert checkpoint_steps(run) == [4, 5]
    assert len(list(run.replay.glob("[1-5]-*"))) == 2
    for folder in (*folders[:-1], run.checkpoints / "000000001.old"):
        assert {path.name for path in folder.iterdir()} >= set(names)
        assert (folder / names[-1] / "photo").read_text() == "mine"
    assert [path.name for path in run.checkpoints.glob("*.old")] == ["000000001.old"]
    assert not (run.checkpoints / "000000001.old" / "state.json").exists()


def test_blocks_of_another_run_in_the_same_folder_stay(run, tmp_path):
    other = RunFolder.create(tmp_path / "runs" / "other", {})
    save_checkpoint(other, 1, {}, {"7": b"z"})
    [foreign] = other.replay.iterdir()
    foreign.rename(run.replay / foreign.name)  # as on a disk that two runs share
    go_on(run)
    assert (run.replay / foreign.name).read_bytes() == b"z"


def test_what_a_process_wrote_that_was_killed_is_swept_away(run, monkeypatch):
    def killed(path: Path, data: bytes) -> int:
        if path.name.endswith("state.json"):
            raise KeyboardInterrupt
        return write(path, data)

    write = Path.write_bytes
    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", killed)
        with pytest.raises(KeyboardInterrupt):
            save_checkpoint(run, 3, {}, {"3": b"x", "4": b"x"})
    assert len(list(run.replay.iterdir())) == 4
    save_checkpoint(run, 3, {}, {"3": b"other"})
    assert len(list(run.replay.iterdir())) == 2
    assert sorted(path.name for path in run.checkpoints.iterdir()) == ["000000002", "000000003"]
