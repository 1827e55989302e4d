"""The dynamics by hand: walls, arrows, slips, wind, and what is paid when."""

import numpy as np
import pytest

from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError, MapError
from trdlab.gridworld import Gridworld, load_map, map_names, parse_map
from trdlab.gridworld.world import Source, State
from trdlab.tabular import MDP, exact

UP, DOWN, LEFT, RIGHT = range(4)


def world_of(*lines: str) -> Gridworld:
    return Gridworld(parse_map("\n".join(lines)))


def outcomes(world: Gridworld, state: int, action: int) -> list[tuple[State, float, float, bool]]:
    """Returns (next state, probability, reward, terminated) of an action, from the exact model."""
    mdp: MDP = world.mdp
    row = state * mdp.num_actions + action
    return [
        (
            world.states[mdp.next_states[k]],
            float(mdp.probabilities[k]),
            float(mdp.rewards[k]),
            bool(mdp.terminated[k]),
        )
        for k in range(mdp.offsets[row], mdp.offsets[row + 1])
    ]


def only(world: Gridworld, state: int, action: int) -> tuple[State, float, bool]:
    """Returns (next state, reward, terminated) of an action that has a single outcome."""
    [(following, probability, reward, terminated)] = outcomes(world, state, action)
    assert probability == 1
    return following, reward, terminated


def walk(world: Gridworld, *actions: int) -> tuple[list[float], State, bool]:
    """Returns the rewards of a walk from the start, where it ends, and whether it is over."""
    state, rewards, terminated = 0, [], False
    for action in actions:
        assert not terminated
        following, reward, terminated = only(world, state, action)
        state = world.states.index(following)
        rewards.append(reward)
    return rewards, world.states[state], terminated


# ---- moving ------------------------------------------------------------------------------------


def test_a_wall_and_the_edge_of_the_map_stop_it():
    world = world_of("S.", "#.")
    for action in (UP, LEFT, DOWN):
        assert only(world, 0, action) == (State(0, 0), 0.0, False)
    assert only(world, 0, RIGHT) == (State(0, 1), 0.0, False)


def test_a_one_way_cell_is_left_along_its_arrow_and_never_entered_against_it():
    world = world_of("...", "S>.", "...")
    onto = world.find_state("1,1")
    assert only(world, onto, RIGHT)[0] == State(1, 2)
    for action in (UP, DOWN, LEFT):
        assert only(world, onto, action)[0] == State(1, 1)
    assert only(world, 0, RIGHT)[0] == State(1, 1)
    assert only(world, world.find_state("1,2"), LEFT)[0] == State(1, 2)  # against the arrow
    assert only(world, world.find_state("0,1"), DOWN)[0] == State(1, 1)  # from the side
    assert only(world, world.find_state("2,1"), UP)[0] == State(1, 1)


def test_slipping_goes_sideways_half_to_each_side():
    world = world_of("slip: 0.2", "---", "...", ".S.", "...")
    assert outcomes(world, 0, UP) == [
        (State(0, 1), 0.8, 0.0, False),
        (State(1, 0), 0.1, 0.0, False),
        (State(1, 2), 0.1, 0.0, False),
    ]
    assert [(s.place, p) for s, p, *_ in outcomes(world, 0, LEFT)] == [
        ((1, 0), 0.8),
        ((0, 1), 0.1),
        ((2, 1), 0.1),
    ]
    corner = world.find_state("0,0")  # up bumps, and so does a slip to the left
    assert {s.place: p for s, p, *_ in outcomes(world, corner, UP)} == pytest.approx(
        {(0, 0): 0.9, (0, 1): 0.1}
    )


def test_a_certain_slip_never_goes_straight():
    world = world_of("slip: 1", "---", "...", ".S.", "...")
    assert [(s.place, p) for s, p, *_ in outcomes(world, 0, UP)] == [((1, 0), 0.5), ((1, 2), 0.5)]


# ---- wind --------------------------------------------------------------------------------------


def test_wind_pushes_by_the_strength_where_the_move_began():
    world = world_of("wind: up 0 2 0", "---", "...", "...", "...", "S..")
    assert only(world, 0, RIGHT)[0] == State(3, 1)  # column 0 is calm
    windy = world.find_state("3,1")
    assert only(world, windy, RIGHT)[0] == State(1, 2)  # two cells up, from column 1
    assert only(world, windy, DOWN)[0] == State(1, 1)  # even after a bump
    assert only(world, world.find_state("1,1"), LEFT)[0] == State(0, 0)  # the edge stops it


