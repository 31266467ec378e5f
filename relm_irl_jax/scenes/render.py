"""Views of a room: a ray caster over axis-aligned boxes.

The camera is a pinhole, level, with a field of view of 90 degrees. Because it is level and the boxes are aligned
with the axes, where a ray crosses a box's slabs in x and z depends on the image column alone, and in y on the row
alone. So all divisions are done once per column and row, and each pixel keeps only the nearest hit so far:

    enter = max(near_xz[column], near_y[row])     exit = min(far_xz[column], far_y[row])

A box is hit where enter < exit. Depth is measured along the optical axis. Colours are computed once, from the box
that won. No array is larger than a batch of images.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int, UInt8, UInt32

from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.boxes import Box, Pattern

EYE_HEIGHT = 1.2
"""Height of the camera in metres: it sees onto tables and beds, and wall objects hang around its horizon."""

MAX_BOXES = 96
"""Boxes in a table. Fixed, so that the ray caster compiles once for all rooms; only the boxes in use cost time."""

BATCH = 16
"""Views per call of the compiled ray caster."""

_UNROLL = 8
"""Boxes handled per pass over the image; the running depth stays in registers meanwhile."""

_BOX_KEYS = 128
"""The running nearest hit is one integer a pixel: a positive depth's bits order like the depth itself, and their last
seven give way to the number of the box. That costs a relative error of 2e-5 in the comparison, none in the result."""

_NOTHING = 0x7FFFFFFF
"""Nearest hit before the first box: beyond every depth."""

_LAST_PERIODIC = Pattern.LEAVES
"""Patterns up to this one repeat, so they blur into their mean where a period is smaller than a pixel."""

_MEAN_SECOND = np.zeros(len(Pattern), np.float32)
_MEAN_SECOND[[Pattern.CHECKER, Pattern.STRIPES, Pattern.BANDS, Pattern.PLASTER, Pattern.LEAVES]] = 0.5
_MEAN_SECOND[[Pattern.TILES, Pattern.BRICKS, Pattern.PLANKS]] = 0.1
_MEAN_SECOND[[Pattern.DOTS, Pattern.DIAMONDS]] = 0.25


class BoxTable(NamedTuple):
    """Boxes as arrays, padded to `MAX_BOXES`.

    Attributes:
        lower: corner with the least coordinates.
        upper: corner with the greatest coordinates.
        colour: first colour.
        second: second colour.
        pattern: index of the pattern.
        scale: length of the pattern in metres.
        glow: share of the colour that does not depend on the light.
        category: index into the category list, or `NO_CATEGORY`.
        count: boxes in use.
        light: position of the lamp that lights the room.
    """

    lower: Float[Array, "box 3"]
    upper: Float[Array, "box 3"]
    colour: Float[Array, "box 3"]
    second: Float[Array, "box 3"]
    pattern: Int[Array, "box"]
    scale: Float[Array, "box"]
    glow: Float[Array, "box"]
    category: Int[Array, "box"]
    count: Int[Array, ""]
    light: Float[Array, "3"]


class Hit(NamedTuple):
    """What each pixel sees.

    Attributes:
        depth: distance along the optical axis in metres, infinite where nothing is hit.
        box: index of the box, -1 where nothing is hit.
        axis: axis of the normal of the face that is seen.
    """

    depth: Float[Array, "height width"]
    box: Int[Array, "height width"]
    axis: Int[Array, "height width"]


def box_table(boxes: Sequence[Box], light: tuple[float, float, float]) -> BoxTable:
    """Pack boxes into arrays.

    Args:
        boxes: at most `MAX_BOXES` boxes.
        light: position of the lamp.

    Returns:
        The padded table.
    """
    if len(boxes) > MAX_BOXES:
        raise ValueError(f"A room can have at most {MAX_BOXES} boxes; this one has {len(boxes)}.")

    def column(values: Sequence, *width: int, dtype: type = np.float32) -> Array:
        array = np.zeros((MAX_BOXES, *width), dtype)
        array[: len(values)] = np.reshape(values, (len(values), *width))
        return jnp.asarray(array)

    return BoxTable(
        lower=column([box.lower for box in boxes], 3),
        upper=column([box.upper for box in boxes], 3),
        colour=column([box.look.colour for box in boxes], 3),
        second=column([box.look.second for box in boxes], 3),
        pattern=column([box.look.pattern for box in boxes], dtype=np.int32),
        scale=column([box.look.scale for box in boxes]),
        glow=column([box.look.glow for box in boxes]),
        category=column([box.category for box in boxes], dtype=np.int32),
        count=jnp.asarray(len(boxes), jnp.int32),
        light=jnp.asarray(light, jnp.float32),
    )


def _rays(
    rotation: Float[Array, ""], size: int
) -> tuple[Float[Array, "width"], Float[Array, "height"], Float[Array, "width"]]:
    """Direction of the rays: x and z by column, y by row, with length 1 along the optical axis."""
    angle = jnp.round(rotation / 90.0) * (jnp.pi / 2)
    sine, cosine = jnp.round(jnp.sin(angle)), jnp.round(jnp.cos(angle))
    offset = (2 * jnp.arange(size, dtype=jnp.float32) + 1) / size - 1
    offset = jnp.where(offset == 0, 1e-6, offset)  # the centre of an odd image: slabs need a direction
    return sine + offset * cosine, -offset, cosine - offset * sine


def _slab(
    lower: Float[Array, "box"], upper: Float[Array, "box"], origin: Float[Array, ""], ray: Float[Array, "pixel"]
) -> tuple[Float[Array, "box pixel"], Float[Array, "box pixel"]]:
    """Depths at which each ray enters and leaves each box along one axis."""
    first = (lower[:, None] - origin) / ray
    second = (upper[:, None] - origin) / ray
    return jnp.minimum(first, second), jnp.maximum(first, second)


def cast(table: BoxTable, location: Float32[Array, "2"], rotation: Float32[Array, ""], size: int) -> Hit:
    """Nearest box along each ray of one view.

    Args:
        table: the room; the camera is inside none of its boxes.
        location: place (x, z) of the camera in metres.
        rotation: heading in degrees.
        size: rows and columns of the image.

    Returns:
        Depth and box of each pixel.
    """
    ray_x, ray_y, ray_z = _rays(rotation, size)
    near_x, far_x = _slab(table.lower[:, 0], table.upper[:, 0], location[0], ray_x)
    near_y, far_y = _slab(table.lower[:, 1], table.upper[:, 1], jnp.float32(EYE_HEIGHT), ray_y)
    near_z, far_z = _slab(table.lower[:, 2], table.upper[:, 2], location[1], ray_z)
    used = (jnp.arange(MAX_BOXES) < table.count)[:, None]
    far = jnp.minimum(far_x, far_z)
    near = jnp.where(used & (far > 0), jnp.maximum(jnp.maximum(near_x, near_z), 0), jnp.inf)
    near_y = jnp.where(far_y > 0, near_y, jnp.inf)

    def visit(chunk: Int[Array, ""], nearest: Int[Array, "height width"]) -> Int[Array, "height width"]:
        for step in range(_UNROLL):
            box = chunk * _UNROLL + step
            enter = jnp.maximum(near[box][None, :], near_y[box][:, None])
            leave = jnp.minimum(far[box][None, :], far_y[box][:, None])
            key = (jax.lax.bitcast_convert_type(enter, jnp.int32) & -_BOX_KEYS) | box
            nearest = jnp.minimum(nearest, jnp.where(enter < leave, key, _NOTHING))
        return nearest

    nothing = jnp.full((size, size), _NOTHING, jnp.int32)
    nearest = jax.lax.fori_loop(0, (table.count + _UNROLL - 1) // _UNROLL, visit, nothing)

    box = jnp.where(nearest == _NOTHING, -1, nearest & (_BOX_KEYS - 1))
    first = jnp.maximum(box, 0)
    origin = (location[0], jnp.float32(EYE_HEIGHT), location[1])
    enter_x, enter_y, enter_z = (
        (jnp.where(ray > 0, table.lower[:, axis][first], table.upper[:, axis][first]) - origin[axis]) / ray
        for axis, ray in enumerate((ray_x[None, :], ray_y[:, None], ray_z[None, :]))
    )
    depth = jnp.maximum(jnp.maximum(enter_x, enter_y), enter_z)
    axis = jnp.where(enter_x >= depth, 0, jnp.where(enter_y >= depth, 1, 2))
    return Hit(jnp.where(box < 0, jnp.inf, depth), box, axis)


def _hash(*keys: Int[Array, "*shape"]) -> UInt32[Array, "*shape"]:
    """Mix integers into 32 bits that look random."""
    bits = jnp.zeros((), jnp.uint32)
    for key in keys:
        bits = (bits ^ key.astype(jnp.uint32)) * jnp.uint32(0x9E3779B1)
        bits = (bits ^ (bits >> 15)) * jnp.uint32(0x85EBCA77)
        bits = bits ^ (bits >> 13)
    return bits


def _unit(bits: UInt32[Array, "*shape"], byte: int = 0) -> Float[Array, "*shape"]:
    """One byte of a hash as a number in [0, 1]."""
    return ((bits >> (8 * byte)) & 0xFF).astype(jnp.int32).astype(jnp.float32) / 255.0


def _cell(position: Float[Array, "*shape"]) -> tuple[Int[Array, "*shape"], Float[Array, "*shape"]]:
    """Number of the cell and the position within it, in [0, 1)."""
    number = jnp.floor(position)
    return number.astype(jnp.int32), position - number


def _border(u: Array, v: Array, width: Array, height: Array) -> Array:
    """Distance to the nearest edge of a rectangle."""
    return jnp.minimum(jnp.minimum(u, width - u), jnp.minimum(v, height - v))


class _Paint(NamedTuple):
    """A pattern at each pixel: the share of the second colour, and a factor on the brightness."""

    second: Array
    brightness: Array


def _clouds(u: Array, v: Array, box: Array) -> Array:
    """Smooth noise in [0, 1] with one value per unit square."""
    column, fu = _cell(u)
    row, fv = _cell(v)
    fu, fv = fu * fu * (3 - 2 * fu), fv * fv * (3 - 2 * fv)
    low = _unit(_hash(column, row, box)) * (1 - fu) + _unit(_hash(column + 1, row, box)) * fu
    high = _unit(_hash(column, row + 1, box)) * (1 - fu) + _unit(_hash(column + 1, row + 1, box)) * fu
    return low * (1 - fv) + high * fv


def _periodic(pattern: Array, u: Array, v: Array, box: Array) -> _Paint:
    """The patterns that repeat; u and v in multiples of the pattern's scale."""
    column, fu = _cell(u)
    row, fv = _cell(v)
    tone = 0.9 + 0.2 * _unit(_hash(column, row, box))
    brick_row, brick_v = _cell(2 * v)
    brick_column, brick_u = _cell(u + 0.5 * (brick_row % 2))
    plank_column, plank_u = _cell(u / 6 + _unit(_hash(row, box)))
    plank_tone = 0.82 + 0.36 * _unit(_hash(plank_column, row, box), 1)
    centre_u, centre_v = fu - 0.5, fv - 0.5
    clouds = _clouds(u, v, box)
    uneven = 0.88 + 0.24 * clouds  # stripes alone would look the same all along a wall
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
    second, brightness = jnp.zeros_like(u), jnp.ones_like(u)
    for kind, share, factor in cases:
        chosen = pattern == kind
        second = jnp.where(chosen, jnp.asarray(share).astype(jnp.float32), second)
        brightness = jnp.where(chosen, factor, brightness)
    return _Paint(second, brightness)


