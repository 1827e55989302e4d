"""Atari: what ale-py does, to the bit, and restored to the bit."""

import subprocess
import sys
from dataclasses import fields

import numpy as np
import pytest
from ale_py import AtariVectorEnv

import trdlab.atari.environments
from trdlab.atari import AtariEnvironments
from trdlab.environments import NotCopyable, NotReproducible, Step
from trdlab.environments.stack import FrameStack, observation_space
from trdlab.errors import InputError, TrdlabError

_MORE = ("allowed", "screens", "info")
TOLD = [of.name for of in fields(Step) if of.name not in _MORE]  # [B, ...] each


def same(a: Step, b: Step) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in TOLD)


def acted(games: AtariEnvironments, steps: int, seed: int = 0) -> list[Step]:
    actions = np.random.default_rng(seed).integers(games.num_actions, size=(steps, games.num_envs))
    return [games.step(row) for row in actions]


def test_stacked_as_ale_stacks_across_lost_lives_and_ends():
    seeds = [np.random.SeedSequence([0, env, 0]).generate_state(1)[0] >> 1 for env in range(2)]
    ale = AtariVectorEnv(
        "breakout", 2, reward_clipping=False, life_loss_info=True, repeat_action_probability=0.25
    )
    expected, info = ale.reset(seed=np.array(seeds, dtype=np.int64))
    games = AtariEnvironments("Breakout", 2, seed=0, sticky=0.25)
    stack = FrameStack(games.reset(), games.stack, games.padding)
    np.testing.assert_array_equal(stack.observations, expected)
    lost = ended = 0
    for actions in np.random.default_rng(0).integers(4, size=(420, 2)):
        expected, rewards, flags, _, info = ale.step(actions)
        step = games.step(actions)
        np.testing.assert_array_equal(step.frames, expected[:, -1])
        np.testing.assert_array_equal(step.rewards, rewards)
        np.testing.assert_array_equal(step.ended, flags & (info["lives"] == 0))
        np.testing.assert_array_equal(step.life_lost, flags & (info["lives"] > 0))
        if step.ended.any():
            expected, info = ale.reset(options={"reset_mask": step.ended})
        stack.push(step.following, step.ended)
        np.testing.assert_array_equal(stack.observations, expected)
        lost, ended = lost + step.life_lost.sum(), ended + step.ended.sum()
    assert (lost > 8, ended > 2) == (True, True)


@pytest.mark.parametrize(("num_envs", "sticky"), [(1, 0.0), (1, 0.25), (4, 0.25)])
def test_restored_to_the_bit_in_the_middle_of_a_game(monkeypatch, num_envs, sticky):
    monkeypatch.setattr(trdlab.atari.environments, "RESEED_AFTER", 250)

    def made() -> AtariEnvironments:
        return AtariEnvironments("Breakout", num_envs, seed=1, sticky=sticky)

    games = made()
    games.reset()
    before = acted(games, 500)
    state = games.state_dict()
    assert sum(step.ended.sum() for step in before) > state["seedings"].sum() > 0
    assert 0 < state["lengths"].min() < 500
    assert state["actions"].dtype == np.uint8
    after = acted(games, 150, seed=1)
    for again in (made(), games):  # new ones, and those that have played on
        frames = again.load_state_dict(state)
        np.testing.assert_array_equal(frames, before[-1].following)
        assert all(map(same, after, acted(again, 150, seed=1)))


def test_copies_go_on_as_the_games_do():
    games = AtariEnvironments("Breakout", 2, seed=1)
    games.reset()
    steps = acted(games, 150) + acted(games, 40, seed=1)
    assert any(step.ended.any() for step in steps), "a copy plays more than one game again"
    copies = games.branch(np.array([1, 0, 1]), seed=5)
    for first, second in np.random.default_rng(2).integers(4, size=(30, 2)):
        original, copied = (
            games.step(np.array([first, second])),
            copies.step(np.array([second, first, (second + 1) % 4])),
        )
        np.testing.assert_array_equal(copied.frames[:2], original.frames[::-1])
        np.testing.assert_array_equal(copied.rewards[:2], original.rewards[::-1])
        np.testing.assert_array_equal(copied.terminated[:2], original.terminated[::-1])
        np.testing.assert_array_equal(copied.life_lost[:2], original.life_lost[::-1])
    assert (copied.frames[2] != copied.frames[0]).any(), "each goes its own way"
    with pytest.raises(NotCopyable, match="sticky"):
        AtariEnvironments("Breakout", 1, seed=1, sticky=0.25).branch(np.array([0]), seed=0)


def test_of_games_that_are_not_active_nothing_is_told():
    games, every = (AtariEnvironments("Breakout", 3, seed=1) for _ in range(2))
    games.reset()
    every.reset()
    active, ended = np.array([True, False, True]), 0
    for actions in np.random.default_rng(0).integers(4, size=(220, 3)):
        told, expected = games.step(actions, active), every.step(actions)
        for name in TOLD:
            of, by = getattr(told, name), getattr(expected, name)
            np.testing.assert_array_equal(of[active], by[active])
        silent = (told.rewards, told.terminated, told.truncated, told.life_lost)
        assert not any(of[1] for of in silent)
        ended += int(expected.ended[1])
    assert ended > 0
    assert games.state_dict()["lengths"][1] == 0


