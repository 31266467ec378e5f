"""The ray caster against arithmetic done by hand and against brute force."""

from functools import partial

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relm_irl_jax.scenes.rooms.boxes import Box, Material, Pattern
from relm_irl_jax.scenes.rooms.floor_plan import draw_floor_plan
from relm_irl_jax.scenes.rooms.furniture import CATEGORIES
from relm_irl_jax.scenes.rooms.ray_casting import EYE_HEIGHT, MAX_BOXES, cast_rays, pack_boxes
from relm_irl_jax.scenes.rooms.rendering import BATCH_SIZE, render_batch, render_views, unpack_rgb
from relm_irl_jax.scenes.scene import HEADINGS, pose_graph
from relm_irl_jax.scenes.settings import ROOM_TYPES

from .sizes import IMAGE_SIZE

GREY = Material((0.5, 0.5, 0.5))
LIGHT = (0.0, 2.0, 0.0)


def brute_force(boxes, location, heading, size):
    """Depth and box of each pixel, one ray at a time in float64."""
    forward = np.array([np.sin(np.radians(heading)), 0.0, np.cos(np.radians(heading))])
    right = np.array([forward[2], 0.0, -forward[0]])
    eye = np.array([location[0], EYE_HEIGHT, location[1]])
    depth, winner = np.full((size, size), np.inf), np.full((size, size), -1)
    for row in range(size):
        for column in range(size):
            across, down = (2 * column + 1) / size - 1, (2 * row + 1) / size - 1
            ray = forward + across * right - down * np.array([0.0, 1.0, 0.0])
            ray[np.abs(ray) < 1e-12] = 1e-12
            for number, box in enumerate(boxes):
                near = (np.asarray(box.lower) - eye) / ray
                far = (np.asarray(box.upper) - eye) / ray
                enter, leave = np.minimum(near, far).max(), np.maximum(near, far).min()
                if 0 < enter < leave and enter < depth[row, column]:
                    depth[row, column], winner[row, column] = enter, number
    return depth, winner


MAX_POSES = 900
"""Poses of one call of the ray caster, more than any room has: it compiles once for each of the three image sizes."""


@partial(jax.jit, static_argnums=2)
def _cast(boxes, poses, size):
    return jax.lax.map(lambda pose: cast_rays(boxes, *pose, size), poses)


def cast(boxes, location, rotation, size, light=LIGHT):
    """Depth, box and axis of each pixel at each pose."""
    count = len(location)
    poses = np.resize(location, (MAX_POSES, 2)).astype(np.float32), np.resize(rotation, MAX_POSES).astype(np.float32)
    return [np.asarray(values)[:count] for values in _cast(pack_boxes(boxes, light), poses, size)]


def view(boxes, location=(0.0, 0.0), heading=0.0, size=8):
    return [values[0] for values in cast(boxes, [location], [heading], size)]


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_box_straight_ahead_covers_the_pixels_computed_by_hand(heading):
    # Two metres ahead and one metre wide and high: it spans ±1/4 of the half-width, two of eight columns and rows.
    ahead = {0.0: (0, 2.5), 90.0: (2.5, 0), 180.0: (0, -2.5), 270.0: (-2.5, 0)}[heading]
    box = Box(
        (ahead[0] - 0.5, EYE_HEIGHT - 0.5, ahead[1] - 0.5), (ahead[0] + 0.5, EYE_HEIGHT + 0.5, ahead[1] + 0.5), GREY
    )
    depth, winner, axis = view([box], heading=heading)
    expected = np.full((8, 8), -1)
    expected[3:5, 3:5] = 0
    np.testing.assert_array_equal(winner, expected)
    np.testing.assert_allclose(depth[expected == 0], 2.0, rtol=1e-6)
    assert np.isinf(depth[expected == -1]).all()
    assert (axis[expected == 0] == (2 if heading in (0.0, 180.0) else 0)).all()


def test_right_of_the_camera_is_right_in_the_image_and_up_is_up():
    box = Box((0.5, EYE_HEIGHT + 0.5, 1.9), (1.5, EYE_HEIGHT + 1.5, 2.1), GREY)
    _, winner, _ = view([box])
    rows, columns = np.nonzero(winner == 0)
    assert rows.max() < 4
    assert columns.min() >= 4


def test_the_nearer_box_hides_the_other_in_either_order():
    near = Box((-1.0, 0.0, 1.0), (1.0, 3.0, 1.5), GREY)
    far = Box((-9.0, 0.0, 4.0), (9.0, 3.0, 5.0), GREY)
    assert view([near, far])[1][4, 4] == 0
    assert view([far, near])[1][4, 4] == 1


def test_a_box_behind_the_camera_is_not_seen():
    assert (view([Box((-1.0, 0.0, -3.0), (1.0, 3.0, -2.0), GREY)])[1] == -1).all()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), heading=st.sampled_from(HEADINGS), odd=st.booleans())
