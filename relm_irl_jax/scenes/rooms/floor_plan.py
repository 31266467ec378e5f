"""Floor plans of the built-in rooms: walls, furniture and free places, without views.

Random rooms are drawn until the number of free places is in the range of the original scenes and all required objects
fit. Places are on the 0.5 m grid, at least `WALL_DISTANCE` from the walls and `CLEARANCE` from the furniture.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool
from scipy import ndimage

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes.rooms.boxes import Box, Point
from relm_irl_jax.scenes.rooms.placement import place_furniture
from relm_irl_jax.scenes.rooms.room_specifications import DECORATIONS, SIZES, SPECIFICATIONS, RoomSpecification
from relm_irl_jax.scenes.rooms.walls import Rectangle, draw_walls, room_outline, wall_boxes
from relm_irl_jax.scenes.scene import GRID_STEP
from relm_irl_jax.scenes.settings import ROOM_TYPES

CLEARANCE = 0.2
"""Smallest distance in metres between camera and furniture; no move of one grid step then crosses furniture."""

HEADROOM = 1.8
"""Height in metres above which a box is not an obstacle."""

STEP_HEIGHT = 0.05
"""Height in metres up to which a box is not an obstacle."""

MAX_ATTEMPTS = 500
"""Attempts to draw a room before an error."""


@dataclass(frozen=True)
class FloorPlan:
    """A furnished room.

    Attributes:
        places: grid coordinates of the free places (column along x, row along z), all connected.
        boxes: walls, floor, ceiling and furniture.
        light: position of the lamp, in metres.
    """

    places: tuple[tuple[int, int], ...]
    boxes: tuple[Box, ...]
    light: Point


def draw_floor_plan(room_type: str, rng: np.random.Generator, size: str = "full") -> FloorPlan:
    """Draw a furnished room.

    Args:
        room_type: one of `ROOM_TYPES`.
        rng: source of all randomness.
        size: one of `SIZES`.

    Returns:
        The room, with connected free places and all required objects.

    Raises:
        InputError: the room type or the size is unknown.
    """
    if room_type not in ROOM_TYPES:
        raise InputError(f"Unknown room type {room_type!r}; choose one of {', '.join(ROOM_TYPES)}.")
    if size not in SIZES:
        raise InputError(f"Unknown room size {size!r}; choose one of {', '.join(SIZES)}.")
    for _ in range(MAX_ATTEMPTS):
        plan = _attempt(room_type, SPECIFICATIONS[size][room_type], rng)
        if plan is not None:
            return plan
    raise RuntimeError(f"No {size} {room_type} fitted its furniture in {MAX_ATTEMPTS} attempts.")


def _attempt(room_type: str, specification: RoomSpecification, rng: np.random.Generator) -> FloorPlan | None:
    """Draw one room; None if it does not satisfy the specification."""
    columns, rows = (int(rng.integers(low, high + 1)) for low, high in (specification.columns, specification.rows))
    if rng.random() < 0.5:
        columns, rows = rows, columns
    outline = room_outline(columns, rows)
    height = float(rng.uniform(2.5, 2.8))
    walls, solid = draw_walls(columns, rows, interior_walls=specification.interior_walls, rng=rng)
    structure = wall_boxes(walls, outline, height, DECORATIONS[room_type], rng)
    furniture = place_furniture(specification.furniture, walls, solid, outline, height, rng)
    if furniture is None:
        return None
    obstacles = solid + [
        Rectangle(box.lower[0], box.upper[0], box.lower[2], box.upper[2])
        for box in furniture
        if box.upper[1] > STEP_HEIGHT and box.lower[1] < HEADROOM
    ]
    places = largest_component(_free_places(columns, rows, obstacles))
    fewest, most = specification.places
    if not fewest <= len(places) <= most:
        return None
    light = ((outline.west + outline.east) / 2, height - 0.3, (outline.south + outline.north) / 2)
    return FloorPlan(places, (*structure, *furniture), light)


def _free_places(columns: int, rows: int, obstacles: Sequence[Rectangle]) -> Bool[np.ndarray, "columns rows"]:
    """Places with the required distance from all obstacles."""
    x, z = GRID_STEP * np.arange(columns)[:, None], GRID_STEP * np.arange(rows)
    free = np.ones((columns, rows), bool)
    for west, east, south, north in obstacles:
        in_x = (west - CLEARANCE < x) & (x < east + CLEARANCE)
        free &= ~(in_x & (south - CLEARANCE < z) & (z < north + CLEARANCE))
    return free


def largest_component(free: Bool[np.ndarray, "columns rows"]) -> tuple[tuple[int, int], ...]:
    """The largest set of free places that are connected by moves along the grid; the first one in case of ties.

    Args:
        free: whether each place is free.

    Returns:
        Coordinates (column, row), row by row.
    """
    label, _ = ndimage.label(free)
    size = np.bincount(label[free], minlength=2)  # label 0 is for places that are not free
    row, column = np.nonzero((label == size.argmax()).T & free.T)
    return tuple(zip(column.tolist(), row.tolist(), strict=True))
