"""Sound scenes pass, and each kind of damage is named with its dataset."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax.scenes.check import check_files, check_table
from relm_irl_jax.scenes.consistency import check_scene
from relm_irl_jax.scenes.scene import shortest_path_distances
from relm_irl_jax.scenes.scene_file import save_scene


@pytest.fixture
def scene():
    return replace(grid_scene(3, 2), observation=np.zeros((24, 4, 5, 3), np.uint8))


def regraphed(scene, graph):
    return replace(scene, graph=graph, shortest_path_distance=shortest_path_distances(graph))


def test_a_sound_scene_has_no_fault(scene):
    assert check_scene(scene) == ((), ())


def test_turns_of_the_opposite_direction_are_a_note(scene):
    mirrored = regraphed(scene, scene.graph[:, [0, 2, 1, 3]].copy())
    faults, notes = check_scene(mirrored)
    assert not faults
    assert notes == ("turns have the opposite direction",)


def test_rounding_noise_is_no_fault(scene):
    generator = np.random.default_rng(0)
    noisy = replace(scene, location=scene.location + generator.uniform(-1e-4, 1e-4, scene.location.shape))
    assert check_scene(noisy)[0] == ()


def damaged_graph(scene, state, action, onward):
    graph = scene.graph.copy()
    graph[state, action] = onward
    return regraphed(scene, graph)


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (lambda s: damaged_graph(s, 0, 0, 8), "MoveAhead does not move by 0.5 m along the heading in 1 states"),
        (lambda s: damaged_graph(s, 0, 0, 5), "MoveAhead from state 0 changes the heading"),
        (lambda s: damaged_graph(s, 0, 1, 2), "RotateRight from state 0 does not turn by 90 degrees"),
        (lambda s: damaged_graph(s, 0, 1, 5), "RotateRight from state 0 changes the position"),
        (lambda s: damaged_graph(s, 0, 1, 3), "turns have different directions"),
        (lambda s: damaged_graph(s, 4, 3, -1), "MoveBack does not undo MoveAhead from state 0"),
        (lambda s: replace(s, rotation=s.rotation + np.eye(24)[5] * 30), "dataset `rotation` has 120 at state 5"),
        (
            lambda s: replace(s, location=s.location[[*range(20), *range(4)]]),
            "have 4 duplicate poses, first at state 0",
        ),
        (
            lambda s: replace(s, shortest_path_distance=s.shortest_path_distance + np.eye(24, dtype=np.int32)),
            "`shortest_path_distance` disagrees with `graph` in 100 pairs, first from state 0 to 0",
        ),
    ],
)
def test_damage_is_named(scene, damage, sentence):
    faults, _ = check_scene(damage(scene))
    assert any(sentence in fault for fault in faults), faults


def test_a_file_that_cannot_be_read_does_not_stop_the_others(scene, tmp_path):
    good, bad = tmp_path / "bathroom-0.h5", tmp_path / "bathroom-1.h5"
    save_scene(scene, good)
    bad.write_bytes(good.read_bytes()[:-400])
    checked = check_files([bad, good])
    assert checked[0].scene is None
    assert "bathroom-1.h5" in checked[0].faults[0]
    assert checked[1].faults == ()
    assert check_table(checked).row_count == 2


def test_an_original_dump_is_sound(tmp_path):
    """As published: 300 x 400 frames, ten crops, 64-bit integers, no attributes, a state that nothing leads to."""
    scene = grid_scene(1, 2)
    graph = np.concatenate([scene.graph, [[-1, -1, -1, -1]]]).astype(np.int64)
    path = tmp_path / "bathroom_02.h5"
    with h5py.File(path, "w") as file:
        file["observation"] = np.zeros((9, 300, 400, 3), np.uint8)
        file["resnet_feature"] = np.zeros((9, 10, 2048), np.float32)
        file["location"] = np.concatenate([scene.location, [[4.0, 4.0]]])
        file["rotation"] = np.concatenate([scene.rotation, [270.0]])
        file["graph"] = graph
        file["shortest_path_distance"] = shortest_path_distances(graph).astype(np.int64)
    checked = check_files([path])[0]
    assert (checked.faults, checked.notes, checked.image_size) == ((), (), (300, 400))
    assert checked.scene.reachable.tolist() == list(range(8))
    assert checked.scene.observation is None
    assert checked.scene.room_type == "bathroom"
    assert (checked.scene.shortest_path_distance[8] == [*[-1] * 8, 0]).all()
