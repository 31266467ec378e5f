"""Floor plans of the built-in rooms: walls, furniture and the places left free. No pictures yet.

A room is drawn at random until its number of free places is in the range of the original scenes and all its required
objects found room. Places lie on the 0.5 m grid, at least `GAP` from the walls and `CLEARANCE` from the furniture.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from relm_irl_jax.errors import InputError
from relm_irl_jax.scenes import furniture
from relm_irl_jax.scenes.boxes import Box, Colour, Look, Pattern, Point
from relm_irl_jax.scenes.furniture import CATEGORIES, Builder, Item
from relm_irl_jax.scenes.scene import GRID_STEP, ROOM_TYPES

Size = Literal["full", "tiny"]
SIZES: tuple[Size, ...] = ("full", "tiny")

PLACES = {
    "full": {"bathroom": (33, 51), "bedroom": (71, 124), "living_room": (117, 219)},
    "tiny": dict.fromkeys(ROOM_TYPES, (12, 20)),
}
"""Least and greatest number of places; four states each give the original scenes' counts."""

GAP = 0.5
"""Distance in metres from the outermost places to the wall."""

CLEARANCE = 0.2
"""Distance in metres that the camera keeps from furniture. No move of one grid step then crosses any."""

WALL_THICKNESS = 0.12
"""Thickness of walls in metres."""

HEADROOM = 1.8
"""Height in metres above which a box does not block the way."""

STEP_OVER = 0.05
"""Height in metres up to which a box is walked over."""

ATTEMPTS = 500
"""Drawings of one room before giving up."""

_Footprint = tuple[float, float, float, float]
"""Least x, greatest x, least z, greatest z in metres."""


@dataclass(frozen=True)
class Wall:
    """The inner face of a wall, or a line along which furniture stands free.

    Attributes:
        axis: axis of its normal, 0 for x and 2 for z.
        position: where it lies on that axis.
        side: direction of the normal, into the room: 1 or -1.
        start: where it begins on the other horizontal axis.
        end: where it ends.
    """

    axis: int
    position: float
    side: int
    start: float
    end: float

    def place(self, u: tuple[float, float], y: tuple[float, float], d: tuple[float, float]) -> tuple[Point, Point]:
        """Corners in the room of a box given along the wall, upwards and away from it."""
        along = (self.start + u[0], self.start + u[1])
        near, far = sorted((self.position + self.side * d[0], self.position + self.side * d[1]))
        x, z = ((near, far), along) if self.axis == 0 else (along, (near, far))
        return (x[0], y[0], z[0]), (x[1], y[1], z[1])


@dataclass(frozen=True)
class RoomLayout:
    """A furnished room.

    Attributes:
        room_type: one of `ROOM_TYPES`.
        places: grid coordinates of the free places, column along x and row along z, all connected.
        boxes: walls, floor, ceiling and furniture.
        light: position of the lamp that lights the room.
    """

    room_type: str
    places: tuple[tuple[int, int], ...]
    boxes: tuple[Box, ...]
    light: Point

    def objects(self) -> frozenset[str]:
        """Categories present."""
        return frozenset(CATEGORIES[box.category] for box in self.boxes if box.category >= 0)


@dataclass(frozen=True)
class Request:
    """Objects to put into a room.

    Attributes:
        build: makes one.
        kind: at a wall, free in the room, or flat on the floor.
        least: number without which the room is drawn again.
        most: number tried.
    """

    build: Builder
    kind: Literal["wall", "free", "flat"] = "wall"
    least: int = 1
    most: int = 1


_FULL = {
    "bathroom": (
        Request(furniture.door),
        Request(furniture.bathtub),
        Request(furniture.washstand),
        Request(furniture.toilet),
        Request(furniture.window),
        Request(furniture.cabinet),
        Request(furniture.towel, most=2),
        Request(furniture.plant),
        Request(furniture.bin_),
        Request(furniture.bath_mat, "flat"),
    ),
    "bedroom": (
        Request(furniture.door),
        Request(furniture.double_bed),
        Request(furniture.window, most=2),
        Request(furniture.wardrobe),
        Request(furniture.desk),
        Request(furniture.bookcase),
        Request(furniture.plant),
        Request(furniture.painting, most=2),
        Request(furniture.mirror, least=0),
        Request(furniture.floor_lamp, least=0),
        Request(furniture.bin_, least=0),
        Request(furniture.cabinet, least=0),
        Request(furniture.rug, "flat"),
    ),
    "living_room": (
        Request(furniture.door),
        Request(furniture.sofa),
        Request(furniture.window, least=1, most=3),
        Request(furniture.tv),
        Request(furniture.dining_set, "free"),
        Request(furniture.bookcase, most=2),
        Request(furniture.armchair),
        Request(furniture.floor_lamp, most=2),
        Request(furniture.plant, most=3),
        Request(furniture.painting, least=2, most=3),
        Request(furniture.cabinet, least=0),
        Request(furniture.rug, "flat"),
    ),
}

