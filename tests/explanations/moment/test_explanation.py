"""What is found about the drone and other maps, against numbers worked out by hand."""

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import pytest

import by_hand
from trdlab.agents.agent import gridworld_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.errors import InputError
from trdlab.estimator import Future
from trdlab.explain.copies import ModelEnvironments
from trdlab.explanations import check, explain_agent, sentences
from trdlab.explanations.calibration.report import judge
from trdlab.explanations.claims import Finding
from trdlab.explanations.moment import (
    chances,
    contrast,
    forecast,
    leads,
    peaks,
    sensitivity,
    worth,
)
from trdlab.explanations.moment.contrast import in_short
from trdlab.explanations.moment.exact import gridworld_moment
from trdlab.explanations.moment.explanation import (
    Explanation,
    TiedActions,
    TiedLater,
    WhoseFuture,
    explain,
)
from trdlab.explanations.moment.limits import judged
from trdlab.explanations.moment.moment import Moment, Uncertainty, moment_of
from trdlab.gridworld import Gridworld, load_map, parse_map
from trdlab.rollouts.episodes import collect
from trdlab.tabular import exact, learn

GAMMA = 0.95
F = TypeVar("F", bound=Finding)


def explained(
    world: Gridworld | None = None, axis: TimeAxis | None = None, state: int = 0, **options: Any
) -> Explanation:
    world = world or Gridworld(load_map("drone"))
    table = exact(world.mdp, axis or TimeAxis(GAMMA, 4), ties=options.pop("ties", "lowest"))
    return explain(gridworld_moment(world, table, state), **options)


def moment(rows: list[list[float]], width: int = 1) -> Moment:
    axis = TimeAxis(GAMMA, len(rows[0]) - 1, width)
    names = tuple("abcd"[: len(rows)])
    return Moment(RewardDecomposition(np.array(rows), axis), names, Future("the optimal policy"))


def found(kind: type[F], explanation: Explanation) -> list[F]:
    return [finding for finding in explanation.findings if type(finding) is kind]


def test_the_drone_prefers_down_because_it_pays_sooner():
    explanation = explained()
    assert (explanation.action, explanation.foil) == ("down", "up")
    (totals,) = found(worth.EqualTotals, explanation)
    assert totals.total == pytest.approx(4.0)
    (sooner,) = found(leads.MoreImmediate, explanation)
    assert (sooner.leader, sooner.other, sooner.last_step) == ("down", "up", 3)
    assert sooner.leader_sum == pytest.approx(GAMMA + GAMMA**2 + GAMMA**3)
    (better,) = found(worth.BetterByDiscount, explanation)
    assert better.better_value == pytest.approx(GAMMA + GAMMA**2 + GAMMA**3 + GAMMA**4)
    assert better.worse_value == pytest.approx(4 * GAMMA**4)
    assert found(leads.StaysAhead, explanation) == [leads.StaysAhead("down", "up")]


def test_the_fewest_components_that_justify_down_are_its_three_coins():
    (reasons,) = found(contrast.Reasons, explained())
    # against them stand 3 γ⁴ of the treasure; two coins are not enough
    assert reasons.components == (1, 2, 3)
    assert reasons.advantage == pytest.approx(GAMMA + GAMMA**2 + GAMMA**3)
    assert reasons.disadvantage == pytest.approx(3 * GAMMA**4)
    assert GAMMA + GAMMA**2 < 3 * GAMMA**4


def test_treasure_4_never_flips_over_gamma_and_treasure_5_flips_once():
    assert found(sensitivity.NeverFlips, explained())[0].quantity == "γ"
    richer = Gridworld(load_map("drone").with_value("treasure", 5))
    (flip,) = (x for x in found(sensitivity.Flips, explained(richer)) if x.quantity == "γ")
    # 1 + γ + γ² = 4 γ³
    (root,) = flip.at
    assert root == pytest.approx(0.86888, abs=5e-6)
    assert 1 + root + root**2 == pytest.approx(4 * root**3, abs=1e-10)


