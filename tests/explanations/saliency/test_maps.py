"""Maps and groups, by hand and by what has to hold of any."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from moments import calibrated, trusted
from trdlab.decomposition import TimeAxis
from trdlab.errors import InputError
from trdlab.explanations.saliency.groups import Group, parse_groups, usual_groups
from trdlab.explanations.saliency.maps import SaliencyMaps, area_of, enlarged, overlap

AXIS = TimeAxis(0.9, 8)
NUMBERS = st.floats(-100, 100, width=32).filter(lambda x: x == 0.0 or abs(x) > 1e-3)
ANY = arrays(np.float64, (9, 3, 4), elements=NUMBERS)
ONE = arrays(np.float64, (3, 4), elements=NUMBERS).filter(np.any)


@given(ANY, st.integers(0, 8), st.integers(0, 8), st.integers(0, 8))
def test_groups_and_differences_add_up(signed, a, b, c):
    maps = SaliencyMaps(signed, AXIS)
    first, middle, last = sorted((a, b, c))
    whole = maps.of(Group(first, last)).signed
    parts = [maps.of(Group(first, middle)).signed]
    if middle < last:
        parts.append(maps.of(Group(middle + 1, last)).signed)
    np.testing.assert_allclose(whole, sum(parts), atol=1e-9)
    near, far = Group(first, middle), Group(middle, last)
    there, back = maps.difference(near, far).signed, maps.difference(far, near).signed
    np.testing.assert_allclose(there, -back)
    np.testing.assert_allclose(there, maps.of(far).signed - maps.of(near).signed)
    twice = SaliencyMaps(2.0 * signed, AXIS)
    np.testing.assert_allclose(twice.minus(maps).of(near).signed, maps.of(near).signed)
    paper = maps.paper_difference(near, far).signed
    np.testing.assert_allclose(paper, twice.paper_difference(near, far).signed)
    assert np.abs(paper).max() <= 1.0


def test_the_papers_difference_by_hand():
    signed = np.zeros((9, 1, 3))
    signed[0], signed[8] = [[2.0, 1.0, -4.0]], [[0.0, 0.1, 0.05]]
    maps = SaliencyMaps(signed, AXIS)
    found = maps.paper_difference(Group(0, 0), Group(8, 8))
    np.testing.assert_allclose(found.signed, [[-1.0, 0.5, 0.5]])
    assert found.label == "later − t, as in the paper"
    plain = maps.difference(Group(0, 0), Group(8, 8))
    np.testing.assert_allclose(plain.signed, [[-2.0, -0.9, 4.05]])
    np.testing.assert_array_equal(maps.of(Group(0, 0)).rectified, [[2.0, 1.0, 0.0]])
    np.testing.assert_array_equal(maps.of(Group(0, 0)).scaled, [[0.5, 0.25, -1.0]])


@given(ONE, ONE, st.floats(0.1, 10))
def test_overlap(one, other, factor):
    assert 0.0 <= overlap(one, other) <= 1.0 + 1e-9
    assert overlap(one, other) == pytest.approx(overlap(other, one))
    assert overlap(one, factor * one) == pytest.approx(1.0)
    assert overlap(one, -one) == 0.0
    assert np.isnan(overlap(one, 0.0 * one))
    assert 0.0 < area_of(np.abs(one)) <= 0.5 + 1 / one.size


@given(ONE, st.integers(1, 30), st.integers(1, 30))
def test_enlarged_as_torch_does_it(values, height, width):
    expected = torch.nn.functional.interpolate(
        torch.from_numpy(values)[None, None], size=(height, width), mode="bilinear"
    )
    np.testing.assert_allclose(enlarged(values, height, width), expected[0, 0], atol=1e-9)


def test_maps_have_to_be_of_all_components():
    with pytest.raises(InputError, match=r"shape \(3, 2, 2\).*\[9, h, w\]"):
        SaliencyMaps(np.zeros((3, 2, 2)), AXIS)


def test_groups_that_users_name():
    assert parse_groups("3", AXIS) == (Group(3, 3),)
    assert parse_groups(" 0-2, later", AXIS) == (Group(0, 2), Group(8, 8))
    assert parse_groups("all", AXIS) == tuple(Group(k, k) for k in range(9))
    wide = TimeAxis(0.9, 3, 4)
    assert [group.label(wide) for group in parse_groups("all", wide)] == [
        "t…t+3",
        "t+4…t+7",
        "t+8…t+11",
        "later",
    ]
    for text in ("9", "2-1", "0-9"):
        with pytest.raises(InputError, match=r"run from 0 to 8"):
            parse_groups(text, AXIS)
    for text in ("", "near", "-1", "1-", "²"):
        with pytest.raises(InputError, match=r"no component '"):
            parse_groups(text, AXIS)
    with pytest.raises(InputError, match=r"names 3 groups"):
        parse_groups("1,2,3", AXIS)


def test_near_and_far_are_told_within_what_can_be_trusted():
    assert usual_groups(AXIS) == (Group(0, 1), Group(6, 7))
    assert usual_groups(AXIS, trusted(AXIS, 5).trust) == (Group(0, 1), Group(3, 4))
    assert usual_groups(AXIS, trusted(AXIS, 3).trust) == (Group(0, 1), Group(6, 7))
    assert usual_groups(AXIS, calibrated(AXIS).trust) == (Group(0, 1), Group(6, 7))
    assert usual_groups(TimeAxis(0.9, 1)) == (Group(0, 0), Group(1, 1))
    assert usual_groups(TimeAxis(0.9, 0)) == (Group(0, 0),)
