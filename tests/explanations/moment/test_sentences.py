"""No sentence without its numbers: what is printed is read back, and what is changed is refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mutants
from definitions import holds
from moments import calibrated, told, trusted
from trdlab.decomposition import RewardDecomposition, TimeAxis
from trdlab.estimator import Future, Outlook
from trdlab.explanations.calibration.calibration import Calibration
from trdlab.explanations.moment.exact import gridworld_moment, tabular_moment
from trdlab.explanations.moment.moment import CHOICES, Choice, Moment, Uncertainty, WhatIf
from trdlab.explanations.moment.telling import in_brief
from trdlab.explanations.rules import Claim, UnsupportedSentenceError, check
from trdlab.gridworld import Gridworld, load_map, map_names, parse_map
from trdlab.tabular import exact

NAMES = ("up", "down", "FIRE", "move left")
PARTS = ("coin", "hazard", "fuel", "life lost", "step", "shaping")
SYMMETRIC = (
    "lead to the same",
    "are worth the same",
    "are equally good",
    "difference between",
    "hardly differ",
)
WORDS = {
    "more": "fewer",
    "never": "always",
    "first": "last",
    "better": "worse",
    "largest": "smallest",
    "Both": "Neither",
    "overtakes": "falls behind",
    "decides": "does not decide",
    ", costs and rewards together,": "",
    "less": "more",
    "Nothing": "Everything",
    "nothing": "much",
    "equally": "hardly",
    "same": "least",
    "All": "None",
    "No searched": "Any searched",
    "pays": "costs",
    "costs": "pays",
    "paid": "cost",
    "reward": "clear reward",
    "clear reward": "reward",
    "clear cost": "clear reward",
    "peaks": "dips",
    "within": "after",
    "Within": "After",
    ", on average": "",
    "on average": "surely",
    "can come": "comes",
    "is expected": "comes",
    "uncertain": "certain",
    "off by": "right to",
    "above": "below",
    "below": "above",
    "between": "outside",
    "ends in": "still runs after",
    "still runs after": "ends in",
    "or more": "or less",
    "or less": "or more",
    "adds up to": "comes",
    "comes": "adds up to",
    " times": "",
    " (discounted)": "",
    "likeliest": "least likely",
    "others": "more others",
    "hardly": "clearly",
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
def outlooks(draw: st.DrawFn, axis: TimeAxis, rows: np.ndarray, size: float) -> Outlook:
    """What else was learned: parts of `rows [A, N+1]`, events, amounts, and their reach."""
    shape, horizon = rows.shape, axis.horizon
    cells = st.sampled_from([0.0, 0.0, 0.02, 0.3, 0.9, -0.5, 1.0])

    def array(columns: int) -> np.ndarray:
        length = shape[0] * columns
        drawn = draw(st.lists(cells, min_size=length, max_size=length))
        return np.array(drawn, dtype=np.float64).reshape(shape[0], columns)

    names = PARTS[: draw(st.sampled_from([0, 1, 2, 6]))]
    parts = {name: size * array(horizon + 1) for name in names[1:]}
    parts |= {name: rows - sum(parts.values()) for name in names[:1]}
    events = {name: array(horizon).clip(min=0.0) for name in ("crash", "life lost")}
    amounts = {"fuel": size * array(horizon + 1)}
    reach = {name: draw(st.integers(0, horizon)) for name in (*parts, *events, *amounts)}
    survival = draw(st.sampled_from([1.0, 0.99, 0.7])) ** np.arange(horizon + 1)
    return Outlook(
        variance=np.zeros((shape[0], horizon)),
        survival=np.broadcast_to(survival, shape),
        chances={},
        parts=parts,
        events=events,
        amounts=amounts,
        survival_reach=draw(st.integers(0, horizon)),
        reach=reach,
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
    learned = draw(st.none() | outlooks(axis, decomposition.components, size))
    total = st.sampled_from([0.0, 4.0, 4.0, 4.001, np.nan])
    totals = np.array([draw(total) for _ in rows]) if draw(st.booleans()) else None
    slope = size * draw(st.sampled_from([0.0, 0.1, 1.0, 5.0, -1.0, -5.0]))

    def q_values(value: float) -> np.ndarray:
        return decomposition.value + slope * (value - 0.95) * np.arange(actions)

    components = draw(st.integers(0, horizon))
    off_by = [0.01, 0.2, 0.3, 0.5, 0.7, 2.0, 4.0, 9.0, np.nan, np.nan]
    errors = size * np.array(draw(st.permutations(off_by))[: horizon + 1])
    amount = draw(st.sampled_from([None, 4.0 * size, -4.0 * size]))
    own = trusted(axis, components, draw(st.booleans()), off_by=errors, only_reward=amount)
    untested = tuple(draw(st.sampled_from(["good", "open", "not tested"])) for _ in rows[0])
    foils = calibrated(axis, untested, 2.0 * errors)
    return Moment(
        decomposition,
        NAMES[:actions],
        Future(draw(st.sampled_from(["the optimal policy", "the given policy"]))),
        totals=totals,
        uncertainty=known,
        outlook=learned,
        tied=draw(st.sampled_from([(), NAMES[:2]])),
        tied_later=draw(st.integers(0, 2)),
        what_ifs=(WhatIf("γ", 0.95, 0.01, 0.99, q_values),),
        policy=draw(st.sampled_from([None, np.eye(actions)[0]])),
        calibration=draw(st.sampled_from([None, own])),
        foils=draw(st.sampled_from([None, foils])),
    )


@pytest.fixture(scope="module")
def of_maps() -> list[Choice]:
    axes = (TimeAxis(0.95, 2, 2), TimeAxis(0.95, 4), TimeAxis(0.7, 0), TimeAxis(0.95, 40))
    result = []
    for name in map_names():
        world = Gridworld(load_map(name))
        for axis in axes:
            table = exact(world.mdp, axis)
            states = range(0, world.mdp.num_states, 4) if name != "corridor" else (0,)
            result += [gridworld_moment(world, table, state).choice() for state in states]
    pebble = Gridworld(parse_map("p = coin 0.001\nT = treasure 100 terminal\n---\nS.p.....T"))
    result.append(gridworld_moment(pebble, exact(pebble.mdp, TimeAxis(0.95, 4)), 0).choice())
    slippery = Gridworld(load_map("bridge").with_slip(0.4))
    table = exact(slippery.mdp, TimeAxis(0.9, 5))
    for state in range(0, slippery.mdp.num_states, 5):
        result.append(tabular_moment(table, state, slippery.action_names).choice())
    return result


@pytest.fixture(scope="module")
def of_learned() -> list[Choice]:
    """Forecasts as networks make them: bumps, noise, a slope, some of it not to be trusted."""
    steps, rng, result = np.arange(41), np.random.default_rng(0), []
    for places in ((8,), (3, 11, 19, 27), (4, 9, 22), (2, 6, 13, 17, 30)):
        for size, slope in ((1.0, 0.0), (-2.0, 0.0), (0.5, 0.3)):
            axis = TimeAxis(0.95, 40)
            bumps = sum(np.exp(-((steps - place) ** 2) / 4.0) for place in places)
            row = size * bumps + slope * (1.0 - steps / 40) + rng.normal(0.0, 0.02, 41)
            rows = np.stack([row, np.roll(row, 2)]) * axis.discounts
            off_by = rng.uniform(0.2, 0.5, 41) * axis.discounts
            far, near = (
                trusted(axis, good, off_by=off_by, only_reward=2.2 * size) for good in (36, 1)
            )
            of = Moment(
                RewardDecomposition(rows, axis),
                NAMES[:2],
                Future("the greedy policy"),
                calibration=far,
                seconds_per_step=0.1,
            )
            result += [of.choice(*NAMES[:2]), replace(of, calibration=near).choice(*NAMES[:2])]
    return result


def read_back(choice: Choice) -> None:
    claims = told(choice)
    found = check(" ".join(claim.sentence for claim in claims), [(CHOICES, choice)])
    assert [claim.sentence for claim in found] == [claim.sentence for claim in claims]
    for claim in (*claims, *in_brief(choice)):
        assert holds(claim), claim.sentence
        assert len(claim.sentence.split()) <= 40, claim.sentence  # slots may hold several words
    assert len(in_brief(choice)) <= 5


def test_every_sentence_about_every_map_is_supported(
    of_maps: list[Choice], of_learned: list[Choice]
):
    for choice in of_maps + of_learned:
        read_back(choice)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(moments())
def test_every_sentence_about_any_moment_is_supported(moment: Moment):
    read_back(moment.choice(*moment.action_names[:2]))


def test_no_rule_needs_more_than_25_words():
    for rule in CHOICES.rules.values():
        words = re.sub(r"\{[^}]*\}", "x", rule.says).split()
        assert len(words) <= 25, rule.says


@settings(max_examples=300, deadline=None, derandomize=True)
@given(moments())
def test_a_lead_of_the_worse_action_is_never_the_last_word(moment: Moment):
    kinds = ("more-immediate", "costs-less", "pays-more")
    claims = in_brief(moment.choice(*moment.action_names[:2]))
    for lead, following in zip(claims, (*claims[1:], None), strict=True):
        is_worse = lead.kind in kinds and moment.q_value(lead.leader) < moment.q_value(lead.other)
        if is_worse and following is not None and following.kind in ("overtakes", "makes-up"):
            assert following.leader == lead.other
        elif is_worse:
            assert following is not None
            assert following.kind in ("equal-values", *(k for k in CHOICES.rules if "better" in k))


def test_every_kind_of_claim_occurs(of_maps: list[Choice], of_learned: list[Choice]):
    seen = {claim.kind for choice in of_maps + of_learned for claim in told(choice)}

    @settings(max_examples=400, deadline=None, derandomize=True)
    @given(moments())
    def collect(moment: Moment) -> None:
        seen.update(claim.kind for claim in told(moment.choice(*moment.action_names[:2])))

    collect()
    # held by examples in test_contrast, test_forecast and test_outlook
    elsewhere = {"nothing-on-average", "zero-on-average", "first-of-several", "signs-count"}
    elsewhere |= {"comes-in-less", "hardly-apart"}
    assert set(CHOICES.rules) - seen <= elsewhere


@settings(max_examples=60, deadline=None, derandomize=True)
@given(moments(), st.integers(-12, 12))
def test_a_scaled_model_says_the_same_with_scaled_numbers(moment: Moment, power: int):
    scale = 10.0**power

    def numbers(claim: Claim) -> list[float]:
        parts = claim.fields.get("parts", {})
        return [of for of in (*claim.fields.values(), *parts.values()) if isinstance(of, float)]

    def scaled(known: Uncertainty | None) -> Uncertainty | None:
        if known is None:
            return None
        outcomes = tuple(
            tuple({reward * scale: p for reward, p in step.items()} for step in steps)
            for steps in known.outcomes
        )
        spread = (known.deviation * scale, known.return_deviation * scale)
        return Uncertainty(*spread, known.survival, outcomes)

    def more(of: Outlook | None) -> Outlook | None:
        if of is None:
            return None
        parts, amounts = (
            {name: rows * scale for name, rows in told.items()} for told in (of.parts, of.amounts)
        )
        return replace(of, parts=parts, amounts=amounts)

    def judged(of: Calibration | None) -> Calibration | None:
        if of is None:
            return None
        amount = None if of.reliability is None else of.reliability.amount * scale
        return calibrated(of.time_axis, of.status, of.off_by * scale, amount)

    times = {
        "decomposition": RewardDecomposition(
            moment.decomposition.components * scale, moment.time_axis
        ),
        "totals": None if moment.totals is None else moment.totals * scale,
        "calibration": judged(moment.calibration),
        "foils": judged(moment.foils),
        "uncertainty": scaled(moment.uncertainty),
        "outlook": more(moment.outlook),
        "what_ifs": (),
    }
    names = moment.action_names[:2]
    small = told(replace(moment, what_ifs=()).choice(*names))
    large = told(replace(moment, **times).choice(*names))  # type: ignore[arg-type]
    assert [claim.kind for claim in small] == [claim.kind for claim in large]
    for one, other in zip(small, large, strict=True):
        for a, b in zip(numbers(one), numbers(other), strict=True):
            assert b == pytest.approx(a, rel=1e-9) or b == pytest.approx(a * scale, rel=1e-9)


# ---- mutants ---------------------------------------------------------------------------------


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


def mutations(choice: Choice) -> list[str]:
    return [
        mutant
        for claim in told(choice)
        for mutant in [
            *mutants.numbers(claim.sentence),
            *mutated_names(claim.sentence, choice.moment.action_names),
            *mutants.words(claim.sentence, WORDS),
        ]
    ]


def survivors(choice: Choice) -> list[str]:
    return mutants.survivors(mutations(choice), lambda text: check(text, [(CHOICES, choice)]))


def test_a_mutated_number_name_or_claim_about_a_map_fails(of_maps: list[Choice]):
    few = of_maps[::3]
    assert sum(len(mutations(choice)) for choice in few) > 1_000
    assert [mutant for choice in few for mutant in survivors(choice)] == []


def test_a_mutated_number_name_or_claim_about_a_learned_forecast_fails(of_learned: list[Choice]):
    assert sum(len(mutations(choice)) for choice in of_learned) > 1_000
    assert [mutant for choice in of_learned for mutant in survivors(choice)] == []


@settings(max_examples=100, deadline=None, derandomize=True)
@given(moments())
def test_a_mutated_number_name_or_claim_about_any_moment_fails(moment: Moment):
    assert survivors(moment.choice(*moment.action_names[:2])) == []


def test_a_sentence_of_no_known_kind_fails(of_maps: list[Choice]):
    with pytest.raises(UnsupportedSentenceError, match="no statement about"):
        check("Down is clearly the wise choice.", [(CHOICES, of_maps[0])])


def test_a_wrong_number_is_named(of_maps: list[Choice]):
    with pytest.raises(
        UnsupportedSentenceError, match=r"worth 0\.96\.' is not true of this moment"
    ):
        check(
            "With down, the first reward comes in the first 2 steps: it is worth 0.96.",
            [(CHOICES, of_maps[0])],
        )
