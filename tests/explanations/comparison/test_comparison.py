"""Two agents at the same states: known differences are found, and where they are."""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from trdlab.agents import Agent, find_pair, gridworld_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations import moment_at
from trdlab.explanations.comparison.claims import nothing_differs, one_tells, sections, trusted
from trdlab.explanations.comparison.comparison import Comparison, centre, compare, compared
from trdlab.explanations.comparison.states import Visits, visit
from trdlab.policies import Memoryless
from trdlab.rollouts.playing import Progress
from trdlab.tabular import ExactTable

AXIS = TimeAxis(0.95, 4)
LEDGE = "ledge,slip=0.3,exploring_starts=true"


def changed(agent: Agent, change: Any) -> Agent:
    """Returns an agent that acts as before, and expects something else `[S, A, N+1]`."""
    table = agent.estimator
    assert isinstance(table, ExactTable)
    components = change(table.decomposition.components.copy())
    decomposition = RewardDecomposition(components, table.time_axis)
    return replace(agent, name="changed", estimator=replace(table, decomposition=decomposition))


def kinds(comparison: Comparison) -> dict[str, Any]:
    """Returns the last claim of each kind that is made."""
    return {claim.kind: claim for section in sections(comparison) for claim in section.claims}


def between(
    first: np.ndarray,
    second: np.ndarray,
    axis: TimeAxis,
    different: int = 20,
    seed: np.ndarray | None = None,
) -> Comparison:
    """Returns the comparison of one action's components `[M, N+1]`.

    Args:
        first: what A expects.
        second: what B expects.
        axis: what the components mean.
        different: how many different episodes there are.
        seed: `[M]`, of the episode of each state; by default each has its own.
    """
    count = len(first)
    visits = Visits(
        time_axis=axis,
        components=np.stack([first, second])[:, :, None],
        probabilities=np.ones((2, count, 1)),
        player=np.arange(count) % 2,
        seed=np.arange(count) if seed is None else seed,
        step=np.zeros(count, dtype=np.int64),
        different=different,
    )
    one, other = (
        SimpleNamespace(
            name=name,
            estimator=SimpleNamespace(future=Future("the policy")),
            action_names=("wait",),
            seconds_per_step=None,
            origin=None,
        )
        for name in ("one", "other")
    )
    agents: Any = one, other
    return compared(agents, visits, episodes=count, max_steps=1_000)


def test_an_agent_against_itself_is_the_same_everywhere():
    agent = gridworld_agent(LEDGE, AXIS)
    found = kinds(compare(agent, agent, episodes=20, judged_by=0))
    assert list(found) == ["nothing-differs", "each-tells", "compared-at"]


def test_a_raised_component_is_found_there_and_by_that_much():
    agent = gridworld_agent(LEDGE, AXIS)

    def raised(components: np.ndarray) -> np.ndarray:
        components[..., 2] += 0.5
        return components

    comparison = compare(agent, changed(agent, raised), episodes=20, judged_by=0)
    found = kinds(comparison)
    np.testing.assert_allclose(comparison.difference.value, [0, 0, 0.5, 0, 0])
    np.testing.assert_allclose(comparison.difference.low, [0, 0, 0.5, 0, 0])
    np.testing.assert_allclose(comparison.of_any_action.value, [0, 0, 0.5, 0, 0])
    assert comparison.gap.value == pytest.approx(0.5)
    largest = found["largest-at"]
    assert (largest.component, largest.more, largest.less) == (2, "B", "A")
    assert largest.by == pytest.approx(0.5)
    assert found["expects-more"].more == "B"
    assert found["agreement"].share == 1.0
    assert found["of-any-action"].distance == pytest.approx(0.5)


def test_rewards_shifted_by_a_step_are_later():
    first = np.tile([0.0, 1.0, 0.0, 0.0, 0.0], (12, 1))
    comparison = between(first, np.roll(first, 1, axis=1), AXIS)
    found = kinds(comparison)
    later = found["later-rewards"]
    assert (later.later, later.sooner, later.last_step) == ("B", "A", 1)
    assert (later.later_share, later.sooner_share) == (0.0, 1.0)
    assert comparison.shift.value == pytest.approx(1.0)
    assert found["same-in-all"].value == pytest.approx(1.0)
    costs = kinds(between(-np.roll(first, 1, axis=1), -first, AXIS))["later-costs"]
    assert (costs.later, costs.sooner) == ("A", "B")


