"""Checks of attributions: on such as they should fail on, and on such as they should pass on."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from trdlab.explanations.saliency.checks import (
    hidden_check,
    hidden_patches,
    patch_means,
    rank_correlation,
    redrawn_check,
)


def test_ranks_as_scipy_has_them():
    rng = np.random.default_rng(0)
    one, other = rng.integers(0, 5, (2, 30)).astype(float)  # with many ties
    assert rank_correlation(one, other) == pytest.approx(spearmanr(one, other)[0])


def test_what_stays_with_new_weights_is_bad():
    rng = np.random.default_rng(0)
    one = rng.random((5, 5))
    assert redrawn_check(one, np.stack([one, 3 * one])) == ("bad", 1.0)
    verdict, value = redrawn_check(one, rng.random((10, 5, 5)))
    assert verdict == "good"
    assert abs(value) < 0.2
    assert redrawn_check(np.ones((5, 5)), one[None]).verdict == "not tested"
    assert redrawn_check(one.ravel()[:3], one.ravel()[None, :3]).verdict == "not tested"
    assert redrawn_check(one, np.zeros((2, 5, 5))) == ("good", 0.0)


def test_what_is_strong_where_hiding_changes_nothing_is_bad():
    changes = np.array([0.0, -3.0, 1.0, 2.0, 0.5, 9.0])
    shown = np.array([True, True, True, True, True, False])
    assert hidden_check(np.abs(changes), changes, shown) == ("good", 1.0)
    assert hidden_check(10 - np.abs(changes), changes, shown) == ("bad", -1.0)
    assert hidden_check(np.abs(changes), changes, np.zeros(6, bool)).verdict == "not tested"
    assert hidden_check(np.abs(changes), 0 * changes, shown).verdict == "not tested"


def test_hidden_patches_by_hand():
    image = np.full((2, 3, 3), 7, dtype=np.uint8)
    image[0, 0, 0], image[1, 2, 2] = 200, 100
    hidden = hidden_patches(image, 2)
    assert hidden.shape == (4, 2, 3, 3)
    assert hidden.dtype == np.uint8
    np.testing.assert_array_equal(hidden[0, 0], 7)
    np.testing.assert_array_equal(hidden[0, 1], image[1])
    np.testing.assert_array_equal(hidden[3, 1], 7)
    assert image[0, 0, 0] == 200
    np.testing.assert_allclose(
        patch_means(np.array([[1.0, 3, 5], [1, 3, 7], [2, 4, 9]]), 2), [[2, 6], [3, 9]]
    )
