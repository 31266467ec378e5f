"""Worlds of tasks: scenes that have a target and no others, heads by room type, standardised features."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import grid_scene, labelled

from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.training import scene_heads
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.scene_file import save_scene
from relm_irl_jax.stages.encoding import EncodedScenes, encode_training
from relm_irl_jax.stages.worlds import evaluation_task, standardised_world
from relm_irl_jax.task_settings import TaskSettings
from relm_irl_jax.tasks import draw_split


def room(number: int, prefix: str = "") -> Scene:
    generator = np.random.default_rng(number)
    scene = labelled(grid_scene(4, 5, name=f"bathroom-{number}"), 6, generator)
    features = generator.normal(size=(scene.n_states, 8)).astype(np.float32)
    views = np.zeros((scene.n_states, 4, 4, 3), np.uint8)
    return replace(
        scene, features=features, observation=views, encoder="x", categories=tuple(prefix + c for c in scene.categories)
    )


def folder_of(scenes: list[Scene], path: Path) -> tuple[Config, EncodedScenes]:
    for scene in scenes:
        save_scene(scene, path / f"{scene.name}.h5")
    config = replace(Config(), scenes=str(path), tasks=TaskSettings(training_targets=4, new_targets_per_scene=4))
    return config, encode_training(config)


def test_unseen_scenes_without_a_target_are_left_out(tmp_path):
    config, training = folder_of([room(0), room(1), room(2, "strange "), room(3)], tmp_path)
    task = evaluation_task(config, training, "III", 0)
    assert [scene.name for scene in task.scenes] == ["bathroom-3"]
    split = draw_split(training.scenes, [room(2, "strange "), room(3)], config.tasks, 0)
    assert np.asarray(task.targets.state).tolist() == [target.state for target in split.similar]
    assert not np.asarray(task.targets.scene).any()
    assert len(task.world.features) == task.scenes[0].n_states
    assert len(evaluation_task(config, training, "II", 0).scenes) == 2


def test_room_types_and_features_are_those_of_the_training_scenes():
    training = [room(0), replace(room(1), name="bedroom-1", room_type="bedroom")]
    strange = replace(room(2), name="attic-2", room_type="attic")
    world = standardised_world([training[1], strange], training)
    assert world.room_type.tolist() == [1, -1]
    assert world.training_scene.tolist() == [1, -1]
    assert world.names == ("bedroom-1", "attic-2")
    features = np.concatenate([scene.encoded for scene in training])
    expected = (training[1].encoded - features.mean(0)) / features.std(0)
    np.testing.assert_allclose(world.features[: training[1].n_states], expected, rtol=1e-4, atol=1e-5)
    with pytest.raises(InputError, match=r"attic-2: siamese\.heads = room_type has no head"):
        scene_heads(world, SiameseSettings(heads="room_type"))
    assert scene_heads(world, SiameseSettings(heads="shared")).tolist() == [0, 0]
