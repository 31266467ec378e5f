"""Scene files: what is written is read back, and damage is one sentence that names file and dataset."""

from dataclasses import fields

import h5py
import numpy as np
import pytest
from builders import grid_scene, labelled

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.scene_file import load_scene, room_type_from_name, save_scene


@pytest.fixture
def scene():
    generator = np.random.default_rng(0)
    features = generator.normal(size=(24, 2048)).astype(np.float32)
    made = labelled(grid_scene(2, 3, name="bedroom-7", features=features), 3, generator)
    views = generator.integers(0, 256, (24, 8, 8, 3), dtype=np.uint8)
    return type(made)(**{f.name: getattr(made, f.name) for f in fields(made)} | {"observation": views, "source": "t/1"})


def test_round_trip(scene, tmp_path):
    save_scene(scene, tmp_path / "scene.h5")
    loaded = load_scene(tmp_path / "scene.h5")
    for field in fields(scene):
        before, after = getattr(scene, field.name), getattr(loaded, field.name)
        if isinstance(before, np.ndarray):
            assert before.dtype == after.dtype
            np.testing.assert_array_equal(before, after)
        else:
            assert before == after
    assert [path.name for path in tmp_path.iterdir()] == ["scene.h5"]


def test_an_original_dump_is_read_as_it_is(scene, tmp_path):
    """Ten crops, 64-bit integers, no attributes, room type from the file's name."""
    path = tmp_path / "bathroom_02.h5"
    with h5py.File(path, "w") as file:
        file["observation"] = np.zeros((24, 6, 8, 3), np.uint8)
        file["resnet_feature"] = np.repeat(scene.features[:, None], 10, axis=1)
        file["location"] = scene.location
        file["rotation"] = scene.rotation
        file["graph"] = scene.graph.astype(np.int64)
        file["shortest_path_distance"] = scene.shortest_path_distance.astype(np.int64)
    loaded = load_scene(path, views=False)
    assert (loaded.name, loaded.room_type, loaded.encoder) == ("bathroom_02", "bathroom", "dump")
    assert loaded.observation is None
    assert loaded.visible_object is None
    np.testing.assert_array_equal(loaded.features, scene.features)


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("graph", lambda v: v[:, :3]),
        ("graph", lambda v: np.where(v == 1, 99, v)),
        ("graph", lambda v: v.astype(np.float32)),
        ("location", lambda v: v[:-1]),
        ("rotation", lambda v: v[:-2]),
        ("shortest_path_distance", lambda v: v[:, :-1]),
        ("resnet_feature", lambda v: np.where(v == v[0, 0, 0], np.nan, v)),
        ("resnet_feature", lambda v: v[:, 0]),
        ("visible_object", lambda v: v[:, :-1]),
        ("observation", lambda v: v.astype(np.float32)),
    ],
)
def test_damage_is_one_sentence(scene, tmp_path, name, damage):
    path = tmp_path / "scene.h5"
    save_scene(scene, path)
    with h5py.File(path, "r+") as file:
        values, attributes = file[name][()], dict(file[name].attrs)
        del file[name]
        file[name] = damage(values)
        file[name].attrs.update(attributes)
    with pytest.raises(InputError, match=rf"scene\.h5.*`{name}`"):
        load_scene(path)


@pytest.mark.parametrize("name", ["graph", "location", "rotation", "shortest_path_distance", "observation"])
def test_a_missing_dataset_is_named(scene, tmp_path, name):
    path = tmp_path / "scene.h5"
    save_scene(scene, path)
    with h5py.File(path, "r+") as file:
        del file[name]
    with pytest.raises(InputError, match=f"`{name}` is missing"):
        load_scene(path)


def test_other_files_are_refused(tmp_path):
    (tmp_path / "scene.h5").write_bytes(b"no scene at all")
    with pytest.raises(InputError, match="cannot be read as HDF5"):
        load_scene(tmp_path / "scene.h5")
    with pytest.raises(InputError, match="no such scene file"):
        load_scene(tmp_path / "absent.h5")


@pytest.mark.parametrize(
    ("name", "room_type"),
    [("bathroom_02", "bathroom"), ("living_room_08", "living_room"), ("LivingRoom-3", "living_room"), ("map01", "map")],
)
def test_room_type_from_the_name(name, room_type):
    assert room_type_from_name(name) == room_type
