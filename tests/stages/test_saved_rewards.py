"""Rewards that an interrupted run has left are those that were learned."""

from dataclasses import fields, replace

import jax
import numpy as np
import pytest
from tiny import two_rooms

from relm_irl_jax.config import Config
from relm_irl_jax.rewards.learned import learn_rewards, predicted_reward
from relm_irl_jax.rewards.settings import ElmSettings, IrlSettings
from relm_irl_jax.run_folder import RunFolder
from relm_irl_jax.stages.rewards import load_rewards, make_predictor, save_rewards
from relm_irl_jax.task_settings import TaskSettings
from relm_irl_jax.tasks import draw_split

CONFIG = Config(irl=IrlSettings(trajectories=2, dimension=6, processes=1), elm=ElmSettings(hidden=20))
SPLIT = TaskSettings(training_targets=4, new_targets_per_scene=2)


@pytest.fixture(scope="module")
def scenes():
    return two_rooms()


@pytest.fixture(scope="module")
def split(scenes):
    return draw_split(scenes, (), SPLIT, 0)


@pytest.fixture(scope="module")
def learned(scenes, split):
    return learn_rewards(scenes, split, CONFIG.irl, CONFIG.elm, 0)


@pytest.fixture
def folder(scenes, split, learned, tmp_path):
    folder = RunFolder(tmp_path)
    save_rewards(scenes, split, learned, 0, folder, maps=False)
    return folder


def same(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)


def test_what_is_read_is_what_was_learned(scenes, split, learned, folder):
    read = load_rewards(CONFIG, folder, scenes, split, 0)
    assert read is not None
    same(read.phi, learned.phi)
    assert read.form == learned.form
    assert len(read.demonstrated) == len(learned.demonstrated) > len(split.training)
    for one, other in zip(read.demonstrated, learned.demonstrated, strict=True):
        for field in fields(one):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name), field.name)
    for method in ("elm-irl", "relm-irl"):
        rewards = []
        for rewards_of in (read, learned):
            predictor = make_predictor(rewards_of, method, scenes)
            assert predictor is not None
            rewards.append(predicted_reward(scenes, split.training, predictor, from_current_view=False))
        same(*(jax.tree.leaves(reward) for reward in rewards))


@pytest.mark.parametrize("name", ["quality.csv", "demonstrated.safetensors", "elm-irl.safetensors"])
def test_what_is_missing_or_damaged_is_learned_again(scenes, split, folder, name):
    path = folder.rewards(0, name)
    if path.suffix == ".safetensors":
        content = bytearray(path.read_bytes())
        content[-3] ^= 1
        path.write_bytes(content)
    else:
        path.unlink()
    assert load_rewards(CONFIG, folder, scenes, split, 0) is None


def test_targets_of_another_split_are_not_those_that_were_learned(scenes, split, folder):
    others = [target for target in split.new if target.scene == 0]
    assert load_rewards(CONFIG, folder, scenes, replace(split, training=tuple(others)), 0) is None
