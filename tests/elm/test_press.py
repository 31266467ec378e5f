"""PRESS against leave-one-out refits and RidgeCV."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from references import curve_by_refits, leave_out
from sklearn.linear_model import RidgeCV

from relm_irl_jax.elm import press_curve, press_path


@pytest.mark.parametrize("intercept", [False, True])
@pytest.mark.parametrize("ridge", [0.0, 1e-3, 5.0])
def test_every_prefix_equals_its_refits(ridge, intercept, rng):
    H, T = np.tanh(rng.standard_normal((30, 20))) + 0.3, rng.standard_normal((30, 6)) + 2
    expected = curve_by_refits(H, T, ridge, intercept)
    np.testing.assert_allclose(press_curve(H, T, ridge, intercept=intercept), expected, rtol=1e-8)


@pytest.mark.parametrize("intercept", [False, True])
@pytest.mark.parametrize("ridge", [1e-2, 3.0])
def test_the_last_prefix_equals_ridge_cv(ridge, intercept, rng):
    H, T = rng.standard_normal((50, 20)) + 1, rng.standard_normal((50, 3)) - 4
    peer = RidgeCV([ridge], fit_intercept=intercept, store_cv_results=True).fit(H, T)
    np.testing.assert_allclose(press_curve(H, T, ridge, intercept=intercept)[-1], peer.cv_results_.mean(), rtol=1e-8)


@pytest.mark.parametrize("intercept", [False, True])
def test_ridge_with_fewer_samples_than_columns(intercept, rng):
    H, T = rng.standard_normal((17, 30)), rng.standard_normal((17, 2))
    np.testing.assert_allclose(
        press_curve(H, T, 0.3, intercept=intercept), curve_by_refits(H, T, 0.3, intercept), rtol=1e-8
    )


@pytest.mark.parametrize("intercept", [False, True])
def test_without_ridge_the_curve_ends_where_every_sample_is_fitted(intercept, rng):
    H, T = rng.standard_normal((17, 30)), rng.standard_normal((17, 2))
    curve = press_curve(H, T, intercept=intercept)
    end = 17 - intercept
    np.testing.assert_allclose(curve[: end - 1], curve_by_refits(H[:, : end - 1], T, intercept=intercept), rtol=1e-8)
    assert np.isinf(curve[end - 1 :]).all()
    assert np.isfinite(curve[np.argmin(curve)])


@pytest.mark.parametrize("intercept", [False, True])
def test_dependent_columns_change_nothing(intercept, rng):
    H, T = rng.standard_normal((30, 17)), rng.standard_normal((30, 2))
    H[:, 0] = 0
    H[:, 3] = H[:, 1]
    H[:, 6] = H[:, 1] - 3 * H[:, 2]
    path = press_path(H, T, intercept=intercept)
    assert path.dependent.tolist() == [0, 3, 6]
    assert path.rank == 14
    np.testing.assert_allclose(path.curve, curve_by_refits(H, T, intercept=intercept), rtol=1e-8)
    assert path.curve[3] == path.curve[2]
    assert path.curve[0] == pytest.approx(path.null_error, rel=1e-12)


def test_a_sample_that_alone_determines_a_coefficient_keeps_its_error(rng):
    H, T = rng.standard_normal((30, 17)), rng.standard_normal((30, 2))
    H[:, 4] = 0
    H[12, 4] = 1.0
    path = press_path(H, T)
    assert path.unit_leverage.tolist() == [0] * 4 + [1] * 13
    others = np.delete(np.arange(30), 12)
    errors = leave_out(H[:, :5], T)  # the refit without the sample leaves its coefficient at zero
    np.testing.assert_allclose(path.curve[4], np.mean(errors**2), rtol=1e-8)
    assert np.isfinite(path.curve).all()
    errors = leave_out(H[:, :6], T)[others]
    np.testing.assert_allclose(path.curve[5] * 60 - np.sum(leave_out(H[:, :4], T)[12] ** 2), np.sum(errors**2))


def test_large_enough_for_several_panels(rng):
    H, T = rng.standard_normal((64, 60)), rng.standard_normal((64, 2))
    H[:, 45] = H[:, :45].sum(axis=1)
    curve = press_curve(H, T)
    for k in (1, 31, 32, 33, 46, 60):
        np.testing.assert_allclose(curve[k - 1], np.mean(leave_out(H[:, :k], T) ** 2), rtol=1e-8)


def test_ill_conditioned_columns(rng):
    # Columns within 1e-6 of each other: the normal equations would lose twelve digits.
    H = rng.standard_normal((60, 1)) + 1e-6 * rng.standard_normal((60, 20))
    T = rng.standard_normal((60, 2))
    np.testing.assert_allclose(press_curve(H, T), curve_by_refits(H, T), rtol=1e-7)


@settings(max_examples=25, deadline=None)
@given(
    samples=st.sampled_from([3, 18, 40]),
    columns=st.sampled_from([1, 9, 36]),
    outputs=st.sampled_from([1, 3]),
    rank=st.integers(1, 40),
    ridge=st.sampled_from([0.0, 0.1]),
    intercept=st.booleans(),
    seed=st.integers(0, 99),
)
def test_any_shape_and_rank(samples, columns, outputs, rank, ridge, intercept, seed):
    rng = np.random.default_rng(seed)
    rank = min(rank, samples, columns)
    H = rng.standard_normal((samples, rank)) @ rng.standard_normal((rank, columns))
    # Which columns depend on earlier ones is a matter of rounding where those are nearly dependent themselves.
    assume(np.linalg.cond(H[:, :rank]) < 1e3)
    T = rng.standard_normal((samples, outputs))
    curve = press_curve(H, T, ridge, intercept=intercept)
    usable = columns if ridge else min(columns, samples - 1 - intercept)
    expected = curve_by_refits(H[:, :usable], T, ridge, intercept)
    np.testing.assert_allclose(curve[:usable], expected, rtol=1e-6)


def test_input_that_cannot_be_used(rng):
    H, T = rng.standard_normal((10, 4)), rng.standard_normal((10, 2))
    with pytest.raises(ValueError, match="T contains NaN"):
        press_curve(H, np.where(T[0, 0] == T, np.nan, T))
    with pytest.raises(ValueError, match="H has 10 rows but T has 8"):
        press_curve(H, T[:8])
    for ridge in (-1.0, np.nan):
        with pytest.raises(ValueError, match="ridge must be"):
            press_curve(H, T, ridge)
