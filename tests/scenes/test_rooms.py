"""The built-in rooms: floor plans, views and labels."""

from dataclasses import replace
from functools import cache

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.objects import MINIMUM_SHARE, best_views
from relm_irl_jax.scenes.rooms import generate
from relm_irl_jax.scenes.rooms.floor_plan import CLEARANCE, HEADROOM, STEP_HEIGHT, draw_floor_plan, largest_component
from relm_irl_jax.scenes.rooms.furniture import CATEGORIES
from relm_irl_jax.scenes.rooms.generate import generate_room
from relm_irl_jax.scenes.rooms.ray_casting import EYE_HEIGHT, MAX_BOXES
from relm_irl_jax.scenes.rooms.room_specifications import SIZES, SOURCE
from relm_irl_jax.scenes.scene import GRID_STEP, UNREACHABLE, pose_graph, shortest_path_distances
from relm_irl_jax.scenes.settings import ROOM_TYPES

from .sizes import IMAGE_SIZE

STATES = {"bathroom": (132, 204), "bedroom": (284, 496), "living_room": (468, 876)}
"""State counts of the original scenes."""

IN_EVERY = {
    "bathroom": {"bathtub", "bin", "cabinet", "door", "mirror", "plant", "rug", "switch", "toilet", "towel"}
    | {"washstand", "window"},
    "bedroom": {"bed", "bookcase", "chair", "desk", "door", "lamp", "nightstand", "painting", "plant", "rug"}
    | {"switch", "wardrobe", "window"},
    "living_room": {"armchair", "bookcase", "chair", "coffee_table", "dining_table", "door", "lamp", "painting"}
    | {"plant", "rug", "sofa", "switch", "tv", "window"},
}

rooms = st.tuples(st.sampled_from(ROOM_TYPES), st.integers(0, 2**31), st.sampled_from(SIZES))


@cache
def plan(room_type, seed, size="full"):
    return draw_floor_plan(room_type, np.random.default_rng(seed), size)


def objects(drawn):
    """Categories present in a floor plan."""
    return {CATEGORIES[box.category] for box in drawn.boxes if box.category >= 0}


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_state_counts_are_the_original_scenes(room_type):
    least, most = STATES[room_type]
    counts = {4 * len(plan(room_type, seed).places) for seed in range(60)}
    assert least <= min(counts)
    assert max(counts) <= most
    assert len(counts) > 8  # and they vary


@pytest.mark.parametrize("room_type", ROOM_TYPES)
def test_objects_of_every_room(room_type):
    for seed in range(30):
        assert objects(plan(room_type, seed)) >= IN_EVERY[room_type]
    assert len(IN_EVERY[room_type]) >= 8


def test_room_types_share_categories():
    for first, second in (("bathroom", "bedroom"), ("bedroom", "living_room"), ("bathroom", "living_room")):
        assert len(IN_EVERY[first] & IN_EVERY[second]) >= 4


@settings(max_examples=60, deadline=None)
@given(room=rooms)
def test_any_room_is_connected_and_keeps_its_clearances(room):
    drawn = draw_floor_plan(room[0], np.random.default_rng(room[1]), room[2])
    check_every_state_reaches_every_other(drawn)
    check_the_camera_touches_nothing_and_walks_through_nothing(drawn)
    check_objects_are_within_the_room(drawn)


def check_every_state_reaches_every_other(drawn):
    assert len(set(drawn.places)) == len(drawn.places)
    _, _, graph = pose_graph(drawn.places)
    assert (shortest_path_distances(graph) != UNREACHABLE).all()


def check_the_camera_touches_nothing_and_walks_through_nothing(drawn):
    assert len(drawn.boxes) <= MAX_BOXES
    places = np.asarray(drawn.places) * GRID_STEP
    neighbours = {(column, row) for column, row in drawn.places}
    middles = [
        ((column + dx / 2) * GRID_STEP, (row + dz / 2) * GRID_STEP)
        for column, row in drawn.places
        for dx, dz in ((1, 0), (0, 1))
        if (column + dx, row + dz) in neighbours
    ]
    for box in drawn.boxes:
        (west, low, south), (east, high, north) = box.lower, box.upper
        assert west < east
        assert low < high
        assert south < north
        assert not (low < EYE_HEIGHT < high and inside(places, west, east, south, north).any())
        if box.category >= 0 and high > STEP_HEIGHT and low < HEADROOM:
            margin = CLEARANCE - 1e-9
            grown = (west - margin, east + margin, south - margin, north + margin)
            assert not inside(places, *grown).any()
        if high > STEP_HEIGHT and low < HEADROOM:
            assert not inside(np.asarray(middles), west, east, south, north).any()