def test_what_is_neither_sooner_nor_later_is_only_said_by_when_it_comes():
    first = np.tile([0.5, 0.5, 0.0, 0.0], (12, 1))
    second = np.tile([0.6, 0.0, 0.0, 0.4], (12, 1))
    found = kinds(between(first, second, TimeAxis(0.9, 3, 2)))
    assert "later-rewards" not in found
    come = found["come-by"]
    assert (come.last_step, come.first_share) == (3, 1.0)
    assert come.second_share == pytest.approx(0.6)


def test_an_interval_that_could_be_turned_round_is_not_claimed():
    rng = np.random.default_rng(0)
    first = rng.normal(size=(30, 3))
    second = first + rng.normal(size=(30, 1)) * [0.5, 0.0, 0.0]
    comparison = between(first, second, TimeAxis(0.9, 2))
    assert comparison.gap.low < 0.0 < comparison.gap.high
    found = kinds(comparison)
    assert "neither-surely-more" in found
    assert not {"expects-more", "largest-at"} & set(found)
    alike = between(first, second, TimeAxis(0.9, 2), different=3)
    assert np.isnan(alike.gap.low)
    assert kinds(alike)["all-alike"].different == 3
    assert "expects-more" in kinds(alike)  # of these episodes, and no others


def test_episodes_that_both_play_alike_tell_of_the_same_chance_once():
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=(2, 30, 3))
    once = between(first, second, TimeAxis(0.9, 2))
    both = np.repeat(np.arange(30), 2)  # the states of A's episodes, and of B's, which are the same
    twice = between(first[both], second[both], TimeAxis(0.9, 2), seed=both)
    np.testing.assert_allclose(twice.difference.low, once.difference.low)
    np.testing.assert_allclose(twice.difference.high, once.difference.high)


def test_episodes_that_do_not_end_are_cut_off_and_it_says_so():
    agent = gridworld_agent("drone", AXIS)
    stuck = replace(
        agent, policy=Memoryless(lambda states: np.tile([1.0, 0.0, 0.0, 0.0], (len(states), 1)))
    )
    comparison = compare(stuck, agent, episodes=6, judged_by=0, max_steps=30)
    found = kinds(comparison)
    assert (found["some-cut-off"].episodes, found["some-cut-off"].steps) == (6, 30)
    assert comparison.visits.step.max() < 30
    assert "some-cut-off" not in kinds(compare(agent, agent, episodes=6, judged_by=0))


def test_the_centre_of_rewards_by_hand():
    axis = TimeAxis(0.9, 2, 3)
    means = np.array([[1.0, 2.0, 1.0], [-1.0, 0.0, -1.0], [1.0, -1.0, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(centre(means, axis), [(2 * 3 + 6) / 4, 3.0, np.nan, np.nan])


def test_two_horizons_are_compared_on_the_axis_they_share():
    short, long = (
        gridworld_agent("ledge,slip=0.2", TimeAxis(0.95, n, w)) for n, w in ((4, 1), (3, 2))
    )
    comparison = compare(short, long, episodes=10, judged_by=0)
    assert comparison.time_axis == TimeAxis(0.95, 2, 2)
    assert next(iter(kinds(comparison))) == "nothing-differs"


def test_states_of_both_are_visited_and_no_one_has_the_say():
    careful, bold = (gridworld_agent(name, AXIS) for name in ("ledge,slip=0.4", "ledge,slip=0"))
    visits = visit((careful, replace(bold, make=careful.make)), episodes=15, most_states=60)
    assert 20 < len(visits) <= 60
    assert (visits.player == 0).sum() == (visits.player == 1).sum()
    assert len(set(visits.seed[visits.player == 0].tolist())) > 10
    again = visit((careful, replace(bold, make=careful.make)), episodes=15, most_states=60)
    np.testing.assert_array_equal(again.components, visits.components)


@pytest.mark.parametrize("is_random", [False, True])
def test_every_state_can_be_explained_by_the_one_who_came_there(is_random):
    place = gridworld_agent("ledge,slip=0.3", AXIS)
    other = replace(gridworld_agent("ledge", AXIS), make=place.make)
    if is_random:
        other = replace(other, policy=Memoryless(lambda states: np.full((len(states), 4), 0.25)))
    visits = visit((place, other), episodes=4, seed=7, most_states=40)
    for m, (player, seed, step) in enumerate(
        zip(visits.player, visits.seed, visits.step, strict=True)
    ):
        moment = moment_at((place, other)[player], seed=int(seed), step=int(step))
        np.testing.assert_array_equal(moment.decomposition.components, visits.components[player, m])


def test_the_largest_disagreements_come_first_and_none_twice():
    first = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 0.0], [5.0, 0.0]])
    visits = between(first, np.zeros((5, 2)), TimeAxis(0.9, 1)).visits
    assert visits.furthest(3) == [4, 3, 1]
    assert visits.furthest(9) == [4, 3, 1]
    assert visits.furthest(1) == [4]


