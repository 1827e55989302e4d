"""Robust means and honest intervals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import beta, norm, trim_mean

from trdlab import statistics
from trdlab.errors import InputError
from trdlab.statistics import bootstrap, enough, interquartile_mean, mean_difference, unseen


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


@pytest.mark.parametrize("successes", [0, 1, 7, 50])
def test_a_chance_has_the_ends_of_clopper_and_pearson(successes, monkeypatch):
    monkeypatch.setattr(statistics, "RESAMPLES", 20_000)
    flips, nothing = np.repeat([1.0, 0.0], [successes, 50 - successes]), np.zeros((1, 1))
    rng = np.random.default_rng(0)
    # of the other nothing else can come, so it adds no width: one end at a time
    found = mean_difference(flips[:, None], nothing, np.zeros(1), np.zeros(1), rng=rng)
    low = beta.ppf(0.025, successes, 51 - successes) if successes else 0.0
    assert found.value[0] == successes / 50
    assert found.low[0] == pytest.approx(low, abs=0.004)
    found = mean_difference(flips[:, None], nothing + 1.0, np.ones(1), np.ones(1), rng=rng)
    high = beta.ppf(0.975, successes + 1, 50 - successes) if successes < 50 else 1.0
    assert found.high[0] + 1.0 == pytest.approx(high, abs=0.004)


def test_one_lucky_event_does_not_tell_two_actions_apart():
    lucky, never = np.eye(50)[:, :1], np.zeros((50, 1))
    found = mean_difference(lucky, never, np.zeros(1), np.ones(1), rng=np.random.default_rng(0))
    assert found.value[0] == 0.02
    assert found.low[0] < -0.02
    assert 0.1 < found.high[0] < 0.15


def test_differences_of_means_are_covered_as_often_as_is_said():
    inside = []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        one, other = (rng.random((50, 1)) < chance for chance in (0.04, 0.02))
        found = mean_difference(
            one.astype(float), other.astype(float), np.zeros(1), np.ones(1), rng=rng
        )
        inside.append(found.low[0] <= 0.02 <= found.high[0])
    assert np.mean(inside) >= 0.95


def test_how_many_would_do_grows_with_the_square_of_what_is_missing():
    assert enough(50, 0.4, 0.2) == 200
    assert enough(50, 0.4, 0.0) is None
    assert enough(50, np.inf, 0.2) is None
    assert unseen(50) == pytest.approx(1.0 - 0.025 ** (1 / 50))
