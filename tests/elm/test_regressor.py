"""The estimator: scikit-learn's contract, least squares, and what it selects."""

import numpy as np
import pytest
import scipy.linalg
from references import curve_by_refits
from sklearn.linear_model import RidgeCV
from sklearn.utils.estimator_checks import parametrize_with_checks

from relm_irl_jax.elm import ELMRegressor, mrsr_path, press_path
from relm_irl_jax.elm.hidden_layer import ACTIVATIONS


# Every check, none expected to fail. Few neurons: the checks fit some sixty data sets of different shapes.
@parametrize_with_checks([ELMRegressor(n_hidden=8)])
def test_the_estimator_contract(estimator, check):
    check(estimator)


@pytest.mark.parametrize(("activation", "n_hidden"), [*((kind, 20) for kind in ACTIVATIONS), ("tanh", 80)])
def test_without_selection_it_is_least_squares(activation, n_hidden, data):
    X, T = data
    model = ELMRegressor(n_hidden, activation, ordering="none", selection="none", random_state=3).fit(X, T)
    H = model.hidden_(X)
    if n_hidden < 60:
        weights = scipy.linalg.lstsq(np.hstack([H, np.ones((60, 1))]), T)[0][:-1]
    else:
        # The intercept takes up the direction of ones; what is orthogonal to it determines the weights.
        rest = scipy.linalg.null_space(np.ones((1, 60))).T
        weights = scipy.linalg.lstsq(rest @ H, rest @ T)[0]
    np.testing.assert_allclose(model.coef_, weights, rtol=1e-6, atol=1e-8 * np.abs(weights).max())
    np.testing.assert_allclose(model.predict(X).mean(axis=0), T.mean(axis=0))


def test_the_curve_is_the_leave_one_out_error_of_the_model_with_its_intercept(data):
    X, T = data
    for ordering in ("mrsr", "none"):
        for ridge in (0.0, 0.1):
            model = ELMRegressor(20, ordering=ordering, ridge=ridge, random_state=1).fit(X, T + 5)
            layer = ELMRegressor(20, ordering=ordering, selection="none", ridge=ridge, random_state=1).fit(X, T)
            expected = curve_by_refits(layer.hidden_(X), T + 5, ridge, intercept=True)
            np.testing.assert_allclose(model.press_curve_, expected, rtol=1e-8)
            assert model.n_selected_ == np.argmin(expected) + 1


def test_the_order_is_that_of_mrsr(data):
    X, T = data
    for norm in (1, 2):
        model = ELMRegressor(20, norm=norm, random_state=1).fit(X, T)
        H = ELMRegressor(20, ordering="none", selection="none", random_state=1).fit(X, T).hidden_(X)
        assert model.order_.tolist() == mrsr_path(H, T, norm).order.tolist()


def test_ridge_by_press(data):
    X, T = data
    model = ELMRegressor(20, ridge="press", random_state=1).fit(X, T)
    errors = model.diagnostics_.ridge_errors
    assert errors[model.ridge_] == min(errors.values()) == model.press_curve_.min()
    assert len(errors) > 5
    fixed = ELMRegressor(20, ordering="none", selection="none", ridge="press", random_state=1).fit(X, T)
    penalties = [ridge for ridge in fixed.diagnostics_.ridge_errors if ridge]
    peer = RidgeCV(penalties, store_cv_results=True).fit(fixed.hidden_(X), T)
    np.testing.assert_allclose(
        [fixed.diagnostics_.ridge_errors[ridge] for ridge in penalties],
        peer.cv_results_.mean(axis=(0, 1)),
        rtol=1e-6,
    )


def test_a_number_of_neurons(data):
    X, T = data
    model = ELMRegressor(20, selection=7, random_state=0).fit(X, T)
    assert model.n_selected_ == 7
    assert model.press_curve_ is None
    assert model.coef_.shape == (7, 3)
    assert ELMRegressor(5, selection=7, random_state=0).fit(X, T).n_selected_ == 5


def test_scale_and_shift_of_the_inputs_do_not_matter(data):
    X, T = data
    plain = ELMRegressor(20, random_state=0).fit(X, T)
    moved = ELMRegressor(20, random_state=0).fit(1e5 * X + 3e5, T)
    np.testing.assert_allclose(moved.predict(1e5 * X + 3e5), plain.predict(X), rtol=1e-6)


def test_a_seed_reproduces_and_seeds_differ(data):
    X, T = data
    first, second, third = (ELMRegressor(20, random_state=seed).fit(X, T).predict(X) for seed in (4, 4, 5))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, third)


def test_diagnostics(data):
    X, T = data
    X = np.hstack([X, X[:, :1], np.ones((60, 1))])
    model = ELMRegressor(activation="linear").fit(X, T)
    assert model.diagnostics_.rank == 4
    assert 5 in model.diagnostics_.dependent
    assert len({0, 4} & set(model.diagnostics_.dependent)) == 1
    assert model.diagnostics_.null_error == pytest.approx(press_path(0 * X, T, intercept=True).null_error)


def test_parameters_that_mean_nothing(data):
    bad = {"n_hidden": 0, "activation": "cos", "ordering": "best", "norm": 3, "selection": 0, "ridge": -1}
    for name, value in bad.items():
        with pytest.raises(ValueError, match=f"{name} must be"):
            ELMRegressor(**{name: value}).fit(*data)
