"""The paper's ablation functions on small data of the same form."""

import numpy as np
import pytest

from relm_irl_jax.elm.ablation import WAYS, accuracy_by_choice, accuracy_by_size, before_and_after, leave_one_out_curve


@pytest.fixture
def pairs(rng):
    X = rng.standard_normal((150, 6))
    T = np.tanh(X @ rng.standard_normal((6, 3))) + 0.05 * rng.standard_normal((150, 3))
    return X[:100], T[:100], X[100:], T[100:]


def test_accuracy_rises_then_falls_where_the_samples_are_used_up(pairs):
    curve = accuracy_by_size(*pairs, sizes=(1, 30, 99), random_state=0)
    assert curve.sizes.tolist() == [1, 30, 99]
    assert curve.test[1] > curve.test[0]
    assert curve.test[1] > curve.test[2]
    assert (np.diff(curve.train) > 0).all()
    assert curve.train[2] == pytest.approx(1)


def test_before_and_after(pairs):
    predictions, model = before_and_after(*pairs, n_hidden=90)
    assert predictions.truth.shape == predictions.plain.shape == predictions.regularised.shape == (50, 3)
    assert predictions.regularised_accuracy > predictions.plain_accuracy
    curve = leave_one_out_curve(model)
    assert curve.best == predictions.kept == np.argmin(curve.error) + 1
    assert len(curve.error) == 90


def test_every_way_to_choose_neurons_is_judged_on_the_test_pairs(pairs):
    choices = accuracy_by_choice(*pairs, np.arange(100) // 2, n_hidden=90)
    assert list(choices) == list(WAYS)
    everything, *chosen = choices.values()
    assert (everything.kept, everything.ridge) == (90, 0.0)
    assert all(choice.accuracy > everything.accuracy for choice in chosen)
    assert choices["MRSR, PRESS leaves out pairs"].kept == before_and_after(*pairs, n_hidden=90)[0].kept
    assert choices["all neurons, ridge by PRESS of targets"].ridge > 0
