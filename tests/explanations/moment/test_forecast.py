"""What is forecast of one action, in numbers worked out by hand and in words."""

from typing import Any

import numpy as np
import pytest

from moments import GAMMA, choice, moment, of_kind, said, told, trusted
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.moment.forecast import forecast
from trdlab.explanations.moment.moment import Choice, Moment, Uncertainty
from trdlab.gridworld import Gridworld, parse_map


def one(row: list[float], **known: Any) -> Choice:
    return moment([row], **known).choice("a")


def test_what_the_drone_expects_of_down():
    of = choice()
    assert [claim.sentence for claim in forecast(of)] == [
        "With down, the first reward comes 1 step later: it is 1.",
        "23 % of what down is worth comes after the first 4 steps.",
        "What down pays in the first 4 steps comes 2.0 steps later on average.",
    ]
    (share,) = of_kind(of, "share-beyond")
    assert share.share == pytest.approx(GAMMA**4 / (GAMMA + GAMMA**2 + GAMMA**3 + GAMMA**4))
    (centre,) = of_kind(of, "centre-of-mass")
    assert centre.step == pytest.approx(
        (GAMMA + 2 * GAMMA**2 + 3 * GAMMA**3) / (GAMMA + GAMMA**2 + GAMMA**3)
    )
    assert said(choice(axis=TimeAxis(GAMMA, 6)), "surely-over") == [
        "With down, the episode ends in the first 5 steps."
    ]


def test_what_is_not_defined_is_not_said():
    mixed = moment([[1.0, -1.0, 0.5], [0.0, 0.0, 0.2]]).choice("a", "b")
    assert not of_kind(mixed, "share-beyond")
    assert not of_kind(mixed, "centre-of-mass")
    grouped = moment([[1.0, 2.0, 0.5], [0.0, 0.0, 0.2]], width=3).choice("a", "b")
    assert not of_kind(grouped, "centre-of-mass")
    assert said(grouped, "first-expected") == [  # the discount inside a group cannot be taken out
        "With a, the first reward to expect comes in the first 3 steps: worth 1 on average."
    ]


