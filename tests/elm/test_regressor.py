"""The estimator: scikit-learn's contract, least squares, what it selects, and files."""

import numpy as np
import pytest
import scipy.linalg
from references import curve_by_refits
from safetensors.numpy import save_file
from sklearn.base import clone
from sklearn.linear_model import RidgeCV
from sklearn.utils.estimator_checks import parametrize_with_checks

from relm_irl_jax.elm import ELMRegressor, load_elm, mrsr_path, press_path, save_elm
from relm_irl_jax.elm.hidden import ACTIVATIONS


@pytest.fixture
def data(rng):
    X = rng.standard_normal((90, 4))
    T = np.stack([np.sin(2 * X[:, 0]), X[:, 1] * X[:, 2], X[:, 3]], axis=1)
    return X, T + 0.1 * rng.standard_normal(T.shape)


# Every check, none expected to fail. Twenty neurons: the checks fit some sixty small data sets.
@parametrize_with_checks([ELMRegressor(n_hidden=20)])
def test_the_estimator_contract(estimator, check):
    check(estimator)


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("n_hidden", [30, 200])
def test_without_selection_it_is_least_squares(activation, n_hidden, data):
    X, T = data
    model = ELMRegressor(n_hidden, activation, ordering="none", selection="none", random_state=3).fit(X, T)
    H = model.hidden_(X)
    if n_hidden < 90 or activation == "linear":
        weights = scipy.linalg.lstsq(np.hstack([H, np.ones((90, 1))]), T)[0][:-1]
    else:
        # The intercept takes up the direction of ones; what is orthogonal to it determines the weights.
        rest = scipy.linalg.null_space(np.ones((1, 90))).T
        weights = scipy.linalg.lstsq(rest @ H, rest @ T)[0]
    np.testing.assert_allclose(model.coef_, weights, rtol=1e-6, atol=1e-8 * np.abs(weights).max())
    np.testing.assert_allclose(model.predict(X).mean(axis=0), T.mean(axis=0))


def test_the_curve_is_the_leave_one_out_error_of_the_model_with_its_intercept(data):
    X, T = data
    for ordering in ("mrsr", "none"):
        for ridge in (0.0, 0.1):
            model = ELMRegressor(25, ordering=ordering, ridge=ridge, random_state=1).fit(X, T + 5)
            layer = ELMRegressor(25, ordering=ordering, selection="none", ridge=ridge, random_state=1).fit(X, T)
            expected = curve_by_refits(layer.hidden_(X), T + 5, ridge, intercept=True)
            np.testing.assert_allclose(model.press_curve_, expected, rtol=1e-8)
            assert model.n_selected_ == np.argmin(expected) + 1


def test_the_order_is_that_of_mrsr(data):
    X, T = data
    for norm in (1, 2):
        model = ELMRegressor(25, norm=norm, random_state=1).fit(X, T)
        H = ELMRegressor(25, ordering="none", selection="none", random_state=1).fit(X, T).hidden_(X)
        assert model.order_.tolist() == mrsr_path(H, T, norm).order.tolist()


def test_ridge_by_press(data):
    X, T = data
    model = ELMRegressor(60, ridge="press", random_state=1).fit(X, T)
    errors = model.diagnostics_.ridge_press
    assert errors[model.ridge_] == min(errors.values()) == model.press_curve_.min()
    assert len(errors) > 5
    fixed = ELMRegressor(60, ordering="none", selection="none", ridge="press", random_state=1).fit(X, T)
    penalties = [ridge for ridge in fixed.diagnostics_.ridge_press if ridge]
    peer = RidgeCV(penalties, store_cv_results=True).fit(fixed.hidden_(X), T)
    np.testing.assert_allclose(
        [fixed.diagnostics_.ridge_press[ridge] for ridge in penalties],
        peer.cv_results_.mean(axis=(0, 1)),
        rtol=1e-6,
    )


def test_a_number_of_neurons(data):
    X, T = data
    model = ELMRegressor(40, selection=7, random_state=0).fit(X, T)
    assert model.n_selected_ == 7
    assert model.press_curve_ is None
    assert model.coef_.shape == (7, 3)
    assert ELMRegressor(5, selection=7, random_state=0).fit(X, T).n_selected_ == 5


