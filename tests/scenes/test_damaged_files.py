"""Whatever happened to a scene file, reading it gives a scene or one sentence that names the file."""

import h5py
import numpy as np
import pytest
from builders import grid_scene, labelled
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.check import check_files
from relm_irl_jax.scenes.scene import Scene
from relm_irl_jax.scenes.scene_file import load_scene

FUZZ = settings(max_examples=60, deadline=2000, derandomize=True, suppress_health_check=list(HealthCheck))
DATASETS = (
    "graph",
    "location",
    "rotation",
    "shortest_path_distance",
    "resnet_feature",
    "observation",
    "visible_object",
)


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """An original dump with labels: 24 states, ten crops of short features, 64-bit integers, compressed frames."""
    generator = np.random.default_rng(0)
    features = generator.normal(size=(24, 8)).astype(np.float32)
    scene = labelled(grid_scene(2, 3, features=features), 3, generator)
    path = tmp_path_factory.mktemp("original") / "bathroom_02.h5"
    with h5py.File(path, "w") as file:
        views = generator.integers(0, 256, (24, 3, 4, 3), dtype=np.uint8)
        file.create_dataset("observation", data=views, chunks=(1, 3, 4, 3), compression="lzf")
        file["resnet_feature"] = np.repeat(features[:, None], 10, axis=1)
        file["location"], file["rotation"] = scene.location, scene.rotation
        file["graph"] = scene.graph.astype(np.int64)
        file["shortest_path_distance"] = scene.shortest_path_distance.astype(np.int64)
        file["visible_object"] = scene.visible_object
        file["visible_object"].attrs["categories"] = list(scene.categories)
    return path


def read(path):
    """A scene, or None and one sentence that names the file; the check never raises either."""
    checked = check_files([path])[0]
    try:
        scene = load_scene(path)
    except InputError as error:
        sentence = str(error)
    else:
        assert isinstance(scene, Scene)
        assert checked.scene is not None
        return scene
    assert sentence.startswith(f"{path}: ")
    assert "\n" not in sentence
    assert checked.faults == (sentence,)
    return None


def test_the_undamaged_file_is_read(original):
    assert read(original).n_states == 24


@FUZZ
@given(share=st.floats(0, 1, exclude_max=True))
def test_truncated_files(original, share):
    content = original.read_bytes()
    damaged = original.with_name("damaged.h5")
    damaged.write_bytes(content[: int(len(content) * share)])
    assert read(damaged) is None


@FUZZ
@given(data=st.data())
def test_flipped_bytes(original, data):
    content = bytearray(original.read_bytes())
    # The first kilobytes hold the structure, where a flipped byte does most.
    end = data.draw(st.sampled_from([len(content), 4096]))
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, end - 1))] = data.draw(st.integers(0, 255))
    damaged = original.with_name("damaged.h5")
    damaged.write_bytes(content)
    read(damaged)


TYPES = ("uint8", "int8", "int64", "uint64", "float16", "float32", "float64", "complex64", "bool", "S3", "structured")


def retyped(values, name):
    if name == "structured":
        return np.zeros(values.shape, [("a", np.int32), ("b", np.float32)])
    with np.errstate(all="ignore"):
        return values.astype(name)


@FUZZ
@given(data=st.data())
def test_datasets_of_other_types_and_shapes(original, data):
    damaged = original.with_name("damaged.h5")
    damaged.write_bytes(original.read_bytes())
    with h5py.File(damaged, "r+") as file:
        for name in data.draw(st.lists(st.sampled_from(DATASETS), min_size=1, max_size=3, unique=True)):
            values, attributes = file[name][()], dict(file[name].attrs)
            del file[name]
            fate = data.draw(st.sampled_from(["missing", "group", "scalar", "empty", "null", "text", "type", "shape"]))
            if fate == "group":
                file.create_group(name)
            elif fate == "scalar":
                file[name] = 3.0
            elif fate == "empty":
                file[name] = values[:0]
            elif fate == "null":
                file[name] = h5py.Empty("f4")
            elif fate == "text":
                file.create_dataset(name, data=["a", "b"] * 12, dtype=h5py.string_dtype())
            elif fate == "type":
                file[name] = retyped(values, data.draw(st.sampled_from(TYPES)))
            elif fate == "shape":
                axis = data.draw(st.integers(0, values.ndim - 1))
                file[name] = data.draw(
                    st.sampled_from(
                        [
                            values.ravel(),
                            values[None],
                            values[..., None],
                            values.swapaxes(0, axis),
                            values.take([0], axis),
                        ]
                    )
                )
            if name in file and isinstance(file[name], h5py.Dataset):
                file[name].attrs.update(attributes)
    read(damaged)


@pytest.mark.parametrize(
    ("dataset", "damage", "sentence"),
    [
        ("location", lambda v: v * np.nan, "not finite"),
        ("rotation", lambda v: np.where(v == 90, np.inf, v), "not finite"),
        ("location", lambda v: v.astype("S8"), "must contain real numbers"),
        ("shortest_path_distance", lambda v: v - 2, "-1 or more"),
        ("shortest_path_distance", lambda v: v + 1e12, "-1 or more"),
        ("visible_object", lambda v: v + 1, "between 0 and 1"),
        ("visible_object", lambda v: v * np.nan, "not finite"),
        ("resnet_feature", lambda v: v.astype(np.complex64), "must contain real numbers"),
    ],
)
def test_values_out_of_range(original, dataset, damage, sentence):
    damaged = original.with_name("damaged.h5")
    damaged.write_bytes(original.read_bytes())
    with h5py.File(damaged, "r+") as file:
        values, attributes = file[dataset][()], dict(file[dataset].attrs)
        del file[dataset]
        file[dataset] = damage(values)
        file[dataset].attrs.update(attributes)
    with pytest.raises(InputError, match=rf"damaged\.h5.*`{dataset}`.*{sentence}"):
        load_scene(damaged)


@pytest.mark.parametrize(
    ("attribute", "value"), [("room_type", np.arange(3)), ("name", 3.5), ("name", "../../elsewhere"), ("room_type", "")]
)
def test_names_that_are_none(original, attribute, value):
    """They become file names in a run folder, so that `../` must not pass."""
    damaged = original.with_name("damaged.h5")
    damaged.write_bytes(original.read_bytes())
    with h5py.File(damaged, "r+") as file:
        file.attrs[attribute] = value
    with pytest.raises(InputError, match=rf"damaged\.h5: attribute `{attribute}` must be a name"):
        load_scene(damaged)
