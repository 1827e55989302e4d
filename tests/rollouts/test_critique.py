"""Critics that are right, or wrong in a known way, beside the exact table of their policy."""

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import trdlab
from by_hand import Given, episode
from trdlab.decomposition import TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.calibration import claims, critic
from trdlab.explanations.calibration.faults import REPORTS
from trdlab.explanations.calibration.report import CalibrationReport, judge
from trdlab.explanations.rules import check
from trdlab.gridworld import Gridworld, load_map
from trdlab.policies import Likeliest, Memoryless
from trdlab.rollouts.critique import Critique, critique_of
from trdlab.rollouts.episodes import collect
from trdlab.tabular import ExactTable, ModelEnvironments, exact

AXIS, SEEDS = TimeAxis(0.95, 40), range(5)
MDP = Gridworld(load_map("bridge").with_slip(0.2)).mdp
POLICY = 0.6 * exact(MDP, AXIS).solution.policy + 0.4 / MDP.num_actions


@dataclass
class Critical:
    """The policy, with a critic that says how much each state is worth."""

    worth: np.ndarray

    def act(self, observations: Any, state: Any, begins: np.ndarray) -> tuple[np.ndarray, Any]:
        return POLICY[observations], None

    def state_values(
        self, observations: Any, state: Any, begins: np.ndarray, likely: np.ndarray
    ) -> tuple[np.ndarray, Any]:
        return self.worth[observations], None


@cache
def table(gamma: float = AXIS.gamma) -> ExactTable:
    return exact(MDP, TimeAxis(gamma, AXIS.horizon), policy=POLICY)


def components(gamma: float = AXIS.gamma) -> np.ndarray:
    """Returns `[S, N+1]`, v^TRD."""
    return table(gamma).decomposition.under(POLICY).components


def values(gamma: float = AXIS.gamma) -> np.ndarray:
    return components(gamma).sum(axis=1)


def report(worth: np.ndarray, seed: int, told: Any = None, **how: Any) -> CalibrationReport:
    play = ModelEnvironments(MDP, 100, seed=seed, **how)
    played = collect(told or table(), play, policy=Critical(worth), seed=seed)
    found = judge(Future("the policy"), played, seed=seed)
    for claim in critic.claims(found):
        assert check(claim.sentence, [(REPORTS, found)])
    return found


def critique(of: CalibrationReport) -> Critique:
    assert of.critique is not None
    return of.critique


def kinds(of: CalibrationReport, whose: str = critic.CRITIC) -> list[str]:
    return [claim.kind for claim in critic.claims(of) if claim.fields.get("whose", whose) == whose]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_critic_that_is_right_is_told_to_be(seed):
    found = report(values(), seed)
    assert kinds(found) == ["value-right"]
    assert critic.wrong(found) == []
    assert critique(found).gap.value == pytest.approx([0.0, 0.0], abs=1e-9)
    assert critique(found).correlation == pytest.approx(1.0)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("by", [1.0, -1.0])
def test_what_is_missing_everywhere_is_found(seed, by):
    found = report(values() + by, seed)
    reached = ["critic-reached"] * (by < 0)
    assert kinds(found) == ["value-off", "critic-sum", *reached, "critic-against"]
    for claim in (of for of in critic.claims(found) if of.kind == "critic-reached"):
        assert claim.sentence.startswith("On average, as much as its own critic says in all is")
        assert 0 < claim.span[1] < AXIS.horizon
    assert kinds(found, critic.FORECASTS)[0] == "value-right"
    assert critique(found).repair[0] == pytest.approx(-by)
    (claim,) = critic.wrong(found)
    assert claims.in_brief(found)[-1].sentence == claim.sentence
    (mended,) = (claim for claim in critic.claims(found) if claim.kind == "critic-sum")
    more = "less" if by > 0 else "more"
    assert mended.sentence == (
        f"With 1 {more} in every state, its own critic would be about right."
    )


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("gamma", [0.8, 0.99])
def test_another_discount_factor_is_found(seed, gamma):
    found = report(values(gamma), seed)
    assert {"value-off", "critic-discount"} <= set(kinds(found))
    assert critique(found).repair[2] == pytest.approx(gamma, abs=0.005)
    played = collect(
        table(), ModelEnvironments(MDP, 100, seed=seed), policy=Critical(values(gamma))
    )
    said = replace(found, critique=critique_of(played, gamma))
    assert kinds(said)[0] == "critic-gamma"
    assert kinds(said)[1] in ("value-right", "value-open")  # what comes later varies more
    assert critic.wrong(said) == []


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("unit", [0.05, 0.5, 20.0])
def test_another_unit_is_found_and_undone(seed, unit):
    found = report(unit * values(), seed)
    assert kinds(found) == ["critic-unit", "value-right"]
    assert critique(found).factor == pytest.approx(unit)
    assert critique(found).said[0] == pytest.approx(critique(found).said[1])


