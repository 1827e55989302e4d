"""`trdlab video` as its users see it."""

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image


def test_it_writes_an_episode_and_says_where(trdlab, tmp_path):
    code, out, err = trdlab("video", "gridworld:drone", "-o", "drone.gif")
    assert (code, out, err) == (0, "", "Video: drone.gif\n")
    with Image.open(Path("drone.gif")) as image:
        assert image.n_frames == 6 + 2 * 4  # five steps, and two seconds of rest


def test_it_replaces_a_video_only_if_it_is_told_to(trdlab):
    Path("a.webp").write_bytes(b"old")
    code, _, err = trdlab("video", "gridworld:drone", "-o", "a.webp")
    assert (code, err) == (
        2,
        "error: The file 'a.webp' exists. Choose another name, or --overwrite.\n",
    )
    assert trdlab("video", "gridworld:drone", "-o", "a.webp", "--overwrite")[0] == 0
    assert Path("a.webp").read_bytes().startswith(b"RIFF")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "a.avi"), "'.avi' is no known ending. Known: .gif, .mp4, .webp."),
        (("-o", "a.gif", "--rate", 0), "The rate is 0."),
        (("-o", "a.gif", "--what", "saliency"), "The ExactTable has no maps of where it looks."),
    ],
)
def test_what_cannot_be_made_is_refused_in_a_line(trdlab, words, message):
    code, _, err = trdlab("video", "gridworld:drone", *words)
    assert code == 2
    assert message in err
    assert not list(Path().glob("*.gif"))


def test_an_mp4_without_the_extra_names_it(trdlab, monkeypatch):
    monkeypatch.setattr("trdlab.show.video.files.find_spec", lambda name: None)
    code, _, err = trdlab("video", "gridworld:drone", "-o", "a.mp4")
    assert code == 2
    assert "pip install 'trdlab[video]', or write a .webp or a .gif" in err


def test_an_exact_table_becomes_a_video_without_torch(tmp_path):
    source = (
        "import sys, trdlab; "
        f"path = {str(tmp_path / 'a.gif')!r}; "
        "trdlab.explain('gridworld:drone', parts='episode', episodes=0).to_video(path); "
        "print('torch' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", source], capture_output=True, text=True, check=True)
    assert run.stdout == "False\n"
