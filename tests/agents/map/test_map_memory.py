import jax.numpy as jnp
import numpy as np
import pytest

from relm_irl_jax.agents.map.geometry import N_CELLS, VIEW_CELLS, Extent
from relm_irl_jax.agents.map.memory import SURE, free_logits, grid_rows, move, start_odometry, summarise, turned
from relm_irl_jax.agents.map.network import CHANNELS, RECORD, SCALARS, turn_features
from relm_irl_jax.agents.map.walks import relative_pose
from relm_irl_jax.scenes.scene import pose_graph, successors

AHEAD, RIGHT, LEFT, BACK = range(4)
ROOM = Extent()
GRID, HALF, RADIUS = ROOM.grid, ROOM.half, ROOM.radius


def walked(*actions: tuple[int, bool]):
    odometry = start_odometry((), ROOM)
    for action, collided in actions:
        odometry = move(odometry, jnp.int32(action), jnp.bool_(collided))
    return odometry


def test_odometry_by_hand():
    odometry = walked((AHEAD, False), (RIGHT, False), (AHEAD, False), (AHEAD, False), (LEFT, False), (BACK, False))
    np.testing.assert_array_equal(odometry.pose, (0, 0, 2))
    assert not odometry.blocked.any()


def test_a_collision_blocks_the_place_ahead_or_behind():
    odometry = walked((RIGHT, False), (AHEAD, True), (BACK, True))
    np.testing.assert_array_equal(odometry.pose, (1, 0, 0))
    np.testing.assert_array_equal(np.argwhere(odometry.blocked) - RADIUS, [(0, -1), (0, 1)])


def test_no_action_moves_nothing():
    np.testing.assert_array_equal(walked((-1, False)).pose, (0, 0, 0))


def test_odometry_follows_a_scene_in_any_frame():
    places = [(x, z) for x in range(4) for z in range(3) if (x, z) != (2, 1)]
    location, rotation, graph = pose_graph(places)
    following = successors(graph)
    pose = np.stack([rotation / 90, location[:, 1] / 0.5, location[:, 0] / 0.5], 1).astype(np.int32)
    generator = np.random.default_rng(0)
    for start in generator.integers(len(graph), size=4):
        state, odometry = int(start), start_odometry((), ROOM)
        frame = relative_pose(pose, pose[start])
        for action in generator.integers(4, size=15):
            after = int(following[state, action])
            odometry = move(odometry, jnp.int32(action), jnp.bool_(after == state))
            state = after
            np.testing.assert_array_equal(odometry.pose, frame[state])


def test_view_region_falls_on_the_cells_in_front():
    cell = int(np.flatnonzero((VIEW_CELLS == (2, 5)).all(1))[0])
    row, column = divmod(int(grid_rows(jnp.array([1, 3, -2]), ROOM)[cell]), GRID)  # facing +x at z = 3, x = −2
    assert (row - HALF, column - HALF) == (3 - 2, -2 + 5)


@pytest.mark.parametrize("heading", range(4))
def test_features_turn_with_the_camera(heading):
    record = np.random.default_rng(0).normal(size=(N_CELLS, RECORD)).astype(np.float32)
    result = turned(jnp.asarray(record), jnp.int32(heading))
    np.testing.assert_array_equal(result, turn_features(jnp.asarray(record), heading))
    np.testing.assert_array_equal(result[:, :SCALARS], record[:, :SCALARS])
    # What the camera sees ahead of it (direction 0) faces `heading` in the map.
    np.testing.assert_array_equal(result[:, SCALARS + heading], record[:, SCALARS])


def test_summary_of_an_empty_cell_is_zero_and_of_a_seen_one_its_mean():
    grid = np.zeros((2, 1, RECORD), np.float32)
    grid[1, 0, 0], grid[1, 0, -2], grid[1, 0, -1] = 6.0, 3.0, 4.0
    seen, evidence = summarise(jnp.asarray(grid))
    np.testing.assert_allclose(seen[0], 0)
    np.testing.assert_allclose(seen[1, 0, [0, CHANNELS]], (6 / 4, 3 / 4))
    np.testing.assert_allclose(evidence[:, 0], (0, 2))


def test_what_is_known_overrides_what_is_seen():
    odometry = walked((AHEAD, True))
    odometry = type(odometry)(odometry.pose, odometry.seen.at[0, RADIUS, RADIUS].set(True), odometry.blocked)
    logits = free_logits(jnp.zeros((GRID, GRID)), jnp.full((2 * RADIUS + 1,) * 2, -1.0), jnp.float32(1), odometry)
    assert logits[RADIUS, RADIUS] == SURE
    assert logits[RADIUS + 1, RADIUS] == -SURE
    assert logits[RADIUS, RADIUS + 1] == -1