def test_scale_and_shift_of_the_inputs_do_not_matter(data):
    X, T = data
    plain = ELMRegressor(40, random_state=0).fit(X, T)
    moved = ELMRegressor(40, random_state=0).fit(1e5 * X + 3e5, T)
    np.testing.assert_allclose(moved.predict(1e5 * X + 3e5), plain.predict(X), rtol=1e-6)


@pytest.mark.parametrize("inputs", [2, 4096])
def test_pre_activations_have_unit_spread_for_any_number_of_inputs(inputs, rng):
    X = rng.standard_normal((60, inputs)) * 7 + 1
    layer = ELMRegressor(200, ordering="none", selection="none", random_state=0).fit(X, X[:, 0]).hidden_
    assert np.std((X - layer.mean) / layer.scale @ layer.weights) == pytest.approx(1, abs=0.15)


def test_a_seed_reproduces_and_seeds_differ(data):
    X, T = data
    first, second, third = (ELMRegressor(30, random_state=seed).fit(X, T).predict(X) for seed in (4, 4, 5))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, third)


def test_pass_through(data):
    X, T = data
    model = ELMRegressor(10, ordering="none", selection="none", pass_through=True, random_state=0).fit(X, T)
    np.testing.assert_allclose(model.hidden_(X)[:, 10:], (X - X.mean(axis=0)) / X.std(axis=0), atol=1e-12)


def test_diagnostics(data):
    X, T = data
    X = np.hstack([X, X[:, :1], np.ones((90, 1))])
    model = ELMRegressor(activation="linear").fit(X, T)
    assert model.diagnostics_.rank == 4
    assert 5 in model.diagnostics_.dropped
    assert len({0, 4} & set(model.diagnostics_.dropped)) == 1
    assert model.diagnostics_.press_empty == pytest.approx(press_path(0 * X, T, intercept=True).empty)


def test_parameters_that_mean_nothing(data):
    bad = {"n_hidden": 0, "activation": "cos", "ordering": "best", "norm": 3, "selection": 0, "ridge": -1, "gain": 0.0}
    for name, value in bad.items():
        with pytest.raises(ValueError, match=f"{name} must be"):
            ELMRegressor(**{name: value}).fit(*data)


@pytest.mark.parametrize(
    "parameters", [{}, {"ridge": "press", "ordering": "none"}, {"selection": 3, "activation": "rbf"}]
)
def test_a_file_gives_the_same_model(parameters, data, tmp_path):
    X, T = data
    model = ELMRegressor(20, random_state=0, **parameters).fit(X, T[:, 0])
    save_elm(model, tmp_path / "model.safetensors")
    loaded = load_elm(tmp_path / "model.safetensors")
    assert loaded.get_params() == model.get_params()
    assert np.array_equal(loaded.predict(X), model.predict(X))
    assert loaded.diagnostics_.ridge_press == model.diagnostics_.ridge_press
    for name, value in vars(model).items():
        if isinstance(value, np.ndarray):
            assert np.array_equal(getattr(loaded, name), value)
    if model.mrsr_ is not None:
        assert np.array_equal(loaded.mrsr_.step, model.mrsr_.step)
    assert clone(loaded).get_params() == model.get_params()


def test_files_that_hold_no_model(tmp_path):
    with pytest.raises(ValueError, match="does not exist"):
        load_elm(tmp_path / "none")
    (tmp_path / "text").write_text("hello")
    with pytest.raises(ValueError, match="not a safetensors file"):
        load_elm(tmp_path / "text")
    save_file({"a": np.ones(1)}, tmp_path / "other")
    with pytest.raises(ValueError, match="holds no regressor"):
        load_elm(tmp_path / "other")
    save_file({"a": np.ones(1)}, tmp_path / "later", metadata={"format": "relm-irl-jax/elm", "version": "99"})
    with pytest.raises(ValueError, match="version 99"):
        load_elm(tmp_path / "later")
