"""No sentence without its numbers: what is printed is read back and tested."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mutants
from by_hand import trusted
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future
from trdlab.explanations.claims import Finding
from trdlab.explanations.moment.contrast import in_short
from trdlab.explanations.moment.exact import gridworld_moment, tabular_moment
from trdlab.explanations.moment.explanation import Explanation, explain
from trdlab.explanations.moment.leads import LEADS, MakesUp, Overtakes
from trdlab.explanations.moment.moment import Moment, Uncertainty, WhatIf
from trdlab.explanations.moment.sentences import (
    TEMPLATES,
    UnsupportedSentenceError,
    check,
    sentences,
)
from trdlab.gridworld import Gridworld, load_map, map_names, parse_map
from trdlab.study.candidates import solved
from trdlab.tabular import exact

NAMES = ("up", "down", "FIRE", "move left")
SYMMETRIC = ("have the same components", "are both worth", "tie: their values", "of what tells")
WORDS = {
    "more": "fewer",
    "never": "always",
    "first": "last",
    "better": "worse",
    "largest": "smallest",
    "Both": "Neither",
    "Without": "With",
    "overtakes": "falls behind",
    "makes up": "does not make up",
    ", costs subtracted": "",
    "paid more": "cost more",
    "less": "more",
    "Nothing": "Everything",
    "nothing": "much",
    "equal": "different",
    "All": "None",
    "flips": "stays",
    "No value": "Any value",
    "not": "too",
    "more likely": "less likely",
    "otherwise": "also",
    "pays": "costs",
    "costs": "pays",
    "first reward": "first notable reward",
    "notable reward": "reward",
    "notable cost": "notable reward",
    "reward expected": "cost expected",
    "peaks": "dips",
    "before": "after",
    "Before": "After",
    "peaks every": "peaks about every",
    "rewards expected": "costs expected",
    "uncertain": "certain",
    "off by": "right to",
    "have not proved": "have proved",
}


@st.composite
def chancy(draw: st.DrawFn, axis: TimeAxis, rows: list[list[float]], size: float) -> Uncertainty:
    """What is uncertain about random actions; `rows` are made to expect what their steps pay."""
    outcomes: list[tuple[dict[float, float], ...]] = []
    for row in rows:
        steps: list[dict[float, float]] = []
        for k in range(axis.horizon if axis.width == 1 else 0):
            chance = draw(st.sampled_from([0.04, 0.1, 0.5]))
            paid = size * draw(st.sampled_from([0.1, 1.0, 4.0, -0.1, -4.0]))
            other = {2.0 * size: 0.2} if draw(st.booleans()) else {}
            step = {0.0: 1.0 - chance - sum(other.values()), paid: chance} | other
            steps.append(step if draw(st.booleans()) else {0.0: 1.0})
            row[k] = sum(r * p for r, p in steps[-1].items()) * axis.discounts[k]
        row[-1] *= draw(st.sampled_from([0.0, 1.0, 1.0, 1e4]))
        outcomes.append(tuple(steps))
    shape = (len(rows), axis.num_components)
    survival = draw(st.sampled_from([1.0, 0.9, 0.6])) ** np.arange(shape[1])
    survival[draw(st.integers(1, 12)) :] = 0.0
    deviation = size * draw(st.sampled_from([0.0, 0.001, 0.7]))
    return Uncertainty(
        deviation=np.full(shape, deviation),
        return_deviation=np.full(shape[0], deviation),
        survival=np.broadcast_to(survival, shape),
        outcomes=tuple(outcomes) if axis.width == 1 else (),
    )


@st.composite
def moments(draw: st.DrawFn) -> Moment:
    """Random moments: repeated, zero and negative components, missing totals, ties, what-ifs."""
    horizon = draw(st.sampled_from([0, 1, 2, 3, 4, 5, 5, 9]))
    actions = draw(st.integers(2, 4))
    gamma = draw(st.sampled_from([0.0, 0.3, 0.95, 0.999]))
    axis = TimeAxis(gamma, horizon, draw(st.sampled_from([1, 1, 2, 5])))
    size = draw(st.sampled_from([1e-6, 0.01, 1.0, 1.0, 1.0, 1e5]))
    entry = st.sampled_from([0.0, 0.0, 0.5, 1.0, -1.0]) | st.floats(-3, 3).map(
        lambda x: round(x, 4)
    )
    rows = [[draw(entry) * size for _ in range(horizon + 1)] for _ in range(actions)]
    if draw(st.booleans()):
        rows[1] = list(rows[0])
    known = draw(chancy(axis, rows, size)) if gamma >= 0.3 and draw(st.booleans()) else None
    decomposition = RewardDecomposition(np.array(rows), axis)
    total = st.sampled_from([0.0, 4.0, 4.0, 4.001, np.nan])
    totals = np.array([draw(total) for _ in rows]) if draw(st.booleans()) else None
    slope = size * draw(st.sampled_from([0.0, 0.1, 1.0, 5.0, -1.0, -5.0]))

    def q_values(value: float) -> np.ndarray:
        return decomposition.value + slope * (value - 0.95) * np.arange(actions)

    components = draw(st.integers(0, horizon))
    trust = trusted(axis, components, draw(st.booleans()))
    foil_trust = trusted(axis, max(0, components - 1), draw(st.booleans()))
    off_by = [0.01, 0.2, 0.3, 0.5, 0.7, 2.0, 4.0, 9.0, np.nan, np.nan]
    errors = draw(st.permutations(off_by))[: horizon + 1]
    return Moment(
        decomposition,
        NAMES[:actions],
        Future(draw(st.sampled_from(["the optimal policy", "the given policy"]))),
        totals=totals,
        uncertainty=known,
        tied=draw(st.sampled_from([(), NAMES[:2]])),
        tied_later=draw(st.integers(0, 2)),
        what_ifs=(WhatIf("γ", 0.95, 0.01, 0.99, q_values),),
        trust=draw(st.sampled_from([None, trust])),
        error=draw(st.sampled_from([None, size * np.array(errors)])),
        policy=draw(st.sampled_from([None, np.eye(actions)[0]])),
        foil_trust=draw(st.sampled_from([None, foil_trust])),
        foil_error=draw(st.sampled_from([None, 2.0 * size * np.array(errors)])),
        only_reward=draw(st.sampled_from([None, 4.0 * size, -4.0 * size])),
    )


@pytest.fixture(scope="module")
def of_maps() -> list[Explanation]:
    axes = (TimeAxis(0.95, 2, 2), TimeAxis(0.95, 4), TimeAxis(0.7, 0), TimeAxis(0.95, 40))
    result = []
    for name in map_names():
        world = Gridworld(load_map(name))
        for axis in axes:
            table = exact(world.mdp, axis)
            states = range(0, world.mdp.num_states, 4) if name != "corridor" else (0,)
            result += [explain(gridworld_moment(world, table, state)) for state in states]
    pebble = Gridworld(parse_map("p = coin 0.001\nT = treasure 100 terminal\n---\nS.p.....T"))
    result.append(explain(gridworld_moment(pebble, exact(pebble.mdp, TimeAxis(0.95, 4)), 0)))
    world, table = solved("C")  # who may slip into what costs much
    for state in range(0, world.mdp.num_states, 5):
        result.append(explain(tabular_moment(table, state, world.action_names)))
    return result


@pytest.fixture(scope="module")
def of_learned() -> list[Explanation]:
    """Forecasts as networks make them: bumps, noise, a slope, some of it not to be trusted."""
    steps, rng, result = np.arange(41), np.random.default_rng(0), []
    for places in ((8,), (3, 11, 19, 27), (4, 9, 22), (2, 6, 13, 17, 30)):
        for size, slope in ((1.0, 0.0), (-2.0, 0.0), (0.5, 0.3)):
            axis = TimeAxis(0.95, 40)
            bumps = sum(np.exp(-((steps - place) ** 2) / 4.0) for place in places)
            row = size * bumps + slope * (1.0 - steps / 40) + rng.normal(0.0, 0.02, 41)
            rows = np.stack([row, np.roll(row, 2)]) * axis.discounts
            trust = trusted(axis, 36)
            told = Moment(
                RewardDecomposition(rows, axis),
                NAMES[:2],
                Future("the greedy policy"),
                trust=trust,
                error=rng.uniform(0.2, 0.5, 41) * axis.discounts,
                only_reward=2.2 * size,
                seconds_per_step=0.1,
            )
            result.append(explain(told, *NAMES[:2]))
            near = replace(told, trust=trusted(axis, 1))
            result.append(explain(near, *NAMES[:2]))
    return result


def test_every_sentence_about_every_map_is_supported(
    of_maps: list[Explanation], of_learned: list[Explanation]
):
    for explanation in of_maps + of_learned:
        claims = check(" ".join(sentences(explanation)), explanation)
        assert [type(c) for c in claims] == [type(x) for x in explanation.findings]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(moments())
def test_every_sentence_about_any_moment_is_supported(moment: Moment):
    explanation = explain(moment, *moment.action_names[:2])
    assert all(finding.holds(moment) for finding in explanation.findings)
    claims = check(" ".join(sentences(explanation)), explanation)
    assert [type(c) for c in claims] == [type(x) for x in explanation.findings]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(moments())
def test_a_lead_of_the_worse_action_is_never_the_last_word(moment: Moment):
    told = explain(moment, *moment.action_names[:2]).contrast
    for found in (told, in_short(told)):
        for lead, following in zip(found, (*found[1:], None), strict=True):
            if isinstance(lead, LEADS) and moment.q_value(lead.leader) < moment.q_value(lead.other):
                assert isinstance(following, Overtakes | MakesUp)
                assert following.leader == lead.other


def test_every_kind_of_finding_occurs_and_has_a_sentence(
    of_maps: list[Explanation], of_learned: list[Explanation]
):
    seen: set[type[Finding]] = {type(x) for e in of_maps + of_learned for x in e.findings}

    @settings(max_examples=400, deadline=None, derandomize=True)
    @given(moments())
    def collect(moment: Moment) -> None:
        seen.update(map(type, explain(moment, *moment.action_names[:2]).findings))

    collect()
    assert set(TEMPLATES) == set(Finding.kinds.values()), "each kind has a sentence"
    assert seen == set(TEMPLATES), f"never found: {set(TEMPLATES) - seen}"


def mutated_names(sentence: str, names: tuple[str, ...]) -> list[str]:
    """Returns the sentence with the actions exchanged, and with one that does not exist."""
    a, b = names[:2]
    pattern = re.compile(rf"\b(?:{a}|{b})\b", re.IGNORECASE)
    if not pattern.search(sentence):
        return []
    result = [pattern.sub("sideways", sentence, count=1)]
    both = {name.lower() for name in pattern.findall(sentence)} == {a, b}
    if both and not any(words in sentence for words in SYMMETRIC):
        result += mutants.exchanged(sentence, a, b)
    return result


def mutations(explanation: Explanation) -> list[str]:
    names = explanation.moment.action_names
    return [
        mutant
        for text in sentences(explanation)
        for mutant in [
            *mutants.numbers(text),
            *mutated_names(text, names),
            *mutants.words(text, WORDS),
        ]
    ]


def survivors(explanation: Explanation) -> list[str]:
    return mutants.survivors(mutations(explanation), lambda text: check(text, explanation))


def test_a_mutated_number_name_or_claim_about_a_map_fails(of_maps: list[Explanation]):
    assert sum(len(mutations(explanation)) for explanation in of_maps) > 2_000
    assert [mutant for explanation in of_maps for mutant in survivors(explanation)] == []


def test_a_mutated_number_name_or_claim_about_a_learned_forecast_fails(
    of_learned: list[Explanation],
):
    assert sum(len(mutations(explanation)) for explanation in of_learned) > 1_000
    assert [mutant for explanation in of_learned for mutant in survivors(explanation)] == []


@settings(max_examples=150, deadline=None, derandomize=True)
@given(moments())
def test_a_mutated_number_name_or_claim_about_any_moment_fails(moment: Moment):
    assert survivors(explain(moment, *moment.action_names[:2])) == []


def test_a_sentence_of_no_known_kind_fails(of_maps: list[Explanation]):
    explanation = of_maps[0]
    with pytest.raises(UnsupportedSentenceError, match="no statement about"):
        check("Down is clearly the wise choice.", explanation)


def test_a_wrong_number_is_named(of_maps: list[Explanation]):
    explanation = of_maps[0]
    with pytest.raises(UnsupportedSentenceError, match=r"pay 5 in total\.' is not true"):
        check("Both routes pay 5 in total.", explanation)