def check_objects_are_within_the_room(drawn):
    structure = [box for box in drawn.boxes if box.category < 0]
    lower = np.min([box.lower for box in structure], axis=0)
    upper = np.max([box.upper for box in structure], axis=0)
    for box in drawn.boxes[len(structure) :]:
        assert (np.asarray(box.lower) >= lower).all()
        assert (np.asarray(box.upper) <= upper).all()
        assert box.lower[1] >= 0


def test_the_largest_component_by_hand():
    plan = np.array([[c == "." for c in row] for row in ("..#.", "##..", ".#..")])
    assert largest_component(plan.T) == ((3, 0), (2, 1), (3, 1), (2, 2), (3, 2))  # (column, row), row by row
    assert largest_component(np.array([[True, False, True]])) == ((0, 0),)  # the first of equal ones
    assert largest_component(np.zeros((2, 2), bool)) == ()


def test_tiny_rooms_are_tiny():
    for room_type in ROOM_TYPES:
        for seed in range(30):
            room = plan(room_type, seed, "tiny")
            assert 12 <= len(room.places) <= 20
            assert len(objects(room)) >= 8


def test_walls_of_a_room_look_different():
    for room_type in ROOM_TYPES:
        for seed in range(10):
            walls = [box.material for box in plan(room_type, seed).boxes if box.category < 0][:4]
            assert len({wall.colour for wall in walls}) == 4
            assert len({wall.pattern for wall in walls}) >= 3


def test_a_category_keeps_its_look_in_all_rooms():
    # The first box of a category is its most telling one, or the one it stands on: its colour hardly moves.
    seen = {}
    for room_type in ROOM_TYPES:
        for seed in range(10):
            for box in plan(room_type, seed).boxes:
                if box.category >= 0:
                    name = CATEGORIES[box.category]
                    seen.setdefault(name, set()).add(box.material.pattern)
    assert set(seen) == set(CATEGORIES)
    assert all(len(patterns) <= 3 for patterns in seen.values())


def test_the_scene_is_whole(room):
    states = room.n_states
    assert room.name == f"{room.room_type}-0"
    assert room.source == SOURCE
    assert room.categories == CATEGORIES
    assert room.observation.shape == (states, IMAGE_SIZE, IMAGE_SIZE, 3)
    assert room.observation.dtype == np.uint8
    assert room.visible_object.shape == (states, len(CATEGORIES))
    assert room.visible_object.dtype == np.float32
    assert (room.visible_object >= 0).all()
    assert (room.visible_object.sum(axis=1) <= 1 + 1e-6).all()
    assert room.features is None


def test_no_two_views_are_the_same(room):
    assert len({view.tobytes() for view in room.observation}) == room.n_states  # no exceptions


def test_best_views_see_every_object_that_is_always_there(room):
    best = best_views(room)
    assert set(best) >= IN_EVERY[room.room_type]
    for category, state in best.items():
        share = room.visible_object[:, room.categories.index(category)]
        assert share[state] == share.max() >= MINIMUM_SHARE
        assert not (share[:state] == share[state]).any()


def test_best_views_without_labels_or_below_the_threshold(room):
    assert best_views(replace(room, visible_object=None)) == {}
    assert best_views(replace(room, visible_object=room.visible_object * np.float32(0.99 * MINIMUM_SHARE))) == {}


def test_the_same_seed_gives_the_same_scene():
    first, second, other = (generate_room("bedroom", seed, size="tiny", image_size=IMAGE_SIZE) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first.observation, second.observation)
    np.testing.assert_array_equal(first.visible_object, second.visible_object)
    np.testing.assert_array_equal(first.graph, second.graph)
    assert first.observation.shape != other.observation.shape or (first.observation != other.observation).any()


def test_the_image_size_does_not_change_the_room(monkeypatch):
    rendered = []

    def render_nothing(boxes, location, rotation, *, size, description):
        rendered.append((boxes, location, rotation))
        images = np.zeros((len(location), size, size, 3), np.uint8)
        return images, np.zeros((len(location), len(CATEGORIES)), np.float32)

    monkeypatch.setattr(generate, "render_views", render_nothing)
    small, large = (generate_room("bathroom", 1, size="tiny", image_size=size) for size in (16, 32))
    np.testing.assert_array_equal(small.graph, large.graph)
    jax.tree.map(np.testing.assert_array_equal, *rendered)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ({"room_type": "garage", "seed": 0}, "garage"),
        ({"room_type": "bedroom", "seed": 0, "size": "huge"}, "huge"),
        ({"room_type": "bedroom", "seed": -1}, "-1"),
        ({"room_type": "bedroom", "seed": 0, "image_size": 0}, "0"),
    ],
)
def test_wrong_input_is_named(arguments, word):
    with pytest.raises(InputError, match=word):
        generate_room(**arguments)


def inside(points, west, east, south, north):
    x, z = points[:, 0], points[:, 1]
    return (west < x) & (x < east) & (south < z) & (z < north)