def _fitted(pattern: Array, u: Array, v: Array, width: Array, height: Array, scale: Array) -> _Paint:
    """The patterns that fit the face; all lengths in metres."""
    edge = _border(u, v, width, height)
    across, up = jnp.maximum(jnp.round(width / scale), 1), jnp.maximum(jnp.round(height / scale), 1)
    pane = _border(
        (u * across / width) % 1 * (width / across), (v * up / height) % 1 * (height / up), width / across, height / up
    )
    tall = jnp.maximum(jnp.round(height / (2 * scale)), 1)
    panel = _border(
        (u * across / width) % 1 * (width / across),
        (v * tall / height) % 1 * (height / tall),
        width / across,
        height / tall,
    )
    hill = v / height < 0.4 + 0.13 * jnp.sin(5.0 * u / width + 1.0)
    gloss = 1.0 + 0.22 * (((u + v) * 2.2) % 1 < 0.35)
    cases = [
        (Pattern.FRAME, edge < scale, jnp.ones_like(u)),
        (Pattern.PANES, (pane < 0.025) | (edge < 0.05), 0.85 + 0.25 * v / height),
        (Pattern.PANELS, ((panel > 0.04) & (panel < 0.06)) | (panel < 0.008), jnp.ones_like(u)),
        (Pattern.PAINTING, hill, jnp.where(edge < 0.05, 0.25, 1.0)),
        (Pattern.MIRROR, edge < scale, jnp.where(edge < scale, 1.0, gloss)),
    ]
    second, brightness = jnp.zeros_like(u), jnp.ones_like(u)
    for kind, share, factor in cases:
        chosen = pattern == kind
        second = jnp.where(chosen, share.astype(jnp.float32), second)
        brightness = jnp.where(chosen, factor, brightness)
    return _Paint(second, brightness)


