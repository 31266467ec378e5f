"""The encoder: maps views to feature vectors, batch by batch.

Views are uint8 RGB of any size. A view is scaled (antialiased bilinear) until its shorter side has
`EncoderSettings.image_size` pixels, and cropped to its centre square. Values are scaled to [0, 1] and normalised by
ImageNet's mean and standard deviation, for all weights.
"""

import hashlib
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import NamedSharding, PartitionSpec
from jaxtyping import Array, Float32, UInt8

from relm_irl_jax.errors import InputError
from relm_irl_jax.features import pretrained, weights
from relm_irl_jax.features.resnet import N_FEATURES, ResNet50, global_average_pool
from relm_irl_jax.features.settings import EncoderSettings
from relm_irl_jax.progress import progress_bar

VERSION = 1
"""Part of every fingerprint. Increase it if the code gives other features for the same views and weights."""

IMAGENET_MEAN = (0.485, 0.456, 0.406)
"""Mean of red, green and blue on [0, 1]."""

IMAGENET_STD = (0.229, 0.224, 0.225)
"""Standard deviation of red, green and blue on [0, 1]."""

N_CALIBRATION_VIEWS = 64
"""Number of views on which the batch-norm statistics of random weights are measured."""

BATCH_SIZE = 16
"""Views in a batch, for each device."""

Views = UInt8[np.ndarray, "view height width 3"]
"""Camera views, RGB."""


@dataclass(frozen=True)
class Encoder:
    """A ready encoder.

    Attributes:
        params: parameters of `ResNet50`.
        name: name for results, for example `resnet50 random/0`.
        fingerprint: checksum of everything besides the views that features depend on: weights, image size, version.
        image_size: height and width at which views are encoded.
    """

    params: weights.Params
    name: str
    fingerprint: str
    image_size: int


def make_encoder(settings: EncoderSettings, calibration_views: Views | None = None) -> Encoder:
    """Load or draw the weights, and fold batch norms into the convolutions.

    Args:
        settings: weights and image size.
        calibration_views: views like those to be encoded. The batch-norm statistics of random weights are measured on
            `N_CALIBRATION_VIEWS` evenly spaced ones; other weights come with statistics.

    Returns:
        The encoder.

    Raises:
        InputError: the weights cannot be loaded, or they are random and there are no calibration views.
    """
    if settings.weights == "random":
        if calibration_views is None or len(calibration_views) == 0:
            raise InputError("random encoder weights need calibration views to measure batch-norm statistics on.")
        index = np.linspace(0, len(calibration_views) - 1, min(len(calibration_views), N_CALIBRATION_VIEWS))
        images = preprocess(jnp.asarray(calibration_views[index.astype(int)]), settings.image_size)
        state = weights.calibrate_batch_norms(weights.random_state_dict(settings.seed), images)
        name = f"resnet50 random/{settings.seed}"
    elif settings.weights in pretrained.PUBLISHED:
        state = pretrained.load_state_dict(pretrained.fetch_published(settings.weights))
        name = f"resnet50 {settings.weights}"
    else:
        state = pretrained.load_state_dict(Path(settings.weights))
        name = f"resnet50 {Path(settings.weights).name}"
    identity = f"{weights.fingerprint(state)} {settings.image_size} {VERSION}"
    return Encoder(
        params=jax.tree.map(jnp.asarray, weights.fold_batch_norms(state)),
        name=name,
        fingerprint=hashlib.sha256(identity.encode()).hexdigest()[:16],
        image_size=settings.image_size,
    )


def encode(
    encoder: Encoder, views: np.ndarray, description: str = "encoding views"
) -> Float32[np.ndarray, "view 2048"]:
    """Encode views in batches; each batch is distributed over all devices.

    Args:
        encoder: the encoder.
        views: uint8 RGB views (view, height, width, 3), all of the same size.
        description: label of the progress bar.

    Returns:
        One vector for each view: the last feature map, averaged over positions.

    Raises:
        InputError: the views have a wrong type or shape.
    """
    if views.ndim != 4 or views.shape[-1] != 3 or views.dtype != np.uint8:
        raise InputError(f"views must be uint8 of shape (N, height, width, 3), not {views.dtype} {views.shape}.")
    mesh = jax.make_mesh((jax.device_count(),), ("view",))
    sharded, replicated = NamedSharding(mesh, PartitionSpec("view")), NamedSharding(mesh, PartitionSpec())
    params = jax.device_put(encoder.params, replicated)
    batch_size = BATCH_SIZE * jax.device_count()
    features = [np.zeros((0, N_FEATURES), np.float32)]
    with progress_bar(description, len(views), "views") as advance:
        for start in range(0, len(views), batch_size):
            batch = views[start : start + batch_size]
            padded = np.concatenate([batch, np.zeros((batch_size - len(batch), *views.shape[1:]), np.uint8)])
            output = encode_batch(params, jax.device_put(padded, sharded), encoder.image_size)
            features.append(np.asarray(output)[: len(batch)])
            advance(len(batch))
    return np.concatenate(features)


@partial(jax.jit, static_argnames="size")
def encode_batch(
    params: weights.Params, views: UInt8[Array, "view height width 3"], size: int
) -> Float32[Array, "view 2048"]:
    """Encode one batch; compiled once for each shape of views.

    Args:
        params: parameters of `ResNet50`.
        views: views of one size.
        size: height and width at which views are encoded.

    Returns:
        One vector for each view.
    """
    return global_average_pool(ResNet50().bind({"params": params})(preprocess(views, size)))


def preprocess(views: UInt8[Array, "view height width 3"], size: int) -> Float32[Array, "view {size} {size} 3"]:
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
    return (images / 255 - jnp.asarray(IMAGENET_MEAN)) / jnp.asarray(IMAGENET_STD)
