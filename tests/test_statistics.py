"""Robust means and honest intervals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm, trim_mean

from trdlab.errors import InputError
from trdlab.statistics import bootstrap, interquartile_mean


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20).map(lambda x: x * 4))
def test_where_quarters_are_whole_it_is_the_trimmed_mean(values):
    assert interquartile_mean(np.array(values)) == pytest.approx(trim_mean(values, 0.25), abs=1e-6)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=30))
def test_counting_each_sample_four_times_changes_nothing(values):
    once, often = (interquartile_mean(np.array(v)) for v in (values, values * 4))
    assert once == pytest.approx(often, abs=1e-6)


def test_intervals_cover_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(0)
    inside = 0
    for _ in range(400):
        interval = bootstrap(rng.normal(2.0, 1.0, 40), rng=rng, resamples=500)
        inside += interval.low <= 2.0 <= interval.high
    assert abs(inside / 400 - 0.95) < 0.04  # percentile intervals are a little short


def test_the_interval_of_a_mean_is_the_normal_one_for_many_samples():
    samples = np.random.default_rng(1).normal(size=2000)
    interval = bootstrap(samples, rng=np.random.default_rng(2))
    half = norm.ppf(0.975) * samples.std() / np.sqrt(2000)
    assert interval.low == pytest.approx(samples.mean() - half, abs=0.005)
    assert interval.high == pytest.approx(samples.mean() + half, abs=0.005)


@pytest.mark.parametrize("samples", [[], [1.0, float("nan")], [[1.0]]])
def test_samples_without_an_interval_are_refused(samples):
    with pytest.raises(InputError, match="no interval"):
        bootstrap(samples, rng=np.random.default_rng(0))
