"""The first reward at the same step after either action, on maps that can be counted by hand."""

import pytest

from moments import choice, moment, of_kind, said
from trdlab.gridworld import Gridworld, parse_map

# right: 1 at the first step, then the treasure; down: 1 at the first step, then nothing
FORK = "c = coin 1\nT = treasure 4 terminal\nC = coin 1 terminal\n---\nScT\nC##"


def test_both_actions_pay_first_at_the_same_step():
    (claim,) = of_kind(choice(Gridworld(parse_map(FORK)), foil="down"), "first-together")
    assert claim.sentence == "With both right and down, the first reward comes at once."
    assert (claim.effect, claim.component) == ("reward", 0)


@pytest.mark.parametrize(("sign", "effect"), [(1.0, "reward"), (-1.0, "cost")])
def test_amounts_and_what_follows_may_differ(sign, effect):
    of = moment([[0, 0, 2 * sign, 0], [0, 0, sign, 5]]).choice(action="a", foil="b")
    assert said(of, "first-together") == [
        f"With both a and b, the first {effect} to expect comes 2 steps later."
    ]


@pytest.mark.parametrize(
    "rows",
    [
        [[0, 1, 0, 0], [0, 0, 1, 0]],  # another step
        [[0, 1, 0, 0], [0, -1, 0, 0]],  # a reward against a cost
        [[0, 1, 0, 0], [0, 1, 0, 0]],  # nothing differs, which is told instead
    ],
)
def test_nothing_is_said_of_other_firsts(rows):
    assert said(moment(rows).choice(action="a", foil="b"), "first-together") == []
