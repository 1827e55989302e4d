"""How two actions are held against each other, in numbers worked out by hand and in words."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from moments import GAMMA, calibrated, choice, moment, of_kind, said, told, trusted
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explanations.moment.exact import gridworld_moment
from trdlab.explanations.moment.moment import CHOICES, Choice, moment_of
from trdlab.explanations.moment.telling import in_brief
from trdlab.explanations.rules import UnsupportedSentenceError, check
from trdlab.gridworld import Gridworld, load_map, parse_map
from trdlab.tabular import exact, learn


def test_the_drone_prefers_down_because_it_pays_sooner():
    of = choice()
    assert (of.action, of.foil) == ("down", "up")
    sooner, discount, first, flip = in_brief(of)
    assert sooner.sentence == (
        "Down gives more immediate rewards: 2.71 in the first 4 steps, while up gives nothing."
    )
    assert sooner.leader_sum == pytest.approx(GAMMA + GAMMA**2 + GAMMA**3)
    assert discount.sentence == (
        "Both pay 4 in total, but each step of waiting makes a reward count 5 % less: down is "
        "worth 3.52, up 3.26."
    )
    assert discount.better_value == pytest.approx(GAMMA + GAMMA**2 + GAMMA**3 + GAMMA**4)
    assert discount.worse_value == pytest.approx(4 * GAMMA**4)
    assert first.sentence == "With down, the first reward comes 1 step later: it is 1."
    assert flip.sentence == "Up would be better if each coin paid less than 0.924 instead of 1."


def test_the_fewest_steps_that_justify_down_are_those_of_its_three_coins():
    (reasons,) = of_kind(choice(), "reasons")
    # against them stand 3 γ⁴ of the treasure; two coins are not enough
    assert reasons.components == (1, 2, 3)
    assert reasons.advantage == pytest.approx(GAMMA + GAMMA**2 + GAMMA**3)
    assert reasons.disadvantage == pytest.approx(3 * GAMMA**4)
    assert reasons.sentence == (
        "What comes 1 to 3 steps later is enough to make down better: it is 2.71 ahead then, and "
        "2.44 behind otherwise."
    )


def test_the_default_foil_is_a_real_alternative():
    of = choice()
    values = dict(zip(of.moment.action_names, of.moment.q_values, strict=True))
    assert values["left"] > values["up"]  # a bump is worth γ·Q(down), more than the foil
    assert choice(action="up").foil == "down"
    assert choice(foil="down").action == "up"
    assert choice("bridge").foil == "right"  # over the bridge; a bump may slip, but mostly stays
    identical = choice("windy")
    assert not identical.moment.difference("down", "right").any()
    assert identical.foil not in (None, "right")


def test_the_action_is_what_the_policy_does_even_if_that_is_to_stay():
    world = Gridworld(parse_map("H = hazard -1 terminal\n---\nSH"))
    of = choice(world)
    assert of.moment.policy is not None
    assert of.moment.policy[of.moment.index(of.action)] == 1.0
    assert of.action != "right"
    assert of.foil == "right"
    assert said(of, "decided-at") == [
        f"What comes at once decides: {of.action} gains nothing and right loses 1."
    ]


def test_without_another_action_that_moves_there_is_nothing_to_compare():
    of = choice("corridor")
    assert (of.action, of.foil) == ("right", None)
    assert in_brief(of)[0].sentence == (
        "Every other action leaves things as they are, surely or most likely, so there is nothing "
        "to compare."
    )


def test_to_fall_off_a_cliff_is_no_bump():
    cliff = Gridworld(parse_map("C = hazard -100\nT = treasure 1 terminal\n---\n..T\nSC."))
    of = choice(cliff, action="up", foil="right")
    assert of.moment.stays is not None
    assert of.moment.stays[of.moment.index("left")] == 1.0
    (decided,) = of_kind(of, "decided-at")
    assert decided.component == 0
    assert decided.sentence == "What comes at once decides: up gains nothing and right loses 100."


def test_where_the_episode_is_over_that_is_all_there_is_to_say():
    world = Gridworld(parse_map("T = treasure 1 terminal\n---\nS.T"))
    over = int(np.flatnonzero(world.mdp.terminal_states)[0])
    assert [claim.sentence for claim in told(choice(world, state=over))] == [
        "The episode is over here: no action pays anything any more."
    ]


@pytest.mark.parametrize("slip", [0.1, 0.3])
def test_nothing_is_expected_of_a_world_that_pays_nothing(slip: float):
    world = Gridworld(parse_map(f"E = coin 0 terminal\nslip: {slip}\n---\n...\nSE."))
    assert [claim.sentence for claim in in_brief(choice(world))] == [
        "Nothing is expected of any action here."
    ]


def test_zero_on_average_is_not_nothing():
    rows = "X = coin 3 terminal\nZ = hazard -3 terminal\nslip: 1.0\n---\n#X#\n.S.\n#Z#"
    of = choice(Gridworld(parse_map(rows)), action="left", foil="up")
    assert of.moment.q_value("left") == pytest.approx(0.0, abs=1e-12)
    texts = [claim.sentence for claim in told(of)]
    assert not any(text.startswith("Nothing is expected") for text in texts)
    assert "On average no action pays anything here, but single episodes differ." in texts or any(
        "on average" in text for text in texts
    )


# ---- ties ------------------------------------------------------------------------------------


def test_what_depends_on_how_a_tie_was_broken_says_so():
    of = choice("tie")
    assert of.moment.tied == ("left", "right")
    assert said(of, "tied-actions") == [
        "Left and right are equally good here, but pay other amounts or at other times; the agent "
        "takes left."
    ]
    assert said(of, "different-totals") == [
        "In total right brings 20 and left 19, with ties broken as here."
    ]
    assert "takes each equally often" in said(choice("tie", ties="mixed"), "tied-actions")[0]


def test_ties_in_later_states_are_counted():
    world = Gridworld(parse_map("X = coin 19 terminal\nY = coin 20 terminal\n---\n##S###\nX....Y"))
    assert said(choice(world, TimeAxis(GAMMA, 8)), "tied-later") == [
        "In 1 state to come several actions are equally good: totals and times depend on which is "
        "taken."
    ]


# ---- totals and values -----------------------------------------------------------------------


def test_a_loop_has_no_total():
    of = choice(Gridworld(parse_map("f.S.f")))
    assert {claim.action for claim in of_kind(of, "no-total")} == {"left", "right"}


def test_totals_of_any_size_are_told_apart():
    world = parse_map("X = coin 1e-12 terminal\nY = treasure 4e-12 terminal\n---\nXS..Y")
    of = choice(Gridworld(world), action="left", foil="right")
    assert said(of, "different-totals") == ["In total right brings 4e-12 and left 1e-12."]
    large = parse_map("X = coin 1e12 terminal\nY = treasure 1.001e12 terminal\n---\nXSY")
    assert said(choice(Gridworld(large)), "different-totals") == [
        "In total right brings 1.001e+12 and left 1e+12."
    ]


def test_the_discount_is_told_where_it_decides_against_the_total():
    of = choice("tie", TimeAxis(0.9, 1))
    assert [claim.sentence for claim in in_brief(of)[1:3]] == [
        "In total right brings 20 and left 19.",
        "But each step of waiting makes a reward count 10 % less: left is worth 17.1, right 16.2.",
    ]
    assert not of_kind(of, "never-behind")  # which of them pays when lies in the residual


# ---- who is ahead ----------------------------------------------------------------------------


def pair(a: list[float], b: list[float], **known: Any) -> Choice:
    return moment([[*map(float, a)], [*map(float, b)]], **known).choice("a", "b")


@pytest.mark.parametrize(
    ("a", "b", "sentence"),
    [
        (
            [1, 0, 0, 0, 0],
            [0, 0, 0, 1, 0.5],
            "A gives more immediate rewards: 1 in the first step, while b gives nothing, on "
            "average.",
        ),
        (
            [0] * 9 + [2, 0],
            [0] * 11,
            "What comes 9 steps later decides: a gains 2 and b gains nothing, on average.",
        ),
        (
            [0] * 9 + [1, 1, 0, 0],
            [0] * 12 + [3],
            "In the first 12 steps a gains 2 and b gains nothing, on average.",
        ),
        (
            [-0.5, 2, 0, 0, 0],
            [-1, 0, 0, 1, 0],
            "In the first 2 steps a gains 1.5 and b loses 1, on average.",
        ),
        (
            [-0.5, -0.5, 3, 0],
            [-1, -1, 3, 0],
            "A costs less: 1 in the first 2 steps, while b costs 2, on average.",
        ),
    ],
)
def test_a_lead_is_told_in_words_that_are_true_of_it(a, b, sentence):
    assert sentence in [claim.sentence for claim in told(pair(a, b))]


def test_a_group_that_reaches_far_is_not_immediate():
    corridor = f"Y = treasure 4 terminal\n---\nY{'.' * 38}S..."
    of = choice(Gridworld(parse_map(corridor)), TimeAxis(GAMMA, 1, 50), foil="right")
    assert not of_kind(of, "more-immediate")


def test_what_makes_up_for_a_lead_follows_it():
    of = pair([0.0, 0.0, 3.0], [1.0, 1.0, 0.2])
    assert [claim.kind for claim in in_brief(of)[:3]] == ["more-immediate", "makes-up", "better"]
    assert said(of, "makes-up") == [
        "But what comes after the first 2 steps decides: with a, that part is worth 2.8 "
        "more, on average."
    ]


def test_crossings_are_found_at_their_step():
    of = pair([0.0, 0.0, 3.0, 0.0], [1.0, 0.5, 0.0, 0.0])
    assert said(of, "overtakes") == [
        "After the first 3 steps a has overtaken b: added up, a gains 3 and b gains 1.5, on "
        "average."
    ]


def test_a_lead_that_begins_in_the_residual_is_not_denied():
    """At t+4 right has paid -0.5 · (1 + γ + γ² + γ³) + 9.5 · γ⁴ = 5.88; N = 4 ends before."""
    rules = "step_cost: 0.5\nX = coin 2 terminal\nY = coin 10\n---\n"
    world = Gridworld(parse_map(f"{rules}XS>...Y{'.' * 29}E"))
    near, far = (choice(world, TimeAxis(GAMMA, horizon), foil="right") for horizon in (4, 40))
    assert near.action == far.action == "left"
    assert said(near, "never-behind") == [
        "Added up step by step, left is never behind right in the first 4 steps, nor in the end."
    ]
    assert not of_kind(far, "never-behind")
    assert (
        "After the first 5 steps right has overtaken left: added up, right gains 5.88 and left "
        "gains 1.5." in said(far, "overtakes")
    )


def test_a_residual_in_which_an_action_pays_more_speaks_for_it():
    of = choice("tie", TimeAxis(0.9, 1), action="left", foil="right")
    texts = [claim.sentence for claim in told(of)]
    assert texts[:2] == [  # 19 · 0.9 and 20 · 0.9²
        "What comes after the first step decides: left gains 17.1 and right gains 16.2.",
        "In total right brings 20 and left 19.",
    ]


def test_an_equal_level_is_no_lead_and_the_residual_is_not_spoken_of_step_by_step():
    level = pair([1, 0, 0, 0], [0, 1, 0, 0])
    assert not of_kind(level, "overtakes")
    ahead = pair([1, 0, 0, 0.5], [0, 0.5, 0, 0])
    assert said(ahead, "never-behind") == [
        "Added up step by step, a is never behind b in the first 3 steps, nor in the end."
    ]
    grouped = moment([[1, 0, 0.5], [0, 0.5, 0]], width=2).choice("a", "b")
    assert not of_kind(grouped, "never-behind")


def test_a_lead_that_may_be_noise_is_not_called_sooner():
    rows = [[0.01, 1.0, 0.0, 0.3, 0.0], [0.03, 0.0, 0.4, 0.0, 0.0]]
    of = moment(rows).choice("a", "b")
    assert not of_kind(of, "overtakes")  # b leads by 0.02 at first
    exactly = replace(moment(rows), totals=np.array([2.0, 1.0])).choice("a", "b")
    assert [claim.leader for claim in of_kind(exactly, "overtakes")] == ["a"]


def test_next_to_nothing_is_no_lead():
    rows = [[0.0, 0.0, 0.0, -0.0004, 1.85], [0.0, 0.0, 0.0, 0.0, 1.77]]
    of = moment(rows, totals=np.array([2.0, 1.9])).choice("a", "b")
    assert said(of, "next-to-nothing") == ["Hardly anything is expected of a in the first 4 steps."]
    assert not of_kind(of, "costs-less")
    assert of_kind(of, "better")


# ---- what is not to be trusted, and learned tables -------------------------------------------


def test_a_difference_that_cannot_be_trusted_is_not_discussed():
    rows = [[0.0, 1.0, 0.0, 3.0], [0.5, 0.0, 0.0, 0.0]]  # |differences| 0.5, 1, 0, 3
    axis = TimeAxis(GAMMA, 3)
    of = moment(rows, calibration=trusted(axis, 3)).choice("a", "b")
    (doubt,) = of_kind(of, "untested-difference")
    assert doubt.share == pytest.approx(3.0 / 4.5)
    assert doubt.sentence == (
        "67 % of the difference between a and b comes after the first 3 steps, and that is not to "
        "be trusted."
    )
    silent = calibrated(axis, ("good", "good", "good", "not tested"))
    (untested,) = of_kind(moment(rows, calibration=silent).choice("a", "b"), "untested-difference")
    assert untested.sentence.endswith("and that was not tested.")
    assert not of_kind(of, "reasons")
    nothing = calibrated(axis, ("open",) * 4)
    (whole,) = of_kind(moment(rows, calibration=nothing).choice("a", "b"), "untested-whole")
    assert whole.sentence == "What tells a and b apart is not to be trusted, all of it."
    sure = moment(rows, calibration=trusted(axis, 3, residual=True)).choice("a", "b")
    assert of_kind(sure, "reasons")
    assert not of_kind(sure, "untested-difference")


def test_differences_far_below_what_forecasts_are_off_by_are_not_discussed():
    rows = [[0.0, 0.02, 0.0, 0.01], [0.0, 0.0, 0.005, 0.0]]  # a leads by 0, 0.02, 0.015, 0.025
    off = calibrated(TimeAxis(GAMMA, 3), off_by=[0.0, 0.3, 0.4, 0.0])
    of = moment(rows, calibration=off).choice("a", "b")
    (close,) = of_kind(of, "hardly-apart")
    assert close.most == pytest.approx(0.025)
    assert close.error == pytest.approx(np.sqrt(2 * (0.3**2 + 0.4**2)))
    assert close.sentence == (
        "A and b hardly differ: by 0.025 at most, added up to any step, where such forecasts are "
        "off by about 0.707."
    )
    assert [claim.kind for claim in in_brief(of)][:2] == ["hardly-apart", "better"]
    assert check(close.sentence, [(CHOICES, of)])[0].kind == "hardly-apart"
    for right, wrong in (("0.025", "0.035"), ("0.707", "0.607"), ("hardly", "clearly")):
        with pytest.raises(UnsupportedSentenceError):
            check(close.sentence.replace(right, wrong), [(CHOICES, of)])
    assert not of_kind(of, "more-immediate")
    assert not of_kind(of, "reasons")
    known = calibrated(TimeAxis(GAMMA, 3), off_by=[0.0, 0.1, 0.1, 0.0])  # 0.02 > 0.1 √2 / 10
    assert not of_kind(moment(rows, calibration=known).choice("a", "b"), "hardly-apart")
    unknown = moment(rows, calibration=calibrated(TimeAxis(GAMMA, 3))).choice("a", "b")
    assert of_kind(unknown, "more-immediate")


def test_a_reward_far_below_what_forecasts_are_off_by_does_not_stand_out():
    rows = [[0.01, 0.0, 0.02, 0.0]] * 2
    off = calibrated(TimeAxis(GAMMA, 3), off_by=[0.2, 0.2, 0.1, 0.2])
    (first,) = of_kind(moment(rows, calibration=off).choice("a", "b"), "first-expected")
    assert first.component == 2  # without what they are off by it would be the first


def test_a_learned_table_is_explained_like_an_exact_one():
    world = Gridworld(load_map("drone"))
    learned = learn(world.mdp, TimeAxis(GAMMA, 4), agent_steps=200_000, seed=0)
    of = moment_of(learned, 0, world.action_names).choice("down", "up")
    (sooner,) = of_kind(of, "more-immediate")
    assert (sooner.leader, sooner.last_step) == ("down", 3)
    assert sooner.leader_sum == pytest.approx(GAMMA + GAMMA**2 + GAMMA**3, abs=0.02)
    assert sooner.sentence.endswith(", on average.")
    assert not of_kind(of, "equal-totals")  # samples tell no undiscounted total
    assert not of_kind(of, "flips")  # and no model can be solved again


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"action": "dwon"}, "There is no action 'dwon'. Did you mean 'down'?"),
        ({"foil": "sideways"}, "There is no action 'sideways'. Known: down, left, right, up."),
        ({"action": "up", "foil": "up"}, "Action and foil are both 'up'."),
    ],
)
def test_wrong_actions_are_refused(options: dict[str, str], message: str):
    with pytest.raises(InputError, match=re.escape(message)):
        choice(**options)


def test_a_given_policy_has_no_what_ifs_and_is_named():
    world = Gridworld(load_map("drone"))
    uniform = np.full((world.mdp.num_states, 4), 0.25)
    table = exact(world.mdp, TimeAxis(GAMMA, 2), policy=uniform)
    of = gridworld_moment(world, table, 0).choice("down", "up")
    assert not of_kind(of, "flips")
    assert said(of, "decided-by") == ["After the first action, the given policy acts."]


def test_whose_future_it_is_says_what_counts():
    signs = Future("the greedy policy", clip_rewards=True, life_loss_ends=True)
    of = replace(moment([[1.0, 0.0], [0.0, 0.0]]), future=signs).choice("a", "b")
    assert said(of, "signs-count") == ["Of each reward only the sign counts."]
    assert said(of, "ended-by") == ["All steps count, up to a lost life, or the end of the game."]
    assert not of_kind(choice(), "signs-count")
