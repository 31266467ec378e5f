import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from relm_irl_jax.agents.map.geometry import (
    FORWARD,
    N_CELLS,
    OFFSETS,
    REACH,
    RIGHT,
    VIEW_CELLS,
    Extent,
    projection_weights,
)
from relm_irl_jax.agents.map.posterior import N_BINS, distance_bins


def test_right_of_each_heading_is_the_next_heading():
    # Facing +z, right is +x; facing +x, right is −z.
    np.testing.assert_array_equal(RIGHT[0], (1, 0))
    np.testing.assert_array_equal(RIGHT[1], (0, -1))
    np.testing.assert_array_equal(RIGHT, FORWARD[[1, 2, 3, 0]])


def test_view_region_covers_ninety_degrees_once():
    assert len(VIEW_CELLS) == N_CELLS == len({tuple(cell) for cell in VIEW_CELLS})
    assert (np.abs(VIEW_CELLS[:, 0]) <= VIEW_CELLS[:, 1]).all()
    assert VIEW_CELLS[:, 1].max() == REACH


def test_offsets_by_hand():
    cell = int(np.flatnonzero((VIEW_CELLS == (1, 3)).all(1))[0])  # one to the right, three ahead
    np.testing.assert_array_equal(OFFSETS[:, cell], [(1, 3), (3, -1), (-1, -3), (-3, 1)])


def test_a_quarter_turn_turns_the_view_region():
    for heading in range(4):
        x, z = OFFSETS[heading].T
        np.testing.assert_array_equal(OFFSETS[(heading + 1) % 4], np.stack([z, -x], 1))


def test_projection_weights_are_the_visible_share_of_each_cell():
    for depth in range(1, REACH + 1):
        weights = projection_weights(depth, 32)
        inner = weights.sum(1)
        np.testing.assert_allclose(inner[1:-1], 1, atol=1e-5)
        np.testing.assert_allclose(inner[[0, -1]], 0.5, atol=1e-5)  # the edge of the view halves these cells
        np.testing.assert_allclose(weights, weights[::-1, ::-1], atol=1e-6)
    np.testing.assert_allclose(projection_weights(0, 32).sum(), 1, rtol=1e-6)


def test_middle_columns_see_the_corridor_ahead():
    # At depth 4 the cell ahead spans the tangents ±1/8: of 8 columns of width 1/4, half of each middle one.
    np.testing.assert_allclose(projection_weights(4, 8)[4], [0, 0, 0, 0.5, 0.5, 0, 0, 0], atol=1e-6)


def test_the_extent_of_built_in_rooms_is_that_of_the_weights():
    room = Extent.of_places(17)
    assert (room, room.radius, room.side, room.grid, room.half) == (Extent(), 16, 33, 56, 28)
    assert distance_bins(room).max() == N_BINS - 1
    assert Extent.of_places(18) == Extent(24)


@given(st.integers(1, 400))
def test_an_extent_holds_its_scenes_from_every_start_and_all_that_is_seen(places):
    extent = Extent.of_places(places)
    assert places - 1 <= extent.radius < max(places - 1, 16) + 8
    assert extent.half - extent.radius - REACH >= 0
    assert extent.half + extent.radius + REACH < extent.grid
    assert extent.grid % 8 == 0
    assert Extent.of_side(extent.side) == Extent.of_grid(extent.grid) == extent


def test_what_lies_farther_than_in_a_room_is_in_the_last_bin():
    room, wide = distance_bins(Extent()), distance_bins(Extent(32))
    np.testing.assert_array_equal(wide[16:-16, 16:-16], room)
    assert wide[32, -1] == wide[0, 0] == N_BINS - 1
