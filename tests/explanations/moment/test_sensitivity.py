"""Sign changes of functions whose roots are known."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trdlab.explanations.moment.sensitivity import find_flips


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
