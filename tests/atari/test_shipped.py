"""The agents that come with trdlab: what lies in their folders, and that they play."""

import json

import numpy as np
import pytest

import trdlab
from trdlab.policies import EpsilonGreedy
from trdlab.runs.pretrained import SHIPPED, pretrained_names

GAMES = pretrained_names()


def test_the_games_that_the_docs_name_are_there():
    assert {"Breakout", "Pong", "Riverraid"} <= {*GAMES}


@pytest.mark.parametrize("game", GAMES)
def test_its_folder_is_small_and_says_where_it_is_from(game):
    files = [path for path in (SHIPPED / game).rglob("*") if path.is_file()]
    assert all(path.stat().st_size < 5e6 for path in files)
    for path in files:
        if path.suffix in (".json", ".toml", ".jsonl"):
            assert '"/' not in path.read_text(encoding="utf-8")  # no path of a machine
    manifest = json.loads((SHIPPED / game / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["teacher"]["origin"]
    assert len(manifest["teacher"]["sha256"]) == 64
    assert manifest["command"].startswith(f"trdlab train atari {game} ")


@pytest.mark.parametrize("game", GAMES)
def test_it_plays_about_as_well_as_its_teacher_and_its_forecasts_are_no_guess(game):
    card = json.loads((SHIPPED / game / "card.json").read_text(encoding="utf-8"))
    assert card["teacher-normalised"] > 0.8
    fitted, joint = (card[of]["skill"] for of in ("fitted", "joint"))
    assert len(fitted["value"]) == 40
    assert np.mean(fitted["value"]) > np.mean(joint["value"])


@pytest.mark.parametrize("game", GAMES)
def test_it_plays_and_tells_what_it_expects(game):
    agent = trdlab.agent(f"pretrained:{game}")
    assert isinstance(agent.policy, EpsilonGreedy)
    (episode,) = agent.play(1, seed=3, max_steps=30)
    assert episode.expected.shape[1] == agent.estimator.time_axis.num_components == 41
    assert np.isfinite(episode.expected).all()
    outlook = agent.estimator.outlook(np.zeros((1, 4, 84, 84), dtype=np.uint8))
    assert outlook is not None
    assert outlook.survival.shape[-1] == 41
