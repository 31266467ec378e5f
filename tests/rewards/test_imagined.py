"""Imagined targets: which views they are, and what arriving somewhere pays."""

import numpy as np
import pytest
from builders import grid_scene, labelled
from hypothesis import given
from hypothesis import strategies as st

from relm_irl_jax.rewards.equation import LinearRewardForm
from relm_irl_jax.rewards.imagined import constant_rewards, imagined_states, predicted_rewards
from relm_irl_jax.rewards.predicted import RewardPredictor
from relm_irl_jax.task_settings import TaskSettings
from relm_irl_jax.tasks import Target, TaskSplit, draw_split

SPLIT = TaskSplit((Target(0, 2),), (Target(0, 1),), (), ())


@given(seed=st.integers(0, 50), largest=st.integers(1, 60))
def test_evaluation_targets_are_never_imagined(seed, largest):
    generator = np.random.default_rng(seed)
    scenes = [labelled(grid_scene(3, 3, name=name), 6, generator) for name in ("bathroom-0", "bedroom-0")]
    split = draw_split(scenes, (), TaskSettings(training_targets=5, new_targets_per_scene=4), seed)
    states = imagined_states(scenes, split, largest, generator)
    for number, of_scene in enumerate(states):
        trained = [target.state for target in split.training if target.scene == number]
        assert of_scene[: len(trained)].tolist() == trained
        assert len(set(of_scene.tolist())) == len(of_scene) <= len(trained) + largest
        # A state that is both trained and drawn again as an evaluation target stays a given target alone.
        assert not split.evaluation_only(number) & set(of_scene[len(trained) :].tolist())


def test_constant_rewards_by_hand():
    scene = grid_scene(1, 1)
    targets = constant_rewards([scene], SPLIT, [np.array([2, 0])], step=-0.5, target=3.0, collision=-0.7, told=True)
    np.testing.assert_allclose(targets.reward[0], [[-0.5, -0.5, 3.0, -0.5], [3.0, -0.5, -0.5, -0.5]])
    assert int(targets.trained[0]) == 1
    assert bool(targets.told)
    assert float(targets.collision) == pytest.approx(-0.7)


def predictor(r_max=2.0):
    """One feature, whose weight is 1 for every pair."""

    class Ones(RewardPredictor):
        def __init__(self):
            self.phi = (np.array([[0.0], [0.5], [1.0], [-4.0]]),)
            self.form = LinearRewardForm(r_max, 0.6, relative=True)

        def weights(self, scene, start, target):
            return np.ones((len(start), 1))

    return Ones()


def test_predicted_rewards_by_hand():
    """Told: costs from 0.6 to 2, and 0 at the target. Alone: 2 · clip(1 + difference / (0.4 · 2), 0, 1)."""
    generator = np.random.default_rng(0)
    told = predicted_rewards(SPLIT, [np.array([2, 0])], predictor(), generator, None)
    np.testing.assert_allclose(told.reward[0], [[-1.0, -0.6, 0.0, -2.0], [0.0, -0.6, -0.6, -2.0]])
    assert bool(told.told)
    assert np.isinf(told.collision)
    alone = predicted_rewards(SPLIT, [np.array([2, 0])], predictor(), generator, 0.4)
    np.testing.assert_allclose(alone.reward[0], [[0.0, 0.75, 2.0, 0.0], [2.0, 2.0, 2.0, 0.0]])
    assert not bool(alone.told)
    assert float(alone.collision) == 0.0
