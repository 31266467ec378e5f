import numpy as np
import pytest

from relm_irl_jax.experts import shortest_path_expert
from relm_irl_jax.irl import feature_expectations, relative_features
from relm_irl_jax.irl.expectations import mean_feature_expectations

from .problems import ring, smooth_features

SCENE = ring()
FEATURES = smooth_features(SCENE, 5, seed=0)


@pytest.mark.parametrize("discount", [0.3, 0.9, 0.99, 0.9999])
def test_equals_the_linear_solve(discount):
    for next_state in (
        shortest_path_expert(SCENE, 7).next_state,
        np.random.default_rng(0).integers(0, SCENE.n_states, SCENE.n_states).astype(np.int32),
    ):
        transition = np.eye(SCENE.n_states)[next_state]
        expected = np.linalg.solve(np.eye(SCENE.n_states) - discount * transition, FEATURES)
        found = feature_expectations(FEATURES, next_state, discount)
        assert found.dtype == np.float64
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
        starts = np.array([1, 5])
        mean = mean_feature_expectations(FEATURES, next_state, discount, starts)
        np.testing.assert_allclose(mean, expected[starts].mean(axis=0), rtol=1e-9, atol=1e-9)


def test_the_corridor_counts_the_steps_to_an_absorbing_target():
    # One state per step 0-1-2-3 with the target at the end, a reward of 1 away from it: V(s) = 1 + γ + …
    # until arrival.
    away = np.array([[1.0], [1.0], [1.0], [0.0]])
    found = feature_expectations(away, np.array([1, 2, 3, 3], np.int32), 0.5)
    np.testing.assert_allclose(found[:, 0], [1.75, 1.5, 1.0, 0.0], rtol=1e-12)


def test_relative_features_shift_every_value_alike():
    expert = shortest_path_expert(SCENE, 5)
    absolute = feature_expectations(FEATURES, expert.next_state, 0.9)
    relative = feature_expectations(relative_features(FEATURES, 5), expert.next_state, 0.9)
    np.testing.assert_allclose(absolute - relative, np.tile(FEATURES[5] / 0.1, (SCENE.n_states, 1)), rtol=1e-10)
    np.testing.assert_allclose(relative[5], 0.0, atol=1e-12)