def test_the_treasure_and_the_coins_that_flip_the_preference():
    at = {x.quantity: x.at for x in found(sensitivity.Flips, explained())}
    treasure = 1 + GAMMA**-1 + GAMMA**-2 + GAMMA**-3
    assert treasure == pytest.approx(4.3270, abs=5e-5)
    assert at["the reward for the treasure"] == pytest.approx((treasure,), abs=1e-9)
    assert at["the reward for each coin"] == pytest.approx((4 / treasure,), abs=1e-9)


def test_flips_re_optimise_the_policy():
    # staying on the near branch is better at low γ; the far branch needs a policy of its own
    world = Gridworld(load_map("patience"))
    (flip,) = (x for x in found(sensitivity.Flips, explained(world)) if x.quantity == "γ")
    assert flip.at == pytest.approx(((1 / 3) ** (1 / 9),), abs=1e-10)  # 3 γ⁹ = 1


def test_a_given_policy_has_no_what_ifs_and_is_named():
    world = Gridworld(load_map("drone"))
    uniform = np.full((world.mdp.num_states, 4), 0.25)
    table = exact(world.mdp, TimeAxis(GAMMA, 2), policy=uniform)
    explanation = explain(gridworld_moment(world, table, 0), "down", "up")
    assert explanation.flips == ()
    assert [type(x) for x in explanation.context] == [WhoseFuture]
    assert found(WhoseFuture, explanation)[0].policy == "the given policy"


def test_contrasts_never_default_to_an_action_that_stays():
    explanation = explained()
    values = dict(zip(["up", "down", "left", "right"], explanation.moment.q_values, strict=True))
    assert values["left"] > values["up"]  # a bump is worth γ·Q(down), more than the foil
    assert explanation.foil == "up"
    assert explained(action="up").foil == "down"
    assert explained(foil="down").action == "up"


def test_a_corridor_has_no_foil():
    explanation = explained(Gridworld(load_map("corridor")))
    assert (explanation.action, explanation.foil) == ("right", None)
    assert explanation.contrast == explanation.flips == ()


def test_ties_are_carried_and_said():
    tie = Gridworld(load_map("tie"))
    explanation = explained(tie)
    assert explanation.context[1:] == (TiedActions(("left", "right")),)
    (whose,) = found(WhoseFuture, explanation)
    assert whose.policy == "the optimal policy (of tied actions the first)"
    assert (whose.reward, whose.ending) == ("reward as the environment pays it", "terminal states")
    mixed = explained(tie, ties="mixed")
    assert "mixes tied actions evenly" in found(WhoseFuture, mixed)[0].policy
    before = Gridworld(
        parse_map("X = coin 19 terminal\nY = treasure 20 terminal\n---\n##S##\nX...Y#"[:-1])
    )
    assert found(TiedLater, explained(before)) == []  # the routes from below S are as long


def test_ties_in_later_states_are_counted():
    world = Gridworld(parse_map("X = coin 19 terminal\nY = coin 20 terminal\n---\n##S###\nX....Y"))
    explanation = explained(world, axis=TimeAxis(GAMMA, 8))
    assert found(TiedLater, explanation) == [TiedLater(1)]


def test_a_loop_has_no_total():
    explanation = explained(Gridworld(load_map("loop")))
    assert np.isnan(explanation.moment.total("right"))
    world = Gridworld(parse_map("f.S.f"))
    assert {x.action for x in found(worth.NoTotal, explained(world))} == {"left", "right"}


def test_forecast_of_an_explicit_step_gives_the_reward_itself():
    explanation = explained()
    (first,) = found(forecast.FirstStepReward, explanation)
    assert (first.component, first.reward) == (1, pytest.approx(1.0))
    (share,) = found(forecast.ShareBeyond, explanation)
    assert share.share == pytest.approx(GAMMA**4 / (GAMMA + GAMMA**2 + GAMMA**3 + GAMMA**4))
    (centre,) = found(forecast.CentreOfMass, explanation)
    assert centre.step == pytest.approx(
        (GAMMA + 2 * GAMMA**2 + 3 * GAMMA**3) / (GAMMA + GAMMA**2 + GAMMA**3)
    )


