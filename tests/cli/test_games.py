"""`trdlab games` as its users see it."""

import json

from trdlab.atari import game_names


def test_every_game_is_listed_once(trdlab, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    code, out, err = trdlab("games")
    assert (code, err) == (0, "")
    assert sorted(out.split()) == sorted(game_names())
    assert max(map(len, out.splitlines())) <= 60
    code, out, _ = trdlab("games", "--json")
    assert code == 0
    assert json.loads(out) == {"schema": "trdlab.games/1", "games": list(game_names())}
