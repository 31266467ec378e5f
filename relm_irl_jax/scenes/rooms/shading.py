"""Colours of a view, from the material of each pixel's box and one lamp."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, UInt32

from relm_irl_jax.scenes.rooms.boxes import Pattern
from relm_irl_jax.scenes.rooms.patterns import (
    LAST_PERIODIC,
    Image,
    book_shelves,
    edge_distance,
    face_patterns,
    periodic_patterns,
)
from relm_irl_jax.scenes.rooms.ray_casting import EYE_HEIGHT, BoxArrays, RayHits, ray_directions

_MEAN_SHARE = np.zeros(len(Pattern), np.float32)
"""Mean share of the second colour of each periodic pattern, used where a period is smaller than a pixel."""
_MEAN_SHARE[[Pattern.CHECKER, Pattern.STRIPES, Pattern.BANDS, Pattern.PLASTER, Pattern.LEAVES]] = 0.5
_MEAN_SHARE[[Pattern.TILES, Pattern.BRICKS, Pattern.PLANKS]] = 0.1
_MEAN_SHARE[[Pattern.DOTS, Pattern.DIAMONDS]] = 0.25


class Surface(NamedTuple):
    """The visible face of each pixel, and the point on it; lengths in metres.

    Attributes:
        u: distance from the face's lower corner along the wall, or along x on level faces.
        v: distance from the face's lower corner upwards, or along z on level faces.
        width: extent of the face along u.
        height: extent of the face along v.
        footprint: length of a pixel on the face.
        light: brightness of a surface without emission.
    """

    u: Image
    v: Image
    width: Image
    height: Image
    footprint: Image
    light: Image


def shade(
    boxes: BoxArrays, hits: RayHits, location: Float32[Array, "2"], rotation: Float32[Array, ""], size: int
) -> UInt32[Array, "height width"]:
    """Colour of each pixel from the box that it hits; black if it hits none.

    The channels are packed into one integer for each pixel. With interleaved channels, XLA's CPU backend would do all
    arithmetic once per channel and without vector instructions, which is eight times as slow.

    Args:
        boxes: the room.
        hits: the first hit of each pixel.
        location: place (x, z) of the camera in metres.
        rotation: heading in degrees.
        size: rows and columns of the image.

    Returns:
        Red in the lowest byte, then green, then blue.
    """
    box = jnp.maximum(hits.box, 0)
    u, v, width, height, footprint, light = _surface(boxes, hits, location, rotation, size)
    pattern, emission = boxes.pattern[box], boxes.emission[box]
    scale = jnp.maximum(boxes.scale, 1e-3)[box]
    mean = jnp.asarray(_MEAN_SHARE)[boxes.pattern][box]
    light = light * (1 - emission) + emission
    # Edges are slightly darker.
    light = light * jnp.where(edge_distance(u, v, width, height) < 0.012 + 0.6 * footprint, 0.8, 1.0)
    light = jnp.where(hits.box < 0, 0.0, light)

    repeating = periodic_patterns(pattern, u / scale, v / scale, box)
    fitted = face_patterns(pattern, u, v, width, height, scale)
    periodic = pattern <= LAST_PERIODIC
    sharp = jnp.clip(1.6 - 2 * footprint / scale, 0, 1)
    share = jnp.where(periodic, mean + sharp * (repeating.share - mean), fitted.share)
    brightness = jnp.where(periodic, 1 + sharp * (repeating.brightness - 1), fitted.brightness)

    board, spines = book_shelves(u, v, height, scale, box)
    books = pattern == Pattern.BOOKS
    board = books & (board | (hits.axis == 1))
    spine = books & ~board
    share = jnp.where(board, 1.0, share)
    sun = (pattern == Pattern.PAINTING) & ((u / width - 0.7) ** 2 + (v / height - 0.72) ** 2 < 0.012)

    packed = jnp.zeros((size, size), jnp.uint32)
    for channel, sun_colour in enumerate((1.0, 0.85, 0.3)):
        first, second = boxes.colour[:, channel][box], boxes.second_colour[:, channel][box]
        colour = (first + share * (second - first)) * brightness
        colour = jnp.where(spine, spines[channel], jnp.where(sun, sun_colour, colour))
        value = jnp.clip(255 * colour * light + 0.5, 0, 255).astype(jnp.int32).astype(jnp.uint32)
        packed = packed | (value << (8 * channel))
    return packed


def _surface(
    boxes: BoxArrays, hits: RayHits, location: Float32[Array, "2"], rotation: Float32[Array, ""], size: int
) -> Surface:
    """Visible point and face of each pixel; those of box 0 if it hits none."""
    box = jnp.maximum(hits.box, 0)
    lower = [boxes.lower[:, axis][box] for axis in range(3)]
    upper = [boxes.upper[:, axis][box] for axis in range(3)]
    depth = jnp.where(hits.box < 0, 0.0, hits.depth)
    ray_x, ray_y, ray_z = ray_directions(rotation, size)
    rays = [jnp.broadcast_to(ray, (size, size)) for ray in (ray_x[None, :], ray_y[:, None], ray_z[None, :])]
    eye = (location[0], jnp.float32(EYE_HEIGHT), location[1])
    point = [origin + depth * ray for origin, ray in zip(eye, rays, strict=True)]
    on_x, on_y = hits.axis == 0, hits.axis == 1

    normal_ray = jnp.abs(jnp.where(on_x, rays[0], jnp.where(on_y, rays[1], rays[2])))
    length = jnp.sqrt(rays[0] ** 2 + rays[1] ** 2 + rays[2] ** 2)
    # Light decreases with the distance from the lamp. It depends on the face's axis, so that edges are visible.
    facing = jnp.where(on_x, 0.86, jnp.where(on_y, jnp.where(rays[1] < 0, 1.0, 0.9), 0.95))
    square = sum((p - boxes.light[axis]) ** 2 for axis, p in enumerate(point))
    return Surface(
        u=jnp.where(on_x, point[2] - lower[2], point[0] - lower[0]),
        v=jnp.where(on_y, point[2] - lower[2], point[1] - lower[1]),
        width=jnp.where(on_x, upper[2] - lower[2], upper[0] - lower[0]),
        height=jnp.where(on_y, upper[2] - lower[2], upper[1] - lower[1]),
        footprint=depth * (2.0 / size) * length / jnp.maximum(normal_ray, 1e-3),
        light=facing * (0.66 + 0.5 / (1 + 0.09 * square)),
    )