@pytest.mark.parametrize("seed", SEEDS)
def test_what_a_critic_counts_less_is_told_by_when_it_comes(seed):
    split = critique(report(values(), seed)).split
    worth = components()[:, :split].sum(axis=1) + 0.4 * components()[:, split:].sum(axis=1)
    found = report(worth, seed)
    (claim,) = (claim for claim in critic.claims(found) if claim.kind == "critic-when")
    assert (claim.one, claim.other) == (pytest.approx(1.0), pytest.approx(0.4))
    assert claim.sentence == (
        f"For each 1 that comes in the first {split} steps its own critic counts 1, for each 1 "
        f"after the first {split} steps 0.4."
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_where_it_says_most_or_least_it_can_be_wrong(seed):
    high = values() > np.quantile(values(), 0.8)
    found = report(values() + 3.0 * high, seed)
    told = {claim.most for claim in critic.claims(found) if claim.kind == "critic-where"}
    assert told == {"most"}


@pytest.mark.parametrize("seed", SEEDS)
def test_if_the_forecasts_are_wrong_the_critic_is_not_blamed(seed):
    wrong = 1.5 * table().decomposition.components
    found = report(values(), seed, Given(wrong, AXIS, Future("the policy")))
    assert kinds(found)[0] == "value-right"
    assert kinds(found, critic.FORECASTS)[0] == "value-off"
    assert critic.wrong(found) == []


def test_where_a_limit_hides_what_came_nothing_is_tested():
    for limit, kind in ((20, "value-untested"), (66, "value-open")):
        found = report(values(), 0, time_limit=limit)
        assert found.judged.truncated
        assert kinds(found)[0] == kind
    played = collect(table(), ModelEnvironments(MDP, 20, seed=0), policy=Critical(values()),
                     epsilon=0.1)  # fmt: skip
    assert np.isnan(critique_of(played).came).all()
    assert critique_of([episode([1.0], AXIS)]) is None


class Aging:
    """Remembers its age, and says it of itself."""

    def act(self, observations: Any, state: Any, begins: np.ndarray) -> tuple[np.ndarray, Any]:
        return POLICY[observations], None

    def state_values(
        self, observations: Any, state: Any, begins: np.ndarray, likely: np.ndarray
    ) -> tuple[np.ndarray, Any]:
        np.testing.assert_allclose(likely.sum(axis=1), 1.0)
        age = np.zeros(len(observations)) if state is None else state["age"]
        age = np.where(begins, 0.0, age)
        return age, {"age": age + 1.0}


def test_a_critic_remembers_along_its_episode():
    for policy in (Aging(), Likeliest(Aging())):
        play = ModelEnvironments(MDP, 30, seed=0, time_limit=30)
        for played in collect(table(), play, policy=policy):
            assert played.critic.tolist() == list(range(len(played)))
    play = ModelEnvironments(MDP, 3, seed=0, time_limit=30)
    assert [of.critic for of in collect(table(), play)] == [None] * 3


def test_what_an_agent_expects_before_it_chooses_is_the_mean_over_its_actions():
    agent = trdlab.agent(table(), policy=Memoryless(lambda states: POLICY[states]))
    told = agent.state_value(np.arange(MDP.num_states))
    np.testing.assert_allclose(told.components, components())
    assert told.time_axis == AXIS
