"""Work that the memory does not suffice for is refused before it begins, with the estimate."""

import weakref
from dataclasses import replace

import h5py
import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax import hardware, pipeline
from relm_irl_jax.config import Config
from relm_irl_jax.errors import InputError
from relm_irl_jax.features.encoder import Encoder
from relm_irl_jax.scenes import mapped_copy, scene_file, selection
from relm_irl_jax.scenes.mapped_copy import map_copy
from relm_irl_jax.scenes.scene_file import load_scene, save_scene
from relm_irl_jax.stages import encoding, memory
from relm_irl_jax.stages.memory import MAPPED_CELL, MAPPED_VIEW, check_memory, check_scenes_memory, estimates

CONFIG = Config()


def test_the_defaults_fit_into_two_gigabytes():
    for agent in ("siamese", "metric", "recurrent", "savn"):
        assert max(estimates(replace(CONFIG, agent=agent)).values()) < 2e9


@pytest.mark.parametrize(
    ("config", "said"),
    [
        (replace(CONFIG, siamese=replace(CONFIG.siamese, workers=10**6, t_max=1000)), r"siamese\.workers.*4,096\.0 GB"),
        (
            replace(CONFIG, agent="recurrent", recurrent=replace(CONFIG.recurrent, workers=10**6)),
            r"recurrent\.workers",
        ),
        (replace(CONFIG, agent="metric", metric=replace(CONFIG.metric, states=10**5, goals=10**5)), r"metric\.states"),
        (replace(CONFIG, elm=replace(CONFIG.elm, hidden=10**6, pairs=10**6)), r"elm\.hidden.*24,000\.0 GB"),
        (replace(CONFIG, scene=replace(CONFIG.scene, training_per_type=1000)), r"scene\.training_per_type: features"),
        (
            replace(CONFIG, agent="map", methods=("rl",), scene=replace(CONFIG.scene, training_per_type=1000)),
            r"scene\.training_per_type: the mapping agent's look at the views",
        ),
        (
            replace(
                CONFIG, agent="map", methods=("rl",), task="III", scene=replace(CONFIG.scene, unseen_per_type=1000)
            ),
            r"scene\.unseen_per_type: the mapping agent's look at the views",
        ),
    ],
)
def test_absurd_sizes_are_refused_with_the_estimate(config, said, tmp_path, monkeypatch):
    monkeypatch.setattr(hardware, "available_memory", lambda: 10**10)
    with pytest.raises(InputError, match=rf"{said}.*and 10\.0 GB are available"):
        check_memory(config)
    monkeypatch.setattr(pipeline, "encode_training", None)
    with pytest.raises(InputError, match="GB"):
        pipeline.run(replace(config, run=tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_rooms_without_a_target_are_refused_before_they_are_rendered(tmp_path, monkeypatch):
    monkeypatch.setattr(pipeline, "encode_training", None)
    scene = replace(CONFIG.scene, training_per_type=7)
    with pytest.raises(InputError, match="20 leave some of the 21 training rooms without a target"):
        pipeline.run(replace(CONFIG, agent="siamese", scene=scene, run=tmp_path / "run"))
    assert not (tmp_path / "run").exists()


def test_a_large_scene_is_refused_for_agents_that_learn_from_goals(monkeypatch):
    scenes = [grid_scene(2, 2), grid_scene(5, 5)]
    monkeypatch.setattr(hardware, "available_memory", lambda: 2 * 100**2 * 8 * 4 - 1)
    monkeypatch.setattr(memory, "MAPPED_VIEW", 1)
    monkeypatch.setattr(memory, "MAPPED_CELL", 1)
    for agent in ("metric", "map"):
        trained = replace(CONFIG.map, weights="train")
        config = replace(CONFIG, agent=agent, methods=("rl",), map=trained, scenes="a folder")
        with pytest.raises(InputError, match=f"training the {agent} agent on 100 states of a scene .* needs about"):
            check_scenes_memory(config, scenes)
        check_scenes_memory(config, scenes[:1])
    check_scenes_memory(replace(CONFIG, methods=("rl",)), scenes)


def test_a_folder_whose_views_do_not_fit_is_refused_before_they_are_read(tmp_path, monkeypatch):
    for number in range(4):
        save_scene(grid_scene(2, 2, name=f"bathroom-{number}"), tmp_path / f"{number}.h5")
    scene = replace(CONFIG.scene, training_per_type=3)
    config = replace(CONFIG, agent="map", methods=("rl",), scenes=str(tmp_path), scene=scene)
    scenes = [load_scene(tmp_path / f"{number}.h5", views=False) for number in range(3)]
    packaged = replace(config, map=replace(CONFIG.map, weights="package"))
    one = replace(packaged, task="I", tasks=replace(CONFIG.tasks, training_targets=1))
    unseen = replace(packaged, task="III")
    for case, states in ((config, 48), (packaged, 48), (one, 16), (unseen, 16), (replace(config, task="III"), 48)):
        monkeypatch.setattr(hardware, "available_memory", lambda states=states: states * MAPPED_VIEW - 1)
        monkeypatch.setattr(selection, "require_views", lambda path: None)
        with pytest.raises(InputError, match=f"the mapping agent's look at the views of {states} states needs about"):
            check_scenes_memory(case, scenes)
        monkeypatch.setattr(hardware, "available_memory", lambda states=states: states * MAPPED_VIEW)
        check_scenes_memory(case, scenes)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"tasks": replace(CONFIG.tasks, training_targets=10**6)}, r"tasks\.training_targets"),
        ({"elm": replace(CONFIG.elm, hidden=10**6, pairs=10)}, r"elm\.hidden"),
        ({"siamese": replace(CONFIG.siamese, targets_at_once=10**4)}, r"siamese\.targets_at_once"),
        ({"siamese": replace(CONFIG.siamese, imagined_targets=10**4)}, None),  # a scene has few states
    ],
)
def test_tables_of_predictions_that_do_not_fit_are_refused(changes, said, monkeypatch):
    monkeypatch.setattr(hardware, "available_memory", lambda: 10**9)
    scenes, config = [grid_scene(5, 5)], replace(CONFIG, agent="siamese", **changes)
    check_scenes_memory(replace(config, methods=("rl", "irl")), scenes)
    if said is None:
        return check_scenes_memory(config, scenes)
    with pytest.raises(InputError, match=rf"{said}.* and 1\.0 GB are available"):
        check_scenes_memory(config, scenes)
    return None


