"""Two actions that are tried: what is said of them against exact values and any numbers."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import mutants
from trdlab.agents.agent import Agent, gridworld_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.explanations import moment_at
from trdlab.explanations.assessment import Copying, assess, try_out
from trdlab.explanations.moment.outcome import Trial, TrialClaim, trial_findings
from trdlab.explanations.moment.trials import TEMPLATES, check_trial, trial_sentences
from trdlab.intervals import Estimates
from trdlab.policies import Memoryless
from trdlab.rollouts.counterfactual import Counterfactual
from trdlab.tabular import ExactTable

AXIS = TimeAxis(0.95, 4)
WORDS = {
    "did not pay": "paid",
    "paid": "did not pay",
    "open": "closed",
    "same": "best",
    "in all": "up to t+1",
}


def changed(agent: Agent, action: int, component: int, by: float) -> Agent:
    """Returns an agent that expects more of one action at one component, and acts as before."""
    table = agent.estimator
    assert isinstance(table, ExactTable)
    components = table.decomposition.components.copy()
    components[:, action, component] += by
    return replace(
        agent, estimator=replace(table, decomposition=RewardDecomposition(components, AXIS))
    )


@st.composite
def trials(draw: st.DrawFn) -> Trial:
    """Random trials: of differences that came, that did not, and of which nothing is known."""
    axis = TimeAxis(0.9, draw(st.integers(0, 4)), draw(st.sampled_from([1, 1, 3])))
    size = axis.num_components + 1
    some = st.sampled_from([0.0, 0.5, -0.5, 1.25]) | st.floats(-2.0, 2.0).map(lambda x: round(x, 3))
    value = np.array([draw(some) for _ in range(size)])
    same, hidden = draw(st.booleans()), draw(st.sampled_from([False, False, True]))
    spread = np.array([0.0 if same else draw(st.sampled_from([0.01, 0.8])) for _ in range(size)])
    if hidden:
        value[-1] = np.nan
    low, high = value - spread, value + spread
    if not same and draw(st.booleans()):
        low[0] = high[0] = np.nan
    action, foil = draw(st.sampled_from([(0, 1), (2, 0)]))
    return Trial(
        Counterfactual(
            time_axis=axis,
            action=action,
            foil=foil,
            copies=draw(st.integers(1, 200)),
            whole=draw(st.booleans()),
            predicted=np.array([draw(some) for _ in range(size)]),
            observed=Estimates(value, low, high),
        ),
        ("up", "FIRE", "move left"),
        draw(st.sampled_from([None, 0.02])),
    )


def mutations(sentence: str, trial: Trial) -> list[str]:
    """Returns the sentence with other numbers, other words, and the actions exchanged."""
    return [
        *mutants.numbers(sentence),
        *mutants.words(sentence, WORDS),
        *mutants.exchanged(sentence, trial.action, trial.foil),
    ]


def test_what_came_on_the_ledge_agrees_with_the_exact_values():
    agent = gridworld_agent("ledge", AXIS)
    trial = try_out(agent, "right", "up", copies=2_000)
    assert trial is not None
    assert trial.found.whole
    assert trial.scope == "in all"
    inside = (trial.found.observed.low <= trial.found.predicted) & (
        trial.found.predicted <= trial.found.observed.high
    )
    assert inside.mean() >= 0.8
    told = trial_sentences(trial)
    assert told[0] == "Right and up were each tried 2,000 times from copies of this state."
    assert any(s.startswith("At t+2 right paid more than up, as forecast: by 0.6") for s in told)
    assert any(s.startswith("At t+3 up paid more than right, as forecast: by 0.") for s in told)


def test_without_chance_it_says_so_and_gives_no_interval():
    trial = try_out(gridworld_agent("drone", AXIS), "down", "up", copies=3)
    assert trial is not None
    assert trial_sentences(trial) == [
        "Down and up were each tried 3 times from copies of this state, and what each brought in "
        "all was the same every time.",
        "As forecast, down paid more than up in all: by 0.27, where 0.27 was forecast.",
        "At t+1 down paid more than up, as forecast: by 0.95, where 0.95 was forecast.",
    ]


def test_what_differs_by_rounding_was_not_forecast_to_differ():
    agent = changed(gridworld_agent("drone", AXIS), action=2, component=2, by=1e-16)
    left, right = (moment_at(agent).components(name) for name in ("left", "right"))
    assert 0.0 < left[2] - right[2] < 1e-15
    trial = try_out(agent, "left", "right", copies=3)
    assert trial is not None
    assert not trial.found.predicted.any()
    assert [claim.kind() for claim in trial_findings(trial)] == ["always-the-same"]


def test_without_explicit_components_it_is_not_seen_what_came_of_copies_that_go_on():
    agent = gridworld_agent("drone", TimeAxis(0.95, 0))
    stuck = replace(
        agent, policy=Memoryless(lambda states: np.tile([1.0, 0.0, 0.0, 0.0], (len(states), 1)))
    )
    trial = try_out(stuck, "left", "up", copies=3)
    assert trial is not None
    assert not trial.found.whole
    assert [claim.kind() for claim in trial_findings(trial)] == ["not-seen"]


def test_a_false_promise_is_found_out():
    agent = changed(gridworld_agent("ledge", AXIS), action=0, component=2, by=2.0)
    trial = try_out(agent, "right", "up", copies=100)
    assert trial is not None
    kinds = {claim.kind() for claim in trial_findings(trial)}
    assert "missed-at" in kinds  # what up was to pay at t+2
    text = " ".join(trial_sentences(trial))
    start = "At t+2 up did not pay more than right, against the forecast: up − right was -0.6"
    assert start in text


def test_foils_are_judged_beside_what_the_agent_does():
    agent = gridworld_agent("ledge", AXIS)
    copying = Copying(episodes=60, moments=5, copies=8)
    healthy = assess(agent, episodes=100, copying=copying)
    assert healthy.foil_trust is not None
    assert healthy.foil_trust.components >= 3
    invents = changed(agent, action=2, component=0, by=1.0)  # left, which it never takes
    worse = assess(replace(invents, policy=agent.policy), episodes=100, copying=copying)
    assert worse.trust.components == healthy.trust.components
    assert worse.foil_trust is not None
    assert worse.foil_trust.components == 0


@settings(max_examples=300, deadline=None, derandomize=True)
@given(trials())
def test_every_sentence_is_supported_and_no_mutation_is(trial: Trial):
    findings, told = trial_findings(trial), trial_sentences(trial)
    assert all(finding.holds(trial) for finding in findings)
    claims = check_trial(" ".join(told), trial)
    assert [type(claim) for claim in claims] == [type(finding) for finding in findings]
    found = (mutant for sentence in told for mutant in mutations(sentence, trial))
    assert mutants.survivors(found, lambda text: check_trial(text, trial)) == []


def test_every_kind_occurs_and_has_a_sentence():
    seen: set[type[TrialClaim]] = set()

    @settings(max_examples=500, deadline=None, derandomize=True)
    @given(trials())
    def look(trial: Trial) -> None:
        seen.update(map(type, trial_findings(trial)))

    look()
    assert seen == set(TEMPLATES) == set(TrialClaim.kinds.values())