def test_what_is_not_defined_is_not_said():
    mixed_signs = explain(moment([[1.0, -1.0, 0.5], [0.0, 0.0, 0.2]]), "a", "b")
    assert not found(forecast.ShareBeyond, mixed_signs)
    assert not found(forecast.CentreOfMass, mixed_signs)
    grouped = explain(moment([[1.0, 2.0, 0.5], [0.0, 0.0, 0.2]], width=3), "a", "b")
    assert not found(forecast.CentreOfMass, grouped)
    assert not found(forecast.FirstStepReward, grouped)  # a group cannot be undiscounted
    assert found(forecast.FirstReward, grouped)
    assert not found(worth.EqualTotals, grouped)  # no totals are known without a model


def test_crossings_are_found_at_their_step():
    explanation = explain(moment([[0.0, 0.0, 3.0, 0.0], [1.0, 0.5, 0.0, 0.0]]), "a", "b")
    (crossing,) = found(leads.Overtakes, explanation)
    assert crossing == leads.Overtakes("a", "b", 2, 3.0, 1.5)
    assert found(leads.MoreImmediate, explanation) == [leads.MoreImmediate("b", "a", 1.5, 0.0, 1)]


def test_costs_are_not_called_rewards():
    explanation = explain(moment([[-1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]), "a", "b")
    assert found(leads.CostsLess, explanation)
    assert not found(leads.MoreImmediate, explanation)
    (first,) = found(forecast.FirstStepReward, explanation)
    assert (first.effect, first.component, first.reward) == ("cost", 0, -1.0)
    assert not found(peaks.Peak, explanation)


def test_a_learned_table_is_explained_like_an_exact_one():
    world = Gridworld(load_map("drone"))
    learned = learn(world.mdp, TimeAxis(GAMMA, 4), agent_steps=200_000, seed=0)
    explanation = explain(moment_of(learned, 0, world.action_names), "down", "up")
    (sooner,) = found(leads.MoreImmediate, explanation)
    assert (sooner.leader, sooner.last_step) == ("down", 3)
    assert sooner.leader_sum == pytest.approx(GAMMA + GAMMA**2 + GAMMA**3, abs=0.02)
    assert not found(worth.EqualTotals, explanation)  # samples tell no undiscounted total
    assert explanation.flips == ()  # and no model can be solved again
    assert check(" ".join(sentences(explanation)), explanation)


def test_uncertainty_is_told_where_there_is_any():
    world = Gridworld(parse_map("T = treasure 4 terminal\nslip: 0.5\n---\n...\nS.T\n..."))
    explanation = explained(world, TimeAxis(0.9, 6), action="right", foil="up")
    (first,) = found(forecast.FirstChance, explanation)
    # two moves to the right in a row succeed with 1/4: then 4 is paid at t+1
    assert (first.effect, first.amount, first.component) == ("reward", 4.0, 1)
    assert first.chance == pytest.approx(0.25)
    assert first.discounted == pytest.approx(0.9)
    assert not found(chances.EitherOr, explanation)  # it would say the same of the same step
    (give,) = found(chances.GiveOrTake, explanation)
    assert 0 < give.deviation < 2
    assert not found(chances.GiveOrTake, explained())  # nothing slips on the drone's map
    over = found(chances.SurelyOver, explained(axis=TimeAxis(GAMMA, 6)))
    assert over == [chances.SurelyOver("down", 5)]


def chancy(outcomes: tuple[dict[float, float], ...], beyond: float = 0.0) -> Moment:
    """A moment of one action whose steps pay so, undiscounted mean times γ^k."""
    axis = TimeAxis(GAMMA, len(outcomes))
    means = [sum(reward * p for reward, p in step.items()) for step in outcomes]
    row = np.append(means, beyond) * axis.discounts
    known = np.zeros((1, len(row)))
    uncertainty = Uncertainty(known, np.ones(1), known + 1.0, (outcomes,))
    parts = RewardDecomposition(row[None], axis)
    future = Future("the optimal policy")
    return Moment(parts, ("a",), future, totals=row[None].sum(-1), uncertainty=uncertainty)


def test_a_chance_is_told_only_of_what_matters():
    small, large = {0.0: 0.95, -0.1: 0.05}, {0.0: 0.5, 0.4: 0.4, 0.8: 0.1}
    trivial = explain(chancy((small, {6.0: 1.0})), "a")
    assert not found(chances.EitherOr, trivial)  # 0.10 beside 6
    assert not found(chances.EitherOr, explain(chancy((small, small), beyond=7.0), "a"))
    risk = explain(chancy((large, {0.0: 0.96, -4.0: 0.04})), "a")
    assert found(chances.EitherOr, risk) == []  # it is the first cost, and told as that
    (first,) = found(forecast.FirstChance, risk)
    assert (first.effect, first.component, first.amount, first.chance) == ("cost", 1, 4.0, 0.04)
    twice = explain(chancy(({0.0: 0.98, -4.0: 0.02}, large, {0.0: 0.9, -4.0: 0.1})), "a")
    assert found(chances.EitherOr, twice) == [chances.EitherOr("a", 2, "costs", 4.0, 0.1)]
    assert "At t+2 a costs 4 with a chance of 10 %, and otherwise nothing." in sentences(twice)


@pytest.mark.parametrize(
    ("a", "b", "kind", "said"),
    [
        ([1, 0, 0, 0], [0, 0, 0, 0.5], leads.MoreImmediate, "by t they are worth 1.00 against 0."),
        (
            [0, 0, 2, 0],
            [0, 0, 0, 1],
            leads.PaysMore,
            "By t+2 a is expected to have paid more than b: worth 2.00 against 0 now.",
        ),
        (
            [2, -0.5, 0, 0],
            [0, 0, 0, 1],
            leads.MoreImmediate,  # it is furthest ahead before the cost
            "by t they are worth 2.00 against 0.",
        ),
        (
            [-0.5, 2, 0, 0],
            [-1, 0, 0, 1],
            leads.PaysMoreNet,
            "By t+1 a is expected to have paid more than b, costs subtracted: worth 1.50 against "
            "-1.00 now.",
        ),
        (
            [-0.5, -0.5, 3, 0],
            [-1, -1, 3, 0],
            leads.CostsLess,
            "By t+1 a is expected to have cost less than b: 1.00 against 2.00 in present worth.",
        ),
    ],
)
def test_a_lead_is_told_in_words_that_are_true_of_it(a, b, kind, said):
    told = explain(moment([[*map(float, a), 0.0], [*map(float, b), 0.0]]), "a", "b")
    assert [type(x) for x in told.contrast if isinstance(x, leads.LEADS)] == [kind]
    assert said in " ".join(sentences(told))


def test_what_makes_up_for_a_lead_is_the_last_word():
    told = explain(moment([[0.0, 0.0, 3.0], [1.0, 1.0, 0.2]]), "a", "b")
    assert [type(x) for x in in_short(told.contrast)] == [
        worth.Better,
        leads.MoreImmediate,
        leads.MakesUp,
    ]
    assert "What comes at t+2…∞ makes up for the lead of b: it is worth 2.80 more after a." in (
        sentences(told)
    )
    ahead = explain(moment([[1.0, 1.0, 0.2], [0.0, 0.0, 1.0]]), "a", "b")
    assert [type(x) for x in in_short(ahead.contrast)] == [worth.Better, leads.MoreImmediate]
    assert in_short(()) == ()


def test_the_centre_is_told_in_steps_where_no_rhythm_is():
    several = explain(moment([[0.0, 1.0, 0.0, 0.0, 0.0, 3.0, 0.0]]), "a")
    (centre,) = found(forecast.CentreOfMass, several)
    assert centre.step == pytest.approx(4.0)  # (1 + 3 · 5) / 4
    assert "come 4.0 steps from now on average." in " ".join(sentences(several))
    assert not found(forecast.CentreOfMass, explain(moment([[0.0, 1.0, 0.05, 0.0]]), "a"))
    regular = explain(moment([[0.0, 1.0, 0.0] * 5]), "a")
    assert found(peaks.Rhythm, regular)
    assert not found(forecast.CentreOfMass, regular)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"action": "dwon"}, "There is no action 'dwon'. Did you mean 'down'?"),
        ({"foil": "sideways"}, "There is no action 'sideways'. Known: down, left, right, up."),
        ({"action": "up", "foil": "up"}, "Action and foil are both 'up'."),
    ],
)
def test_wrong_actions_are_refused(options: dict[str, str], message: str):
    with pytest.raises(InputError, match=message.replace(".", r"\.").replace("?", r"\?")):
        explained(**options)


