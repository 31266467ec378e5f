"""Where a task is evaluated: scenes that have a target, and no others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from builders import grid_scene, labelled
from relm_irl_jax.stages.ground import ground_of

from relm_irl_jax.config import Config
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.scene_file import save_scene
from relm_irl_jax.stages.encoding import EncodedScenes, encode_training
from relm_irl_jax.tasks import TaskSettings, draw_split


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
    ground = ground_of(config, training, "III", 0)
    assert [scene.name for scene in ground.scenes] == ["bathroom-3"]
    split = draw_split(training.scenes, [room(2, "strange "), room(3)], config.tasks, 0)
    assert np.asarray(ground.targets.state).tolist() == [target.state for target in split.similar]
    assert not np.asarray(ground.targets.scene).any()
    assert len(ground.world.features) == ground.scenes[0].n_states
    assert len(ground_of(config, training, "II", 0).scenes) == 2
