"""Windows against a naive reading of the recorded episodes, and each rule by hand."""

from dataclasses import dataclass

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st

from trdlab.errors import InputError
from trdlab.tabular.windows import WindowBuilder
from trdlab.tabular.worlds import GymWorlds

GAMMA = 0.9
ENDS = ("terminated", "truncated", "both")


@dataclass(frozen=True)
class Recorded:
    """An episode: what each step paid, whether it was greedy, and how it ended (or None)."""

    rewards: list[float]
    greedy: list[bool]
    end: str | None


@st.composite
def records(draw) -> tuple[list[list[Recorded]], np.random.Generator]:
    """Draws for one to three environments up to four episodes each, the last maybe unfinished."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    lengths, ends = st.integers(1, 8), st.sampled_from(ENDS)
    shapes = st.tuples(st.lists(st.tuples(lengths, ends), max_size=4), st.integers(0, 8))
    envs = []
    for ended, running in draw(st.lists(shapes, min_size=1, max_size=3)):
        shape = [*ended, (running, None)] if running else ended
        envs.append([recorded(rng, length, end) for length, end in shape])
    return envs, rng


def recorded(rng: np.random.Generator, length: int, end: str | None) -> Recorded:
    return Recorded(rng.normal(size=length).tolist(), (rng.random(length) < 0.7).tolist(), end)


def observation(env: int, episode: int, step: int) -> int:
    return 10_000 * env + 100 * episode + step


def naive(envs: list[list[Recorded]], width: int) -> tuple[list[tuple], int]:
    """Returns every window that should come out, and how many should be dropped."""
    windows, dropped = [], 0
    for e, episodes in enumerate(envs):
        for k, episode in enumerate(episodes):
            length = len(episode.rewards)
            terminates = episode.end in ("terminated", "both")
            for t in range(length):
                last = min(t + width, length)
                if t + width > length and not terminates:
                    dropped += episode.end == "truncated"
                    continue
                over = terminates and last == length
                reward = sum(GAMMA ** (i - t) * episode.rewards[i] for i in range(t, last))
                windows.append(
                    (
                        observation(e, k, t),
                        7 * t,
                        round(reward, 9),
                        0.0 if over else round(GAMMA**width, 9),
                        observation(e, k, last),
                        over,
                        all(episode.greedy[t + 1 : last]),
                        last - t,
                        e,
                    )
                )
    return windows, dropped


def played(envs: list[list[Recorded]], builder: WindowBuilder, idle) -> list[tuple]:
    """Plays the records side by side, pausing an environment where `idle()` says so."""
    scripts = [
        [(k, t, episode) for k, episode in enumerate(episodes) for t in range(len(episode.rewards))]
        for episodes in envs
    ]
    position, found = [0] * len(envs), []
    while any(position[e] < len(script) for e, script in enumerate(scripts)):
        rows = []
        for e, script in enumerate(scripts):
            if position[e] == len(script) or idle():
                # What stands in the entries of an inactive environment must not matter.
                rows.append((-1, -1, 1e9, True, True, -1, False, False))
                continue
            k, t, episode = script[position[e]]
            position[e] += 1
            end = episode.end if t + 1 == len(episode.rewards) else None
            rows.append(
                (
                    observation(e, k, t),
                    7 * t,
                    episode.rewards[t],
                    end in ("terminated", "both"),
                    end in ("truncated", "both"),
                    observation(e, k, t + 1),
                    episode.greedy[t],
                    True,
                )
            )
        *step, greedy, active = (np.array(column) for column in zip(*rows, strict=True))
        w = builder.add(*step, greedy=greedy, active=active)
        columns = (w.observations, w.actions, w.rewards.round(9), w.discounts.round(9))
        more = (w.next_observations, w.terminated, w.tail_greedy, w.steps, w.environments)
        found += zip(*(column.tolist() for column in columns + more), strict=True)
    return found


@pytest.mark.parametrize("width", [1, 3, 5])
@settings(max_examples=150, deadline=None)
@given(drawn=records())
def test_windows_are_those_of_the_recorded_episodes(width, drawn):
    envs, rng = drawn
    builder = WindowBuilder(width, GAMMA, len(envs))
    found = played(envs, builder, lambda: rng.random() < 0.2)
    expected, dropped = naive(envs, width)
    assert sorted(found) == sorted(expected)
    assert builder.dropped == dropped
    for env in range(len(envs)):  # within an environment, in the order in which they began
        begun = [window[0] for window in found if window[-1] == env]
        assert begun == sorted(begun)


@pytest.mark.parametrize("width", [1, 3, 5])
def test_every_mix_of_endings_and_lengths(width):
    """Four environments side by side, of which no two end alike, against the same reference."""
    rng = np.random.default_rng(0)
    ends = [ENDS, ENDS[::-1], (ENDS[1],) * 3, (ENDS[0], ENDS[1], None)]
    lengths = [(1, 2, 3), (4, 5, 6), (2, 7, 1), (5, 3, 4)]
    envs = [
        [recorded(rng, length, end) for length, end in zip(*row, strict=True)]
        for row in zip(lengths, ends, strict=True)
    ]
    builder = WindowBuilder(width, GAMMA, 4)
    found = played(envs, builder, lambda: False)
    expected, dropped = naive(envs, width)
    assert sorted(found) == sorted(expected)
    assert builder.dropped == dropped == {1: 0, 3: 11, 5: 16}[width]


def step(builder, t, *, terminated=False, truncated=False, **more):
    """Takes step t of a single environment, which pays 10^t."""
    return builder.add([t], [0], [10.0**t], [terminated], [truncated], [t + 1], **more)


def test_the_bootstrap_state_is_w_steps_later():  # errata C1
    builder = WindowBuilder(3, 0.5, 1)
    assert [len(step(builder, t)) for t in range(2)] == [0, 0]
    window = step(builder, 2)
    assert (window.observations.tolist(), window.next_observations.tolist()) == ([0], [3])
    assert window.rewards.tolist() == [1 + 0.5 * 10 + 0.25 * 100]
    assert window.discounts.tolist() == [0.125]


def test_a_full_window_keeps_the_true_last_observation_of_a_truncated_episode():  # errata C2
    builder = WindowBuilder(2, 0.5, 1)
    step(builder, 0)
    window = step(builder, 1, truncated=True)
    assert (window.next_observations.tolist(), window.discounts.tolist()) == ([2], [0.25])
    assert builder.dropped == 1
    assert len(step(builder, 5)) == 0
    assert step(builder, 6).observations.tolist() == [5]  # and nothing of the old episode


def test_unfinished_windows_of_a_terminated_episode_are_exact():  # errata C3
    builder = WindowBuilder(5, 0.5, 1)
    step(builder, 0)
    windows = step(builder, 1, terminated=True)
    assert windows.observations.tolist() == [0, 1]
    assert windows.rewards.tolist() == [1 + 5, 10]
    assert windows.discounts.tolist() == [0, 0]
    assert windows.steps.tolist() == [2, 1]
    assert builder.dropped == 0


def test_a_reward_never_leaks_from_a_short_episode_into_the_next():  # errata C3
    builder = WindowBuilder(3, 0.5, 1)
    step(builder, 3, truncated=True)
    assert builder.dropped == 1
    found = [step(builder, t) for t in range(3)][-1]
    assert found.rewards.tolist() == [1 + 5 + 25]


def test_the_greediness_of_the_first_action_does_not_matter():
    builder = WindowBuilder(2, 0.5, 1)
    step(builder, 0, greedy=False)
    assert step(builder, 1, greedy=True).tail_greedy.tolist() == [True]
    assert step(builder, 2, greedy=False).tail_greedy.tolist() == [False]


def test_windows_begin_only_where_they_may():
    builder = WindowBuilder(2, 0.5, 1)
    windows = [step(builder, t, begins=t % 2 == 0) for t in range(5)]
    assert [w.observations.tolist() for w in windows] == [[], [0], [], [2], []]


def test_a_known_time_limit_leaves_no_window_to_chance():
    """Near the limit only what terminates could be finished, so nothing is begun there."""
    builder = WindowBuilder(3, 0.5, 1, time_limit=4)
    windows = [step(builder, t, terminated=t == 3) for t in range(4)]
    assert [w.observations.tolist() for w in windows] == [[], [], [0], [1]]
    assert builder.dropped == 2
    assert builder.elapsed.tolist() == [0]


def test_observations_may_have_any_shape_and_kind():
    pictures = np.arange(2 * 2 * 3, dtype=np.uint8).reshape(2, 2, 3)
    no = [False, False]
    windows = WindowBuilder(1, 0.5, 2).add(pictures, [0, 1], [1.0, 2.0], no, no, pictures + 1)
    np.testing.assert_array_equal(windows.observations, pictures)
    np.testing.assert_array_equal(windows.next_observations, pictures + 1)
    assert windows.observations.dtype == np.uint8


def test_returned_windows_stay_as_they_are():
    builder = WindowBuilder(1, 0.5, 1)
    window = step(builder, 0)
    step(builder, 5)
    assert (window.observations.tolist(), window.rewards.tolist()) == ([0], [1.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, 0.5, 1), r"The width w is 0\. It must be at least 1\."),
        ((1, 0.5, 0), r"The number of environments is 0\. It must be at least 1\."),
        ((3, 0.5, 1, 2), r"end after 2 steps, so no window of 3 steps.* width w of at most 2"),
    ],
)
def test_impossible_builders_are_refused(arguments, message):
    *first, time_limit = arguments if len(arguments) == 4 else (*arguments, None)
    with pytest.raises(InputError, match=message):
        WindowBuilder(*first, time_limit=time_limit)


@pytest.mark.parametrize("position", range(6))
def test_arrays_that_do_not_fit_are_refused(position):
    arrays = [np.zeros(2) for _ in range(6)]
    arrays[position] = np.zeros(3)
    with pytest.raises(InputError, match=r"have shape \(3,\), there are 2 environments"):
        WindowBuilder(1, 0.5, 2).add(*arrays)


def test_a_column_of_rewards_is_refused():
    with pytest.raises(InputError, match=r"The rewards have shape \(2, 1\)"):
        WindowBuilder(1, 0.5, 2).add([0, 0], [0, 0], np.zeros((2, 1)), [0, 0], [0, 0], [0, 0])


class Counter(gym.Env):
    """Observes 20 times its episode, plus its step; pays its step; ends after 3, 4, 5, 3, … ."""

    observation_space, action_space = gym.spaces.Discrete(1000), gym.spaces.Discrete(2)

    def __init__(self) -> None:
        self.episode, self.at = -1, 0

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.episode, self.at = self.episode + 1, 0
        return np.int64(20 * self.episode), {}

    def step(self, action):
        self.at += 1
        ended = self.at == 3 + self.episode % 3
        terminated, truncated = ended and self.episode % 2 == 0, ended and self.episode % 2 == 1
        return np.int64(20 * self.episode + self.at), float(self.at), terminated, truncated, {}


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_each_way_to_reset_gives_the_same_windows(mode):
    worlds = GymWorlds(SyncVectorEnv([Counter, Counter], autoreset_mode=mode), seed=0)
    builder = WindowBuilder(3, 1.0, 2)
    begun, actions = [], np.zeros(2, dtype=np.int64)
    for _ in range(40):
        here = worlds.observations
        s = worlds.step(actions)
        w = builder.add(
            here,
            actions,
            s.rewards,
            s.terminated,
            s.truncated,
            s.next_observations,
            active=s.active,
        )
        np.testing.assert_array_equal(w.next_observations, w.observations + w.steps)
        first = w.observations % 20 + 1  # the reward of the first step
        np.testing.assert_array_equal(w.rewards, w.steps * (2 * first + w.steps - 1) / 2)
        begun += w.observations[w.environments == 1].tolist()
    assert begun[:12] == [0, 1, 2, 20, 21, 40, 41, 42, 43, 44, 60, 80]
    assert builder.dropped > 0


def test_a_single_environment_will_do():
    worlds = GymWorlds(gym.wrappers.TimeLimit(Counter(), 9), seed=0)
    assert (worlds.num_envs, worlds.num_states, worlds.num_actions) == (1, 1000, 2)


def test_time_limits_are_read_from_specifications():
    assert GymWorlds(gym.make("FrozenLake-v1"), seed=0).time_limit == 100
    assert GymWorlds(gym.make_vec("FrozenLake-v1", num_envs=2), seed=0).time_limit == 100
    assert GymWorlds(Counter(), seed=0).time_limit is None


def test_spaces_that_do_not_count_from_0_are_refused():
    class Shifted(Counter):
        action_space = gym.spaces.Discrete(2, start=1)

    with pytest.raises(InputError, match=r"space of actions is Discrete\(2, start=1\).*from 0"):
        GymWorlds(Shifted(), seed=0)
    with pytest.raises(InputError, match="space of observations is Box"):
        GymWorlds(gym.make("CartPole-v1"), seed=0)
