"""An ensemble equals its members fitted one by one."""

import numpy as np
import pytest

from relm_irl_jax.elm import ELMRegressor, fit_ensemble


@pytest.mark.parametrize("norm", [1, 2])
def test_members_are_the_regressors_of_their_seeds(norm, rng):
    X = rng.standard_normal((70, 3))
    T = np.stack([np.sin(X[:, 0]), X[:, 1] * X[:, 2]], axis=1) + 0.1 * rng.standard_normal((70, 2))
    ensemble = fit_ensemble(X, T, seeds=(3, 4, 5), n_hidden=25, norm=norm)
    for i, seed in enumerate((3, 4, 5)):
        model = ELMRegressor(25, norm=norm, random_state=seed).fit(X, T)
        assert ensemble.orders[i].tolist() == model.order_.tolist()
        np.testing.assert_allclose(ensemble.curves[i], model.press_curve_, rtol=1e-9)
        np.testing.assert_allclose(ensemble.members(X)[i], model.predict(X), atol=1e-9)
    np.testing.assert_allclose(ensemble.predict(X), ensemble.members(X).mean(axis=0))
