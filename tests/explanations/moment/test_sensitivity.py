"""Sign changes of functions whose roots are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from moments import GAMMA, choice, moment, of_kind, said
from trdlab.explanations.moment.moment import WhatIf
from trdlab.explanations.moment.sensitivity import find_flips
from trdlab.gridworld import Gridworld, load_map


def test_all_roots_are_found_in_order():
    roots = find_flips(lambda x: math.sin(5 * x), 0.1, 3.0)
    assert roots == pytest.approx([math.pi * k / 5 for k in range(1, 5)], abs=1e-11)


def test_none_is_a_possible_answer():
    assert find_flips(lambda x: x * x + 0.1, -1.0, 1.0) == ()


def test_a_pair_of_flips_in_the_last_interval_is_found():
    for mirror in (1.0, -1.0):
        roots = find_flips(lambda x, m=mirror: (m * x - 0.991) * (m * x - 0.993), -1.0, 1.0)
        assert sorted(mirror * root for root in roots) == pytest.approx([0.991, 0.993], abs=1e-11)


def test_roots_that_fall_on_samples_are_found():
    assert find_flips(lambda x: (x - 0.5) * (x - 0.515625), 0.0, 1.0) == (0.5, 0.515625)


def test_touching_zero_is_no_flip():
    assert find_flips(lambda x: x * x, -1.0, 1.0) == ()
    assert find_flips(lambda x: (x - 0.123) ** 2, -1.0, 1.0) == ()


def test_a_pair_of_flips_between_two_samples_is_found():
    # 64 samples of [0, 1] are 0.0156 apart; the dip below zero is 0.002 wide
    roots = find_flips(lambda x: (x - 0.507) * (x - 0.509), 0.0, 1.0)
    assert roots == pytest.approx([0.507, 0.509], abs=1e-11)


def test_a_stretch_of_exact_ties_between_two_signs_is_one_flip():
    (root,) = find_flips(lambda x: max(x - 0.6, 0.0) + min(x - 0.4, 0.0), 0.0, 1.0)
    assert 0.4 <= root <= 0.6


@given(
    st.lists(st.integers(1, 48), min_size=1, max_size=4, unique=True),
    st.floats(0.0, 0.01),
    st.sampled_from([-1.0, 1.0]),
)
def test_polynomials_flip_at_their_roots(places: list[int], shift: float, sign: float):
    roots = [place / 49 + shift for place in places]  # further apart than the samples are
    flips = find_flips(lambda x: sign * math.prod(x - root for root in roots), 0.0, 1.0)
    assert flips == pytest.approx(sorted(roots), abs=1e-9)


def test_treasure_4_never_flips_over_gamma_and_treasure_5_flips_once():
    assert said(choice(), "never-flips") == [
        "Whatever γ was, within the values tried, down is better than up."
    ]
    richer = choice(Gridworld(load_map("drone").with_value("treasure", 5)))
    flip = next(claim for claim in of_kind(richer, "flips") if claim.quantity == "γ")
    # 1 + γ + γ² = 4 γ³
    (root,) = flip.bounds
    assert root == pytest.approx(0.86888, abs=5e-6)
    assert 1 + root + root**2 == pytest.approx(4 * root**3, abs=1e-10)
    assert flip.sentence == "Down would be better if γ were below 0.869 instead of 0.95."


def test_the_treasure_and_the_coins_that_flip_the_preference():
    at = {claim.quantity: claim.bounds for claim in of_kind(choice(), "flips")}
    treasure = 1 + GAMMA**-1 + GAMMA**-2 + GAMMA**-3
    assert treasure == pytest.approx(4.3270, abs=5e-5)
    assert at["the treasure"] == pytest.approx((treasure,), abs=1e-9)
    assert at["each coin"] == pytest.approx((4 / treasure,), abs=1e-9)
    assert "Up would be better if the treasure paid more than 4.33 instead of 4." in said(
        choice(), "flips"
    )


def test_flips_re_optimise_the_policy():
    # staying on the near branch is better at low γ; the far branch needs a policy of its own
    (flip,) = (claim for claim in of_kind(choice("patience"), "flips") if claim.quantity == "γ")
    assert flip.bounds == pytest.approx(((1 / 3) ** (1 / 9),), abs=1e-10)  # 3 γ⁹ = 1


def test_what_lies_between_two_flips_is_said_to():
    known = moment([[1.0, 0.0], [0.0, 0.9]])
    dip = WhatIf("γ", 0.9, 0.0, 1.0, lambda x: np.array([(x - 0.2) * (x - 0.6), 0.0]))
    of = replace(known, what_ifs=(dip,)).choice("a", "b")
    assert said(of, "flips") == ["B would be better if γ were between 0.2 and 0.6 instead of 0.9."]
    assert said(of, "several-flips") == [
        "The preference changes sides at each of these values of γ: 0.2 and 0.6."
    ]
    cost = WhatIf("the hazards", -4.0, -40.0, 0.0, lambda x: np.array([-1.0 - x, 0.0]))
    of = replace(known, what_ifs=(cost,)).choice("a", "b")
    assert said(of, "flips") == ["B would be better if the hazards cost less than 1 instead of 4."]


def test_what_was_searched_is_said():
    assert said(choice(), "searched") == [
        "65 values of each were tried, every one with its own best policy: γ from 0.01 to 0.99, "
        "each coin from 0 to 10 and the treasure from 0 to 40."
    ]
