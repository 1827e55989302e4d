"""What is told of an episode: key moments, rewards foreseen, promises broken."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import trdlab
from by_hand import episode
from trdlab.arrays import FloatArray
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.episode.played import Played
from trdlab.explanations.episode.promises import broken_promises, foreseen
from trdlab.explanations.episode.story import key_rows, place, tell
from trdlab.explanations.episode.surprises import sizes
from trdlab.explanations.rules import Claim
from trdlab.gridworld import Gridworld, load_map, map_names
from trdlab.rollouts.episodes import collect
from trdlab.tabular import exact
from trdlab.tabular.episodes import ModelEnvironments

AXIS = TimeAxis(0.5, 4)


def played(expected: Any, rewards: list[float], axis: TimeAxis = AXIS, **changes: Any) -> Played:
    """An episode of one action, by what was expected at every observation."""
    return Played(episode(rewards, axis, expected, **changes), ("wait",))


def foretold(rewards: list[float], axis: TimeAxis = AXIS) -> FloatArray:
    """Returns `[T+1, N+1]`: the rewards that follow each step, for w = 1."""
    total = len(rewards)
    rows = np.zeros((total + 1, axis.num_components))
    for t in range(total):
        for k, reward in enumerate(rewards[t:]):
            rows[t, min(k, axis.horizon)] += axis.gamma**k * reward
    return rows


@dataclass(frozen=True, eq=False)
class Always:
    """An estimator that expects the same of every observation and action."""

    row: FloatArray
    time_axis: TimeAxis
    num_actions: int
    future = Future("the given policy")

    def decompose(self, observations: Any) -> RewardDecomposition:
        shape = (len(observations), self.num_actions, self.time_axis.num_components)
        return RewardDecomposition(np.broadcast_to(self.row, shape).copy(), self.time_axis)


def said(claims: Sequence[Claim]) -> list[str]:
    return [claim.sentence for claim in claims]


# ---- surprises -----------------------------------------------------------------------------------


def test_each_surprise_has_its_reason():
    rows = foretold([0.0, 0.0, 1.0])
    rows[1] += [0.0, 0.0, 0.0, 0.25, 0.0]  # a promise that the next step takes back
    changed = played(rows, [0.0, 0.0, 1.0])
    turns = {
        place(claim): claim.sentence for claim in tell(changed).moments if "gap" in claim.fields
    }
    assert turns == {
        0: "At step 0, wait turned out 0.125 better than expected, mainly because what it "
        "expects to come after step 3 went from 0 to 0.125.",
        1: "At step 1, wait turned out 0.25 worse than expected, mainly because what it "
        "expects to come at step 4 went from 0.25 to 0.",
    }
    more = played(foretold([0.0, 0.5]), [0.0, 2.0])
    assert said(tell(more).moments) == [
        "At step 1, wait turned out 1.5 better than expected, mainly because a reward of 2 came "
        "where 0.5 was expected."
    ]
    none = played(foretold([0.0, 0.5]), [0.0, 0.0])
    assert said(tell(none).moments) == [
        "At step 1, wait turned out 0.5 worse than expected, mainly because nothing came where 0.5 "
        "was expected."
    ]
    early = played(foretold([1.0, 1.0, 1.0, 1.0])[:3], [1.0, 1.0])
    assert said(tell(early).moments) == [
        "At step 1, wait turned out 0.75 worse than expected, mainly because the episode ended "
        "while rewards worth 0.75 were still expected."
    ]


def test_a_cost_is_not_called_a_reward():
    hurt = played(foretold([0.0, -0.5]), [0.0, -2.0])
    assert "mainly because a cost of 2 came" in said(tell(hurt).moments)[0]
    assert said(tell(hurt).start) == [
        "At the start, all that the agent expected was worth -0.25, most of it 1 step later."
    ]


def test_a_reward_that_comes_at_another_step_is_one_of_timing():
    rows = foretold([0.0, 1.0, 0.0, 0.0])
    rows[2] = [0.0, 0.5, 0.0, 0.0, 0.0]  # at step 1 it did not come: it is now expected at step 3
    rows[1] = [0.25, 0.0, 0.0, 0.0, 0.0]
    rows[0] = [0.0, 0.125, 0.0, 0.0, 0.0]
    rows[3] = [1.0, 0.0, 0.0, 0.0, 0.0]
    late = played(rows, [0.0, 0.0, 0.0, 1.0])
    assert tell(late).moments[0].sentence == (
        "At step 1, wait delayed rewards worth 0.25: they were to come at step 1, and now at "
        "step 3; in all, it expects about as much as before."
    )
    costly = played(-rows, [0.0, 0.0, 0.0, -1.0])
    assert "delayed costs worth 0.25" in tell(costly).moments[0].sentence


def test_key_moments_are_spread_over_the_episode():
    rng = np.random.default_rng(0)
    rewards = rng.normal(size=200)
    rewards[100:110] += 20.0  # all that surprises most is here
    told = played(np.zeros((201, 5)), rewards.tolist())
    rows = key_rows(told, 5)
    assert len(rows) == 5
    assert 100 <= rows[0] < 110
    assert np.diff(sorted(rows)).min() >= 200 / 10
    assert sizes(told)[rows].tolist() == sorted(sizes(told)[rows], reverse=True)
    assert len(tell(told).claims) <= 8


def test_what_the_agent_drew_itself_is_told_where_a_likelier_action_was_left():
    axis = TimeAxis(0.5, 1)
    chances = np.array([[0.75, 0.25], [0.75, 0.25], [1.0, 0.0]])
    worth = np.array([[[0.0, 4.0], [0.0, 4.0]], [[8.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]]])
    drawn = replace(
        episode([0.0, 0.0, 0.0], axis),
        decomposition=RewardDecomposition(worth, axis),
        expected=np.array([[0.0, 4.0], [6.0, 0.0], [0.0, 0.0], [0.0, 0.0]]),
        actions=np.array([1, 1, 0]),
        probabilities=chances,
    )
    story = tell(Played(drawn, ("left", "right")))
    # step 0: of both actions as much is expected; it led where 6 is, of which half counts: 1 less
    assert said(story.moments) == [
        "At step 0, right turned out 1 worse than expected, mainly because what it expects to come "
        "after step 0 went from 4 to 3.",
        "At step 1, the agent drew right, with a 25 % chance, instead of left, its likeliest "
        "action: 6 worse than its draws on average.",
    ]
    assert story.most is not None
    assert story.most.kind == "drawn"
    forced = replace(drawn, random=np.array([False, True, False, False]))
    assert "drawn" not in [of.kind for of in tell(Played(forced, ("left", "right"))).moments]
    likeliest = replace(drawn, probabilities=chances[:, ::-1])
    assert "drawn" not in [of.kind for of in tell(Played(likeliest, ("left", "right"))).moments]


def test_episodes_that_are_played_know_how_likely_each_action_was():
    world = Gridworld(load_map("drone"))
    agent = trdlab.agent(world, policy=lambda seen: np.tile([0.7, 0.1, 0.1, 0.1], (len(seen), 1)))
    (played,) = agent.play(1, seed=0, max_steps=20)
    np.testing.assert_allclose(played.probabilities, [[0.7, 0.1, 0.1, 0.1]] * len(played))


def test_where_nothing_surprises_nothing_is_made_of_it():
    story = tell(played(foretold([0.0, 1.0, 0.0, 4.0]), [0.0, 1.0, 0.0, 4.0]))
    assert [claim.kind for claim in story.claims] == [
        "expected-in-all",
        "foreseen-fully",
        "nothing-changed",
        "ended",
        "as-expected",
    ]
    assert story.most is None


def test_what_came_is_held_against_what_was_expected_only_where_it_is_known():
    rows, rewards = foretold([1.0, 1.0]), [1.0, 3.0]
    other = "What came was worth 2.5 at the start; the agent had expected 1.5."
    assert tell(played(rows, rewards)).end[-1].sentence == other
    same = "What came was worth 1.5 at the start, as the agent had expected."
    assert tell(played(rows, [1.0, 1.0])).end[-1].sentence == same
    assert tell(played(rows, rewards, terminated=False)).end[-1].kind == "cut-off"
    ends = np.array([True, True])
    lost = played(rows, rewards, life_lost=np.array([True, False]), ends=ends)
    assert tell(lost).end[-1].sentence == (
        "What came was worth 1 at the start (up to step 0, where a life was lost); the agent had "
        "expected 1.5."
    )


# ---- rewards that were foreseen ------------------------------------------------------------------


def test_how_long_before_a_reward_was_foreseen():
    rewards = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    rows = foretold(rewards)
    fully = "A reward of 1 at step 4 was foreseen 3 steps before, as early as it can be told."
    assert said(foreseen(played(rows, rewards))) == [fully]  # t+3 is the last explicit
    rows[2] *= 0.49  # less than half of it
    assert said(foreseen(played(rows, rewards))) == [
        "A reward of 1 at step 4 was foreseen 1 step before."
    ]
    rows[3] *= 0.49
    assert foreseen(played(rows, rewards)) == []
    start = [0.0, 0.0, 1.0]
    (first,) = foreseen(played(foretold(start), start))
    assert (first.kind, first.step, first.steps) == ("foreseen-fully", 2, 2)


def test_the_largest_reward_that_was_foreseen_is_told_and_none_that_always_comes():
    rewards = [0.0, 1.0, 5.0, 2.0]
    rows = foretold(rewards)
    rows[2, 0] = 0.0  # the 5
    found = foreseen(played(rows, rewards))
    assert [(claim.reward, claim.step, claim.steps) for claim in found] == [(2, 3, 3), (1, 1, 1)]
    assert foreseen(played(foretold([1.0] * 4), [1.0] * 4)) == []


def test_a_group_foresees_a_reward_at_any_of_its_steps():
    axis = TimeAxis(0.5, 2, 2)
    rows = [[0.0, 0.5**3, 0.0], [0.0, 0.25, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0] * 3]
    (found,) = foreseen(played(rows, [0.0, 0.0, 0.0, 1.0], axis))
    assert (found.kind, found.step, found.steps) == ("foreseen-fully", 3, 3)


# ---- promises ------------------------------------------------------------------------------------


@pytest.mark.parametrize("component", [1, 3])
def test_an_agent_that_circles_promises_what_never_comes(component):
    world = Gridworld(load_map("drone"))
    axis, row = TimeAxis(0.95, 5), np.zeros(6)
    row[component] = 0.95**component
    estimator = Always(row, axis, len(world.action_names))
    (circling,) = collect(estimator, ModelEnvironments(world.mdp, 1, seed=0, time_limit=20))
    told = Played(circling, world.action_names)
    assert circling.rewards.sum() == 0.0
    (broken,) = broken_promises(told)
    away = "1 step" if component == 1 else f"{component} steps"
    assert broken.sentence == (
        f"From step 0 to step 19 a reward was always {away} away, and had not come when the "
        "episode was cut off."
    )
    most = tell(told).most
    assert most is not None
    assert most.sentence == broken.sentence
    assert len(tell(told).moments) == 1  # and not each step of it


def test_a_promise_that_is_kept_later_is_late_and_one_that_is_kept_in_time_is_none():
    stay, axis = [0.0, 0.25, 0.0], TimeAxis(0.5, 2)
    rows = [*[stay] * 8, [0.0, 0.5, 0.0], [1.0, 0.0, 0.0], [0.0] * 3]
    late = played(rows, [*[0.0] * 9, 1.0], axis)
    assert said(broken_promises(late)) == [
        "From step 0 to step 8 a reward was always 1 step away, and came only at step 9."
    ]
    kept = played([*[stay] * 8, [0.0] * 3], [0.0] * 4 + [1.0] * 4, axis)
    assert broken_promises(kept) == []
    few = played([*[stay] * 5, *[[0.0] * 3] * 4], [0.0] * 8, axis)
    assert broken_promises(few) == []


def test_for_wider_groups_a_promise_may_stay_as_long_as_they_are():
    axis = TimeAxis(1.0 - 1e-9, 3, 4)
    rows = [[0.0, 1.0, 0.0, 0.0]] * 8 + [[0.0] * 4]
    assert broken_promises(played(rows, [0.0] * 8, axis)) == []  # steps 4 to 7 later: not overdue
    rows = [[0.0, 1.0, 0.0, 0.0]] * 9 + [[0.0] * 4]
    assert said(broken_promises(played(rows, [0.0] * 9, axis))) == [
        "From step 0 to step 8 a reward was always 4 to 7 steps away, and never came."
    ]


@pytest.mark.parametrize("name", map_names())
def test_no_exact_table_breaks_a_promise(name):
    for slip, axis in ((None, TimeAxis(0.95, 12)), (0.2, TimeAxis(0.95, 4)), (0.2, AXIS)):
        grid = load_map(name)
        world = Gridworld(grid if slip is None else grid.with_slip(slip))
        table = exact(world.mdp, axis)
        play = ModelEnvironments(world.mdp, 10, seed=1, time_limit=200)
        for one in collect(table, play):
            assert broken_promises(Played(one, world.action_names)) == []