@pytest.mark.parametrize("task", ["I", "III"])
def test_scenes_too_wide_to_be_mapped_are_refused(task, monkeypatch, tmp_path):
    """Of 90 places along a side, a map has 2 · (96 + 12) = 216 rows, whatever the others need."""
    scenes = [grid_scene(90, 1), grid_scene(17, 1, name="bathroom-1")]
    loaders = [lambda *, views, scene=scene: scene for scene in scenes]
    monkeypatch.setattr(memory, "unseen_scenes", lambda *_: loaders)
    monkeypatch.setattr(memory, "MAPPED_VIEW", 1)
    config = replace(CONFIG, agent="map", methods=("rl",), task=task, scenes=str(tmp_path))
    config = replace(config, map=replace(CONFIG.map, weights="package"))
    monkeypatch.setattr(hardware, "available_memory", lambda: 2 * 216**2 * MAPPED_CELL - 1)
    with pytest.raises(InputError, match="the mapping agent's map of scenes up to 90 places wide needs about"):
        check_scenes_memory(config, scenes)
    check_scenes_memory(replace(config, agent="metric"), scenes)
    monkeypatch.setattr(hardware, "available_memory", lambda: 2 * 216**2 * MAPPED_CELL)
    check_scenes_memory(config, scenes)


def test_a_scene_that_does_not_fit_is_refused(tmp_path, monkeypatch):
    scene = replace(grid_scene(2, 2), observation=np.zeros((16, 20, 20, 3), np.uint8))
    save_scene(scene, tmp_path / "a.h5")
    monkeypatch.setattr(hardware, "available_memory", lambda: 10_000)
    assert load_scene(tmp_path / "a.h5", views=False).n_states == 16
    with pytest.raises(InputError, match=r"a\.h5: reading the scene needs about"):
        load_scene(tmp_path / "a.h5")