def test_it_is_told_whose_forecasts_can_be_trusted():
    agent = gridworld_agent(LEDGE, AXIS)
    noise = np.random.default_rng(0)

    def worse(components: np.ndarray) -> np.ndarray:
        components[..., 2:] += noise.normal(size=components[..., 2:].shape)
        return components

    heard: list[Progress] = []
    comparison = compare(
        agent, changed(agent, worse), episodes=5, judged_by=400, watch=heard.append
    )
    good, bad = comparison.reports
    assert good is not None
    assert bad is not None
    assert (good.trust.last_step, bad.trust.last_step) == (3, 1)
    whom = [claim.sentence for claim in trusted(comparison)]
    assert any(
        re.match("A: for what comes .*first 4 steps, .*better than a guess", x) for x in whom
    )
    assert any(
        re.match("B: for what comes .*first 2 steps, .*better than a guess", x) for x in whom
    )
    assert list(dict.fromkeys(progress.what for progress in heard)) == [
        "episodes to compare at",
        "episodes to judge by A",
        "episodes to judge by B",
    ]
    assert (heard[-1].finished, heard[-1].episodes) == (400, 400)


def test_different_futures_are_each_between():
    one = np.ones((12, 2))
    comparison = between(one, 2 * one, TimeAxis(0.9, 1))
    comparison.agents[1].estimator.future = Future("another", clip_rewards=True)
    assert [claim.sentence for claim in one_tells(comparison)] == [
        "A tells of the future of the policy: reward as the environment pays it, up to the end of "
        "the episode.",
        "B tells of the future of another: sign of each reward, up to the end of the episode.",
    ]
    assert nothing_differs(comparison) == []


def test_a_pair_shares_what_is_said_of_exact_tables():
    first, second = find_pair(("gridworld:ledge", "gridworld:ledge,slip=0.3"), gamma=0.9, width=2)
    assert first.estimator.time_axis == second.estimator.time_axis == TimeAxis(0.9, 4, 2)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (("ledge", AXIS), ("drone", AXIS), "they have 8 states and 14 states"),
        (("ledge", AXIS), ("ledge", TimeAxis(0.9, 4)), "discount factors differ: 0.95 and 0.9"),
    ],
)
def test_what_cannot_be_compared(first, second, message):
    with pytest.raises(InputError, match=message):
        compare(gridworld_agent(*first), gridworld_agent(*second))


def test_other_actions_cannot_be_compared():
    agent = gridworld_agent("ledge", AXIS)
    turned = replace(agent, action_names=("down", "up", "left", "right"))
    with pytest.raises(InputError, match=r"they have 4 actions \(up, down, left, right\) and 4"):
        compare(agent, turned)
    numbered = replace(agent, action_names=tuple(f"action {i}" for i in range(4)))
    compare(agent, numbered, episodes=2, judged_by=0)
    with pytest.raises(InputError, match="There are 0 episodes"):
        compare(agent, agent, episodes=0)
