"""Patterns on the faces of boxes: share of the second colour, and brightness.

All patterns are evaluated at all pixels, and each pixel selects its pattern.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float32, Int32, UInt32

from relm_irl_jax.scenes.rooms.boxes import Pattern

Image = Float32[Array, "height width"]
Integers = Int32[Array, "height width"]
Mask = Bool[Array, "height width"]
Hash = UInt32[Array, "height width"]

LAST_PERIODIC = Pattern.LEAVES
"""The last of the patterns that repeat."""


class PatternValues(NamedTuple):
    """A pattern at each pixel.

    Attributes:
        share: share of the second colour, in [0, 1].
        brightness: factor on the brightness.
    """

    share: Image
    brightness: Image


def periodic_patterns(pattern: Integers, u: Image, v: Image, box: Integers) -> PatternValues:
    """Evaluate the patterns that repeat, up to `LAST_PERIODIC`.

    Args:
        pattern: number of each pixel's pattern.
        u: coordinate along the face, in multiples of the pattern's scale.
        v: coordinate up the face, in multiples of the pattern's scale.
        box: number of each pixel's box, which varies the pattern.
    """
    column, fu = _cell(u)
    row, fv = _cell(v)
    tone = 0.9 + 0.2 * _unit(_hash(column, row, box))
    brick_row, brick_v = _cell(2 * v)
    brick_column, brick_u = _cell(u + 0.5 * (brick_row % 2).astype(jnp.float32))
    plank_column, plank_u = _cell(u / 6 + _unit(_hash(row, box)))
    plank_tone = 0.82 + 0.36 * _unit(_hash(plank_column, row, box), 1)
    centre_u, centre_v = fu - 0.5, fv - 0.5
    clouds = _value_noise(u, v, box)
    uneven = 0.88 + 0.24 * clouds  # without it, stripes would look the same everywhere on a wall
    cases = [
        (Pattern.CHECKER, (column + row) % 2, 0.95 + 0.5 * (tone - 0.9)),
        (Pattern.TILES, (jnp.minimum(fu, fv) < 0.06), tone),
        (Pattern.STRIPES, column % 2, uneven * (0.93 + 0.14 * _unit(_hash(column, box)))),
        (Pattern.BANDS, row % 2, uneven * (0.93 + 0.14 * _unit(_hash(row, box)))),
        (
            Pattern.BRICKS,
            (brick_u < 0.05) | (brick_v < 0.1),
            0.85 + 0.3 * _unit(_hash(brick_column, brick_row, box)),
        ),
        (Pattern.DOTS, centre_u**2 + centre_v**2 < 0.08, tone),
        (Pattern.PLASTER, clouds, jnp.ones_like(u)),
        (Pattern.PLANKS, (fv < 0.06) | (plank_u < 0.01), plank_tone),
        (Pattern.DIAMONDS, jnp.abs(centre_u) + jnp.abs(centre_v) < 0.36, tone),
        (Pattern.LEAVES, _unit(_hash(column, row, box), 1), 0.75 + 0.5 * _unit(_hash(column, row, box), 2)),
    ]
    share, brightness = jnp.zeros_like(u), jnp.ones_like(u)
    for kind, kind_share, factor in cases:
        chosen = pattern == kind
        share = jnp.where(chosen, jnp.asarray(kind_share).astype(jnp.float32), share)
        brightness = jnp.where(chosen, factor, brightness)
    return PatternValues(share, brightness)


def face_patterns(pattern: Integers, u: Image, v: Image, width: Image, height: Image, scale: Image) -> PatternValues:
    """Evaluate the patterns that are fitted to a face; all lengths in metres.

    Args:
        pattern: number of each pixel's pattern.
        u: coordinate along the face.
        v: coordinate up the face.
        width: of the face.
        height: of the face.
        scale: length of the pattern.
    """
    edge = edge_distance(u, v, width, height)
    across, up = jnp.maximum(jnp.round(width / scale), 1), jnp.maximum(jnp.round(height / scale), 1)
    pane = edge_distance(
        (u * across / width) % 1 * (width / across), (v * up / height) % 1 * (height / up), width / across, height / up
    )
    tall = jnp.maximum(jnp.round(height / (2 * scale)), 1)
    panel = edge_distance(
        (u * across / width) % 1 * (width / across),
        (v * tall / height) % 1 * (height / tall),
        width / across,
        height / tall,
    )
    hill = v / height < 0.4 + 0.13 * jnp.sin(5.0 * u / width + 1.0)
    gloss = 1.0 + 0.22 * (((u + v) * 2.2) % 1 < 0.35).astype(jnp.float32)
    cases = [
        (Pattern.FRAME, edge < scale, jnp.ones_like(u)),
        (Pattern.PANES, (pane < 0.025) | (edge < 0.05), 0.85 + 0.25 * v / height),
        (Pattern.PANELS, ((panel > 0.04) & (panel < 0.06)) | (panel < 0.008), jnp.ones_like(u)),
        (Pattern.PAINTING, hill, jnp.where(edge < 0.05, 0.25, 1.0)),
        (Pattern.MIRROR, edge < scale, jnp.where(edge < scale, 1.0, gloss)),
    ]
    share, brightness = jnp.zeros_like(u), jnp.ones_like(u)
    for kind, kind_share, factor in cases:
        chosen = pattern == kind
        share = jnp.where(chosen, kind_share.astype(jnp.float32), share)
        brightness = jnp.where(chosen, factor, brightness)
    return PatternValues(share, brightness)


def book_shelves(u: Image, v: Image, height: Image, scale: Image, box: Integers) -> tuple[Mask, list[Image]]:
    """Evaluate the pattern `BOOKS`, which has its own colours; all lengths in metres.

    Args:
        u: coordinate along the face.
        v: coordinate up the face.
        height: of the face.
        scale: height of a shelf, approximately.
        box: number of each pixel's box, which varies the books.

    Returns:
        Mask of the shelf boards, and red, green and blue of the books.
    """
    shelves = jnp.maximum(jnp.round(height / scale), 1)
    shelf, up = _cell(v * shelves / height)
    bits = _hash(_cell(u / 0.06)[0], shelf, box)
    gap = up > 0.62 + 0.3 * _unit(bits, 3)
    board = up * height / shelves < 0.035
    colours = [jnp.where(gap, 0.12, 0.2 + 0.7 * _unit(bits, byte)) for byte in range(3)]
    return board, colours


def edge_distance(u: Image, v: Image, width: Image, height: Image) -> Image:
    """Distance to the nearest edge of a rectangle.

    Args:
        u: coordinate along the width.
        v: coordinate along the height.
        width: of the rectangle.
        height: of the rectangle.
    """
    return jnp.minimum(jnp.minimum(u, width - u), jnp.minimum(v, height - v))


def _value_noise(u: Image, v: Image, box: Integers) -> Image:
    """Smooth noise in [0, 1] between one random value per corner of the unit grid."""
    column, fu = _cell(u)
    row, fv = _cell(v)
    fu, fv = fu * fu * (3 - 2 * fu), fv * fv * (3 - 2 * fv)
    low = _unit(_hash(column, row, box)) * (1 - fu) + _unit(_hash(column + 1, row, box)) * fu
    high = _unit(_hash(column, row + 1, box)) * (1 - fu) + _unit(_hash(column + 1, row + 1, box)) * fu
    return low * (1 - fv) + high * fv


def _hash(*keys: Integers) -> Hash:
    """Mix integers into 32 pseudo-random bits."""
    bits = jnp.zeros((), jnp.uint32)
    for key in keys:
        bits = (bits ^ key.astype(jnp.uint32)) * jnp.uint32(0x9E3779B1)
        bits = (bits ^ (bits >> 15)) * jnp.uint32(0x85EBCA77)
        bits = bits ^ (bits >> 13)
    return bits


def _unit(bits: Hash, byte: int = 0) -> Image:
    """One byte of a hash as a number in [0, 1]."""
    return ((bits >> (8 * byte)) & 0xFF).astype(jnp.int32).astype(jnp.float32) / 255.0


def _cell(position: Image) -> tuple[Integers, Image]:
    """Number of the cell and the position within it, in [0, 1)."""
    number = jnp.floor(position)
    return number.astype(jnp.int32), position - number
