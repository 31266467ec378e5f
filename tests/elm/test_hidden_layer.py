"""Random hidden layers: what is drawn, and projections of parts of the inputs."""

import numpy as np
import pytest

from relm_irl_jax.elm.hidden_layer import draw_hidden_layer


@pytest.mark.parametrize("inputs", [2, 4096])
def test_pre_activations_have_unit_spread_for_any_number_of_inputs(inputs, rng):
    X = rng.standard_normal((60, inputs)) * 7 + 1
    layer = draw_hidden_layer(X, 200, "tanh", np.random.RandomState(0))
    assert np.std((X - layer.mean) / layer.scale @ layer.weights) == pytest.approx(1, abs=0.15)


def test_linear_neurons_are_the_standardised_inputs(data):
    X, _ = data
    layer = draw_hidden_layer(X, 20, "linear", np.random.RandomState(0))
    np.testing.assert_allclose(layer(X), (X - X.mean(axis=0)) / X.std(axis=0), atol=1e-12)


@pytest.mark.parametrize("activation", ["tanh", "rbf"])
def test_inputs_may_be_projected_in_parts(activation, data):
    X, _ = data
    layer = draw_hidden_layer(X, 20, activation, np.random.RandomState(0)).select(np.arange(19, -1, -1))
    projection = layer.project(X[:, :2]) + layer.project(X[:, 2:], first=2)
    chosen = np.array([7, 3, 3])
    assert len(projection) == 60
    np.testing.assert_allclose(layer.activate(projection[chosen]), layer(X)[chosen], rtol=1e-12)
