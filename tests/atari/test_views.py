"""Games in colour, in grey and in colour in step, and games whose lives are apart."""

from dataclasses import fields, replace

import numpy as np
import pytest
from ale_py import Action, ALEInterface, LoggerMode, roms

import trdlab.atari.environments
from trdlab.atari import AtariEnvironments, GreyAndColour, game_names
from trdlab.atari.names import rom_name
from trdlab.atari.vector import screen_shape
from trdlab.environments import NotCopyable, Step
from trdlab.environments.stack import FrameStack
from trdlab.errors import InputError, TrdlabError

TOLD = [of.name for of in fields(Step) if of.name not in ("allowed", "screens", "info")]


@pytest.fixture
def quiet():
    """Lets ale-py's own interface say nothing, as its vector environment does."""
    before = ALEInterface.getLoggerMode() if hasattr(ALEInterface, "getLoggerMode") else None
    ALEInterface.setLoggerMode(LoggerMode.Error)
    yield
    ALEInterface.setLoggerMode(before or LoggerMode.Info)


def alone(game: str, seed: int) -> ALEInterface:
    ale = ALEInterface()
    ale.setInt("random_seed", seed)
    ale.setFloat("repeat_action_probability", 0.0)
    ale.loadROM(roms.get_rom_path(rom_name(game)))
    ale.reset_game()
    return ale


def same(a: Step, b: Step) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in TOLD)


def random_actions(games, steps, seed=0):
    return np.random.default_rng(seed).integers(games.num_actions, size=(steps, games.num_envs))


@pytest.mark.parametrize(
    ("game", "num_envs"), [("Breakout", 1), ("Breakout", 8), ("Pong", 1), ("Riverraid", 2)]
)
def test_colour_is_the_last_screen_pixel_for_pixel(quiet, game, num_envs):
    games = AtariEnvironments(game, num_envs, seed=0, noop_max=1, colour=True)
    screens = games.reset()
    assert screens.shape == (num_envs, *screen_shape(game))
    assert games.observation_space.contains(screens[0])
    assert games.stack is None
    ales = []
    for env in range(num_envs):
        seed = int(np.random.SeedSequence([0, env, 0]).generate_state(1)[0] >> 1)
        ales.append(alone(game, seed))
        if "FIRE" in games.action_names:  # as the vector environment begins a game
            ales[env].act(Action.FIRE)
    own = ales[0].getMinimalActionSet()
    for env, ale in enumerate(ales):
        np.testing.assert_array_equal(ale.getScreenRGB(), screens[env])
    for actions in random_actions(games, 60):
        step = games.step(actions)
        if step.ended.any():
            break
        for env, ale in enumerate(ales):
            paid = sum(ale.act(own[actions[env]]) for _ in range(4))
            np.testing.assert_array_equal(ale.getScreenRGB(), step.frames[env])
            assert paid == step.rewards[env]


def test_the_heights_of_all_screens(quiet):
    for game in game_names():
        assert alone(game, 0).getScreenDims() == screen_shape(game)[:2]


@pytest.mark.parametrize(("num_envs", "sticky"), [(1, 0.0), (8, 0.0), (1, 0.25), (8, 0.25)])
def test_in_step_they_are_what_each_is_alone(monkeypatch, num_envs, sticky):
    monkeypatch.setattr(trdlab.atari.environments, "RESEED_AFTER", 150)
    made = {"seed": 3, "sticky": sticky}
    both = GreyAndColour("Breakout", num_envs, **made)
    grey = AtariEnvironments("Breakout", num_envs, **made)
    colour = AtariEnvironments("Breakout", num_envs, colour=True, **made)
    np.testing.assert_array_equal(both.reset(), grey.reset())
    np.testing.assert_array_equal(both.screens, colour.reset())
    ended = 0
    for actions in random_actions(both, 220):
        step, one, other = (games.step(actions) for games in (both, grey, colour))
        assert same(step, one)
        np.testing.assert_array_equal(step.screens, other.frames)
        np.testing.assert_array_equal(both.screens, other.following)
        ended += one.ended.sum()
    assert ended > 0