_TINY = {
    "bathroom": (
        Request(furniture.door),
        Request(furniture.washstand),
        Request(furniture.toilet),
        Request(furniture.towel),
        Request(furniture.window, least=0),
        Request(furniture.bathtub, least=0),
        Request(furniture.plant),
        Request(furniture.bath_mat, "flat"),
    ),
    "bedroom": (
        Request(furniture.door),
        Request(furniture.single_bed),
        Request(furniture.window),
        Request(furniture.painting),
        Request(furniture.bookcase, least=0),
        Request(furniture.plant),
        Request(furniture.rug, "flat"),
    ),
    "living_room": (
        Request(furniture.door),
        Request(furniture.tv),
        Request(furniture.armchair),
        Request(furniture.window),
        Request(furniture.bookcase, least=0),
        Request(furniture.floor_lamp),
        Request(furniture.painting),
        Request(furniture.plant),
        Request(furniture.rug, "flat"),
    ),
}

_REQUESTS = {"full": _FULL, "tiny": _TINY}

_GRID = {
    "full": {"bathroom": ((5, 7), (7, 9)), "bedroom": ((9, 12), (10, 13)), "living_room": ((12, 16), (13, 17))},
    "tiny": {"bathroom": ((4, 5), (5, 6)), "bedroom": ((5, 6), (5, 6)), "living_room": ((5, 6), (5, 6))},
}
"""Range of columns and rows of the grid, both ends included."""

_WALL_COLOURS: dict[str, tuple[Colour, ...]] = {
    "bathroom": (
        (0.62, 0.82, 0.86),
        (0.72, 0.88, 0.78),
        (0.86, 0.88, 0.92),
        (0.55, 0.7, 0.88),
        (0.9, 0.82, 0.88),
        (0.75, 0.8, 0.68),
    ),
    "bedroom": (
        (0.93, 0.85, 0.72),
        (0.82, 0.72, 0.85),
        (0.75, 0.82, 0.92),
        (0.92, 0.74, 0.72),
        (0.78, 0.86, 0.7),
        (0.95, 0.92, 0.8),
    ),
    "living_room": (
        (0.72, 0.42, 0.33),
        (0.85, 0.78, 0.62),
        (0.48, 0.56, 0.5),
        (0.8, 0.66, 0.5),
        (0.58, 0.52, 0.62),
        (0.88, 0.86, 0.8),
        (0.62, 0.66, 0.72),
    ),
}

_WALL_PATTERNS: dict[str, tuple[tuple[Pattern, float], ...]] = {
    "bathroom": ((Pattern.TILES, 0.23), (Pattern.CHECKER, 0.19), (Pattern.TILES, 0.41), (Pattern.DIAMONDS, 0.27)),
    "bedroom": ((Pattern.PLASTER, 0.6), (Pattern.STRIPES, 0.21), (Pattern.DOTS, 0.29), (Pattern.BANDS, 0.47)),
    "living_room": (
        (Pattern.BRICKS, 0.42),
        (Pattern.PLASTER, 0.7),
        (Pattern.STRIPES, 0.33),
        (Pattern.PLANKS, 0.17),
        (Pattern.BANDS, 0.61),
        (Pattern.DIAMONDS, 0.37),
    ),
}

_FLOORS: dict[str, tuple[Look, ...]] = {
    "bathroom": (
        Look((0.88, 0.88, 0.86), (0.35, 0.42, 0.48), Pattern.CHECKER, 0.31),
        Look((0.6, 0.68, 0.72), (0.9, 0.9, 0.9), Pattern.TILES, 0.37),
    ),
    "bedroom": (
        Look((0.66, 0.46, 0.28), (0.4, 0.26, 0.15), Pattern.PLANKS, 0.17),
        Look((0.52, 0.56, 0.62), (0.62, 0.66, 0.72), Pattern.PLASTER, 0.4),
    ),
    "living_room": (
        Look((0.55, 0.36, 0.2), (0.32, 0.2, 0.1), Pattern.PLANKS, 0.21),
        Look((0.78, 0.72, 0.62), (0.55, 0.48, 0.4), Pattern.TILES, 0.57),
    ),
}


