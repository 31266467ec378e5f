"""Means and intervals by hand, and against scipy's own test of one sample."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ttest_1samp

from relm_irl_jax.report.intervals import MeanInterval, mean_interval, mean_intervals, paired_difference


def test_the_interval_is_students():
    """The 97.5% point of Student's t with two degrees of freedom is 4.3027, the standard error 1/√3."""
    interval = mean_interval([1.0, 2.0, 3.0])
    assert (interval.mean, interval.half_width) == (2.0, pytest.approx(4.3027 / np.sqrt(3), abs=1e-4))
    assert mean_interval([1.0, 1.0]) == MeanInterval(1.0, 0.0)
    assert np.isnan(mean_interval([1.0]).half_width)
    assert np.isnan(mean_interval([]).mean)


@settings(deadline=None)
@given(st.lists(st.floats(-1e3, 1e3, width=32), min_size=2, max_size=6).filter(lambda v: np.std(v) > 1e-3))
def test_the_interval_is_that_of_the_t_test(values):
    interval = mean_interval(values)
    low, high = ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert interval.mean - interval.half_width == pytest.approx(low, rel=1e-9, abs=1e-9)
    assert interval.mean + interval.half_width == pytest.approx(high, rel=1e-9, abs=1e-9)


def test_unknown_values_do_not_count():
    values = np.asarray([[1.0, np.nan, np.nan], [3.0, np.inf, 2.0], [np.nan, np.nan, np.nan]])
    mean, half_width = mean_intervals(values)
    np.testing.assert_array_equal(mean, [2.0, np.nan, 2.0])
    np.testing.assert_allclose(half_width, [mean_interval([1.0, 3.0]).half_width, np.nan, np.nan])


def test_pairs_are_of_the_same_seed():
    """Differences 0.1, 0.1 and 0.4 have mean 0.2 and standard error 0.1; a seed that one side lacks does not count."""
    interval, seeds = paired_difference({0: 0.3, 1: 0.5, 2: 0.9, 3: 0.0}, {0: 0.2, 1: 0.4, 2: 0.5})
    assert seeds == 3
    assert (interval.mean, interval.half_width) == (pytest.approx(0.2), pytest.approx(0.43027, abs=1e-4))


def test_an_interval_formats_itself():
    assert str(MeanInterval(0.5, 0.125)) == "0.50 ± 0.12"
    assert f"{MeanInterval(1234.4, float('nan')):,.0f}" == "1,234"