def judged_moment(rows: list[list[float]], trusted: int, residual: bool, **known: Any) -> Moment:
    told = moment(rows)
    trust = by_hand.trusted(told.time_axis, trusted, residual)
    return replace(told, trust=trust, **known)


def test_a_difference_that_cannot_be_trusted_is_not_discussed():
    rows = [[0.0, 1.0, 0.0, 3.0], [0.5, 0.0, 0.0, 0.0]]  # |differences| 0.5, 1, 0, 3
    told = explain(judged_moment(rows, 3, False), "a", "b")
    assert [type(x) for x in told.contrast] == [worth.Better, contrast.DoubtfulDifference]
    assert told.contrast[1] == contrast.DoubtfulDifference("a", "b", 3.0 / 4.5)
    assert "67 % of what tells a and b apart lies at steps" in " ".join(sentences(told))
    trusted = explain(judged_moment(rows, 3, True), "a", "b")
    assert found(contrast.Reasons, trusted)
    assert not found(contrast.DoubtfulDifference, trusted)
    none = explain(replace(judged_moment(rows, 3, False), trust=None), "a", "b")
    assert none.contrast == trusted.contrast


def test_nothing_is_forecast_that_cannot_be_trusted():
    rows = [[0.0, 0.0, 0.9, 0.0, 2.0, 0.0]]
    assert explain(judged_moment(rows, 0, False), "a").forecast == ()
    near = explain(judged_moment(rows, 2, False), "a").forecast
    assert near == (forecast.NothingBefore("a", 2),)
    kinds = {type(x) for x in explain(judged_moment(rows, 4, False), "a").forecast}
    assert kinds == {forecast.FirstStepReward}  # and no peak at t+4, nor a share beyond t+5
    (whole,) = found(forecast.FirstStepReward, explain(judged_moment(rows, 5, True), "a"))
    assert (whole.component, whole.discounted) == (2, 0.9)