def _shape(
    room_type: str, size: Size, columns: int, rows: int, rng: np.random.Generator
) -> tuple[list[Wall], list[_Footprint]]:
    """Inner faces of the walls, and what they take away of the rectangle: an L's corner or a partition."""
    west, east = -GAP, (columns - 1) * GRID_STEP + GAP
    south, north = -GAP, (rows - 1) * GRID_STEP + GAP
    kind = "box"
    if room_type == "living_room" and size == "full":
        kind = str(rng.choice(["box", "corner", "partition"]))
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
        return walls, [(x, east, z, north)]
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
        return walls, [(x - half, x + half, z, north)]
    return walls, []


def _structure(
    room_type: str, walls: Sequence[Wall], outline: _Footprint, height: float, rng: np.random.Generator
) -> list[Box]:
    """Boxes of the walls, the floor and the ceiling, each with a look of its own."""
    colours = _WALL_COLOURS[room_type]
    order = [*rng.permutation(len(colours)), *rng.permutation(len(colours))]
    patterns = _WALL_PATTERNS[room_type]
    pattern_order = [*rng.permutation(len(patterns)), *rng.permutation(len(patterns))]
    boxes = []
    overlap = WALL_THICKNESS / 2
    for wall, colour, pattern in zip(walls, order, pattern_order, strict=False):
        first = np.clip(np.asarray(colours[colour]) + rng.uniform(-0.05, 0.05, 3), 0, 1)
        second = first * rng.uniform(0.78, 0.86) if rng.random() < 0.6 else first + 0.6 * (1 - first)
        kind, scale = patterns[pattern]
        look = Look(_colour(first), _colour(second), kind, scale * float(rng.uniform(0.9, 1.1)))
        # Walls overlap where they meet the outline, so that no ray slips through a corner. At an L's inner corner they
        # must not, because they would stand out into the room.
        least, most = outline[2:] if wall.axis == 0 else outline[:2]
        before = overlap if wall.start == least else 0.0
        after = overlap if wall.end == most else 0.0
        lower, upper = wall.place((-before, wall.end - wall.start + after), (0.0, height), (-overlap, 0.0))
        boxes.append(Box(lower, upper, look))
    floor = _FLOORS[room_type][rng.integers(len(_FLOORS[room_type]))]
    first, second = (_colour(np.asarray(c) + rng.uniform(-0.05, 0.05, 3)) for c in (floor.colour, floor.second))
    ceiling = Look((0.93, 0.92, 0.9), (0.8, 0.79, 0.78), Pattern.TILES, float(rng.uniform(0.8, 1.1)))
    west, south = outline[0] - overlap, outline[2] - overlap
    east, north = outline[1] + overlap, outline[3] + overlap
    floor = Look(first, second, floor.pattern, floor.scale)
    boxes.append(Box((west, -0.1, south), (east, 0.0, north), floor))
    boxes.append(Box((west, height, south), (east, height + 0.1, north), ceiling))
    return boxes


def _colour(values: np.ndarray) -> Colour:
    red, green, blue = np.clip(values, 0, 1).tolist()
    return red, green, blue


_Span = tuple[Point, Point]
"""Lower and upper corner of the room that an item takes."""


def _overlap(first: _Span, second: _Span) -> bool:
    return all(first[0][axis] < second[1][axis] and second[0][axis] < first[1][axis] for axis in range(3))


def _stand(
    item: Item, request: Request, walls: Sequence[Wall], outline: _Footprint, rng: np.random.Generator
) -> Wall | None:
    """Draw where an item stands: the line behind it, beginning at its left end."""
    if request.kind == "wall":
        wall = walls[int(rng.integers(len(walls)))]
        slack = wall.end - wall.start - item.width
        if slack < 0.04:
            return None
        start = wall.start + float(rng.uniform(0.02, slack - 0.02))
        return Wall(wall.axis, wall.position, wall.side, start, start + item.width)
    west, east, south, north = outline
    axis = int(rng.choice((0, 2)))
    along, across = ((south, north), (west, east)) if axis == 0 else ((west, east), (south, north))
    margin = 0.7 if request.kind == "free" else 0.3
    if across[1] - across[0] < item.depth + 2 * margin or along[1] - along[0] < item.width + 2 * margin:
        return None
    start = float(rng.uniform(along[0] + margin, along[1] - margin - item.width))
    return Wall(
        axis, float(rng.uniform(across[0] + margin, across[1] - margin - item.depth)), 1, start, start + item.width
    )


