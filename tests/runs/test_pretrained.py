"""Runs that come with trdlab: named wherever an agent is named, and left as they are."""

from pathlib import Path

import numpy as np
import pytest

import trdlab
from small_runs import train
from trdlab.errors import InputError
from trdlab.runs import find_checkpoint, pretrained
from trdlab.training.loading import evaluate_run
from trdlab.training.run import resume
from trdlab.training.setup import read_settings, shipped_teacher


@pytest.fixture
def shipped(tmp_path, monkeypatch) -> Path:
    """A run of CartPole that comes with trdlab as if it were Breakout."""
    monkeypatch.setattr(pretrained, "SHIPPED", tmp_path / "shipped")
    return train(tmp_path / "shipped" / "Breakout", "CartPole-v1", agent_steps=200, hidden=[8])


def files(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_it_is_named_like_any_other_agent(shipped):
    seen = np.zeros((1, 4), dtype=np.float32)
    agent = trdlab.agent("pretrained:Breakout")
    told = agent.estimator.decompose(seen).components
    assert np.array_equal(told, trdlab.load("pretrained:Breakout").decompose(seen).components)
    assert np.array_equal(told, trdlab.load(shipped).decompose(seen).components)
    assert agent.name == "Breakout"
    assert agent.origin is not None
    assert agent.origin.words == ("pretrained:Breakout",)  # and no path of this machine
    assert find_checkpoint("pretrained:Breakout") == (shipped, None)


def test_it_is_left_as_it_is(shipped):
    before = files(shipped)
    _, kept = evaluate_run(shipped, episodes=2)
    assert str(kept) == "What comes with trdlab is left as it is."
    again = r"'pretrained:Breakout' comes with trdlab.* --teacher pretrained:Breakout"
    with pytest.raises(InputError, match=again), resume(shipped):
        pass
    assert files(shipped) == before


def test_one_that_there_is_not_says_which_there_are(shipped):
    with pytest.raises(InputError, match=r"'Brekout' comes.* Did you mean 'Breakout'\?"):
        trdlab.agent("pretrained:Brekout")
    with pytest.raises(InputError, match=r"No trained agent '\.\./shipped/Breakout'"):
        trdlab.agent("pretrained:../shipped/Breakout")


def test_a_game_is_learned_from_the_agent_that_comes_with_trdlab(shipped):
    assert shipped_teacher("atari", "ALE/Breakout-v5") == "pretrained:Breakout"
    assert shipped_teacher("atari", "Pong") is None
    assert shipped_teacher("gym", "Breakout") is None
    taught = read_settings("atari", "Breakout", "cpu", None, {})
    assert taught.teacher == "pretrained:Breakout"
    assert (taught.agent_steps, taught.offline_updates) == (20_000, 10_000)
    alone = read_settings("atari", "Breakout", "cpu", None, {}, from_scratch=True)
    other = read_settings("atari", "Pong", "cpu", None, {})
    assert alone.teacher is other.teacher is None
    assert alone.agent_steps == other.agent_steps == 1_000_000
    own = read_settings("atari", "Breakout", "cpu", None, {"teacher": "mine.zip"})
    assert own.teacher == "mine.zip"
    assert read_settings("atari", "Breakout", "smoke", None, {}).teacher is None