def test_wind_sideways_is_given_row_by_row():
    world = world_of("wind: right 1 0", "---", "S...", "....")
    assert only(world, 0, RIGHT)[0] == State(0, 2)
    assert only(world, 0, DOWN)[0] == State(1, 1)


def test_wind_stops_at_walls_and_respects_arrows():
    world = world_of("wind: up 3 0", "---", "..", "v.", "..", "S.")
    assert only(world, 0, LEFT)[0] == State(2, 0)  # up one cell, then against the arrow
    world = world_of("wind: up 3 0", "---", "..", "#.", "..", "S.")
    assert only(world, 0, LEFT)[0] == State(2, 0)


def test_what_the_wind_passes_over_is_collected_and_paid():
    """Nobody can ever stand on the coin and the fountain, and both are within reach."""
    world = world_of("wind: up 3 0", "---", ".#", "f#", "c#", "S.")
    rewards, place, _ = walk(world, LEFT)
    assert rewards == [2.0]
    assert place == State(0, 0, frozenset({(2, 0)}))
    assert {state.place for state in world.states} == {(3, 0), (3, 1), (0, 0)}


def test_a_terminal_cell_on_the_way_ends_the_push():
    world = world_of("wind: up 3 0", "---", "T.", "C.", "..", "S.")
    assert only(world, 0, LEFT) == (State(1, 0, frozenset({(1, 0)})), 1.0, True)


# ---- being paid --------------------------------------------------------------------------------


def test_a_coin_pays_once_and_a_fountain_each_time_it_is_entered():
    coin = world_of("S.c.")
    assert walk(coin, RIGHT, RIGHT, RIGHT, LEFT)[0] == [0, 1, 0, 0]
    fountain = world_of("S.f")
    assert walk(fountain, RIGHT, RIGHT, RIGHT, LEFT, RIGHT)[0] == [0, 1, 0, 0, 1]  # not by a bump


def test_hazards_pay_each_time_and_steps_cost():
    world = world_of("step_cost: 0.5", "---", "Sh.H")
    rewards, place, over = walk(world, LEFT, RIGHT, RIGHT, LEFT, RIGHT, RIGHT)
    assert rewards == [-0.5, -1.5, -0.5, -1.5, -0.5, -1.5]
    assert (place, over) == (State(0, 3), True)


def test_after_a_terminal_cell_nothing_is_paid_and_nothing_moves():
    world = world_of("step_cost: 0.5", "---", "SE.")
    over = world.find_state("0,1")
    assert world.is_terminal(over)
    assert not world.is_terminal(0)
    for action in range(4):
        assert only(world, over, action) == (State(0, 1), 0.0, True)
    assert world.mdp.num_states == 2  # what lies behind the exit is never seen


def test_the_papers_drone_step_by_step():
    world = Gridworld(load_map("drone"))
    assert walk(world, DOWN, RIGHT, RIGHT, RIGHT, RIGHT) == (
        [0, 1, 1, 1, 1],
        State(2, 4, frozenset({(2, 1), (2, 2), (2, 3), (2, 4)})),
        True,
    )
    assert walk(world, UP, RIGHT, RIGHT, RIGHT, RIGHT)[0] == [0, 0, 0, 0, 4]
    for first in (UP, DOWN):  # no return
        _, place, _ = walk(world, first, UP, DOWN, LEFT)
        assert place.place == ((0, 0) if first == UP else (2, 0))


@pytest.mark.parametrize("name", map_names())
def test_states_are_all_that_can_be_reached_and_each_once(name):
    world = Gridworld(load_map(name).with_slip(0.1))
    mdp = world.mdp
    assert len(set(world.states)) == len(world.states) == mdp.num_states
    assert {0, *mdp.next_states.tolist()} == set(range(mdp.num_states))
    terminal = [s for s in range(mdp.num_states) if world.is_terminal(s)]
    assert mdp.terminal_states.nonzero()[0].tolist() == terminal


# ---- what-ifs ----------------------------------------------------------------------------------


