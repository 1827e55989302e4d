"""Two actions that are tried: what is said of them against exact values and any numbers."""

import re
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import mutants
from by_hand import try_out
from trdlab.agents import Agent, gridworld_agent, tabular_agent
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.explanations import moment_at
from trdlab.explanations.assessment import Effort, assess
from trdlab.explanations.moment.outcome import TRIALS, Trial, in_brief, sections
from trdlab.explanations.rules import Claim, check
from trdlab.policies import Memoryless
from trdlab.rollouts.counterfactual import Counterfactual
from trdlab.statistics import Estimates
from trdlab.tabular import ExactTable

AXIS = TimeAxis(0.95, 4)
WORDS = {
    "more": "less",
    "less": "more",
    "As": "Against the",
    "too few": "enough",
    "too close": "too far apart",
    "same": "best",
    "that step alone": "the end",
    "these steps alone": "the end",
    "but cut off": "and played on",
    "worth": "in debt",
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


def told(trial: Trial | None) -> tuple[Claim, ...]:
    assert trial is not None
    (section,) = sections(trial)
    return section.claims


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
    predicted = np.array([draw(some) for _ in range(size)])
    if draw(st.booleans()):
        predicted = np.where(predicted, value, 0.0)  # all as forecast
    if draw(st.booleans()):
        predicted *= 1e-4
    action, foil = draw(st.sampled_from([(0, 1), (2, 0)]))
    return Trial(
        Counterfactual(
            time_axis=axis,
            action=action,
            foil=foil,
            copies=draw(st.integers(1, 200)),
            whole=draw(st.booleans()),
            predicted=np.nan_to_num(predicted),
            observed=Estimates(value, value - spread, value + spread),
            same_every_time=same,
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
    trial = try_out(gridworld_agent("ledge", AXIS), "right", "up", copies=500)
    assert trial is not None
    assert trial.found.whole
    found = trial.found
    inside = (found.observed.low <= found.predicted) & (found.predicted <= found.observed.high)
    assert inside.all()
    in_all, now, later, often = (claim.sentence for claim in told(trial))
    assert in_all.startswith(
        "500 tries of each are too few to tell whether right is worth more than up; about "
    )
    assert now.startswith("When tried, 2 steps later, right gained 0.6")
    assert now.endswith("more than up in that step alone; the forecast, 0.658, fits.")
    assert later.startswith("When tried, 3 steps later, up gained 0.")
    assert later.endswith("more than right in that step alone; the forecast, 0.5, fits.")
    assert often == "Right and up were each tried 500 times from here."


def test_without_chance_it_says_so_and_gives_no_interval():
    trial = try_out(gridworld_agent("drone", AXIS), "down", "up", copies=3)
    assert [claim.sentence for claim in told(trial)] == [
        "As forecast, down was worth 0.266 more than up.",
        "As forecast, 1 step later, down gained 0.95 more than up in that step alone.",
        "Down and up were each tried 3 times from here; each gave the same result every time.",
    ]


def test_what_is_too_rare_to_be_seen_is_no_verdict():
    agent = tabular_agent("FrozenLake-v1", TimeAxis(0.95, 8))
    report = assess(agent, episodes=100, effort=agent.effort)
    for seed in range(6):
        trial = try_out(agent, "left", "down", seed=seed, report=report)
        assert {claim.kind for claim in in_brief(trial)} == {"too-few-tries"}  # type: ignore[arg-type]
        (claim,) = in_brief(trial)  # type: ignore[arg-type]
        assert claim.enough > 50
        assert claim.came.low <= claim.said <= claim.came.high


def test_what_differs_by_rounding_was_not_forecast_to_differ():
    agent = changed(gridworld_agent("drone", AXIS), action=2, component=2, by=1e-16)
    left, right = (moment_at(agent).components(name) for name in ("left", "right"))
    assert 0.0 < left[2] - right[2] < 1e-15
    trial = try_out(agent, "left", "right", copies=3)
    assert trial is not None
    assert not trial.found.predicted.any()
    assert [claim.kind for claim in told(trial)] == ["tried"]


def test_without_explicit_components_it_is_not_seen_what_came_of_copies_that_go_on():
    agent = gridworld_agent("drone", TimeAxis(0.95, 0))
    stuck = replace(
        agent, policy=Memoryless(lambda states: np.tile([1.0, 0.0, 0.0, 0.0], (len(states), 1)))
    )
    trial = try_out(stuck, "left", "up", copies=3)
    assert trial is not None
    assert not trial.found.whole
    assert [claim.sentence for claim in told(trial)] == [
        "Left and up were each tried 3 times from here, but cut off before anything could come."
    ]


def test_a_false_promise_is_found_out():
    agent = changed(gridworld_agent("ledge", AXIS), action=0, component=2, by=2.0)
    trial = try_out(agent, "right", "up", copies=100)
    false = next(claim for claim in told(trial) if claim.kind == "against-the-forecast")
    assert (false.more, false.less, false.component) == ("up", "right", 2)
    assert false.sentence.startswith(
        "The forecast was wrong: up was to be 1.34 ahead, but 2 steps later, right gained 0.6"
    )
    assert false.sentence.endswith(" more in that step alone.")


def test_less_than_was_promised_is_found_out_too():
    agent = changed(gridworld_agent("ledge", AXIS), action=3, component=2, by=2.0)
    trial = try_out(agent, "right", "up", copies=100)
    (claim,) = (claim for claim in told(trial) if claim.kind == "by-another-amount")
    assert claim.sentence.endswith(
        "more than up in that step alone, less than the 2.66 that was forecast."
    )


def test_foils_are_judged_beside_what_the_agent_does():
    agent = gridworld_agent("ledge", AXIS)
    effort = Effort(episodes=60, moments=5, copies=8)
    healthy = assess(agent, episodes=100, effort=effort)
    assert healthy.foils is not None
    assert healthy.foils.trust.components >= 3
    invents = changed(agent, action=2, component=0, by=1.0)  # left, which it never takes
    worse = assess(replace(invents, policy=agent.policy), episodes=100, effort=effort)
    assert worse.trust.components == healthy.trust.components
    assert worse.foils is not None
    assert worse.foils.trust.components == 0


@settings(max_examples=300, deadline=None, derandomize=True)
@given(trials())
def test_every_sentence_is_supported_and_no_mutation_is(trial: Trial):
    claims = told(trial)
    read = check(" ".join(claim.sentence for claim in claims), [(TRIALS, trial)])
    assert [claim.kind for claim in read] == [claim.kind for claim in claims]
    shown = (re.sub(r" \([^)]*\)", "", claim.sentence) for claim in claims)  # without brackets
    assert all(len(sentence.split()) <= 25 for sentence in shown)
    found = (mutant for claim in claims for mutant in mutations(claim.sentence, trial))
    assert mutants.survivors(found, lambda text: check(text, [(TRIALS, trial)])) == []


def test_every_kind_occurs():
    seen: set[str] = set()

    @settings(max_examples=500, deadline=None, derandomize=True)
    @given(trials())
    def look(trial: Trial) -> None:
        seen.update(claim.kind for claim in told(trial))

    look()
    assert seen == set(TRIALS.rules)