def _spines(u: Array, v: Array, height: Array, scale: Array, box: Array) -> tuple[Array, list[Array]]:
    """Book spines: where the boards are, and the three channels of the books' colours."""
    shelves = jnp.maximum(jnp.round(height / scale), 1)
    shelf, up = _cell(v * shelves / height)
    bits = _hash(_cell(u / 0.06)[0], shelf, box)
    gap = up > 0.62 + 0.3 * _unit(bits, 3)
    board = up * height / shelves < 0.035
    colours = [jnp.where(gap, 0.12, 0.2 + 0.7 * _unit(bits, byte)) for byte in range(3)]
    return board, colours


def _shade(table: BoxTable, hit: Hit, location: Array, rotation: Array, size: int) -> UInt32[Array, "height width"]:
    """Colour of each pixel, from the box that it sees: red in the lowest byte, then green, then blue.

    The channels are packed into one integer a pixel, because an interleaved result makes XLA's CPU backend do the
    whole arithmetic once per channel and without vector instructions: eight times as slow.
    """
    box = jnp.maximum(hit.box, 0)
    lower = [table.lower[:, axis][box] for axis in range(3)]
    upper = [table.upper[:, axis][box] for axis in range(3)]
    pattern, glow = table.pattern[box], table.glow[box]
    scale = jnp.maximum(table.scale, 1e-3)[box]
    mean = jnp.asarray(_MEAN_SECOND)[table.pattern][box]

    depth = jnp.where(hit.box < 0, 0.0, hit.depth)
    ray_x, ray_y, ray_z = _rays(rotation, size)
    rays = [jnp.broadcast_to(ray, (size, size)) for ray in (ray_x[None, :], ray_y[:, None], ray_z[None, :])]
    eye = (location[0], jnp.float32(EYE_HEIGHT), location[1])
    point = [origin + depth * ray for origin, ray in zip(eye, rays, strict=True)]
    on_x, on_y = hit.axis == 0, hit.axis == 1
    # Texture coordinates in metres from the face's lower corner: along the wall and up, or x and z on level faces.
    u = jnp.where(on_x, point[2] - lower[2], point[0] - lower[0])
    v = jnp.where(on_y, point[2] - lower[2], point[1] - lower[1])
    width = jnp.where(on_x, upper[2] - lower[2], upper[0] - lower[0])
    height = jnp.where(on_y, upper[2] - lower[2], upper[1] - lower[1])
    normal_ray = jnp.abs(jnp.where(on_x, rays[0], jnp.where(on_y, rays[1], rays[2])))
    length = jnp.sqrt(rays[0] ** 2 + rays[1] ** 2 + rays[2] ** 2)
    footprint = depth * (2.0 / size) * length / jnp.maximum(normal_ray, 1e-3)

    # A lamp, softened; faces of different axes differ, so that edges show, and edges are drawn a little darker.
    facing = jnp.where(on_x, 0.86, jnp.where(on_y, jnp.where(rays[1] < 0, 1.0, 0.9), 0.95))
    square = sum((p - table.light[axis]) ** 2 for axis, p in enumerate(point))
    light = facing * (0.66 + 0.5 / (1 + 0.09 * square)) * (1 - glow) + glow
    light = light * jnp.where(_border(u, v, width, height) < 0.012 + 0.6 * footprint, 0.8, 1.0)

    repeating = _periodic(pattern, u / scale, v / scale, box)
    fitted = _fitted(pattern, u, v, width, height, scale)
    board, spines = _spines(u, v, height, scale, box)
    books = pattern == Pattern.BOOKS
    board = books & (board | on_y)
    spine = books & ~board
    sun = (pattern == Pattern.PAINTING) & ((u / width - 0.7) ** 2 + (v / height - 0.72) ** 2 < 0.012)
    periodic = pattern <= _LAST_PERIODIC
    sharp = jnp.clip(1.6 - 2 * footprint / scale, 0, 1)
    second = jnp.where(periodic, mean + sharp * (repeating.second - mean), fitted.second)
    second = jnp.where(board, 1.0, second)
    brightness = jnp.where(periodic, 1 + sharp * (repeating.brightness - 1), fitted.brightness)
    light = jnp.where(hit.box < 0, 0.0, light)

    packed = jnp.zeros((size, size), jnp.uint32)
    for channel, sunny in enumerate((1.0, 0.85, 0.3)):
        first, other = table.colour[:, channel][box], table.second[:, channel][box]
        paint = (first + second * (other - first)) * brightness
        paint = jnp.where(spine, spines[channel], jnp.where(sun, sunny, paint))
        value = jnp.clip(255 * paint * light + 0.5, 0, 255).astype(jnp.int32).astype(jnp.uint32)
        packed = packed | (value << (8 * channel))
    return packed


