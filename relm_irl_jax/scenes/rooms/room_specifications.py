"""Specifications of the built-in rooms: sizes, furniture, colours and patterns of each room type."""

from dataclasses import dataclass
from typing import Literal

from relm_irl_jax.scenes.rooms import furniture
from relm_irl_jax.scenes.rooms.boxes import Colour, Material, Pattern
from relm_irl_jax.scenes.rooms.furniture import Builder

VERSION = 3
"""Version of the generator. Increase it if rooms or views change, since cached rooms depend on it."""

SOURCE = f"rooms/{VERSION}"
"""`Scene.source` of these scenes."""

Size = Literal["full", "tiny"]
SIZES: tuple[Size, ...] = ("full", "tiny")
"""`full` for the state counts of the original scenes, `tiny` for 12 to 20 places."""


@dataclass(frozen=True)
class Request:
    """A number of objects of one kind in a room.

    Attributes:
        build: draws an object.
        position: along a wall, anywhere in the room, or flat on the floor.
        minimum: smallest number; if fewer fit, the room is drawn again.
        maximum: largest number.
    """

    build: Builder
    position: Literal["wall", "free", "floor"] = "wall"
    minimum: int = 1
    maximum: int = 1


@dataclass(frozen=True)
class RoomSpecification:
    """Size and furniture of a room; ranges include both ends.

    Attributes:
        places: range of the number of free places; with four states each, it gives the original scenes' state counts.
        columns: range of the number of grid columns.
        rows: range of the number of grid rows; columns and rows are swapped in half of the rooms.
        furniture: objects, in the order in which they are placed.
        interior_walls: whether some rooms are L-shaped or have a partition.
    """

    places: tuple[int, int]
    columns: tuple[int, int]
    rows: tuple[int, int]
    furniture: tuple[Request, ...]
    interior_walls: bool = False


@dataclass(frozen=True)
class Decoration:
    """Colours and patterns of walls and floors, from which each room is drawn.

    Attributes:
        wall_colours: first colours of the walls; the walls of a room have different ones.
        wall_patterns: patterns of the walls with their scale in metres.
        floors: materials of the floor.
    """

    wall_colours: tuple[Colour, ...]
    wall_patterns: tuple[tuple[Pattern, float], ...]
    floors: tuple[Material, ...]


_FULL = {
    "bathroom": RoomSpecification(
        places=(33, 51),
        columns=(5, 7),
        rows=(7, 9),
        furniture=(
            Request(furniture.door),
            Request(furniture.bathtub),
            Request(furniture.washstand),
            Request(furniture.toilet),
            Request(furniture.window),
            Request(furniture.cabinet),
            Request(furniture.towel, maximum=2),
            Request(furniture.plant),
            Request(furniture.waste_bin),
            Request(furniture.bath_mat, "floor"),
        ),
    ),
    "bedroom": RoomSpecification(
        places=(71, 124),
        columns=(9, 12),
        rows=(10, 13),
        furniture=(
            Request(furniture.door),
            Request(furniture.double_bed),
            Request(furniture.window, maximum=2),
            Request(furniture.wardrobe),
            Request(furniture.desk),
            Request(furniture.bookcase),
            Request(furniture.plant),
            Request(furniture.painting, maximum=2),
            Request(furniture.mirror, minimum=0),
            Request(furniture.floor_lamp, minimum=0),
            Request(furniture.waste_bin, minimum=0),
            Request(furniture.cabinet, minimum=0),
            Request(furniture.rug, "floor"),
        ),
    ),
    "living_room": RoomSpecification(
        places=(117, 219),
        columns=(12, 16),
        rows=(13, 17),
        furniture=(
            Request(furniture.door),
            Request(furniture.sofa),
            Request(furniture.window, maximum=3),
            Request(furniture.tv),
            Request(furniture.dining_set, "free"),
            Request(furniture.bookcase, maximum=2),
            Request(furniture.armchair),
            Request(furniture.floor_lamp, maximum=2),
            Request(furniture.plant, maximum=3),
            Request(furniture.painting, minimum=2, maximum=3),
            Request(furniture.cabinet, minimum=0),
            Request(furniture.rug, "floor"),
        ),
        interior_walls=True,
    ),
}