def test_small_components_of_what_was_learned_are_no_first_reward():
    rows = [[0.03, -0.04, 0.03, 1.0, 0.02, 0.5]]
    (first,) = found(forecast.FirstStepReward, explain(moment(rows), "a"))
    assert (first.component, first.effect) == (3, "notable reward")
    exactly = replace(moment(rows), totals=np.array([2.0]))
    firsts = found(forecast.FirstStepReward, explain(exactly, "a"))
    assert [(x.component, x.effect) for x in firsts] == [(0, "reward"), (1, "cost")]


def test_next_to_nothing_is_no_first_cost_and_no_lead():
    rows = [[0.0, 0.0, 0.0, -0.0004, 1.85], [0.0, 0.0, 0.0, 0.0, 1.77]]
    explanation = explain(replace(moment(rows), totals=np.array([2.0, 1.9])), "a", "b")
    assert not found(forecast.FirstStepReward, explanation)
    assert found(forecast.NextToNothing, explanation) == [forecast.NextToNothing("a", 4)]
    assert not found(leads.CostsLess, explanation)
    assert found(worth.Better, explanation)


@pytest.mark.parametrize(
    ("amount", "trusted", "said"),
    [(2.0, 4, 0.4), (0.5, 4, None), (-2.0, 4, None), (None, 4, None), (2.0, 3, None)],
)
def test_an_expected_reward_is_a_chance_only_where_one_reward_or_none_comes(amount, trusted, said):
    rows = [[0.0, 0.0, 0.0, 0.8 * GAMMA**3, 0.0, 0.0]]
    explanation = explain(judged_moment(rows, trusted, False, only_reward=amount), "a")
    chance = [x.chance for x in found(chances.PutAt, explanation)]
    assert chance == ([] if said is None else [pytest.approx(said)])


