"""A ray caster over axis-aligned boxes.

The camera is a level pinhole camera with a field of view of 90 degrees. Since it is level and the boxes are aligned
with the axes, the intersections of a ray with a box's slabs in x and z depend only on the image column, and those in y
only on the row. All divisions are therefore done once per column or row, and each pixel stores the nearest hit so far:

    enter = max(near_xz[column], near_y[row])     exit = min(far_xz[column], far_y[row])

A ray hits a box if enter < exit. Depth is measured along the optical axis. No array is larger than an image, or than
the number of boxes times the rows or columns of an image.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int32

from relm_irl_jax.scenes.rooms.boxes import Box

EYE_HEIGHT = 1.2
"""Height of the camera in metres, above tables and beds and level with wall objects."""

MAX_BOXES = 96
"""Boxes in `BoxArrays`. It is fixed, so that the ray caster compiles once for all rooms; unused boxes take no time."""

_UNROLL = 8
"""Boxes handled in each pass over the image, during which the nearest hit stays in registers."""

_BOX_KEYS = 128
"""The nearest hit so far is one integer for each pixel. The bits of positive depths have the same order as the depths;
the last seven bits are replaced by the number of the box. This causes a relative error of 2e-5 in the comparison, but
none in the result."""

_NO_HIT = 0x7FFFFFFF
"""Nearest hit before the first box, larger than that of every depth."""


class BoxArrays(NamedTuple):
    """Boxes as arrays, padded to `MAX_BOXES`.

    Attributes:
        lower: corner with the smallest coordinates (x, y, z), in metres.
        upper: corner with the largest coordinates, in metres.
        colour: first colour, RGB in [0, 1].
        second_colour: second colour, RGB in [0, 1].
        pattern: number of the pattern, one of `Pattern`.
        scale: length of the pattern in metres.
        emission: share of the colour that does not depend on the light, in [0, 1].
        category: index into the category list, or `NO_CATEGORY`.
        count: boxes in use.
        light: position of the lamp, in metres.
    """

    lower: Float32[Array, "box 3"]
    upper: Float32[Array, "box 3"]
    colour: Float32[Array, "box 3"]
    second_colour: Float32[Array, "box 3"]
    pattern: Int32[Array, "box"]
    scale: Float32[Array, "box"]
    emission: Float32[Array, "box"]
    category: Int32[Array, "box"]
    count: Int32[Array, ""]
    light: Float32[Array, "3"]


class RayHits(NamedTuple):
    """The first hit of each pixel's ray.

    Attributes:
        depth: distance along the optical axis in metres, infinite if no box is hit.
        box: index of the box, -1 if no box is hit.
        axis: axis of the normal of the visible face: 0 for x, 1 for y, 2 for z.
    """

    depth: Float32[Array, "height width"]
    box: Int32[Array, "height width"]
    axis: Int32[Array, "height width"]


def pack_boxes(boxes: Sequence[Box], light: tuple[float, float, float]) -> BoxArrays:
    """Pack boxes into arrays.

    Args:
        boxes: at most `MAX_BOXES` boxes.
        light: position of the lamp, in metres.

    Returns:
        The padded arrays.
    """
    if len(boxes) > MAX_BOXES:
        raise ValueError(f"A room can have at most {MAX_BOXES} boxes; this one has {len(boxes)}.")

    def column(values: Sequence, *width: int, dtype: type = np.float32) -> Array:
        array = np.zeros((MAX_BOXES, *width), dtype)
        array[: len(values)] = np.reshape(values, (len(values), *width))
        return jnp.asarray(array)

    return BoxArrays(
        lower=column([box.lower for box in boxes], 3),
        upper=column([box.upper for box in boxes], 3),
        colour=column([box.material.colour for box in boxes], 3),
        second_colour=column([box.material.second_colour for box in boxes], 3),
        pattern=column([box.material.pattern for box in boxes], dtype=np.int32),
        scale=column([box.material.scale for box in boxes]),
        emission=column([box.material.emission for box in boxes]),
        category=column([box.category for box in boxes], dtype=np.int32),
        count=jnp.asarray(len(boxes), jnp.int32),
        light=jnp.asarray(light, jnp.float32),
    )


def ray_directions(
    rotation: Float[Array, ""], size: int
) -> tuple[Float[Array, "width"], Float[Array, "height"], Float[Array, "width"]]:
    """Direction of the rays of one view, with length 1 along the optical axis.

    Args:
        rotation: heading in degrees.
        size: rows and columns of the image.

    Returns:
        x by column, y by row, z by column.
    """
    angle = jnp.round(rotation / 90.0) * (jnp.pi / 2)
    sine, cosine = jnp.round(jnp.sin(angle)), jnp.round(jnp.cos(angle))
    offset = (2 * jnp.arange(size, dtype=jnp.float32) + 1) / size - 1
    offset = jnp.where(offset == 0, 1e-6, offset)  # the centre of an odd image would lead to divisions by zero
    return sine + offset * cosine, -offset, cosine - offset * sine


def _slab(
    lower: Float[Array, "box"], upper: Float[Array, "box"], origin: Float[Array, ""], ray: Float[Array, "pixel"]
) -> tuple[Float[Array, "box pixel"], Float[Array, "box pixel"]]:
    """Depths at which each ray enters and leaves each box along one axis."""
    first = (lower[:, None] - origin) / ray
    second = (upper[:, None] - origin) / ray
    return jnp.minimum(first, second), jnp.maximum(first, second)


def cast_rays(boxes: BoxArrays, location: Float32[Array, "2"], rotation: Float32[Array, ""], size: int) -> RayHits:
    """Nearest box along each ray of one view.

    Args:
        boxes: the room; the camera must not be inside a box.
        location: place (x, z) of the camera in metres.
        rotation: heading in degrees.
        size: rows and columns of the image.

    Returns:
        Depth and box of each pixel.
    """
    ray_x, ray_y, ray_z = ray_directions(rotation, size)
    near_x, far_x = _slab(boxes.lower[:, 0], boxes.upper[:, 0], location[0], ray_x)
    near_y, far_y = _slab(boxes.lower[:, 1], boxes.upper[:, 1], jnp.float32(EYE_HEIGHT), ray_y)
    near_z, far_z = _slab(boxes.lower[:, 2], boxes.upper[:, 2], location[1], ray_z)
    used = (jnp.arange(MAX_BOXES) < boxes.count)[:, None]
    far = jnp.minimum(far_x, far_z)
    near = jnp.where(used & (far > 0), jnp.maximum(jnp.maximum(near_x, near_z), 0), jnp.inf)
    near_y = jnp.where(far_y > 0, near_y, jnp.inf)

    def visit(chunk: Int32[Array, ""], nearest: Int32[Array, "height width"]) -> Int32[Array, "height width"]:
        for step in range(_UNROLL):
            box = chunk * _UNROLL + step
            enter = jnp.maximum(near[box][None, :], near_y[box][:, None])
            leave = jnp.minimum(far[box][None, :], far_y[box][:, None])
            key = (jax.lax.bitcast_convert_type(enter, jnp.int32) & -_BOX_KEYS) | box
            nearest = jnp.minimum(nearest, jnp.where(enter < leave, key, _NO_HIT))
        return nearest

    no_hits = jnp.full((size, size), _NO_HIT, jnp.int32)
    nearest = jax.lax.fori_loop(0, (boxes.count + _UNROLL - 1) // _UNROLL, visit, no_hits)

    box = jnp.where(nearest == _NO_HIT, -1, nearest & (_BOX_KEYS - 1))
    first = jnp.maximum(box, 0)
    origin = (location[0], jnp.float32(EYE_HEIGHT), location[1])
    enter_x, enter_y, enter_z = (
        (jnp.where(ray > 0, boxes.lower[:, axis][first], boxes.upper[:, axis][first]) - origin[axis]) / ray
        for axis, ray in enumerate((ray_x[None, :], ray_y[:, None], ray_z[None, :]))
    )
    depth = jnp.maximum(jnp.maximum(enter_x, enter_y), enter_z)
    axis = jnp.where(enter_x >= depth, 0, jnp.where(enter_y >= depth, 1, 2))
    return RayHits(jnp.where(box < 0, jnp.inf, depth), box, axis)
