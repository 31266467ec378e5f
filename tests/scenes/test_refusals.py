"""Loading refuses what `relm-irl scenes check` refuses, and scenes that cannot be used together."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from builders import grid_scene
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes import consistency
from relm_irl_jax.scenes.check import check_files, check_table
from relm_irl_jax.scenes.scene_file import load_scene, save_scene
from relm_irl_jax.scenes.selection import training_scenes, unseen_scenes
from relm_irl_jax.scenes.settings import SceneSettings


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setattr(consistency, "cache_folder", lambda: tmp_path / "cache")
    return tmp_path / "cache"


def scene(name="bathroom-0", **changes):
    return replace(grid_scene(2, 2, name=name), observation=np.zeros((16, 4, 4, 3), np.uint8), **changes)


@settings(max_examples=50, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_loading_and_checking_agree_on_every_rewired_scene(tmp_path, data):
    """One entry of the graph, the distances or the poses is changed to another valid value."""
    whole = scene()
    kind = data.draw(st.sampled_from(["graph", "shortest_path_distance", "location", "rotation"]))
    array = getattr(whole, kind).copy()
    place = data.draw(st.integers(0, array.size - 1))
    new = {
        "graph": st.integers(-1, 15),
        "shortest_path_distance": st.integers(-1, 20),
        "location": st.sampled_from([0.0, 0.25, 0.5, 1.0]),
        "rotation": st.sampled_from([0.0, 45.0, 90.0, 180.0, 270.0]),
    }[kind]
    before = array.flat[place]
    array.flat[place] = data.draw(new)
    path = tmp_path / "bathroom-0.h5"
    save_scene(replace(whole, **{kind: array}), path)
    faults = check_files([path])[0].faults
    assert bool(faults) == (array.flat[place] != before)
    for views in (False, True):
        if faults:
            with pytest.raises(InputError) as refusal:
                load_scene(path, views=views)
            assert str(refusal.value).startswith(faults[0])
        else:
            load_scene(path, views=views)


def test_a_file_is_checked_once(tmp_path, monkeypatch):
    checked = []
    monkeypatch.setattr(consistency, "check_scene", lambda scene: checked.append(scene.name) or ((), ()))
    save_scene(scene(), tmp_path / "a.h5")
    for views in (True, False):
        load_scene(tmp_path / "a.h5", views=views)
    assert checked == ["bathroom-0"]
    save_scene(scene(location=scene().location + 1), tmp_path / "a.h5")
    load_scene(tmp_path / "a.h5")
    assert checked == ["bathroom-0"] * 2


def test_without_a_cache_folder_the_file_is_checked_each_time(tmp_path, own_cache):
    own_cache.write_text("a file where the folder should be")
    save_scene(scene(), tmp_path / "a.h5")
    assert load_scene(tmp_path / "a.h5").n_states == 16


def test_a_folder_without_views_is_refused_before_the_work(tmp_path):
    """Features suffice for training, but figures show views."""
    save_scene(replace(scene("bathroom-0"), observation=None), tmp_path / "a.h5")
    for choose in (training_scenes, unseen_scenes):
        with pytest.raises(InputError, match=r"a\.h5: dataset `observation` is missing"):
            choose(str(tmp_path), SceneSettings(training_per_type=1))


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"features": np.ones((16, 5), np.float32)}, "features have 5 numbers, and those of bathroom-0 16"),
        ({"encoder": "another"}, "encoder 'another', and those of bathroom-0 from ''"),
        ({"features": None}, "has no features, unlike bathroom-0"),
        ({"name": "bathroom-0"}, "has the name bathroom-0, as"),
    ],
)
def test_scenes_that_cannot_be_used_together(tmp_path, changes, fault):
    save_scene(scene("bathroom-0"), tmp_path / "bathroom-0.h5")
    save_scene(replace(scene("bathroom-1"), **changes), tmp_path / "bathroom-1.h5")
    for choose in (training_scenes, unseen_scenes):
        with pytest.raises(InputError, match=rf"bathroom-1\.h5: .*{fault}"):
            choose(str(tmp_path), SceneSettings(training_per_type=1))


@pytest.mark.parametrize(
    ("attribute", "value"),
    [
        *[("room_type", value) for value in ("mean", "Mean", "living room", "a\tb", "a|b", "x" * 200)],
        *[("format_version", value) for value in (0, 2, 1.5, "1", [1, 1])],
    ],
)
def test_attributes_that_are_refused(tmp_path, attribute, value):
    save_scene(scene(), tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file.attrs[attribute] = value
    with pytest.raises(InputError, match=rf"a\.h5: attribute `{attribute}`") as refusal:
        load_scene(tmp_path / "a.h5")
    assert "\n" not in str(refusal.value)


def test_datasets_in_other_files_are_refused(tmp_path):
    save_scene(scene(), tmp_path / "other.h5")
    graph = scene().graph
    (tmp_path / "graph.raw").write_bytes(graph.tobytes())

    def external_link(file):
        file["graph"] = h5py.ExternalLink("other.h5", "graph")

    def soft_link_to_an_external_link(file):
        file["away"] = h5py.ExternalLink("other.h5", "/")
        file["graph"] = h5py.SoftLink("/away/graph")

    def external_storage(file):
        raw = [(str(tmp_path / "graph.raw"), 0, graph.nbytes)]
        file.create_dataset("graph", graph.shape, graph.dtype, external=raw)

    def virtual(file):
        layout = h5py.VirtualLayout(graph.shape, graph.dtype)
        layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "graph", graph.shape)
        file.create_virtual_dataset("graph", layout)

    for place in (external_link, soft_link_to_an_external_link, external_storage, virtual):
        save_scene(scene(), tmp_path / "a.h5")
        with h5py.File(tmp_path / "a.h5", "r+") as file:
            del file["graph"]
            place(file)
        with pytest.raises(InputError, match=r"a\.h5: dataset `graph` is stored in another file"):
            load_scene(tmp_path / "a.h5")


def test_a_table_of_distances_without_any_path_has_a_row(tmp_path):
    save_scene(scene(shortest_path_distance=np.full((16, 16), -1, np.int32)), tmp_path / "a.h5")
    checked = check_files([tmp_path / "a.h5"])
    assert "shortest_path_distance" in checked[0].faults[0]
    assert check_table(checked).row_count == 1


@pytest.mark.parametrize("names", [["a", "a"], ["a", ""], ["a", "b\n"], ["a", "\x1b[2J"], ["a", "b" * 101]])
def test_names_of_categories_are_distinct_and_printable(tmp_path, names):
    visible = np.zeros((16, 2), np.float32)
    save_scene(scene(visible_object=visible, categories=("a", "b")), tmp_path / "a.h5")
    assert load_scene(tmp_path / "a.h5").categories == ("a", "b")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["visible_object"].attrs["categories"] = names
    with pytest.raises(InputError, match="`visible_object` needs distinct names of 1 to 100 printable characters"):
        load_scene(tmp_path / "a.h5")


@pytest.mark.parametrize("attribute", ["source", "encoder"])
@pytest.mark.parametrize("value", ["a\n# title", "\x1b[31m", "x" * 101])
def test_source_and_encoder_are_short_and_printable(tmp_path, attribute, value):
    save_scene(scene(), tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file.attrs[attribute] = value
    with pytest.raises(InputError, match=f"`{attribute}` must be at most 100 printable characters"):
        load_scene(tmp_path / "a.h5")