def test_the_views_of_one_scene_at_a_time_are_in_memory(tmp_path, monkeypatch):
    """Of every scene's views, only features and a few views to calibrate the encoder remain."""
    generator, alive = np.random.default_rng(0), []
    for number in range(5):
        views = generator.integers(0, 256, (16, 8, 8, 3), dtype=np.uint8)
        scene = replace(grid_scene(2, 2, name=f"bathroom-{number}"), observation=views, features=None)
        save_scene(scene, tmp_path / f"{number}.h5")

    def read(path, *, views=True):
        scene = load_scene(path, views=views)
        if views:
            alive.append(weakref.ref(scene.views))
            assert sum(array() is not None for array in alive) <= 2  # the one before is not freed yet
        return scene

    def features(scene, encoder):
        return replace(scene, features=scene.views.reshape(scene.n_states, -1).astype(np.float32))

    monkeypatch.setattr(selection, "load_scene", read)
    monkeypatch.setattr(encoding, "encode_scene", features)
    monkeypatch.setattr(encoding, "make_encoder", lambda settings, views: Encoder("resnet50", {}, "pixels", "", 8))
    config = replace(CONFIG, scenes=str(tmp_path), scene=replace(CONFIG.scene, training_per_type=4))
    training = encoding.encode_training(config)
    assert len(alive) == 2 * len(training.scenes) == 8
    (unseen,) = encoding.encode_unseen(config, training)
    assert unseen.name == "bathroom-4"
    assert all(scene.observation is None for scene in (*training.scenes, unseen))


@pytest.mark.parametrize("layout", [{}, {"compression": "gzip"}, {"dtype": np.int64}, {"dtype": np.float32}])
def test_a_large_table_of_distances_stays_in_a_file_of_its_own(tmp_path, monkeypatch, layout):
    scene = replace(grid_scene(3, 2), features=None)
    save_scene(scene, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        del file["shortest_path_distance"]
        file.create_dataset("shortest_path_distance", data=scene.shortest_path_distance, **layout)
    monkeypatch.setattr(scene_file, "IN_FILE_BYTES", 100)
    monkeypatch.setattr(scene_file, "ROWS_AT_ONCE", 5)
    found = load_scene(tmp_path / "a.h5", views=False)
    assert isinstance(found.shortest_path_distance, np.memmap) == (not layout)
    assert found.shortest_path_distance.dtype == np.int32
    assert (found.shortest_path_distance == scene.shortest_path_distance).all()
    if layout:
        return
    again = load_scene(tmp_path / "a.h5", views=False)
    assert again.shortest_path_distance is found.shortest_path_distance
    # A file written anew, or overwritten in place by anything, does not change a scene that is in use.
    save_scene(grid_scene(2, 3), tmp_path / "a.h5")
    assert not (load_scene(tmp_path / "a.h5", views=False).shortest_path_distance == scene.shortest_path_distance).all()
    (tmp_path / "a.h5").write_bytes(b"x")
    assert (found.shortest_path_distance == scene.shortest_path_distance).all()


def test_a_copy_without_room_is_refused(tmp_path, monkeypatch):
    (tmp_path / "table").write_bytes(bytes(64))
    assert map_copy(tmp_path / "table", 0, (4, 4)).sum() == 0
    with pytest.raises(InputError, match="table: became shorter"):
        map_copy(tmp_path / "table", 32, (4, 4))
    (tmp_path / "full").write_bytes(b"")
    monkeypatch.setattr(mapped_copy, "cache_folder", lambda: tmp_path / "full")
    with pytest.raises(InputError, match=r"full: no room for a copy of the distances of .*table"):
        map_copy(tmp_path / "table", 0, (4, 4))


def test_where_the_system_says_nothing_nothing_is_refused(monkeypatch):
    monkeypatch.setattr(hardware, "available_memory", lambda: None)
    check_memory(replace(CONFIG, siamese=replace(CONFIG.siamese, workers=10**6, t_max=1000)))


def test_this_computer_has_memory():
    available = hardware.available_memory()
    assert available is None or 10**7 < available < 10**14
