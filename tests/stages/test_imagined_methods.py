"""Which methods imagine targets, and what they are told."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from builders import grid_scene, labelled

from relm_irl_jax.config import Config
from relm_irl_jax.stages.training import SeedInputs, goals_of, imagined_of
from relm_irl_jax.task_settings import TaskSettings
from relm_irl_jax.tasks import draw_split


@pytest.fixture(scope="module")
def inputs():
    generator = np.random.default_rng(0)
    scenes = [labelled(grid_scene(3, 3, name=f"bathroom-{number}"), 6, generator) for number in (0, 1)]
    split = draw_split(scenes, (), TaskSettings(training_targets=4, new_targets_per_scene=4), 0)
    return SeedInputs(0, scenes, split, None)


def imagining(protocol):
    return replace(Config(), siamese=replace(Config().siamese, imagine=protocol, imagined_targets=5))


def test_methods_that_are_told_have_the_same_targets(inputs):
    rl, constant = (imagined_of(imagining("told"), method, inputs, None) for method in ("rl", "constant"))
    for number in (0, 1):
        trained = [target.state for target in inputs.split.training if target.scene == number]
        np.testing.assert_array_equal(rl.state[number], constant.state[number])
        assert rl.state[number][: len(trained)].tolist() == trained
        assert len(rl.state[number]) == len(trained) + 5
        assert not inputs.split.evaluation_only(number) & set(rl.state[number][len(trained) :].tolist())
    assert float(rl.reward[0].max()) == 10.0
    assert set(np.unique(constant.reward[0]).tolist()) == {-1.0, 0.0}
    assert bool(rl.told)
    assert bool(constant.told)


@pytest.mark.parametrize(
    ("protocol", "method"),
    [("told", "irl"), ("reward-alone", "rl"), ("reward-alone", "irl")],
)
def test_methods_without_a_reward_for_new_targets_have_the_given_ones(inputs, protocol, method):
    assert imagined_of(imagining(protocol), method, inputs, None) is None


def test_the_control_of_reward_alone_is_paid_at_the_target_only(inputs):
    control = imagined_of(imagining("reward-alone"), "constant", inputs, None)
    assert not bool(control.told)
    assert float(control.collision) == 0.0
    for reward, states in zip(control.reward, control.state, strict=True):
        np.testing.assert_array_equal(reward, np.arange(reward.shape[1]) == np.asarray(states)[:, None])


def test_the_control_of_the_metric_agent_imagines_without_hindsight(inputs):
    """It then has the goals and costs of RL with hindsight."""
    config = replace(Config(), goals=replace(Config().goals, hindsight="none"))
    rl, constant = (goals_of(config, method, inputs, None) for method in ("rl", "constant"))
    np.testing.assert_array_equal(rl.count, rl.trained)
    assert (np.asarray(constant.count) > np.asarray(constant.trained)).all()
    assert set(np.unique(constant.cost).tolist()) == {1.0}
    with_hindsight = goals_of(Config(), "rl", inputs, None)
    for left, right in zip(jax.tree.leaves(constant), jax.tree.leaves(with_hindsight), strict=True):
        np.testing.assert_array_equal(left, right)


def test_the_control_of_the_metric_agent_is_told_by_either_protocol(inputs):
    """To be paid at the target's view only is to be told of it."""
    told, alone = (
        replace(Config(), goals=replace(Config().goals, hindsight="none", arrival=arrival))
        for arrival in ("told", "reward-alone")
    )
    one, other = (goals_of(config, "constant", inputs, None) for config in (told, alone))
    for left, right in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(left, right)
    assert other.stop is None
