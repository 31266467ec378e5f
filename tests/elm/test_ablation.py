"""The paper's ablation functions on small data of the same form."""

import numpy as np
import pytest

from relm_irl_jax.elm.ablation import (
    SELECTIONS,
    Pairs,
    accuracy_by_selection,
    accuracy_by_size,
    compare_regularisation,
)

NEURONS = 59
"""As many as determine the training pairs exactly."""


@pytest.fixture(scope="module")
def pairs():
    rng = np.random.default_rng(0)
    X = rng.standard_normal((120, 6))
    T = np.tanh(X @ rng.standard_normal((6, 3))) + 0.05 * rng.standard_normal((120, 3))
    targets = np.arange(60) // 4
    return Pairs(X[:60], T[:60], targets), Pairs(X[60:], T[60:], targets)


@pytest.fixture(scope="module")
def regularisation(pairs):
    return compare_regularisation(*pairs, n_hidden=NEURONS)


def test_accuracy_rises_then_falls_where_the_samples_are_used_up(pairs):
    curve = accuracy_by_size(*pairs, sizes=(1, 20, NEURONS), random_state=0)
    assert curve.sizes.tolist() == [1, 20, NEURONS]
    assert curve.test_r2[1] > curve.test_r2[0]
    assert curve.test_r2[1] > curve.test_r2[2]
    assert (np.diff(curve.train_r2) > 0).all()
    assert curve.train_r2[2] == pytest.approx(1)


def test_mrsr_and_press_predict_better(regularisation):
    assert regularisation.truth.shape == regularisation.elm.shape == regularisation.relm.shape == (60, 3)
    assert regularisation.relm_r2 > regularisation.elm_r2
    assert regularisation.kept == np.argmin(regularisation.press_curve) + 1
    assert len(regularisation.press_curve) == NEURONS


def test_every_selection_is_judged_on_the_test_pairs(pairs, regularisation):
    results = accuracy_by_selection(*pairs, n_hidden=NEURONS)
    assert list(results) == list(SELECTIONS)
    everything, *selected = results.values()
    assert (everything.kept, everything.ridge) == (NEURONS, 0.0)
    assert all(result.accuracy > everything.accuracy for result in selected)
    assert results["MRSR, PRESS leaves out pairs"].kept == regularisation.kept
    assert results["all neurons, ridge by PRESS of targets"].ridge > 0
    assert all(np.isnan(result.accuracy_in_unseen_scenes) for result in results.values())
    train, test = pairs
    for result in accuracy_by_selection(train, test, Pairs(test.X, test.T, test.target), n_hidden=NEURONS).values():
        assert result.accuracy_in_unseen_scenes == result.accuracy