def test_both_are_restored_and_copied():
    both = GreyAndColour("Breakout", 2, seed=1)
    with pytest.raises(TrdlabError, match=r"Call reset\(\) first"):
        both.state_dict()
    both.reset()
    for actions in random_actions(both, 150):
        both.step(actions)
    state, screens = both.state_dict(), both.screens
    copies = both.branch(np.array([1, 1, 0]), seed=0)
    np.testing.assert_array_equal(copies.screens, screens[[1, 1, 0]])
    assert (copies.num_envs, copies.stack, copies.padding) == (3, 4, "zero")
    after = [both.step(actions) for actions in random_actions(both, 40, seed=1)]
    for actions, step in zip(random_actions(both, 40, seed=1), after, strict=True):
        copied = copies.step(actions[[1, 1, 0]])
        np.testing.assert_array_equal(copied.screens, step.screens[[1, 1, 0]])
    again = GreyAndColour("Breakout", 2, seed=1)
    again.load_state_dict(state)
    np.testing.assert_array_equal(again.screens, screens)
    for actions, step in zip(random_actions(both, 40, seed=1), after, strict=True):
        repeated = again.step(actions)
        assert same(repeated, step)
        np.testing.assert_array_equal(repeated.screens, step.screens)
    with pytest.raises(InputError, match="have seed = 1, these have 2"):
        GreyAndColour("Breakout", 2, seed=2).load_state_dict(state)
    sticky = GreyAndColour("Breakout", 1, seed=1, sticky=0.25)
    sticky.reset()
    with pytest.raises(NotCopyable, match="sticky"):
        sticky.branch(np.array([0]), seed=0)


@pytest.mark.parametrize("name", ["rewards", "terminated", "truncated", "life_lost"])
def test_two_that_go_different_ways_are_found_out(monkeypatch, name):
    both = GreyAndColour("Breakout", 2, seed=0)
    both.reset()
    play = both.colour.step

    def another(actions, active=None):
        step = play(actions, active)
        changed = getattr(step, name).copy()
        changed[1] = 1
        return replace(step, **{name: changed})

    monkeypatch.setattr(both.colour, "step", another)
    with pytest.raises(TrdlabError, match=f"another way in colour than in grey: {name} are"):
        both.step(np.array([0, 0]))


@pytest.mark.parametrize("num_envs", [1, 4])
def test_each_life_begins_with_fire_and_a_stack_of_zeros(num_envs):
    apart = AtariEnvironments("Breakout", num_envs, seed=1, separate_lives=True)
    whole = AtariEnvironments("Breakout", num_envs, seed=1)
    seen = apart.reset()
    stack = FrameStack(whole.reset(), 4, "zero")
    np.testing.assert_array_equal(seen, stack.observations)
    assert apart.observation_space.shape == (4, 84, 84)
    fires, lost, ended = np.zeros(num_envs, dtype=bool), 0, 0
    for actions in random_actions(apart, 300):
        told = apart.allowed
        np.testing.assert_array_equal(told.all(axis=1), ~fires)
        assert (told[fires] == (np.arange(4) == 1)).all()
        step = apart.step(actions)
        other = whole.step(np.where(fires, 1, actions))  # whatever is chosen
        for name in ("rewards", "terminated", "truncated", "life_lost"):
            np.testing.assert_array_equal(getattr(step, name), getattr(other, name))
        stack.push(other.frames, other.life_lost)
        np.testing.assert_array_equal(step.frames, stack.observations)
        stack.begin(other.following, other.ended)
        np.testing.assert_array_equal(step.following, stack.observations)
        assert not step.following[step.life_lost, :3].any()
        fires = step.life_lost
        lost, ended = lost + step.life_lost.sum(), ended + step.ended.sum()
    assert min(lost / 4, ended) >= 1


def test_lives_apart_are_restored_and_copied():
    games = AtariEnvironments("Breakout", 2, seed=1, separate_lives=True)
    games.reset()
    steps = random_actions(games, 200)
    lost = next(i for i, row in enumerate(steps) if games.step(row).life_lost[0])
    assert lost < 199
    state, allowed = games.state_dict(), games.allowed
    copies = games.branch(np.array([0, 1]), seed=0)
    again = AtariEnvironments("Breakout", 2, seed=1, separate_lives=True)
    seen = again.load_state_dict(state)
    for other in (copies, again):
        np.testing.assert_array_equal(other.allowed, allowed)
    assert not allowed[0].all()
    assert not seen[0, :3].any()
    for row in steps[lost:]:
        step = games.step(row)
        assert same(step, copies.step(row))
        assert same(step, again.step(row))


def test_nothing_is_fired_where_there_is_no_fire():
    games = AtariEnvironments("MsPacman", 1, seed=0, separate_lives=True)
    assert "FIRE" not in games.action_names
    games.reset()
    assert games.allowed is None
    assert games.step(np.array([0])).allowed is None
    assert AtariEnvironments("Breakout", 1, seed=0).allowed is None