_TINY = {
    "bathroom": RoomSpecification(
        places=(12, 20),
        columns=(4, 5),
        rows=(5, 6),
        furniture=(
            Request(furniture.door),
            Request(furniture.washstand),
            Request(furniture.toilet),
            Request(furniture.towel),
            Request(furniture.window, minimum=0),
            Request(furniture.bathtub, minimum=0),
            Request(furniture.plant),
            Request(furniture.bath_mat, "floor"),
        ),
    ),
    "bedroom": RoomSpecification(
        places=(12, 20),
        columns=(5, 6),
        rows=(5, 6),
        furniture=(
            Request(furniture.door),
            Request(furniture.single_bed),
            Request(furniture.window),
            Request(furniture.painting),
            Request(furniture.bookcase, minimum=0),
            Request(furniture.plant),
            Request(furniture.rug, "floor"),
        ),
    ),
    "living_room": RoomSpecification(
        places=(12, 20),
        columns=(5, 6),
        rows=(5, 6),
        furniture=(
            Request(furniture.door),
            Request(furniture.tv),
            Request(furniture.armchair),
            Request(furniture.window),
            Request(furniture.bookcase, minimum=0),
            Request(furniture.floor_lamp),
            Request(furniture.painting),
            Request(furniture.plant),
            Request(furniture.rug, "floor"),
        ),
    ),
}

SPECIFICATIONS: dict[Size, dict[str, RoomSpecification]] = {"full": _FULL, "tiny": _TINY}
"""Size and furniture by room size and room type."""

DECORATIONS = {
    "bathroom": Decoration(
        wall_colours=(
            (0.62, 0.82, 0.86),
            (0.72, 0.88, 0.78),
            (0.86, 0.88, 0.92),
            (0.55, 0.7, 0.88),
            (0.9, 0.82, 0.88),
            (0.75, 0.8, 0.68),
        ),
        wall_patterns=(
            (Pattern.TILES, 0.23),
            (Pattern.CHECKER, 0.19),
            (Pattern.TILES, 0.41),
            (Pattern.DIAMONDS, 0.27),
        ),
        floors=(
            Material((0.88, 0.88, 0.86), (0.35, 0.42, 0.48), Pattern.CHECKER, 0.31),
            Material((0.6, 0.68, 0.72), (0.9, 0.9, 0.9), Pattern.TILES, 0.37),
        ),
    ),
    "bedroom": Decoration(
        wall_colours=(
            (0.93, 0.85, 0.72),
            (0.82, 0.72, 0.85),
            (0.75, 0.82, 0.92),
            (0.92, 0.74, 0.72),
            (0.78, 0.86, 0.7),
            (0.95, 0.92, 0.8),
        ),
        wall_patterns=(
            (Pattern.PLASTER, 0.6),
            (Pattern.STRIPES, 0.21),
            (Pattern.DOTS, 0.29),
            (Pattern.BANDS, 0.47),
        ),
        floors=(
            Material((0.66, 0.46, 0.28), (0.4, 0.26, 0.15), Pattern.PLANKS, 0.17),
            Material((0.52, 0.56, 0.62), (0.62, 0.66, 0.72), Pattern.PLASTER, 0.4),
        ),
    ),
    "living_room": Decoration(
        wall_colours=(
            (0.72, 0.42, 0.33),
            (0.85, 0.78, 0.62),
            (0.48, 0.56, 0.5),
            (0.8, 0.66, 0.5),
            (0.58, 0.52, 0.62),
            (0.88, 0.86, 0.8),
            (0.62, 0.66, 0.72),
        ),
        wall_patterns=(
            (Pattern.BRICKS, 0.42),
            (Pattern.PLASTER, 0.7),
            (Pattern.STRIPES, 0.33),
            (Pattern.PLANKS, 0.17),
            (Pattern.BANDS, 0.61),
            (Pattern.DIAMONDS, 0.37),
        ),
        floors=(
            Material((0.55, 0.36, 0.2), (0.32, 0.2, 0.1), Pattern.PLANKS, 0.21),
            Material((0.78, 0.72, 0.62), (0.55, 0.48, 0.4), Pattern.TILES, 0.57),
        ),
    ),
}
"""Colours and patterns by room type."""
