"""Recording: a maze of text becomes a valid scene, whatever errors its simulator makes."""

from dataclasses import replace

import numpy as np
import pytest

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes import Pose, SimulatorScene, View, load_scene, next_pose, record_scene
from relm_irl_jax.scenes.consistency import check_scene
from relm_irl_jax.scenes.scene import HEADINGS

PLAN = ["....", ".##.", "...."]


def maze(plan=PLAN, name="maze-0"):
    free = {(0.5 * x, 0.5 * z) for z, row in enumerate(plan) for x, cell in enumerate(row) if cell == "."}

    def move(pose, action):
        after = next_pose(pose, action)
        return after if after[:2] in free else None

    def view(pose):
        image = np.full((4, 4, 3), round(pose.x * 20 + pose.z * 40) + int(pose.rotation) // 90, np.uint8)
        return View(pose, image, {"lamp": 0.25} if pose.rotation == 0 else {})

    poses = [Pose(x, z, heading) for x, z in sorted(free) for heading in HEADINGS]
    return SimulatorScene(name, "maze", "text/1", poses, move, view)


def place(scene, state):
    return (*scene.location[state], scene.rotation[state])


def test_a_maze_becomes_a_valid_scene(tmp_path):
    """Ten free places on a ring; (0, 0) facing +z moves ahead to (0, 0.5) and back into the wall."""
    source = maze()
    recording = record_scene(source, tmp_path / "maze-0.h5")
    scene = load_scene(tmp_path / "maze-0.h5")
    assert check_scene(scene) == ((), ())
    assert (recording.refused, recording.closed, recording.disconnected) == (0, 0, 0)
    assert (scene.n_states, scene.room_type, scene.source, scene.categories) == (40, "maze", "text/1", ("lamp",))
    ahead, right, left, back = scene.graph[0]
    assert place(scene, ahead) == (0, 0.5, 0)
    assert (place(scene, right), place(scene, left)) == ((0, 0, 90), (0, 0, 270))
    assert back == -1
    assert scene.shortest_path_distance.max() == 9  # half the ring of ten with its corners, and turns
    assert scene.visible_object is not None
    np.testing.assert_array_equal(scene.visible_object[:, 0] > 0, scene.rotation == 0)
    np.testing.assert_array_equal(scene.views[5], source.view(source.poses[5]).image)
    assert [path.name for path in tmp_path.iterdir()] == ["maze-0.h5"]


def test_rounding_errors_are_removed(tmp_path):
    source = maze()
    generator = np.random.default_rng(0)

    def noisy(pose):
        return Pose(*(value + generator.uniform(-1e-4, 1e-4) for value in pose))

    first = source.poses[0]
    shaken = replace(
        source,
        poses=[first, *map(noisy, source.poses[1:])],
        move=lambda pose, action: (after := source.move(clean(pose), action)) and noisy(after),
        view=lambda pose: replace(source.view(clean(pose)), pose=noisy(pose)),
    )
    plain = record_scene(source, tmp_path / "plain.h5").scene
    scene = record_scene(shaken, tmp_path / "noisy.h5").scene
    np.testing.assert_array_equal(scene.graph, plain.graph)
    np.testing.assert_array_equal(scene.location, plain.location)
    np.testing.assert_array_equal(scene.rotation, plain.rotation)


def clean(pose):
    return Pose(round(pose.x, 1), round(pose.z, 1), round(pose.rotation) % 360)


def test_states_that_the_simulator_refuses_or_moves_are_left_out(tmp_path):
    source = maze(["....."])

    def view(pose):
        if pose == (1.0, 0, 90):
            return None
        seen = source.view(pose)
        return replace(seen, pose=pose._replace(x=pose.x + 0.2)) if pose == (1.0, 0, 180) else seen

    recording = record_scene(replace(source, view=view), tmp_path / "maze.h5")
    scene = recording.scene
    assert (recording.refused, scene.n_states) == (2, 18)
    assert check_scene(scene)[0] == ()
    poses = {place(scene, state) for state in range(18)}
    assert (1.0, 0, 90) not in poses
    left_of_it = next(state for state in range(18) if place(scene, state) == (0.5, 0, 90))
    assert scene.graph[left_of_it, 0] == -1


def test_drops_teleports_and_islands(tmp_path):
    """A one-way step and a teleporter are closed; the smaller part is left out."""
    source = maze(["...#.."])

    def move(pose, action):
        if (pose.x, pose.rotation, action) == (0.5, 90, "MoveBack"):
            return None  # down from 0 to 0.5, not up again
        if (pose.x, pose.rotation, action) == (1.0, 90, "MoveAhead"):
            return pose._replace(x=2.0)
        return source.move(pose, action)

    recording = record_scene(replace(source, move=move), tmp_path / "maze.h5")
    # One way: ahead from 0 facing +x. The teleporter: ahead from 1.0. The two right-hand places cannot be reached.
    assert (recording.closed, recording.disconnected, recording.scene.n_states) == (2, 8, 12)
    assert check_scene(recording.scene)[0] == ()


def crashing(source, after):
    """The scene of a simulator that crashes after so many views."""
    seen = []

    def view(pose):
        if len(seen) == after:
            raise RuntimeError("the simulator crashed")
        seen.append(pose)
        return source.view(pose)

    return replace(source, view=view), seen


def test_an_interrupted_recording_continues(tmp_path):
    path = tmp_path / "maze.h5"
    with pytest.raises(RuntimeError, match="crashed"):
        record_scene(crashing(maze(), 17)[0], path)
    assert not path.exists()
    again, seen = crashing(maze(), 99)
    scene = record_scene(again, path).scene
    assert len(seen) == 40 - 17
    whole = record_scene(maze(), tmp_path / "whole.h5").scene
    np.testing.assert_array_equal(scene.graph, whole.graph)
    np.testing.assert_array_equal(scene.views, whole.views)
    np.testing.assert_array_equal(scene.visible_object, whole.visible_object)


@pytest.mark.parametrize("fate", ["other settings", "truncated", "garbage"])
def test_a_recording_that_does_not_fit_starts_again(tmp_path, fate):
    path, database = tmp_path / "maze.h5", tmp_path / ".maze.record"
    with pytest.raises(RuntimeError, match="crashed"):
        record_scene(crashing(maze(), 17)[0], path)
    source, seen = crashing(maze(), 99)
    if fate == "other settings":
        source = replace(source, source="text/2")
    else:
        database.write_bytes(database.read_bytes()[:5000] if fate == "truncated" else b"no database" * 99)
    record_scene(source, path)
    assert len(seen) == 40
    assert not database.exists()


def test_scenes_that_cannot_be_recorded(tmp_path):
    with pytest.raises(InputError, match="gives no pose"):
        record_scene(replace(maze(), poses=[]), tmp_path / "maze.h5")
    with pytest.raises(InputError, match="refuses all 40 poses"):
        record_scene(replace(maze(), view=lambda pose: None), tmp_path / "maze.h5")
    with pytest.raises(ValueError, match="off the grid"):
        record_scene(replace(maze(), poses=[Pose(0, 0, 0), Pose(0.3, 0, 0)]), tmp_path / "maze.h5")
    with pytest.raises(ValueError, match="twice"):
        record_scene(replace(maze(), poses=[Pose(0, 0, 0), Pose(1e-4, 0, 360)]), tmp_path / "maze.h5")
