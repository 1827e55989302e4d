"""What else is expected, counted by hand; and nothing of what has not beaten a guess."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from moments import moment, said, told
from trdlab.estimator import Outlook
from trdlab.explanations.moment import outlook
from trdlab.explanations.moment.moment import Choice
from trdlab.explanations.rules import Claim
from trdlab.show.data import actions_data

GAMMA = 0.5
COIN = [[0.0, 0.5, 0.25, 0.125], [0.0, 0.5, 0.25, 0.0]]
HAZARD = [[-0.1, 0.0, -0.05, -7.0], [-1.0, 0.0, 0.0, -7.0]]
CRASH = [[0.1, 0.0, 0.2], [0.6, 0.0, 0.0]]
FUEL = [[1.0, 0.5, 0.25, 9.0], [2.0, 1.0, 0.5, 9.0]]
REACH = {"coin": 3, "hazard": 2, "crash": 3, "fuel": 2}


def known(**of: object) -> Outlook:
    """What is known of two actions, N = 3: parts, an event, an amount, and the end."""
    found = Outlook(
        variance=np.zeros((2, 3)),
        survival=np.array([[1.0, 0.9, 0.9, 0.7], [1.0, 0.4, 0.4, 0.4]]),
        chances={},
        parts={"coin": np.array(COIN), "hazard": np.array(HAZARD)},
        events={"crash": np.array(CRASH)},
        amounts={"fuel": np.array(FUEL)},
        survival_reach=3,
        reach=REACH,
    )
    return replace(found, **of)  # type: ignore[arg-type]


def choice(of: Outlook | None, foil: str | None = "b", action: str = "a", width: int = 1) -> Choice:
    rows = (np.array(COIN) + np.array(HAZARD)).tolist()
    return Choice(moment(rows, width, GAMMA, outlook=of), action, foil)


def sentences(of: Choice) -> list[str]:
    return [claim.sentence for claim in outlook.forecast(of) + outlook.contrast(of)]


def test_an_example_by_hand():
    assert sentences(choice(known())) == [
        "In the first 2 steps a brings +0.4 on average: coin +0.5, hazard -0.1.",
        "With a, +0.75 is expected from coin in the first 3 steps.",
        "Within the first 3 steps of a, crash is likeliest 2 steps later: about a 20 % chance.",
        "With a, fuel adds up to 2 in the first 2 steps, on average.",  # 1 + 0.5 / 0.5
        "In the first 2 steps, most of the difference is hazard: on average -0.1 with a and -1 "
        "with b.",
        "Of the first 3 steps, crash comes in 0.3 with a and in 0.6 with b, on average.",
        "In the first 2 steps, fuel adds up to 2 with a and 4 with b, on average.",
    ]


def test_dying_reads_otherwise_than_waiting_for_nothing():
    assert said(choice(known()), "learned-over") == [
        "With a, there is about a 70 % chance that the episode still runs after the first 3 steps."
    ]
    assert said(choice(known(), action="b", foil="a"), "learned-over") == [
        "With b, there is about a 60 % chance that the episode ends in the first step."
    ]
    near = known(survival_reach=2)
    assert said(choice(near), "learned-over") == [
        "With a, there is about a 90 % chance that the episode still runs after the first 2 steps."
    ]
    assert said(choice(known(survival_reach=0)), "learned-over") == []


def test_what_was_learned_is_never_sure():
    surely = known(survival=np.array([[1.0, 0.003, 0.0, 0.0]] * 2))
    (sentence,) = said(choice(surely), "learned-over")
    assert sentence.endswith(
        "a chance of about 95 % or more that the episode ends in the first step."
    )
    one = known(events={"crash": np.array([[0.997, 0.0, 0.0]] * 2)})
    assert said(choice(one), "likeliest") == [
        "Within the first 3 steps of a, crash is likeliest at once: a chance of about 95 % or more."
    ]


@pytest.mark.parametrize(
    ("row", "reach", "says"),
    [
        ([0.01, 0.01, 0.02], 3, "With a, there is a chance of about 5 % or less of crash in the "
         "first 3 steps."),
        ([0.8, 0.1, 0.1], 1, "With a, there is about an 80 % chance of crash in the first step."),
        ([0.2, 0.3, 0.25], 3, "With a, crash comes in less than one of the first 3 steps: 0.75 on "
         "average."),
        ([0.7, 0.8, 0.6], 3, "With a, crash comes in 2.1 of the first 3 steps, on average."),
    ],
)  # fmt: skip
def test_an_event_is_rare_or_has_a_time_or_has_none(row, reach, says):
    of = known(events={"crash": np.array([row, row])}, reach=REACH | {"crash": reach})
    assert says in sentences(choice(of))
    assert said(choice(of), "comes-otherwise") == [], "both are alike"


def test_an_event_that_ends_the_episode_comes_once_at_most():
    of = known(events={"crash": np.array([[0.2, 0.3, 0.25], [0.5, 0.4, 0.2]])}, endings=("crash",))
    says = "With a, there is about a 75 % chance of crash in the first 3 steps."
    assert said(choice(of), "chance-of") == [says]
    assert said(choice(of), "chances-differ") == [  # errors of learning may add up to more than 1
        "In the first 3 steps, there is about a 75 % chance of crash with a, and a chance of about "
        "95 % or more with b."
    ]


def test_groups_of_steps_are_discounted_and_an_event_counts_once_in_each():
    often = known(events={"crash": np.array([[0.7, 0.8, 0.6], [0.1, 0.1, 0.1]])})
    assert said(choice(often, width=2), "adds-up") == [
        "With a, fuel adds up to 1.5 (discounted) in the first 4 steps, on average."
    ]
    assert said(choice(often, width=2), "comes-in") == [
        "With a, crash comes in 2.1 of the first 3 groups of 2 steps, on average."
    ]


def test_an_event_of_a_single_step_has_another_chance_with_the_foil():
    near = known(reach=REACH | {"crash": 1})
    assert said(choice(near), "chances-differ") == [
        "In the first step, there is about a 10 % chance of crash with a, and about a 60 % chance "
        "with b."
    ]
    assert said(choice(near), "comes-otherwise") == []


def test_only_the_largest_parts_are_named():
    sizes = {"s": 1.0, "t": -9.0, "u": 2.0, "v": 3.0, "w": 4.0, "x": 0.1}
    rows = {name: np.full((2, 4), size) for name, size in sizes.items()}
    of = known(parts=rows, reach=REACH | dict.fromkeys(rows, 1))
    assert said(choice(of), "made-of") == [
        "In the first step a brings +1.1 on average: t -9, w +4, v +3, u +2, 2 others +1.1."
    ]


def test_a_foil_is_not_needed_and_differences_that_are_not_to_be_trusted_are_not_told():
    assert sentences(choice(known(), foil=None)) == sentences(choice(known()))[:4]
    assert sentences(choice(None)) == []


def test_what_cannot_be_told_yet_is_said():
    of = known(reach={"coin": 3, "fuel": 3})
    assert said(choice(of), "untold") == [
        f"{name} cannot be told yet: such forecasts have not proved better than a guess."
        for name in ("Hazard", "Crash")
    ]
    assert said(choice(of), "made-of") == said(choice(of), "decides") == []
    assert said(choice(of), "part-alone") == ["With a, +0.75 is expected from coin in the first "
                                              "3 steps."]  # fmt: skip


def test_the_short_answer_has_one_of_them():
    (first,) = outlook.in_brief(choice(known()))
    assert first.kind == "decides"
    assert outlook.in_brief(choice(None)) == []


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.integers(0, 3), st.integers(0, 3), st.integers(0, 3), st.integers(0, 3), st.data())
def test_nothing_is_told_beyond_what_was_judged(coin, hazard, crash, end, data):
    reach = {"coin": coin, "hazard": hazard, "crash": crash, "fuel": coin}
    of = known(reach=reach, survival_reach=end)
    noise = data.draw(st.sampled_from([np.nan, np.inf, -3.0, 0.77]))

    def garbled(rows: np.ndarray, count: int) -> np.ndarray:
        changed = rows.copy()
        changed[:, count:] = noise
        return changed

    other = replace(
        of,
        variance=np.full((2, 3), np.nan),
        survival=garbled(of.survival, end + 1),
        **{
            kind: {name: garbled(rows, reach[name]) for name, rows in getattr(of, kind).items()}
            for kind in ("parts", "events", "amounts")
        },
    )
    assert list(map(str, told(choice(of)))) == list(map(str, told(choice(other))))
    data_of = actions_data(choice(other).moment)
    assert json.loads(json.dumps(data_of, allow_nan=False))["a"]["outlook"]["reach"] == reach


def means(claim: Claim, of: Outlook) -> bool:
    """Whether a claim about w = 1 is true by its definition, computed in other ways."""
    if claim.kind == "untold":
        return not of.reach[claim.outcome]
    i, end = "ab".index(claim.action), claim.fields.get("last_step", 0) + 1
    near = {name: rows[i] for name, rows in (of.parts | of.events | of.amounts).items()}
    match claim.kind:
        case "made-of":
            parts = {name: near[name][:end].sum() for name in of.parts}
            return claim.total == pytest.approx(sum(parts.values())) and all(
                claim.parts[name] == pytest.approx(parts[name]) for name in claim.parts
            )
        case "part-alone":
            return claim.total == pytest.approx(near[claim.outcome][:end].sum())
        case "decides":
            apart = {name: abs(np.diff(of.parts[name][:, :end].sum(axis=1))) for name in of.parts}
            return 2 * apart[claim.outcome] > sum(apart.values())
        case "likeliest":
            assert claim.outcome not in of.endings
            row = near[claim.outcome][:end]
            return claim.chance == row[claim.component] == row.max()
        case "chance-of":
            total = near[claim.outcome][:end].sum()
            is_once = end == 1 or claim.outcome in of.endings
            return (is_once or total <= 0.05) and claim.chance == min(total, 1.0)
        case "chances-differ":
            totals = of.events[claim.outcome][[i, 1 - i], :end].sum(axis=1)
            is_once = end == 1 or claim.outcome in of.endings
            return is_once and [claim.total, claim.other] == np.minimum(totals, 1.0).tolist()
        case "comes-in" | "comes-in-less" | "comes-otherwise" | "adds-up" | "adds-up-otherwise":
            assert claim.outcome not in of.endings
            if claim.kind in ("comes-in", "comes-in-less"):
                assert (claim.total < 0.995) == (claim.kind == "comes-in-less")
            full = GAMMA ** np.arange(end) if claim.outcome in of.amounts else np.ones(end)
            totals = [(rows[:end] / full).sum() for rows in
                      (of.events | of.amounts)[claim.outcome][[i, 1 - i]]]  # fmt: skip
            said = [claim.total, claim.fields.get("other", totals[1])]
            return said == pytest.approx(totals)
    return False


cells = st.sampled_from([0.0, 0.01, 0.1, 0.4, 1.0])
rows = st.lists(st.lists(cells, min_size=3, max_size=3), min_size=2, max_size=2).map(np.array)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(rows, rows, rows, st.tuples(*[st.integers(0, 3)] * 4), st.sampled_from([(), ("crash",)]))
def test_every_claim_means_what_it_says(coin, crash, fuel, reach, endings):
    of = known(
        parts={"coin": np.pad(coin, ((0, 0), (0, 1))), "hazard": np.array(HAZARD)},
        events={"crash": crash},
        amounts={"fuel": np.pad(fuel, ((0, 0), (0, 1)))},
        reach=dict(zip(REACH, reach, strict=True)),
        endings=endings,
    )
    of_moment = moment((np.pad(coin, ((0, 0), (0, 1))) + HAZARD).tolist(), 1, GAMMA, outlook=of)
    for claim in outlook.forecast(Choice(of_moment, "a", "b")) + outlook.contrast(
        Choice(of_moment, "a", "b")
    ):
        assert means(claim, of), claim.sentence
        assert claim.kind == "untold" or claim.last_step < max(of.reach.values())