def test_random_boxes_as_by_brute_force(seed, heading, odd):
    rng = np.random.default_rng(seed)
    size = 13 if odd else 8
    boxes = []
    while len(boxes) < 11:
        lower, extent = rng.uniform((-4, 0, -4), (4, 2, 4)), rng.uniform(0.1, 2, 3)
        if (np.maximum(lower, -lower - extent)[[0, 2]] > 0.05).any():  # the camera stands in none
            boxes.append(Box(tuple(lower.tolist()), tuple((lower + extent).tolist()), GREY))
    depth, winner = brute_force(boxes, (0.0, 0.0), heading, size)
    got_depth, got_winner, _ = view(boxes, heading=heading, size=size)
    same = got_winner == winner
    assert same.mean() > 0.98  # rays that graze an edge may go either way
    hit = same & (winner >= 0)
    np.testing.assert_allclose(got_depth[hit], depth[hit], rtol=1e-4)


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_a_room_as_by_brute_force(room_type):
    room = draw_floor_plan(room_type, np.random.default_rng(3))
    location, rotation, _ = pose_graph(room.places)
    for state in (5, len(location) // 2):
        depth, winner = brute_force(room.boxes, location[state], rotation[state], 20)
        got_depth, got_winner, _ = view(room.boxes, location[state], rotation[state], 20)
        assert (got_winner == winner).mean() > 0.98
        assert (winner >= 0).all(), "a ray leaves the room"
        same = got_winner == winner
        np.testing.assert_allclose(got_depth[same], depth[same], rtol=1e-4)


def test_views_rendered_together_are_those_rendered_one_by_one():
    room = draw_floor_plan("bathroom", np.random.default_rng(3))
    location, rotation, _ = pose_graph(room.places)
    boxes, poses = pack_boxes(room.boxes, room.light), (np.float32(location[:3]), np.float32(rotation[:3]))
    one_by_one, together = (render_batch(boxes, *poses, size=20, together=way) for way in (False, True))
    assert (unpack_rgb(np.asarray(one_by_one[0])) == unpack_rgb(np.asarray(together[0]))).mean() > 0.98
    np.testing.assert_allclose(one_by_one[1], together[1], atol=0.01)


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_no_ray_leaves_a_room(room_type):
    # These sizes send rays exactly into corners that lie a multiple of the grid step away.
    for seed in range(6):
        room = draw_floor_plan(room_type, np.random.default_rng(seed))
        location, rotation, _ = pose_graph(room.places)
        for size in (8, 20):
            assert (cast(room.boxes, location, rotation, size)[1] >= 0).all()


def test_shares_hardly_depend_on_the_image_size():
    room = draw_floor_plan("bathroom", np.random.default_rng(1), "tiny")
    location, rotation, _ = pose_graph(room.places)
    _, shares = render_views(pack_boxes(room.boxes, room.light), location, rotation, size=IMAGE_SIZE)
    category = np.asarray([box.category for box in room.boxes])[cast(room.boxes, location, rotation, 20)[1]]
    coarse = (category[..., None] == np.arange(len(CATEGORIES))).mean((1, 2))
    assert np.abs(shares - coarse).max() < 0.1


def test_shares_count_the_pixels_of_a_category():
    # The left half of the view is a box of category 1; a quarter of the right half is of category 0.
    left = Box((-9.0, -9.0, 2.0), (0.0, 9.0, 3.0), GREY, category=1)
    right = Box((0.0, EYE_HEIGHT, 2.0), (1.0, EYE_HEIGHT + 1.0, 3.0), GREY, category=0)
    _, shares = render_views(pack_boxes([left, right], LIGHT), np.zeros((1, 2)), np.zeros(1), size=IMAGE_SIZE)
    np.testing.assert_allclose(shares[0, :2], [1 / 16, 1 / 2])
    assert not shares[0, 2:].any()


@pytest.mark.parametrize("pattern", list(Pattern))
def test_every_pattern_gives_a_picture(pattern):
    wall = Box((-3.0, -1.0, 2.0), (3.0, 4.0, 3.0), Material((0.9, 0.2, 0.1), (0.1, 0.3, 0.9), pattern, 0.4))
    images, _ = render_views(pack_boxes([wall], LIGHT), np.zeros((1, 2)), np.zeros(1), size=IMAGE_SIZE)
    colours = len(np.unique(images.reshape(-1, 3), axis=0))
    tones = images[0, 12:20, 12:20].reshape(-1, 3)  # the middle: the light hardly changes over it
    assert images.shape == (1, IMAGE_SIZE, IMAGE_SIZE, 3)
    assert colours > 1
    if pattern == Pattern.PLAIN:
        assert (np.ptp(tones.astype(int), axis=0) < 12).all()


def test_nothing_is_black_and_unpacking_orders_the_channels():
    images, shares = render_views(pack_boxes([], LIGHT), np.zeros((1, 2)), np.zeros(1), size=IMAGE_SIZE)
    assert not images.any()
    assert not shares.any()
    assert unpack_rgb(np.array([0x00030201], np.uint32)).tolist() == [[1, 2, 3]]


@pytest.mark.parametrize("count", [1, BATCH_SIZE - 1, BATCH_SIZE, BATCH_SIZE + 1])
def test_batches_do_not_show(count):
    room = draw_floor_plan("bathroom", np.random.default_rng(0), "tiny")
    location, rotation, _ = pose_graph(room.places)
    boxes = pack_boxes(room.boxes, room.light)
    whole, shares = render_views(boxes, location, rotation, size=IMAGE_SIZE)
    part, part_shares = render_views(boxes, location[:count], rotation[:count], size=IMAGE_SIZE)
    np.testing.assert_array_equal(part, whole[:count])
    np.testing.assert_array_equal(part_shares, shares[:count])


def test_too_many_boxes_are_refused():
    with pytest.raises(ValueError, match=str(MAX_BOXES)):
        pack_boxes([Box((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), GREY)] * (MAX_BOXES + 1), LIGHT)
