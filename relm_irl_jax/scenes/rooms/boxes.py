"""The geometry of rooms: axis-aligned boxes with a material and, for objects, a category."""

from dataclasses import dataclass
from enum import IntEnum

Point = tuple[float, float, float]
"""A corner (x, y, z) in metres; y points up and is 0 on the floor."""

Colour = tuple[float, float, float]
"""Red, green and blue in [0, 1]."""

NO_CATEGORY = -1
"""Category of walls, floors and ceilings."""


class Pattern(IntEnum):
    """Arrangement of the two colours of a `Material` on a face; lengths are multiples of `Material.scale`."""

    PLAIN = 0
    """The first colour only."""
    CHECKER = 1
    """Squares of alternating colour."""
    TILES = 2
    """Squares of slightly varying brightness with joints of the second colour."""
    STRIPES = 3
    """Vertical stripes."""
    BANDS = 4
    """Horizontal bands."""
    BRICKS = 5
    """Bricks in running bond with joints of the second colour."""
    DOTS = 6
    """A lattice of discs of the second colour."""
    PLASTER = 7
    """Smooth clouds between the two colours."""
    PLANKS = 8
    """Long boards of varying brightness."""
    DIAMONDS = 9
    """A lattice of diamonds of the second colour."""
    LEAVES = 10
    """Small cells that mix the two colours at random."""
    FRAME = 11
    """The first colour within a border of the second, `scale` wide."""
    PANES = 12
    """Cells about `scale` wide, divided and bordered by bars of the second colour."""
    PANELS = 13
    """Cells about `scale` wide with an inset outline of the second colour."""
    BOOKS = 14
    """Shelves about `scale` high of coloured book spines, the boards in the second colour."""
    PAINTING = 15
    """A landscape: sky of the first colour, hill of the second, a sun, in a dark frame."""
    MIRROR = 16
    """Diagonal gloss in a frame of the second colour, `scale` wide."""


@dataclass(frozen=True)
class Material:
    """Surface of a box.

    Attributes:
        colour: first colour.
        second_colour: second colour; the pattern determines where it is visible.
        pattern: arrangement of the colours.
        scale: length of the pattern in metres.
        emission: share of the colour that does not depend on the light, in [0, 1].
    """

    colour: Colour
    second_colour: Colour = (0.0, 0.0, 0.0)
    pattern: Pattern = Pattern.PLAIN
    scale: float = 0.1
    emission: float = 0.0


@dataclass(frozen=True)
class Box:
    """An axis-aligned box.

    Attributes:
        lower: corner with the smallest coordinates.
        upper: corner with the largest coordinates.
        material: its surface.
        category: index into the category list, or `NO_CATEGORY`.
    """

    lower: Point
    upper: Point
    material: Material
    category: int = NO_CATEGORY
