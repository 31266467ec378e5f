"""Views of a room, rendered in batches by one compiled program for all rooms."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, UInt8, UInt32

from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.rooms.furniture import CATEGORIES
from relm_irl_jax.scenes.rooms.ray_casting import MAX_BOXES, BoxArrays, cast_rays
from relm_irl_jax.scenes.rooms.shading import shade

BATCH_SIZE = 16
"""Views per call of the compiled program on a CPU, which renders one after the other."""

ACCELERATOR_BATCH_SIZE = 128
"""Views per call on an accelerator, which renders them together."""


def render_views(
    boxes: BoxArrays,
    location: Float[np.ndarray, "states 2"],
    rotation: Float[np.ndarray, "states"],
    *,
    size: int,
    description: str | None = "rendering",
) -> tuple[UInt8[np.ndarray, "states height width 3"], Float32[np.ndarray, "states category"]]:
    """Render all poses of a room.

    Args:
        boxes: the room.
        location: places (x, z) in metres.
        rotation: headings in degrees.
        size: rows and columns of an image.
        description: label of the progress bar; None for no bar.

    Returns:
        Images, and the share of each image that each of `CATEGORIES` covers.
    """
    total = len(location)
    images = np.empty((total, size, size, 3), np.uint8)
    shares = np.empty((total, len(CATEGORIES)), np.float32)
    together = jax.default_backend() != "cpu"
    batch = ACCELERATOR_BATCH_SIZE if together else BATCH_SIZE

    def dispatch(start: int) -> tuple[Array, Array]:
        chosen = np.minimum(np.arange(start, start + batch), total - 1)  # the last batch repeats its last pose
        poses = (jnp.asarray(values[chosen], jnp.float32) for values in (location, rotation))
        return render_batch(boxes, *poses, size=size, together=together)

    with progress_bar(description, total, "views") as advance:
        next_batch = dispatch(0)
        for start in range(0, total, batch):
            packed, share = next_batch
            if start + batch < total:
                next_batch = dispatch(start + batch)  # computed while this batch is copied
            done = min(batch, total - start)
            images[start : start + done] = unpack_rgb(np.asarray(packed))[:done]
            shares[start : start + done] = np.asarray(share)[:done]
            advance(done)
    return images, shares


@partial(jax.jit, static_argnames=("size", "together"))
def render_batch(
    boxes: BoxArrays,
    location: Float32[Array, "view 2"],
    rotation: Float32[Array, "view"],
    *,
    size: int,
    together: bool = False,
) -> tuple[UInt32[Array, "view height width"], Float[Array, "view category"]]:
    """Render a batch of poses in one compiled program.

    Args:
        boxes: the room.
        location: places (x, z) in metres.
        rotation: headings in degrees.
        size: rows and columns of an image. Static.
        together: whether to render them at once, or one by one, so that the arrays of a view stay in a CPU's cache.
            Static.

    Returns:
        Images, packed for `unpack_rgb`, and the share of each image that each of `CATEGORIES` covers.
    """
    view = partial(_view, boxes, size=size)
    return (
        jax.vmap(view)(location, rotation) if together else jax.lax.map(lambda pose: view(*pose), (location, rotation))
    )


def unpack_rgb(packed: UInt32[np.ndarray, "*shape"]) -> UInt8[np.ndarray, "*shape 3"]:
    """Split colours into red, green and blue.

    Args:
        packed: one integer for each pixel, red in the lowest byte, then green, then blue.
    """
    return packed.astype("<u4", copy=False)[..., None].view(np.uint8)[..., :3]


def _view(
    boxes: BoxArrays, location: Float32[Array, "2"], rotation: Float32[Array, ""], size: int
) -> tuple[UInt32[Array, "height width"], Float[Array, "category"]]:
    """Image of one pose, and the share of it that each category covers."""
    hits = cast_rays(boxes, location, rotation, size)
    pixels = jnp.bincount(hits.box.ravel() + 1, length=MAX_BOXES + 1)[1:]  # without the pixels that hit no box
    belongs = boxes.category[None] == jnp.arange(len(CATEGORIES))[:, None]
    share = jnp.sum(jnp.where(belongs, pixels[None], 0), axis=1).astype(jnp.float32) / (size * size)
    return shade(boxes, hits, location, rotation, size), share
