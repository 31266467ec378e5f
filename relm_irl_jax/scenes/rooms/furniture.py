"""Objects of the built-in rooms: shape and material of each category.

A category has the same shape, pattern and colours in every room, up to small random changes of size and colour. Objects
have local coordinates: u is along the wall behind the object, y upwards from the floor, and d away from the wall into
the room. `placement` converts them to room coordinates.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relm_irl_jax.scenes.rooms.boxes import Colour, Material, Pattern

CATEGORIES = (
    "armchair",
    "bathtub",
    "bed",
    "bin",
    "bookcase",
    "cabinet",
    "chair",
    "coffee_table",
    "desk",
    "dining_table",
    "door",
    "lamp",
    "mirror",
    "nightstand",
    "painting",
    "plant",
    "rug",
    "sofa",
    "switch",
    "toilet",
    "towel",
    "tv",
    "wardrobe",
    "washstand",
    "window",
)
"""Categories of objects, the same list for all rooms."""

WHITE: Colour = (0.95, 0.95, 0.93)
DARK_WOOD: Colour = (0.36, 0.22, 0.13)
OAK: Colour = (0.78, 0.58, 0.34)
BLACK: Colour = (0.08, 0.08, 0.09)
STEEL: Colour = (0.66, 0.69, 0.72)


@dataclass(frozen=True)
class Part:
    """A box of an object, in local coordinates.

    Attributes:
        category: name in `CATEGORIES`.
        u: extent along the wall.
        y: extent upwards.
        d: extent away from the wall.
        material: its surface.
    """

    category: str
    u: tuple[float, float]
    y: tuple[float, float]
    d: tuple[float, float]
    material: Material


@dataclass(frozen=True)
class Item:
    """An object, or a group of objects such as a desk with its chair.

    Attributes:
        parts: boxes of the item.
        width: extent along the wall.
        height: lowest and highest point.
        depth: extent away from the wall, including the space that must stay free in front of it.
    """

    parts: tuple[Part, ...]
    width: float
    height: tuple[float, float]
    depth: float


Builder = Callable[[np.random.Generator], Item]
"""Draws one variant of an object."""


def _vary_colour(rng: np.random.Generator, colour: Colour, amount: float = 0.04) -> Colour:
    """A colour within `amount` of the given one in each channel."""
    red, green, blue = np.clip(np.asarray(colour) + rng.uniform(-amount, amount, 3), 0.02, 1).tolist()
    return red, green, blue


def _vary_length(rng: np.random.Generator, length: float) -> float:
    """A length within 6% of the given one."""
    return length * float(rng.uniform(0.94, 1.06))


def _make_item(parts: list[Part], clearance: float = 0.0) -> Item:
    """Make an item that occupies the extent of its parts, and `clearance` metres in front of them."""
    return Item(
        parts=tuple(parts),
        width=max(part.u[1] for part in parts),
        height=(min(part.y[0] for part in parts), max(part.y[1] for part in parts)),
        depth=max(part.d[1] for part in parts) + clearance,
    )


def _shift(parts: list[Part], u: float = 0.0, y: float = 0.0, d: float = 0.0) -> list[Part]:
    """Shift parts in local coordinates."""

    def moved(extent: tuple[float, float], by: float) -> tuple[float, float]:
        return extent[0] + by, extent[1] + by

    return [Part(part.category, moved(part.u, u), moved(part.y, y), moved(part.d, d), part.material) for part in parts]


def door(rng: np.random.Generator) -> Item:
    """A panelled door with the light switch beside it; the space in front stays free."""
    leaf = Material(_vary_colour(rng, (0.72, 0.42, 0.16)), (0.45, 0.25, 0.08), Pattern.PANELS, 0.45)
    frame = Material(_vary_colour(rng, (0.9, 0.88, 0.82)))
    plate = Material(WHITE, (0.75, 0.12, 0.12), Pattern.FRAME, 0.025)
    parts = [
        Part("door", (0.0, 1.0), (0.0, 2.1), (0.0, 0.03), frame),
        Part("door", (0.07, 0.93), (0.0, 2.03), (0.0, 0.05), leaf),
        Part("door", (0.8, 0.88), (1.0, 1.06), (0.0, 0.1), Material(STEEL)),
        Part("switch", (1.13, 1.33), (1.1, 1.34), (0.0, 0.02), plate),
        Part("switch", (1.18, 1.28), (1.15, 1.29), (0.0, 0.04), Material((0.2, 0.2, 0.22))),
    ]
    return _make_item(parts, clearance=0.85)


def window(rng: np.random.Generator) -> Item:
    """A bright window with white bars."""
    width, top = _vary_length(rng, 1.3), _vary_length(rng, 2.1)
    pane = Material(_vary_colour(rng, (0.55, 0.8, 0.98)), WHITE, Pattern.PANES, 0.62, emission=0.9)
    sill = Material(WHITE)
    parts = [
        Part("window", (0.03, width - 0.03), (0.95, top), (0.0, 0.03), pane),
        Part("window", (0.0, width), (0.88, 0.95), (0.0, 0.1), sill),
    ]
    return _make_item(parts, clearance=0.2)


def painting(rng: np.random.Generator) -> Item:
    """A framed landscape with a sun."""
    width, height = _vary_length(rng, 0.85), _vary_length(rng, 0.62)
    low = float(rng.uniform(1.15, 1.3))
    skies = ((0.95, 0.55, 0.35), (0.55, 0.65, 0.95), (0.95, 0.75, 0.55))
    hills = ((0.25, 0.45, 0.25), (0.45, 0.3, 0.5), (0.3, 0.35, 0.2))
    sky, hill = (_vary_colour(rng, colours[rng.integers(3)]) for colours in (skies, hills))
    material = Material(sky, hill, Pattern.PAINTING, 0.05)
    return _make_item([Part("painting", (0.0, width), (low, low + height), (0.0, 0.04), material)], clearance=0.2)


def mirror(rng: np.random.Generator) -> Item:
    """A framed mirror with diagonal gloss."""
    width = _vary_length(rng, 0.7)
    material = Material(
        _vary_colour(rng, (0.72, 0.84, 0.88), 0.02), (0.55, 0.5, 0.42), Pattern.MIRROR, 0.04, emission=0.3
    )
    return _make_item(
        [Part("mirror", (0.0, width), (1.1, _vary_length(rng, 1.85)), (0.0, 0.03), material)], clearance=0.2
    )


def towel(rng: np.random.Generator) -> Item:
    """A towel with orange bands on a rail."""
    width = _vary_length(rng, 0.55)
    cloth = Material(_vary_colour(rng, (0.95, 0.5, 0.15)), _vary_colour(rng, (0.98, 0.9, 0.75)), Pattern.BANDS, 0.11)
    parts = [
        Part("towel", (0.0, width), (1.36, 1.39), (0.0, 0.09), Material(STEEL)),
        Part("towel", (0.05, width - 0.05), (0.72, 1.385), (0.03, 0.08), cloth),
    ]
    return _make_item(parts, clearance=0.2)


def washstand(rng: np.random.Generator) -> Item:
    """A wash basin on a blue cupboard, a mirror above it."""
    width = _vary_length(rng, 0.8)
    cupboard = Material(_vary_colour(rng, (0.3, 0.45, 0.62)), (0.16, 0.25, 0.38), Pattern.PANELS, 0.4)
    parts = [
        Part("washstand", (0.0, width), (0.08, 0.78), (0.0, 0.45), cupboard),
        Part("washstand", (0.0, width), (0.78, 0.9), (0.0, 0.5), Material(WHITE)),
        Part("washstand", (0.12, width - 0.12), (0.9, 0.905), (0.12, 0.42), Material((0.6, 0.68, 0.72))),
        Part("washstand", (width / 2 - 0.025, width / 2 + 0.025), (0.9, 1.06), (0.04, 0.2), Material(STEEL)),
    ]
    glass = mirror(rng)
    return _make_item(parts + _shift(list(glass.parts), u=(width - glass.width) / 2))


def toilet(rng: np.random.Generator) -> Item:
    """A white toilet with a cistern and a pink lid."""
    white = Material(_vary_colour(rng, WHITE, 0.02))
    parts = [
        Part("toilet", (0.02, 0.42), (0.38, 0.85), (0.0, 0.2), white),
        Part("toilet", (0.12, 0.32), (0.0, 0.38), (0.08, 0.5), white),
        Part("toilet", (0.04, 0.4), (0.3, 0.42), (0.2, 0.66), white),
        Part("toilet", (0.05, 0.39), (0.42, 0.45), (0.21, 0.65), Material(_vary_colour(rng, (0.93, 0.55, 0.65)))),
        Part("toilet", (0.18, 0.26), (0.85, 0.87), (0.06, 0.14), Material(STEEL)),
    ]
    return _make_item(parts)


def bathtub(rng: np.random.Generator) -> Item:
    """A white bathtub full of water."""
    width, depth = _vary_length(rng, 1.6), _vary_length(rng, 0.75)
    water = Material(_vary_colour(rng, (0.25, 0.72, 0.85)), (0.45, 0.85, 0.95), Pattern.PLASTER, 0.15)
    parts = [
        Part(
            "bathtub", (0.0, width), (0.0, 0.56), (0.0, depth), Material(WHITE, (0.8, 0.84, 0.86), Pattern.BANDS, 0.28)
        ),
        Part("bathtub", (0.09, width - 0.09), (0.56, 0.565), (0.09, depth - 0.09), water),
        Part("bathtub", (0.1, 0.16), (0.56, 0.78), (depth / 2 - 0.05, depth / 2 + 0.05), Material(STEEL)),
    ]
    return _make_item(parts)


def cabinet(rng: np.random.Generator) -> Item:
    """A green cupboard with drawers."""
    width, height = _vary_length(rng, 0.75), _vary_length(rng, 1.15)
    material = Material(_vary_colour(rng, (0.4, 0.62, 0.42)), (0.2, 0.36, 0.22), Pattern.PANELS, 0.37)
    return _make_item([Part("cabinet", (0.0, width), (0.0, height), (0.0, 0.4), material)])


def waste_bin(rng: np.random.Generator) -> Item:
    """A dotted waste bin."""
    material = Material(_vary_colour(rng, (0.25, 0.25, 0.3)), (0.95, 0.85, 0.2), Pattern.DOTS, 0.11)
    parts = [
        Part("bin", (0.0, 0.33), (0.0, 0.5), (0.04, 0.37), material),
        Part("bin", (0.02, 0.31), (0.5, 0.53), (0.06, 0.35), Material(BLACK)),
    ]
    return _make_item(parts)


def plant(rng: np.random.Generator) -> Item:
    """Green leaves in a terracotta pot."""
    height = _vary_length(rng, 1.25)
    pot = Material(_vary_colour(rng, (0.75, 0.36, 0.2)), (0.6, 0.27, 0.14), Pattern.BANDS, 0.1)
    leaves = Material(_vary_colour(rng, (0.1, 0.4, 0.12)), _vary_colour(rng, (0.4, 0.72, 0.25)), Pattern.LEAVES, 0.06)
    parts = [
        Part("plant", (0.1, 0.4), (0.0, 0.34), (0.1, 0.4), pot),
        Part("plant", (0.0, 0.5), (0.42, 0.75 * height), (0.0, 0.5), leaves),
        Part("plant", (0.1, 0.4), (0.75 * height, height), (0.1, 0.4), leaves),
        Part("plant", (0.22, 0.28), (0.34, 0.42), (0.22, 0.28), Material(DARK_WOOD)),
    ]
    return _make_item(parts)


def rug(rng: np.random.Generator) -> Item:
    """A red rug with cream diamonds; it is not an obstacle."""
    width, depth = _vary_length(rng, 1.9), _vary_length(rng, 1.4)
    material = Material(
        _vary_colour(rng, (0.62, 0.12, 0.2)), _vary_colour(rng, (0.93, 0.85, 0.65)), Pattern.DIAMONDS, 0.31
    )
    return _make_item([Part("rug", (0.0, width), (0.0, 0.012), (0.0, depth), material)])


def bath_mat(rng: np.random.Generator) -> Item:
    """A small rug."""
    width, depth = _vary_length(rng, 1.0), _vary_length(rng, 0.8)
    material = Material(
        _vary_colour(rng, (0.62, 0.12, 0.2)), _vary_colour(rng, (0.93, 0.85, 0.65)), Pattern.DIAMONDS, 0.25
    )
    return _make_item([Part("rug", (0.0, width), (0.0, 0.012), (0.0, depth), material)])


def _table_lamp(rng: np.random.Generator, u: float, y: float, d: float) -> list[Part]:
    shade = Material(_vary_colour(rng, (1.0, 0.86, 0.45), 0.03), emission=0.85)
    parts = [
        Part("lamp", (-0.04, 0.04), (0.0, 0.26), (-0.04, 0.04), Material(BLACK)),
        Part("lamp", (-0.14, 0.14), (0.22, 0.48), (-0.14, 0.14), shade),
    ]
    return _shift(parts, u, y, d)


def floor_lamp(rng: np.random.Generator) -> Item:
    """A bright yellow shade on a black pole."""
    shade = Material(_vary_colour(rng, (1.0, 0.86, 0.45), 0.03), emission=0.85)
    parts = [
        Part("lamp", (0.06, 0.4), (0.0, 0.04), (0.06, 0.4), Material(BLACK)),
        Part("lamp", (0.21, 0.25), (0.04, 1.3), (0.21, 0.25), Material(BLACK)),
        Part("lamp", (0.02, 0.44), (1.25, 1.65), (0.02, 0.44), shade),
    ]
    return _make_item(parts)


def _bed(rng: np.random.Generator, width: float) -> Item:
    length = _vary_length(rng, 2.0)
    blanket = Material(_vary_colour(rng, (0.2, 0.3, 0.7)), _vary_colour(rng, (0.75, 0.82, 0.95)), Pattern.CHECKER, 0.23)
    frame = Material(_vary_colour(rng, DARK_WOOD), (0.26, 0.15, 0.09), Pattern.PLANKS, 0.15)
    parts = [
        Part("bed", (0.0, width), (0.0, 1.0), (0.0, 0.08), frame),
        Part("bed", (0.0, width), (0.0, 0.3), (0.08, length), frame),
        Part("bed", (0.02, width - 0.02), (0.3, 0.52), (0.55, length - 0.02), blanket),
        Part("bed", (0.04, width - 0.04), (0.3, 0.46), (0.08, 0.55), Material(WHITE)),
        Part("bed", (0.12, width / 2 - 0.05), (0.46, 0.58), (0.1, 0.48), Material((0.98, 0.97, 0.9))),
        Part("bed", (width / 2 + 0.05, width - 0.12), (0.46, 0.58), (0.1, 0.48), Material((0.98, 0.97, 0.9))),
    ]
    stand = Material(_vary_colour(rng, (0.85, 0.62, 0.72)), (0.55, 0.32, 0.42), Pattern.PANELS, 0.4)
    parts.append(Part("nightstand", (width + 0.06, width + 0.5), (0.0, 0.52), (0.0, 0.4), stand))
    return _make_item(parts + _table_lamp(rng, width + 0.28, 0.52, 0.2))


def double_bed(rng: np.random.Generator) -> Item:
    """A bed with a blue chequered blanket, a nightstand and a lamp beside it."""
    return _bed(rng, _vary_length(rng, 1.5))


def single_bed(rng: np.random.Generator) -> Item:
    """A narrow bed, as `double_bed`."""
    return _bed(rng, _vary_length(rng, 0.95))


def wardrobe(rng: np.random.Generator) -> Item:
    """A tall dark wardrobe with light outlines."""
    width = _vary_length(rng, 1.4)
    material = Material(_vary_colour(rng, (0.42, 0.24, 0.16)), (0.85, 0.65, 0.4), Pattern.PANELS, 0.42)
    return _make_item([Part("wardrobe", (0.0, width), (0.0, _vary_length(rng, 2.0)), (0.0, 0.58), material)])


def bookcase(rng: np.random.Generator) -> Item:
    """Shelves full of coloured books."""
    width = _vary_length(rng, 1.1)
    material = Material(OAK, _vary_colour(rng, OAK), Pattern.BOOKS, 0.36)
    return _make_item([Part("bookcase", (0.0, width), (0.0, _vary_length(rng, 1.85)), (0.0, 0.34), material)])


def _legs(category: str, width: float, depth: float, top: float, material: Material) -> list[Part]:
    """Two side panels under a table top or a seat."""
    return [Part(category, (u, u + 0.05), (0.0, top), (0.05, depth - 0.05), material) for u in (0.04, width - 0.09)]


def _chair(rng: np.random.Generator, back_away: bool) -> list[Part]:
    """A red chair, 0.42 m square, with its back away from the wall or towards it."""
    red = Material(_vary_colour(rng, (0.85, 0.15, 0.12)), (0.6, 0.08, 0.08), Pattern.STRIPES, 0.07)
    back = (0.38, 0.42) if back_away else (0.0, 0.04)
    return [
        Part("chair", (0.0, 0.42), (0.42, 0.48), (0.0, 0.42), red),
        Part("chair", (0.0, 0.42), (0.48, 0.95), back, red),
        *_legs("chair", 0.42, 0.42, 0.42, Material(DARK_WOOD)),
    ]


def desk(rng: np.random.Generator) -> Item:
    """A light desk with a drawer block, a chair in front and a lamp on top."""
    width, depth = _vary_length(rng, 1.25), 0.6
    wood = Material(_vary_colour(rng, (0.93, 0.82, 0.5)), (0.75, 0.62, 0.3), Pattern.PLANKS, 0.2)
    drawers = Material(_vary_colour(rng, (0.9, 0.78, 0.45)), (0.5, 0.38, 0.15), Pattern.PANES, 0.25)
    parts = [
        Part("desk", (0.0, width), (0.7, 0.76), (0.0, depth), wood),
        Part("desk", (0.03, 0.45), (0.0, 0.7), (0.03, depth - 0.04), drawers),
        Part("desk", (width - 0.08, width - 0.03), (0.0, 0.7), (0.05, depth - 0.05), wood),
        *_shift(_chair(rng, back_away=True), u=0.55 * width, d=depth - 0.15),
        *_table_lamp(rng, 0.2, 0.76, 0.2),
    ]
    return _make_item(parts)


def sofa(rng: np.random.Generator) -> Item:
    """A teal sofa with yellow cushions, a coffee table in front."""
    width, depth = _vary_length(rng, 2.0), 0.85
    teal = Material(_vary_colour(rng, (0.1, 0.5, 0.5)), (0.06, 0.38, 0.4), Pattern.STRIPES, 0.5)
    cushion = Material(_vary_colour(rng, (0.95, 0.75, 0.2)))
    parts = [
        Part("sofa", (0.0, width), (0.08, 0.42), (0.0, depth), teal),
        Part("sofa", (0.0, width), (0.42, 0.85), (0.0, 0.22), teal),
        Part("sofa", (0.0, 0.2), (0.42, 0.62), (0.22, depth), teal),
        Part("sofa", (width - 0.2, width), (0.42, 0.62), (0.22, depth), teal),
        Part("sofa", (0.24, 0.62), (0.42, 0.76), (0.22, 0.36), cushion),
        Part("sofa", (width - 0.62, width - 0.24), (0.42, 0.76), (0.22, 0.36), cushion),
    ]
    table_width, away = _vary_length(rng, 1.0), depth + 0.7
    top = Material(_vary_colour(rng, (0.92, 0.92, 0.86)), (0.2, 0.22, 0.25), Pattern.FRAME, 0.07)
    low = [
        Part("coffee_table", (0.0, table_width), (0.34, 0.4), (0.0, 0.6), top),
        *_legs("coffee_table", table_width, 0.6, 0.34, Material(BLACK)),
    ]
    return _make_item(parts + _shift(low, u=(width - table_width) / 2, d=away))


def armchair(rng: np.random.Generator) -> Item:
    """A purple dotted armchair."""
    width, depth = _vary_length(rng, 0.85), 0.8
    cloth = Material(_vary_colour(rng, (0.5, 0.28, 0.62)), (0.8, 0.68, 0.88), Pattern.DOTS, 0.13)
    parts = [
        Part("armchair", (0.0, width), (0.06, 0.44), (0.0, depth), cloth),
        Part("armchair", (0.0, width), (0.44, 0.95), (0.0, 0.2), cloth),
        Part("armchair", (0.0, 0.16), (0.44, 0.62), (0.2, depth), cloth),
        Part("armchair", (width - 0.16, width), (0.44, 0.62), (0.2, depth), cloth),
    ]
    return _make_item(parts)


def tv(rng: np.random.Generator) -> Item:
    """A wide black screen with a bright edge on a low white board."""
    width = _vary_length(rng, 1.5)
    screen = Material(_vary_colour(rng, (0.05, 0.06, 0.1), 0.02), (0.35, 0.36, 0.4), Pattern.FRAME, 0.02, emission=0.5)
    board = Material(_vary_colour(rng, (0.88, 0.86, 0.84)), (0.4, 0.4, 0.42), Pattern.PANES, 0.5)
    parts = [
        Part("tv", (0.0, width), (0.05, 0.5), (0.0, 0.42), board),
        Part("tv", (0.12, width - 0.12), (0.6, 1.32), (0.18, 0.24), screen),
        Part("tv", (width / 2 - 0.1, width / 2 + 0.1), (0.5, 0.6), (0.15, 0.27), Material(BLACK)),
    ]
    return _make_item(parts)


def dining_set(rng: np.random.Generator) -> Item:
    """A dining table with four chairs, which stands away from the walls."""
    width, depth = _vary_length(rng, 1.5), _vary_length(rng, 0.9)
    top = Material(_vary_colour(rng, (0.5, 0.3, 0.16)), (0.34, 0.19, 0.1), Pattern.PLANKS, 0.18)
    table = [
        Part("dining_table", (0.0, width), (0.7, 0.77), (0.0, depth), top),
        Part("dining_table", (0.2, 0.3), (0.0, 0.7), (0.15, depth - 0.15), top),
        Part("dining_table", (width - 0.3, width - 0.2), (0.0, 0.7), (0.15, depth - 0.15), top),
    ]
    chairs = []
    for u in (0.22 * width - 0.21 + 0.05, 0.78 * width - 0.21 - 0.05):
        chairs += _shift(_chair(rng, back_away=False), u=u, d=0.0)
        chairs += _shift(_chair(rng, back_away=True), u=u, d=depth + 0.5 - 0.02)
    return _make_item(_shift(table, d=0.25 + 0.21) + chairs)