def test_one_source_of_reward_can_pay_another_value():
    world = Gridworld(load_map("drone"))
    assert world.sources == [Source("coin", 1.0), Source("treasure", 4.0)]
    treasure = world.mdp_if(Source("treasure", 4.0), 7.0)
    coins = world.mdp_if(Source("coin", 1.0), 7.0)
    assert sorted(treasure.rewards[treasure.rewards > 0].tolist()) == [1.0] * 4 + [7.0]
    assert sorted(coins.rewards[coins.rewards > 0].tolist()) == [4.0] + [7.0] * 4
    as_map = Gridworld(load_map("drone").with_value("treasure", 7.0)).mdp
    np.testing.assert_array_equal(treasure.rewards, as_map.rewards)
    np.testing.assert_array_equal(treasure.next_states, as_map.next_states)


def test_steps_are_a_source_and_kinds_are_told_apart_by_value():
    world = world_of("step_cost: 0.5", "X = coin 3", "---", "ScXc")
    assert world.sources == [Source("coin", 1.0), Source("coin", 3.0), Source("step", -0.5)]
    free = world.mdp_if(Source("step", -0.5), 0.0)
    assert set(free.rewards.tolist()) == {0.0, 1.0, 3.0}


def test_an_unknown_source_or_value_is_refused():
    world = Gridworld(load_map("drone"))
    with pytest.raises(InputError, match="No coin pays 2 here"):
        world.mdp_if(Source("coin", 2.0), 3.0)
    with pytest.raises(InputError, match="value of the coin is inf"):
        world.mdp_if(Source("coin", 1.0), float("inf"))


# ---- finding states ----------------------------------------------------------------------------


def test_a_state_is_named_by_number_or_place():
    world = world_of("Scc")
    assert world.find_state("0") == world.find_state("0,0") == 0
    assert world.find_state(" 0 , 2 ") == world.find_state("0,2")
    assert world.states[world.find_state("0,1")] == State(0, 1, frozenset({(0, 1)}))
    again = world.states.index(State(0, 0, frozenset({(0, 1)})))
    assert world.find_state(str(again)) == again
    assert str(world.states[again]) == "row 0, column 0, 1 collected"
    assert world.find_state("0,0,1") == again
    assert world.find_state("0,0,0") == 0
    with pytest.raises(InputError, match=r"column 1 no state has 0 collected.*one of 1, 2"):
        world_of("Scc.").find_state("0,1,0")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("3", "no state 3.*0 to 2"),
        ("9" * 5000, "no state 9+.*0 to 2"),
        ("-1", "state is '-1'.*number, row,column"),
        ("1.0", "number, row,column"),
        ("0,", "number, row,column"),
        ("0,0,0,0", "number, row,column or row,column,collected"),
        ("", "number, row,column"),
        ("1,0", r"never be at row 1, column 0.*rows 0 to 0 .* columns 0 to 3"),
        ("0,3", "never be at row 0, column 3"),  # a wall
        (f"0,{'9' * 5000}", "never be at"),
    ],
)
def test_a_state_that_does_not_exist_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        world_of("S.f#").find_state(text)


# ---- maps that cannot be played ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["S.#c"], "coin at row 0, column 3 of the map 'map' cannot be reached.*Open a way"),
        (["S.#T"], "treasure at row 0, column 3"),
        (["S.#f"], "fountain at row 0, column 3"),
        (["SE.c"], "coin at row 0, column 3"),  # behind the exit
        (["S.<c"], "coin at row 0, column 3"),  # against the arrow
        (["S#.", "##."], "walled in.*Open a way"),
        (["S"], "walled in"),
    ],
)
def test_a_map_that_cannot_be_played_is_refused(rows, message):
    with pytest.raises(MapError, match=message):
        world_of(*rows)


def test_hazards_and_floor_out_of_reach_are_fine():
    assert world_of("S.#h", "###.").mdp.num_states == 2


def test_too_many_states_are_refused_with_the_count():
    with pytest.raises(MapError, match=r"more than 50000 .*\(5\d{4} counted.* its 20 one-time"):
        world_of("S" + "." * 9, *["c" * 10] * 2)


@pytest.mark.parametrize("name", ["drone", "bridge"])
def test_rewards_too_large_to_square_are_refused_by_that_reason(name):
    world = Gridworld(load_map(name).with_value("treasure", 1e160))
    with pytest.raises(InputError, match=r"Rewards of 1e\+160 .* square is beyond double"):
        exact(world.mdp, TimeAxis(0.95, 2))
