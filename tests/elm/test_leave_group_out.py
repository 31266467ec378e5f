"""PRESS with groups left out, against refits without each group."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from references import curve_by_refits
from sklearn.linear_model import Ridge
from sklearn.model_selection import LeaveOneGroupOut, cross_val_predict

from relm_irl_jax.elm import press_curve, press_path
from relm_irl_jax.elm.leave_group_out import rows_by_group


@settings(max_examples=20, deadline=None)
@given(ridge=st.sampled_from([0.0, 0.1, 3.0]), intercept=st.booleans(), seed=st.integers(0, 99))
def test_every_prefix_equals_its_refits(ridge, intercept, seed):
    rng = np.random.default_rng(seed)
    H, T = np.tanh(rng.standard_normal((40, 17))) + 0.3, rng.standard_normal((40, 2)) + 2
    groups = rng.permutation(np.repeat(np.arange(14), [1, 1, 1, 1, 1, 2, 2, 2, 3, 3, 4, 5, 6, 8]))
    curve = press_path(H, T, ridge, intercept=intercept, groups=groups).curve
    np.testing.assert_allclose(curve, curve_by_refits(H, T, ridge, intercept, groups), rtol=1e-6)


def test_a_group_of_all_samples_but_one(rng):
    H, T = rng.standard_normal((9, 20)), rng.standard_normal((9, 2))
    groups = np.arange(9) > 0
    found = press_path(H, T, 0.1, intercept=True, groups=groups).curve
    np.testing.assert_allclose(found, curve_by_refits(H, T, 0.1, True, groups), rtol=1e-6)


def test_groups_of_one_are_samples(rng):
    H, T = rng.standard_normal((16, 9)), rng.standard_normal((16, 2))
    H[:, 5] = H[:, 1] - H[:, 2]
    single = press_path(H, T, intercept=True)
    grouped = press_path(H, T, intercept=True, groups=rng.permutation(16))
    np.testing.assert_allclose(grouped.curve, single.curve, rtol=1e-9)
    assert grouped.null_error == pytest.approx(single.null_error, rel=1e-12)
    assert grouped.dependent.tolist() == single.dependent.tolist() == [5]


def test_the_last_prefix_equals_cross_validation_of_scikit_learn(rng):
    H, T = rng.standard_normal((35, 20)) + 1, rng.standard_normal((35, 3)) - 4
    groups = rng.permutation(np.repeat(["a", "b", "c", "d", "e"], [8, 8, 8, 6, 5]))
    without = cross_val_predict(Ridge(0.7), H, T, groups=groups, cv=LeaveOneGroupOut())
    found = press_path(H, T, 0.7, intercept=True, groups=groups).curve[-1]
    np.testing.assert_allclose(found, np.mean((T - without) ** 2), rtol=1e-8)


def test_copies_deceive_who_leaves_out_one_at_a_time(rng):
    """Noise that is the same in all copies of a sample: a new group has another."""
    X = np.repeat(rng.standard_normal((12, 20)), 5, axis=0) + 0.01 * rng.standard_normal((60, 20))
    T = np.repeat(rng.standard_normal((12, 2)), 5, axis=0)
    alone, together = press_curve(X, T), press_path(X, T, groups=np.repeat(np.arange(12), 5)).curve
    assert alone[11] < 0.3 * together[11]


def test_a_group_that_alone_determines_a_coefficient_keeps_its_error(rng):
    H, T = rng.standard_normal((30, 17)), rng.standard_normal((30, 2))
    groups = np.repeat(np.arange(6), 5)
    H[:, 4] = np.where(groups == 3, rng.standard_normal(30), 0)
    path = press_path(H, T, groups=groups)
    assert path.unit_leverage.tolist() == [0] * 4 + [5] * 13
    assert np.isfinite(path.curve).all()


def test_rows_of_each_group():
    rows = rows_by_group(["b", "a", "b", "b", "b", "b"], 6)
    assert rows[:2].tolist() == [[1, *7 * [-1]], [0, 2, 3, 4, 5, *3 * [-1]]]
    assert (rows[2:] == -1).all()
    with pytest.raises(ValueError, match=r"groups has shape \(3,\); it needs one label for each of the 4 samples"):
        rows_by_group([1, 2, 3], 4)
    with pytest.raises(ValueError, match="all samples belong to one group"):
        rows_by_group([1, 1], 2)
