"""`trdlab games` as its users see it."""

import json

from trdlab.atari import game_names
from trdlab.runs.pretrained import pretrained_names


def test_every_game_is_listed_once(trdlab, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    code, out, err = trdlab("games")
    assert (code, err) == (0, "")
    listed, _, trained = out.partition("\n\n")
    assert sorted(listed.split()) == sorted(game_names())
    assert max(map(len, out.splitlines())) <= 60
    assert all(f" {name}" in trained for name in pretrained_names())
    code, out, _ = trdlab("games", "--json")
    assert code == 0
    told = {"games": list(game_names()), "pretrained": list(pretrained_names())}
    assert json.loads(out) == {"schema": "trdlab.games/1", **told}
