"""What a fit forecasts beside the reward, by hand, and against exact answers."""

import numpy as np
import pytest

from tests.deep.test_fit import FAR, experience
from trdlab.deep.channels import (
    Channel,
    channels_of,
    groups_of,
    outlook_of,
    reward_of,
    within,
)
from trdlab.deep.experience import Experience
from trdlab.time_axis import TimeAxis


def episode(rewards: list[float], outcomes: list[list[float]]) -> Experience:
    """One episode with outcomes; the last row is what was seen after it."""
    of = experience(rewards, [FAR] * len(rewards))
    told = np.array([*outcomes, [0.0] * len(outcomes[0])])
    return Experience(**{**vars(of), "outcomes": told})


def kinds(of: Experience, *names: str, parts: tuple[str, ...] = (), axis: TimeAxis) -> list[str]:
    return [channel.kind for channel in channels_of(of, names, parts, axis)]


def test_what_is_forecast_depends_on_what_came():
    axis = TimeAxis(0.5, 2)
    few, many = [1.0, 0.0, 1.0, 2.0], [0.1, 0.2, 0.3, 0.4]
    nothing: list[list[float]] = [[]] * 4
    assert kinds(episode(few, nothing), axis=axis) == ["value", "value", "running"]
    assert kinds(episode(many, nothing), axis=axis) == ["reward", "square", "running"]
    assert kinds(episode(few, nothing), axis=TimeAxis(0.5, 2, 2))[0] == "reward", "w > 1"
    assert kinds(episode(few, nothing), axis=TimeAxis(0.5, 0)) == ["reward"], "no components"
    told = [[0.0, 1.0, 2.5], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 2.0, 0.0]]
    found = kinds(episode(few, told), "crash", "coin", "fuel", axis=axis)
    assert found == ["value", "value", "running", "event", "amount", "amount"]
    parts = [[1.0, 0.0], [0.0, 0.0], [2.0, -1.0], [2.0, 0.0]]
    found = kinds(episode(few, parts), "coin", "step", parts=("coin", "step"), axis=axis)
    assert found == ["part", "part", "square", "running"]


def test_an_event_that_only_came_with_an_end_is_known_as_one():
    of = episode([1.0, 2.0, 4.0], [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    of.ends[2] = True
    assert kinds(of, "crash", "never", "coin", axis=TimeAxis(0.5, 2))[-3:] == [
        "ending",
        "event",
        "event",
    ]


def test_groups_end_where_the_episode_does():
    of = episode([1.0, 2.0, 4.0], [[1.0, 3.0], [1.0, 0.0], [0.0, 5.0]])
    of.ends[2] = True
    all_kinds = (
        Channel("reward"),
        Channel("square"),
        Channel("running"),
        Channel("event", "crash"),
        Channel("amount", "fuel"),
    )
    groups = groups_of(of, all_kinds, ("crash", "fuel"), TimeAxis(0.5, 2, 2))[:3]
    assert groups.tolist() == [
        [1.0 + 0.5 * 2.0, 2.0**2, 1.0, 1.0, 3.0],  # the crash in both steps happened
        [2.0 + 0.5 * 4.0, 4.0**2, 0.0, 1.0, 2.5],  # over within the group
        [4.0, 4.0**2, 0.0, 0.0, 5.0],  # nothing comes after the end
    ]


def test_chances_give_reward_spread_and_survival():
    axis = TimeAxis(0.5, 2)
    channels = (Channel("value", reward=4.0), Channel("value", reward=-1.0), Channel("running"))
    chances = np.array([[0.5, 0.25, 0.0], [0.25, 0.25, 0.0], [0.75, 0.5, 0.0]])  # [C, N+1]
    told = (chances * axis.discounts)[None]  # [A, C, N+1]
    np.testing.assert_allclose(reward_of(channels, told), [[1.75, 0.375, 0.0]])
    outlook = outlook_of(channels, told, axis)
    np.testing.assert_allclose(outlook.chances[4.0], [[0.5, 0.25]])
    squares = np.array([16.0 * 0.5 + 0.25, (16.0 * 0.25 + 0.25) * 0.25])
    np.testing.assert_allclose(outlook.variance, [squares - np.array([1.75, 0.375]) ** 2])
    np.testing.assert_allclose(outlook.survival, [[1.0, 0.75, 0.5]])


def test_the_square_of_a_group_gives_its_spread_too():
    axis = TimeAxis(0.5, 1, 2)
    channels = (Channel("reward"), Channel("square"), Channel("running"))
    told = np.array([[[2.0, 1.0], [6.0, 1.0], [0.5, 0.0]]])
    assert outlook_of(channels, told, axis).variance.tolist() == [[2.0]], "6 − 2²"


def test_who_has_ended_stays_so_and_no_chance_is_above_one():
    axis = TimeAxis(0.5, 3)
    channels = (Channel("running"), Channel("event", "crash"))
    told = np.array([[[0.4, 0.3, -0.1, 0.0], [2.0, 0.1, -1.0, 0.0]]])
    outlook = outlook_of(channels, told, axis)
    np.testing.assert_allclose(outlook.survival, [[1.0, 0.4, 0.4, 0.0]])
    np.testing.assert_allclose(outlook.events["crash"], [[1.0, 0.2, 0.0]])
    values = (Channel("value", reward=1.0), Channel("value", reward=2.0))
    most = np.stack([np.zeros((2, 2)), np.ones((2, 2))])
    cut = within(values, np.array([[[0.9, 0.5], [0.6, -0.5]]]), most)
    np.testing.assert_allclose(cut, [[[0.6, 0.5], [0.4, 0.0]]])


@pytest.mark.parametrize("gamma", [0.0, 0.5])
def test_without_a_discounted_future_nothing_is_divided_by_zero(gamma: float):
    axis = TimeAxis(gamma, 2)
    outlook = outlook_of((Channel("reward"), Channel("running")), np.zeros((1, 2, 3)), axis)
    assert np.isfinite(outlook.survival).all()