def _furnish(
    requests: Sequence[Request],
    walls: Sequence[Wall],
    solid: Sequence[_Span],
    outline: _Footprint,
    rng: np.random.Generator,
) -> list[Box] | None:
    """Boxes of the furniture, or None where a required object found no room.

    Objects keep clear of what is solid and of each other; a rug may lie under furniture.
    """
    boxes: list[Box] = []
    standing: list[_Span] = []
    for request in requests:
        placed = 0
        for _ in range(int(rng.integers(max(request.least, 1), request.most + 1))):
            item = request.build(rng)
            for _ in range(40):
                stand = _stand(item, request, walls, outline, rng)
                if stand is None:
                    continue
                span = stand.place((-0.03, item.width + 0.03), item.height, (0.001, item.depth))
                obstacles = solid if request.kind == "flat" else [*solid, *standing]
                if any(_overlap(span, other) for other in obstacles):
                    continue
                if request.kind != "flat":
                    standing.append(span)
                placed += 1
                boxes += [
                    Box(*stand.place(part.u, part.y, part.d), part.look, CATEGORIES.index(part.category))
                    for part in item.parts
                ]
                break
        if placed < request.least:
            return None
    return boxes


def _largest_component(free: set[tuple[int, int]]) -> list[tuple[int, int]]:
    """The largest set of places that one can walk between, row by row."""
    largest: set[tuple[int, int]] = set()
    left = set(free)
    while left:
        seed = min(left)
        component, frontier = {seed}, [seed]
        while frontier:
            column, row = frontier.pop()
            for place in ((column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)):
                if place in left and place not in component:
                    component.add(place)
                    frontier.append(place)
        left -= component
        largest = max(largest, component, key=len)
    return sorted(largest, key=lambda place: (place[1], place[0]))


def _blocked(column: int, row: int, footprints: Sequence[_Footprint]) -> bool:
    x, z = column * GRID_STEP, row * GRID_STEP
    return any(
        west - CLEARANCE < x < east + CLEARANCE and south - CLEARANCE < z < north + CLEARANCE
        for west, east, south, north in footprints
    )


def _draw(room_type: str, rng: np.random.Generator, size: Size) -> RoomLayout | None:
    """Draw one room, or None where it does not come out as asked."""
    (least_columns, most_columns), (least_rows, most_rows) = _GRID[size][room_type]
    columns = int(rng.integers(least_columns, most_columns + 1))
    rows = int(rng.integers(least_rows, most_rows + 1))
    if rng.random() < 0.5:
        columns, rows = rows, columns
    outline = (-GAP, (columns - 1) * GRID_STEP + GAP, -GAP, (rows - 1) * GRID_STEP + GAP)
    height = float(rng.uniform(2.5, 2.8))
    walls, solid = _shape(room_type, size, columns, rows, rng)
    structure = _structure(room_type, walls, outline, height, rng)
    blocks = [((west, 0.0, south), (east, height, north)) for west, east, south, north in solid]
    boxes = _furnish(_REQUESTS[size][room_type], walls, blocks, outline, rng)
    if boxes is None:
        return None
    footprints = solid + [
        (box.lower[0], box.upper[0], box.lower[2], box.upper[2])
        for box in boxes
        if box.upper[1] > STEP_OVER and box.lower[1] < HEADROOM
    ]
    free = {(column, row) for column in range(columns) for row in range(rows) if not _blocked(column, row, footprints)}
    places = _largest_component(free)
    least, most = PLACES[size][room_type]
    if not least <= len(places) <= most:
        return None
    light = ((outline[0] + outline[1]) / 2, height - 0.3, (outline[2] + outline[3]) / 2)
    return RoomLayout(room_type, tuple(places), (*structure, *boxes), light)


def layout(room_type: str, rng: np.random.Generator, size: str = "full") -> RoomLayout:
    """Draw a furnished room.

    Args:
        room_type: one of `ROOM_TYPES`.
        rng: source of all randomness.
        size: `full` for the original scenes' state counts, `tiny` for 12 to 20 places.

    Returns:
        The room: its free places are connected, and its required objects are all there.
    """
    if room_type not in ROOM_TYPES:
        raise InputError(f"Unknown room type {room_type!r}; choose one of {', '.join(ROOM_TYPES)}.")
    if size not in SIZES:
        raise InputError(f"Unknown room size {size!r}; choose one of {', '.join(SIZES)}.")
    for _ in range(ATTEMPTS):
        room = _draw(room_type, rng, size)
        if room is not None:
            return room
    raise RuntimeError(f"No {size} {room_type} came out in {ATTEMPTS} drawings.")