def test_costs_are_not_called_rewards():
    of = moment([[-1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]).choice("a", "b")
    assert said(of, "first-expected") == [
        "With a, the first cost to expect comes at once: 1 on average."
    ]
    assert not of_kind(of, "peak")


# ---- chances ---------------------------------------------------------------------------------


def test_a_chance_is_told_where_there_is_any():
    world = Gridworld(parse_map("T = treasure 4 terminal\nslip: 0.5\n---\n...\nS.T\n..."))
    of = choice(world, TimeAxis(0.9, 6), action="right", foil="up")
    # two moves to the right in a row succeed with 1/4: then 4 is paid at t+1
    assert said(of, "first-chance") == [
        "With right, a reward of 4 can come 1 step later at the earliest; the chance that it comes "
        "then is 25 %."
    ]
    (varies,) = of_kind(of, "give-or-take")
    assert 0 < varies.deviation < 2
    assert not of_kind(choice(), "give-or-take")  # nothing slips on the drone's map


def chancy(outcomes: tuple[dict[float, float], ...], beyond: float = 0.0) -> Choice:
    """A moment of one action whose steps pay so, undiscounted mean times γ^k."""
    axis = TimeAxis(GAMMA, len(outcomes))
    means = [sum(reward * p for reward, p in step.items()) for step in outcomes]
    row = np.append(means, beyond) * axis.discounts
    known = np.ones((1, len(row)))
    uncertainty = Uncertainty(known, np.ones(1), known, (outcomes,))
    parts = RewardDecomposition(row[None], axis)
    future, totals = Future("the optimal policy"), row[None].sum(-1)
    return Moment(parts, ("a",), future, totals=totals, uncertainty=uncertainty).choice("a")


def test_a_chance_is_told_only_of_what_matters():
    small, large = {0.0: 0.95, -0.1: 0.05}, {0.0: 0.5, 0.4: 0.4, 0.8: 0.1}
    assert not of_kind(chancy((small, {6.0: 1.0})), "either-or")  # 0.10 beside 6
    assert not of_kind(chancy((small, small), beyond=7.0), "either-or")
    risk = chancy((large, {0.0: 0.96, -4.0: 0.04}))
    assert said(risk, "first-of-several") == [
        "With a, a reward can come at once; the chance that it comes then is 50 %."
    ]
    assert said(risk, "first-chance") == [
        "With a, a cost of 4 can come 1 step later at the earliest; the chance that it comes then "
        "is 4 %."
    ]
    assert not of_kind(risk, "either-or")  # it is the first cost, and told as that
    twice = chancy(({0.0: 0.98, -4.0: 0.02}, large, {0.0: 0.9, -4.0: 0.1}))
    assert said(twice, "either-or") == ["There is a 10 % chance that a costs 4, 2 steps later."]


def test_the_first_cost_is_the_first_step_that_can_cost_something():
    steps = ({-0.1: 1.0}, {-0.1: 0.5, 2.0: 0.5}, {-0.1: 1.0})  # the mean of the second is positive
    of = chancy(steps)
    assert said(of, "first-reward") == ["With a, the first cost comes at once: it is 0.1."]
    assert said(of, "first-chance") == [
        "With a, a reward of 2 can come 1 step later at the earliest; the chance that it comes "
        "then is 50 %."
    ]


# ---- what was learned ------------------------------------------------------------------------


def judged(row: list[float], good: int, residual: bool, **known: Any) -> Choice:
    axis = TimeAxis(GAMMA, len(row) - 1)
    return one(row, calibration=trusted(axis, good, residual, **known))


def test_nothing_is_forecast_that_cannot_be_trusted():
    row = [0.0, 0.0, 0.9, 0.0, 2.0, 0.0]
    assert forecast(judged(row, 0, False)) == []
    assert [claim.sentence for claim in forecast(judged(row, 2, False))] == [
        "Nothing is expected of a in the first 2 steps."
    ]
    kinds = {claim.kind for claim in forecast(judged(row, 4, False))}
    assert kinds == {"first-expected"}  # and no peak at t+4, nor a share beyond t+5


@pytest.mark.parametrize(("chance", "told"), [(0.0, 0), (0.0025, 0), (0.3, 1)])
def test_an_action_that_is_hardly_ever_taken_is_judged_where_it_was_forced(chance, told):
    """Of b, drawn at random now and then, what was judged of a says nothing."""
    axis, row = TimeAxis(GAMMA, 3), [0.0, 0.9, 0.0, 0.0]
    of = moment(
        [row, row],
        calibration=trusted(axis, 3),
        foils=trusted(axis, 0),
        policy=np.array([1.0 - chance, chance]),
    )
    assert len(forecast(of.choice("a"))) > 0
    assert bool(forecast(of.choice("b"))) == bool(told)


def test_small_components_of_what_was_learned_are_no_first_reward():
    row = [0.03, -0.04, 0.03, 1.0, 0.02, 0.5]
    (first,) = of_kind(one(row), "first-expected")
    assert (first.component, first.effect) == (3, "clear reward")
    exactly = of_kind(one(row, totals=np.array([2.0])), "first-expected")
    assert [(x.component, x.effect) for x in exactly] == [(0, "reward"), (1, "cost")]


@pytest.mark.parametrize(
    ("amount", "good", "chance"),
    [(2.0, 4, 0.4), (0.5, 4, None), (-2.0, 4, None), (None, 4, None), (2.0, 3, None)],
)
def test_an_expected_reward_is_a_chance_only_where_one_reward_or_none_comes(amount, good, chance):
    row = [0.0, 0.0, 0.0, 0.8 * GAMMA**3, 0.0, 0.0]
    of = judged(row, good, False, only_reward=amount)
    assert [claim.chance for claim in of_kind(of, "put-at")] == (
        [] if chance is None else [pytest.approx(chance)]
    )


def test_no_chance_is_read_from_a_group():
    axis = TimeAxis(GAMMA, 2, 3)
    known = trusted(axis, 2, residual=True, only_reward=1.0)
    of = moment([[0.0, 0.8, 0.0]], width=3, calibration=known).choice("a")
    assert not of_kind(of, "put-at")


def test_an_error_is_told_where_it_is_as_large_as_half_of_what_is_expected():
    row = [0.0, 0.8, 0.0, 0.0]
    large = judged(row, 3, True, off_by=[0.1, 0.4, 0.1, 0.1])
    assert said(large, "off-by") == ["Forecasts of what comes 1 step later are off by about 0.4."]
    for error in ([0.5, 0.39, 0.5, 0.5], [np.nan] * 4):
        assert not of_kind(judged(row, 3, True, off_by=error), "off-by")


def test_the_centre_is_told_in_steps_where_no_rhythm_is():
    several = one([0.0, 1.0, 0.0, 0.0, 0.0, 3.0, 0.0])
    assert said(several, "centre-of-mass") == [  # (1 + 3 · 5) / 4
        "What a pays in the first 6 steps comes 4.0 steps later on average."
    ]
    regular = one([0.0, 1.0, 0.0] * 5)
    assert of_kind(regular, "rhythm")
    assert not of_kind(regular, "centre-of-mass")


def test_an_action_of_which_nothing_is_expected():
    of = moment([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).choice("a", "b")
    assert said(of, "earns-nothing") == ["Nothing is expected of a, at any step."]
    assert "nothing-at-all" not in {claim.kind for claim in told(of)}