def _view(
    table: BoxTable, location: Array, rotation: Array, size: int, n_categories: int
) -> tuple[UInt32[Array, "height width"], Float[Array, "category"]]:
    """Picture of one pose, and the share of it that each category covers."""
    hit = cast(table, location, rotation, size)
    pixels = jnp.bincount(hit.box.ravel() + 1, length=MAX_BOXES + 1)[1:]  # without the pixels that see nothing
    belongs = table.category[None] == jnp.arange(n_categories)[:, None]
    share = jnp.sum(jnp.where(belongs, pixels[None], 0), axis=1).astype(jnp.float32) / (size * size)
    return _shade(table, hit, location, rotation, size), share


@partial(jax.jit, static_argnames=("size", "n_categories"))
def render_batch(
    table: BoxTable,
    location: Float32[Array, "view 2"],
    rotation: Float32[Array, "view"],
    *,
    size: int,
    n_categories: int,
) -> tuple[UInt32[Array, "view height width"], Float[Array, "view category"]]:
    """Views of a batch of poses, compiled; one after the other, so that a view's arrays stay in the cache.

    Args:
        table: the room.
        location: places (x, z) in metres.
        rotation: headings in degrees.
        size: rows and columns of an image.
        n_categories: length of the category list.

    Returns:
        Images, packed as `unpack` reads them, and the share of each that each category covers.
    """
    return jax.lax.map(lambda pose: _view(table, pose[0], pose[1], size, n_categories), (location, rotation))