def test_no_chance_is_read_from_a_group():
    grouped = moment([[0.0, 0.8, 0.0]], width=3)
    trust = by_hand.trusted(grouped.time_axis, 2, residual=True)
    explanation = explain(replace(grouped, trust=trust, only_reward=1.0), "a")
    assert not found(chances.PutAt, explanation)


def test_an_error_is_told_where_it_is_as_large_as_half_of_what_is_expected():
    rows = [[0.0, 0.8, 0.0, 0.0]]
    large = explain(judged_moment(rows, 3, True, error=np.array([0.1, 0.4, 0.1, 0.1])), "a")
    assert found(forecast.OffBy, large) == [forecast.OffBy("a", 1, 0.4)]
    small = explain(judged_moment(rows, 3, True, error=np.array([0.5, 0.39, 0.5, 0.5])), "a")
    assert not found(forecast.OffBy, small)
    unknown = explain(judged_moment(rows, 3, True, error=np.full(4, np.nan)), "a")
    assert not found(forecast.OffBy, unknown)


def test_a_lead_that_may_be_noise_is_not_called_sooner():
    rows = [[0.01, 1.0, 0.0, 0.3, 0.0], [0.03, 0.0, 0.4, 0.0, 0.0]]
    explanation = explain(moment(rows), "a", "b")
    (sooner,) = found(leads.MoreImmediate, explanation)
    assert (sooner.leader, sooner.last_step) == ("a", 1)  # b leads by 0.02 at first
    assert not found(leads.Overtakes, explanation)
    exactly = replace(moment(rows), totals=np.array([2.0, 1.0]))
    assert found(leads.MoreImmediate, explain(exactly, "a", "b"))[0].leader == "b"


def test_a_moment_is_judged_by_a_report():
    world = Gridworld(load_map("bridge"))
    table = exact(world.mdp, TimeAxis(GAMMA, 6))
    play = ModelEnvironments(world.mdp, 40, seed=0, time_limit=60)
    report = judge(table.future, collect(table, play))
    there = judged(gridworld_moment(world, table, 0), report)
    assert there.trust == report.trust
    assert there.error is not None
    known = np.isfinite(there.error)
    assert known.any()
    np.testing.assert_allclose(there.error[known] ** 2, report.calibration.error.value[known])
    reliability = report.calibration.reliability
    assert there.only_reward == (None if reliability is None else reliability.amount)


def test_an_exact_table_of_a_healthy_world_is_told_as_without_a_report():
    agent = gridworld_agent("drone", TimeAxis(GAMMA, 4))
    unjudged = explain_agent(agent, ("forecast", "contrast"), episodes=0).explanation
    judged_too = explain_agent(agent, ("forecast", "contrast"), episodes=40).explanation
    assert unjudged is not None
    assert judged_too is not None
    assert judged_too.moment.trust is not None
    assert judged_too.contrast == unjudged.contrast
    assert judged_too.forecast == unjudged.forecast
