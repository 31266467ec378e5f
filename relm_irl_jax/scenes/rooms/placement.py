"""Placement of furniture: random positions are tried until an object overlaps no other."""

from collections.abc import Sequence

import numpy as np

from relm_irl_jax.scenes.rooms.boxes import Box, Point
from relm_irl_jax.scenes.rooms.furniture import CATEGORIES, Item
from relm_irl_jax.scenes.rooms.room_specifications import Request
from relm_irl_jax.scenes.rooms.walls import Rectangle, Wall

POSITIONS_TRIED = 40
"""Random positions tried for one object."""

Corners = tuple[Point, Point]
"""Lower and upper corner of the space that an object occupies."""


def place_furniture(
    requests: Sequence[Request],
    walls: Sequence[Wall],
    solid: Sequence[Rectangle],
    outline: Rectangle,
    height: float,
    rng: np.random.Generator,
) -> list[Box] | None:
    """Draw objects and their positions.

    Objects overlap neither the solid parts of the room nor each other, but furniture may stand on a rug.

    Args:
        requests: objects to place, in this order.
        walls: inner faces of the walls.
        solid: parts of the outline that do not belong to the room.
        outline: rectangle that encloses the room.
        height: of the room, in metres.
        rng: source of all randomness.

    Returns:
        Boxes of the objects, or None if a required object does not fit.
    """
    blocks: list[Corners] = [((west, 0.0, south), (east, height, north)) for west, east, south, north in solid]
    boxes: list[Box] = []
    standing: list[Corners] = []
    for request in requests:
        placed = 0
        for _ in range(int(rng.integers(max(request.minimum, 1), request.maximum + 1))):
            item = request.build(rng)
            for _ in range(POSITIONS_TRIED):
                line = _draw_position(item, request, walls, outline, rng)
                if line is None:
                    continue
                space = line.box_corners((-0.03, item.width + 0.03), item.height, (0.001, item.depth))
                obstacles = blocks if request.position == "floor" else [*blocks, *standing]
                if any(_overlap(space, other) for other in obstacles):
                    continue
                if request.position != "floor":
                    standing.append(space)
                placed += 1
                boxes += [
                    Box(*line.box_corners(part.u, part.y, part.d), part.material, CATEGORIES.index(part.category))
                    for part in item.parts
                ]
                break
        if placed < request.minimum:
            return None
    return boxes


def _draw_position(
    item: Item, request: Request, walls: Sequence[Wall], outline: Rectangle, rng: np.random.Generator
) -> Wall | None:
    """Draw the line behind an item, from the item's left end; None if there is not enough space."""
    if request.position == "wall":
        wall = walls[int(rng.integers(len(walls)))]
        slack = wall.end - wall.start - item.width
        if slack < 0.04:
            return None
        start = wall.start + float(rng.uniform(0.02, slack - 0.02))
        return Wall(wall.axis, wall.position, wall.side, start, start + item.width)
    west, east, south, north = outline
    axis = int(rng.choice((0, 2)))
    along, across = ((south, north), (west, east)) if axis == 0 else ((west, east), (south, north))
    margin = 0.7 if request.position == "free" else 0.3
    if across[1] - across[0] < item.depth + 2 * margin or along[1] - along[0] < item.width + 2 * margin:
        return None
    start = float(rng.uniform(along[0] + margin, along[1] - margin - item.width))
    position = float(rng.uniform(across[0] + margin, across[1] - margin - item.depth))
    return Wall(axis, position, 1, start, start + item.width)


def _overlap(first: Corners, second: Corners) -> bool:
    return all(first[0][axis] < second[1][axis] and second[0][axis] < first[1][axis] for axis in range(3))