def unpack(packed: UInt32[np.ndarray, "*shape"]) -> UInt8[np.ndarray, "*shape 3"]:
    """Split packed colours into red, green and blue."""
    return packed.astype("<u4", copy=False)[..., None].view(np.uint8)[..., :3]


def render(
    table: BoxTable,
    location: Float[np.ndarray, "states 2"],
    rotation: Float[np.ndarray, "states"],
    *,
    size: int,
    n_categories: int,
    description: str = "rendering",
) -> tuple[UInt8[np.ndarray, "states height width 3"], Float32[np.ndarray, "states category"]]:
    """Views of all poses of a room, showing a progress bar.

    Args:
        table: the room.
        location: places (x, z) in metres.
        rotation: headings in degrees.
        size: rows and columns of an image.
        n_categories: length of the category list.
        description: label of the progress bar.

    Returns:
        Images, and the share of each that each category covers.
    """
    total = len(location)
    images = np.empty((total, size, size, 3), np.uint8)
    shares = np.empty((total, n_categories), np.float32)

    def dispatch(start: int) -> tuple[Array, Array]:
        chosen = np.minimum(np.arange(start, start + BATCH), total - 1)  # the last batch repeats its last pose
        poses = (jnp.asarray(values[chosen], jnp.float32) for values in (location, rotation))
        return render_batch(table, *poses, size=size, n_categories=n_categories)

    with progress_bar(description, total, "views") as advance:
        following = dispatch(0)
        for start in range(0, total, BATCH):
            packed, share = following
            if start + BATCH < total:
                following = dispatch(start + BATCH)  # runs while this batch is copied
            done = min(BATCH, total - start)
            images[start : start + done] = unpack(np.asarray(packed))[:done]
            shares[start : start + done] = np.asarray(share)[:done]
            advance(done)
    return images, shares
