"""PRESS of penalties from one decomposition, against refits."""

import numpy as np
import pytest
from references import leave_out
from sklearn.base import clone

from relm_irl_jax.elm import ELMRegressor, press_path
from relm_irl_jax.elm.ridge_press import press_of_penalties

PENALTIES = [0.0, *np.logspace(-3, 1, 10)]
GROUPS = np.repeat(np.arange(15), 4)


@pytest.mark.parametrize("grouped", [False, True])
@pytest.mark.parametrize("columns", [20, 59])
def test_errors_equal_refits(columns, grouped, rng):
    H, T = np.tanh(rng.standard_normal((60, columns))) + 0.3, rng.standard_normal((60, 3)) + 2
    groups = rng.permutation(GROUPS) if grouped else None
    found = press_of_penalties(H, T, PENALTIES, groups)
    refitted = [np.mean(leave_out(H, T, penalty, True, groups) ** 2) for penalty in PENALTIES]
    if columns == 59:
        assert np.isinf(found[0])
        found, refitted = found[1:], refitted[1:]
    np.testing.assert_allclose(found, refitted, rtol=1e-8)


def test_dependent_columns_change_nothing(rng):
    H, T = rng.standard_normal((60, 20)), rng.standard_normal((60, 3))
    H[:, 4] = H[:, 0] - H[:, 1]
    expected = press_path(H, T, intercept=True).curve[-1]
    np.testing.assert_allclose(press_of_penalties(H, T, PENALTIES)[0], expected, rtol=1e-8)


def test_a_penalty_is_chosen_for_groups_that_were_never_seen(rng):
    """Copies of a sample tell its noise: leaving out one at a time asks for less penalty than new samples need."""
    X = rng.standard_normal((15, 3))
    T = X + rng.standard_normal((15, 3))
    X = np.repeat(X, 4, axis=0) + 0.05 * rng.standard_normal((60, 3))
    T = np.repeat(T, 4, axis=0)
    model = ELMRegressor(59, ordering="none", selection="none", ridge="press", random_state=0)
    alone, together = clone(model).fit(X, T), clone(model).fit(X, T, GROUPS)
    assert together.ridge_ > alone.ridge_
    new = rng.standard_normal((60, 3))
    error = [np.mean((fitted.predict(new) - new) ** 2) for fitted in (alone, together)]
    assert error[1] < 0.5 * error[0]
    assert together.press_curve_ is None
    assert together.diagnostics_.ridge_errors[together.ridge_] == min(together.diagnostics_.ridge_errors.values())
