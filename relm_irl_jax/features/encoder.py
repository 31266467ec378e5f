"""The encoder: views to feature vectors, batch by batch.

Views are uint8 RGB of any size. A view of another size than `EncoderSettings.image_size` is scaled
(antialiased bilinear) until its shorter side has that size, and its centre square is cut out. Values are
scaled to [0, 1] and normalised by ImageNet's mean and deviation, which belong to the encoder whatever its
weights.
"""

import hashlib
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pydantic
from jax.sharding import NamedSharding, PartitionSpec
from jaxtyping import Array, Float, Float32, UInt8

from relm_irl_jax.errors import InputError
from relm_irl_jax.features import weights
from relm_irl_jax.features.resnet import MIN_SIZE, ResNet50, pooled
from relm_irl_jax.progress import progress_bar

VERSION = 1
"""Raised whenever the same views and weights give other features: part of every fingerprint."""

MEAN = (0.485, 0.456, 0.406)
"""ImageNet's mean of red, green and blue on [0, 1]."""

DEVIATION = (0.229, 0.224, 0.225)
"""ImageNet's standard deviation of red, green and blue on [0, 1]."""

Views = UInt8[np.ndarray, "view height width 3"]
"""Camera views, RGB."""


@pydantic.dataclasses.dataclass(frozen=True)
class EncoderSettings:
    """The image encoder: which weights, at which size."""

    weights: str = "random"
    """random (seeded, untrained), imagenet (torchvision's V1), imagenet-v2, or a file of safetensors."""

    seed: int = pydantic.Field(default=0, ge=0)
    """Seed of random weights."""

    residual_scale: float = pydantic.Field(default=0.25, ge=0, le=1)
    """Random weights: what each of the 16 blocks adds to its input; 1/√16 lets all of them add as much as the input."""

    image_size: int = pydantic.Field(default=224, ge=MIN_SIZE)
    """Height and width at which views are encoded."""

    calibration_views: int = pydantic.Field(default=64, ge=1)
    """Number of views on which the batch-norm statistics of random weights are measured."""

    batch_size: int = pydantic.Field(default=16, ge=1)
    """Views that each device encodes at once."""


@dataclass(frozen=True)
class Encoder:
    """A ready encoder.

    Attributes:
        params: parameters of `ResNet50`.
        name: what a person reads, for example `resnet50 random/0`.
        fingerprint: checksum of all that features depend on besides the views: weights, size, version.
        image_size: height and width at which views are encoded.
        batch_size: views that each device encodes at once.
    """

    params: weights.Params
    name: str
    fingerprint: str
    image_size: int
    batch_size: int


def make_encoder(settings: EncoderSettings, calibration_views: Views | None = None) -> Encoder:
    """Load or draw the weights and fold them.

    Args:
        settings: which weights.
        calibration_views: views like those to be encoded; random weights take their batch-norm statistics
            from `settings.calibration_views` of them, evenly spread. Other weights have statistics of their
            own.

    Returns:
        The encoder.

    Raises:
        InputError: if the weights cannot be had or random weights come without views.
    """
    if settings.weights == "random":
        if calibration_views is None or len(calibration_views) == 0:
            raise InputError("random encoder weights need calibration views to measure batch-norm statistics on.")
        spread = np.linspace(0, len(calibration_views) - 1, min(len(calibration_views), settings.calibration_views))
        images = preprocess(jnp.asarray(calibration_views[spread.astype(int)]), settings.image_size)
        state = weights.calibrated(weights.random_state_dict(settings.seed, settings.residual_scale), images)
        name = f"resnet50 random/{settings.seed}"
    elif settings.weights in weights.PUBLISHED:
        state = weights.load_state_dict(weights.fetch_published(settings.weights))
        name = f"resnet50 {settings.weights}"
    else:
        state = weights.load_state_dict(Path(settings.weights))
        name = f"resnet50 {Path(settings.weights).name}"
    identity = f"{weights.fingerprint(state)} {settings.image_size} {VERSION}"
    return Encoder(
        params=jax.tree.map(jnp.asarray, weights.folded(state)),
        name=name,
        fingerprint=hashlib.sha256(identity.encode()).hexdigest()[:16],
        image_size=settings.image_size,
        batch_size=settings.batch_size,
    )


def encode(encoder: Encoder, views: Views, description: str = "encoding views") -> Float32[np.ndarray, "view 2048"]:
    """Feature vectors of views: the last map, averaged over its places.

    Args:
        encoder: the encoder.
        views: views of one size.
        description: what the progress bar calls this work.

    Returns:
        One vector per view.
    """
    return _encode(encoder, views, description, pool=True)


def encode_maps(
    encoder: Encoder, views: Views, description: str = "encoding views"
) -> Float32[np.ndarray, "view rows columns 2048"]:
    """The last maps of views, 7x7x2048 at 224x224.

    Args:
        encoder: the encoder.
        views: views of one size.
        description: what the progress bar calls this work.

    Returns:
        One map per view.
    """
    return _encode(encoder, views, description, pool=False)


def preprocess(views: UInt8[Array, "view height width 3"], size: int) -> Float[Array, "view {size} {size} 3"]:
    """Scale and crop views to a square and normalise their colours.

    Args:
        views: views of one size.
        size: height and width of the square.

    Returns:
        Normalised images.
    """
    images = views.astype(jnp.float32)
    height, width = views.shape[1:3]
    if (height, width) != (size, size):
        shorter = min(height, width)
        scaled = (round(height * size / shorter), round(width * size / shorter))
        images = jax.image.resize(images, (len(views), *scaled, 3), "linear", antialias=True)
        top, left = (scaled[0] - size) // 2, (scaled[1] - size) // 2
        images = images[:, top : top + size, left : left + size]
    return (images / 255 - jnp.asarray(MEAN)) / jnp.asarray(DEVIATION)


@partial(jax.jit, static_argnames=("size", "pool"))
def _features(params: weights.Params, views: UInt8[Array, "view height width 3"], size: int, pool: bool) -> Array:
    """Features of one batch."""
    maps = ResNet50().bind({"params": params})(preprocess(views, size))
    return pooled(maps) if pool else maps


def _encode(encoder: Encoder, views: Views, description: str, pool: bool) -> np.ndarray:
    """Encode in batches of one size, the last one padded, each spread over all devices."""
    if views.ndim != 4 or views.shape[-1] != 3 or views.dtype != np.uint8:
        raise InputError(f"views must be uint8 of shape (N, height, width, 3), not {views.dtype} {views.shape}.")
    mesh = jax.make_mesh((jax.device_count(),), ("view",))
    over_devices, everywhere = (
        NamedSharding(mesh, PartitionSpec("view")),
        NamedSharding(mesh, PartitionSpec()),
    )
    params = jax.device_put(encoder.params, everywhere)
    size = encoder.batch_size * jax.device_count()
    features = []
    with progress_bar(description, len(views), "views") as advance:
        for start in range(0, len(views), size):
            batch = views[start : start + size]
            padded = np.concatenate([batch, np.zeros((size - len(batch), *views.shape[1:]), np.uint8)])
            output = _features(params, jax.device_put(padded, over_devices), encoder.image_size, pool)
            features.append(np.asarray(output)[: len(batch)])
            advance(len(batch))
    empty = jax.eval_shape(
        partial(_features, size=encoder.image_size, pool=pool),
        encoder.params,
        jax.ShapeDtypeStruct((0, *views.shape[1:]), np.uint8),
    )
    return np.concatenate([np.zeros(empty.shape, np.float32), *features])