def test_same_seed_same_games_and_each_game_another():
    def played(seed: int) -> list[bytes]:
        games = AtariEnvironments("SpaceInvaders", 2, seed=seed, sticky=0.25)
        games.reset()
        last = acted(games, 60)[-1]
        return [frame.tobytes() for frame in last.frames]

    assert played(0) == played(0)
    assert len({*played(0), *played(1)}) == 4


def test_cut_off_at_the_time_limit_with_its_true_last_frame():
    games = AtariEnvironments("Breakout", 2, seed=0, max_frames=42)
    assert games.time_limit == 11  # the last step is half a one
    first = games.reset()
    steps = acted(games, 22)
    for number, step in enumerate(steps, start=1):
        assert step.truncated.tolist() == [number % 11 == 0] * 2
        assert not step.terminated.any()
        changed = (step.frames != step.following).any(axis=(1, 2))
        assert changed.tolist() == step.truncated.tolist()
    assert not np.array_equal(steps[10].following, first)  # other idle frames at the beginning


@pytest.mark.parametrize("game", ["Klax", "Pong"])
def test_games_without_lives_lose_none(game):
    games = AtariEnvironments(game, 1, seed=0, frame_skip=16)
    games.reset()
    steps = acted(games, 700)
    assert sum(step.terminated.sum() for step in steps) > 0
    assert not any(step.life_lost.any() for step in steps)


def test_won_lives_are_none_lost():
    games = AtariEnvironments("Breakout", 2, seed=0)
    games.reset()
    seen = []
    play = games._envs.step

    def step(actions):
        observations, rewards, _, truncated, info = play(actions)
        lives, over = seen[-1]
        info = {**info, "lives": np.array(lives, dtype=np.int32)}
        return observations, rewards, np.array(over), truncated, info

    games._envs.step = step
    told = []
    for lives, over in [
        ([6, 5], [False, False]),  # one is won
        ([5, 4], [False, False]),
        ([5, 0], [False, False]),  # the last one is being lost, the game is not over yet
        ([4, 0], [False, True]),
    ]:
        seen.append((lives, over))
        told.append(games.step(np.zeros(2, dtype=np.int64)).life_lost.tolist())
    assert told == [[False, False], [True, True], [False, False], [True, False]]


def test_a_saved_state_that_is_not_played_again_is_found_out():
    games = AtariEnvironments("Breakout", 1, seed=0)
    with pytest.raises(TrdlabError, match=r"Call reset\(\) first"):
        games.state_dict()
    games.reset()
    acted(games, 40)
    state = games.state_dict()
    with pytest.raises(NotReproducible, match="Breakout did something else when 40 actions were"):
        games.load_state_dict({**state, "actions": 3 - state["actions"]})
    games.reset()
    assert games.state_dict()["seedings"].tolist() == [1]
    with pytest.raises(InputError, match=r"have sticky = 0.0, these have 0.25\. Resume with"):
        AtariEnvironments("Breakout", 1, seed=0, sticky=0.25).load_state_dict(state)


def test_what_is_known_of_a_game():
    games = AtariEnvironments("ms_pacman", 3, seed=0)
    assert (games.game, games.num_actions, games.first_action) == ("MsPacman", 9, 0)
    assert games.action_names[:3] == ("NOOP", "UP", "RIGHT")
    assert observation_space(games).shape == (4, 84, 84)
    assert (games.time_limit, games.frame_skip, games.frames_per_second) == (27_000, 4, 60)
    assert AtariEnvironments("MsPacman", seed=0, full_action_space=True).num_actions == 18


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"game": "Brekout"}, r"Did you mean 'Breakout'\?"),
        ({"num_envs": 0}, "There are 0 environments"),
        ({"sticky": 1.0}, "The sticky probability is 1.0"),
        ({"noop_max": -1}, "The value of noop_max is -1. It is at least 0"),
        ({"max_frames": 0}, "The value of max_frames is 0"),
        ({"frame_skip": 0}, "The value of frame_skip is 0"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(InputError, match=message):
        AtariEnvironments(**{"game": "Breakout", "seed": 0, **options})


def test_an_action_that_does_not_exist_is_refused_before_it_hangs_the_emulator():
    games = AtariEnvironments("Breakout", 2, seed=0)
    games.reset()
    with pytest.raises(InputError, match=r"The actions are \[0, 4\]\. They run from 0 to 3"):
        games.step(np.array([0, 4]))
    games.step(np.array([0, 3]))


def test_nothing_is_printed():
    code = (
        "from trdlab.atari import AtariEnvironments\n"
        "games = AtariEnvironments('Pong', 2, seed=0); games.reset(); games.close()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


def test_a_missing_rom_is_said(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("ALE_ROMS_DIR", str(tmp_path))
    with pytest.raises(TrdlabError, match=r"The ROM of Pong cannot be read.* unset ALE_ROMS_DIR"):
        AtariEnvironments("Pong", seed=0)
    assert capsys.readouterr().out == ""
