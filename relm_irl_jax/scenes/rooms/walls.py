"""Walls, floor and ceiling of a room: positions and materials."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relm_irl_jax.scenes.rooms.boxes import Box, Colour, Material, Pattern, Point
from relm_irl_jax.scenes.rooms.room_specifications import Decoration
from relm_irl_jax.scenes.scene import GRID_STEP

WALL_DISTANCE = 0.5
"""Distance in metres from the outermost places to the wall."""

WALL_THICKNESS = 0.12
"""Thickness of walls in metres."""


class Rectangle(NamedTuple):
    """A rectangle of the floor, in metres.

    Attributes:
        west: smallest x.
        east: largest x.
        south: smallest z.
        north: largest z.
    """

    west: float
    east: float
    south: float
    north: float


@dataclass(frozen=True)
class Wall:
    """The inner face of a wall, or a line in the room along which furniture stands.

    Attributes:
        axis: axis of its normal, 0 for x and 2 for z.
        position: coordinate on that axis, in metres.
        side: direction of the normal, into the room: 1 or -1.
        start: smallest coordinate on the other horizontal axis, in metres.
        end: largest coordinate on the other horizontal axis, in metres.
    """

    axis: int
    position: float
    side: int
    start: float
    end: float

    def box_corners(
        self, u: tuple[float, float], y: tuple[float, float], d: tuple[float, float]
    ) -> tuple[Point, Point]:
        """Convert the extent of a box from the wall's coordinates to the room's.

        Args:
            u: extent along the wall, from its start, in metres.
            y: extent upwards, from the floor.
            d: extent away from the wall.

        Returns:
            Lower and upper corner.
        """
        along = (self.start + u[0], self.start + u[1])
        near, far = sorted((self.position + self.side * d[0], self.position + self.side * d[1]))
        x, z = ((near, far), along) if self.axis == 0 else (along, (near, far))
        return (x[0], y[0], z[0]), (x[1], y[1], z[1])


def room_outline(columns: int, rows: int) -> Rectangle:
    """The rectangle that encloses a room.

    Args:
        columns: places along x.
        rows: places along z.
    """
    return Rectangle(
        west=-WALL_DISTANCE,
        east=(columns - 1) * GRID_STEP + WALL_DISTANCE,
        south=-WALL_DISTANCE,
        north=(rows - 1) * GRID_STEP + WALL_DISTANCE,
    )


def draw_walls(
    columns: int, rows: int, *, interior_walls: bool, rng: np.random.Generator
) -> tuple[list[Wall], list[Rectangle]]:
    """Draw the walls of a room: a rectangle, an L, or a rectangle with a partition.

    Args:
        columns: places along x.
        rows: places along z.
        interior_walls: whether the room may be an L or have a partition.
        rng: source of all randomness.

    Returns:
        Inner faces of the walls, and the solid part of the rectangle: an L's corner or a partition.
    """
    west, east, south, north = room_outline(columns, rows)
    kind = str(rng.choice(["box", "corner", "partition"])) if interior_walls else "box"
    if kind == "corner":
        x = int(rng.integers(columns * 6 // 10, columns * 8 // 10 + 1)) * GRID_STEP
        z = int(rng.integers(rows * 6 // 10, rows * 8 // 10 + 1)) * GRID_STEP
        walls = [
            Wall(0, west, 1, south, north),
            Wall(0, east, -1, south, z),
            Wall(2, south, 1, west, east),
            Wall(2, north, -1, west, x),
            Wall(0, x, -1, z, north),
            Wall(2, z, -1, x, east),
        ]
        return walls, [Rectangle(x, east, z, north)]
    walls = [
        Wall(0, west, 1, south, north),
        Wall(0, east, -1, south, north),
        Wall(2, south, 1, west, east),
        Wall(2, north, -1, west, east),
    ]
    if kind == "partition":
        x = int(rng.integers(columns * 4 // 10, columns * 6 // 10 + 1)) * GRID_STEP
        z = int(rng.integers(rows * 5 // 10, rows * 6 // 10 + 1)) * GRID_STEP
        half = WALL_THICKNESS / 2
        walls += [Wall(0, x - half, -1, z, north), Wall(0, x + half, 1, z, north)]
        return walls, [Rectangle(x - half, x + half, z, north)]
    return walls, []


def wall_boxes(
    walls: Sequence[Wall], outline: Rectangle, height: float, decoration: Decoration, rng: np.random.Generator
) -> list[Box]:
    """Boxes of the walls, the floor and the ceiling, with different materials.

    Args:
        walls: inner faces of the walls.
        outline: rectangle that encloses the room.
        height: of the room, in metres.
        decoration: colours and patterns to draw from.
        rng: source of all randomness.

    Returns:
        The boxes: walls in the order given, floor, ceiling.
    """
    colours, patterns = decoration.wall_colours, decoration.wall_patterns
    colour_order = [*rng.permutation(len(colours)), *rng.permutation(len(colours))]
    pattern_order = [*rng.permutation(len(patterns)), *rng.permutation(len(patterns))]
    boxes = []
    overlap = WALL_THICKNESS / 2
    for wall, colour, pattern in zip(walls, colour_order, pattern_order, strict=False):
        first = np.clip(np.asarray(colours[colour]) + rng.uniform(-0.05, 0.05, 3), 0, 1)
        second = first * rng.uniform(0.78, 0.86) if rng.random() < 0.6 else first + 0.6 * (1 - first)
        kind, scale = patterns[pattern]
        material = Material(_colour(first), _colour(second), kind, scale * float(rng.uniform(0.9, 1.1)))
        # Walls overlap at the corners of the outline, so that no ray passes through a corner. At an L's inner corner
        # they must not overlap, because they would extend into the room.
        smallest, largest = outline[2:] if wall.axis == 0 else outline[:2]
        start_overlap = overlap if wall.start == smallest else 0.0
        end_overlap = overlap if wall.end == largest else 0.0
        extent = (-start_overlap, wall.end - wall.start + end_overlap)
        lower, upper = wall.box_corners(extent, (0.0, height), (-overlap, 0.0))
        boxes.append(Box(lower, upper, material))
    floor = decoration.floors[rng.integers(len(decoration.floors))]
    first, second = (_colour(np.asarray(c) + rng.uniform(-0.05, 0.05, 3)) for c in (floor.colour, floor.second_colour))
    ceiling = Material((0.93, 0.92, 0.9), (0.8, 0.79, 0.78), Pattern.TILES, float(rng.uniform(0.8, 1.1)))
    west, south = outline.west - overlap, outline.south - overlap
    east, north = outline.east + overlap, outline.north + overlap
    floor = Material(first, second, floor.pattern, floor.scale)
    boxes.append(Box((west, -0.1, south), (east, 0.0, north), floor))
    boxes.append(Box((west, height, south), (east, height + 0.1, north), ceiling))
    return boxes


def _colour(values: np.ndarray) -> Colour:
    red, green, blue = np.clip(values, 0, 1).tolist()
    return red, green, blue
