"""Maps and episodes are read as they were saved, and refused in one sentence where they are damaged."""

import json
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from run_folders import POSES, ROOM, episode, state_map

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import load_arrays_and_metadata, save_arrays
from relm_irl_jax.saved_episodes import load_episodes, save_episodes
from relm_irl_jax.saved_maps import SHORTEST_PATH, load_map, save_map
from relm_irl_jax.saved_poses import ScenePoses, poses_of


def same_poses(one: ScenePoses, other: ScenePoses) -> bool:
    same = all(np.array_equal(getattr(one, n), getattr(other, n)) for n in ("location", "rotation"))
    return same and (one.name, one.room_type) == (other.name, other.room_type)


@pytest.mark.parametrize(("start", "limits"), [(None, None), (3, (-1.0, 0.0))])
def test_a_map_is_read_as_it_was_saved(tmp_path, start, limits):
    saved = state_map(["relm-irl", SHORTEST_PATH], start=start, limits=limits)
    save_map(tmp_path / "map.safetensors", saved)
    read = load_map(tmp_path / "map.safetensors")
    assert same_poses(read.poses, saved.poses)
    assert list(read.values) == list(saved.values)
    for name in saved.values:
        np.testing.assert_array_equal(read.values[name], saved.values[name])
    fields = ("seed", "target", "category", "start", "limits")
    assert [getattr(read, name) for name in fields] == [getattr(saved, name) for name in fields]


def test_episodes_are_read_as_they_were_saved(tmp_path):
    saved = [episode(), episode([0, 1], method="rl")]
    save_episodes(tmp_path / "I.safetensors", saved)
    read = load_episodes(tmp_path / "I.safetensors")
    assert [(e.method, e.success) for e in read] == [("relm-irl", True), ("rl", False)]
    for one, other in zip(saved, read, strict=True):
        assert same_poses(one.poses, other.poses)
        assert (one.seed, one.target, one.category) == (other.seed, other.target, other.category)
        for name in ("path", "shortest_path", "target_view"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_poses_are_those_of_the_scene():
    assert same_poses(poses_of(ROOM), ScenePoses("bathroom-0", "bathroom", ROOM.location, ROOM.rotation))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"target": 24}, "target is not a state of bathroom-0"),
        ({"start": -1}, "start is not a state of bathroom-0"),
        ({"values": {}}, "there are no values"),
        ({"limits": (1.0, 0.0)}, "limits are not ascending"),
    ],
)
def test_maps_that_cannot_be_are_refused(change, fault):
    with pytest.raises(InputError, match=fault):
        replace(state_map(["rl"]), **change)


def test_paths_that_leave_the_scene_are_refused():
    with pytest.raises(InputError, match="path is not a state of bathroom-0"):
        episode([0, 99])
    with pytest.raises(InputError, match="rotation is not one of"):
        replace(POSES, rotation=POSES.rotation + 1)


def damage(path, *, drop=(), arrays=None, **fields):
    """Change what a file of a map holds."""
    held, metadata = load_arrays_and_metadata(path)
    kept = {name: value for name, value in held.items() if name not in drop} | (arrays or {})
    save_arrays(path, kept, {"fields": json.dumps(json.loads(metadata["fields"]) | fields)})


@pytest.mark.parametrize(
    ("damaged", "fault"),
    [
        ({"drop": ["rotation"]}, "'rotation' is missing"),
        ({"drop": ["values/rl"]}, "'values/rl' is missing"),
        ({"arrays": {"location": np.zeros((24, 2)) * np.nan}}, "location is not finite"),
        ({"target": 99}, "target is not a state"),
        ({"target": "x"}, "invalid literal"),
        ({"limits": [1]}, "index out of range"),
        ({"methods": 3}, "not iterable"),
    ],
)
def test_a_damaged_map_is_one_sentence(tmp_path, damaged, fault):
    path = tmp_path / "map.safetensors"
    save_map(path, state_map(["rl"]))
    damage(path, **damaged)
    with pytest.raises(
        InputError, match=rf"map\.safetensors: .*{fault}.*; remove the file and run `relm-irl evaluate`"
    ):
        load_map(path)


def test_a_file_of_something_else_is_refused(tmp_path):
    path = tmp_path / "map.safetensors"
    with pytest.raises(InputError, match="is missing"):
        load_map(path)
    save_arrays(path, {"weights": np.zeros(3)})
    with pytest.raises(InputError, match="'fields' is missing"):
        load_episodes(path)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0, 1, exclude_max=True), byte=st.integers(0, 255), kept=st.floats(0, 2))
def test_no_damage_ends_in_a_traceback(tmp_path, place, byte, kept):
    path = tmp_path / "map.safetensors"
    save_map(path, state_map(["rl"], start=1))
    content = bytearray(path.read_bytes())
    content[int(place * len(content))] = byte
    path.write_bytes(content[: int(kept * len(content))])
    with suppress(InputError):
        load_map(path)
