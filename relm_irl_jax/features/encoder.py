"""The encoder: maps views to feature vectors, batch by batch.

Views are uint8 RGB of any size. A view is scaled (antialiased bilinear) until its shorter side has as many
pixels as the encoder takes, and cropped to its centre square. Values are scaled to [0, 1] and normalised by
ImageNet's mean and standard deviation, for all weights.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, NamedSharding, PartitionSpec
from jaxtyping import Array, Float32, UInt8

from relm_irl_jax.errors import InputError
from relm_irl_jax.features import convnet, convnet_weights, pretrained, resnet, weights
from relm_irl_jax.features.convnet import VIEW, ConvNet
from relm_irl_jax.features.resnet import ResNet50, global_average_pool
from relm_irl_jax.features.settings import RESNET_IMAGE_SIZE, SHIPPED, EncoderSettings
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
"""Views in a batch of ResNet-50, for each device."""

SMALL_BATCH_SIZE = 64
"""Views in a batch of the small network, for each device."""

Views = UInt8[np.ndarray, "view height width 3"]
"""Camera views, RGB."""

NetworkName = Literal["resnet50", "convnet"]


@dataclass(frozen=True)
class Network:
    """A network that encodes.

    Attributes:
        apply: maps parameters and normalised images to features.
        n_features: length of a feature vector.
        batch_size: views in a batch, for each device.
    """

    apply: Callable[[weights.Params, Array], Array]
    n_features: int
    batch_size: int


NETWORKS: dict[NetworkName, Network] = {
    "resnet50": Network(
        lambda params, images: global_average_pool(ResNet50().bind({"params": params})(images)),
        resnet.N_FEATURES,
        BATCH_SIZE,
    ),
    "convnet": Network(
        lambda params, images: ConvNet().bind({"params": params})(images), convnet.N_FEATURES, SMALL_BATCH_SIZE
    ),
}
"""The networks: ResNet-50, whose features are its last feature map averaged over positions, and the small network."""


@dataclass(frozen=True)
class Encoder:
    """A ready encoder.

    Attributes:
        network: name of the network, a key of `NETWORKS`.
        params: its parameters.
        name: name for results, for example `resnet50 random/0`.
        fingerprint: checksum of everything besides the views that features depend on: weights, image size, version.
        image_size: height and width at which views are encoded.
        trained_scenes: names of the scenes that the weights were trained on, where they are known.
    """

    network: NetworkName
    params: weights.Params
    name: str
    fingerprint: str
    image_size: int
    trained_scenes: frozenset[str] = frozenset()

    @property
    def n_features(self) -> int:
        """Length of a feature vector."""
        return NETWORKS[self.network].n_features


def is_small(settings: EncoderSettings) -> bool:
    """Whether the settings choose the small network.

    Args:
        settings: the settings.
    """
    return settings.weights in SHIPPED or convnet_weights.is_convnet(Path(settings.weights))


def image_size_of(settings: EncoderSettings) -> int:
    """Height and width at which views are encoded.

    Args:
        settings: the settings.
    """
    return settings.image_size or (VIEW if is_small(settings) else RESNET_IMAGE_SIZE)


def make_encoder(settings: EncoderSettings, calibration_views: Views | None = None) -> Encoder:
    """Load or draw the weights, and fold batch norms into the convolutions.

    Args:
        settings: weights and image size; `auto` means `random`.
        calibration_views: views like those to be encoded. The batch-norm statistics of random weights are measured on
            `N_CALIBRATION_VIEWS` evenly spaced ones; other weights come with statistics.

    Returns:
        The encoder.

    Raises:
        InputError: the weights cannot be loaded, or they are random and there are no calibration views.
    """
    size = image_size_of(settings)
    if is_small(settings):
        return _small_encoder(settings)
    if settings.weights in ("auto", "random"):
        if calibration_views is None or len(calibration_views) == 0:
            raise InputError("random encoder weights need calibration views to measure batch-norm statistics on.")
        index = np.linspace(0, len(calibration_views) - 1, min(len(calibration_views), N_CALIBRATION_VIEWS))
        images = preprocess(jnp.asarray(calibration_views[index.astype(int)]), size)
        state = weights.calibrate_batch_norms(weights.random_state_dict(settings.seed), images)
        name = f"resnet50 random/{settings.seed}"
    elif settings.weights in pretrained.PUBLISHED:
        state = pretrained.load_state_dict(pretrained.fetch_published(settings.weights))
        name = f"resnet50 {settings.weights}"
    else:
        state = pretrained.load_state_dict(Path(settings.weights))
        name = f"resnet50 {Path(settings.weights).name}"
    params = jax.tree.map(jnp.asarray, weights.fold_batch_norms(state))
    return Encoder("resnet50", params, name, _fingerprint(weights.fingerprint(state), size), size)


def _small_encoder(settings: EncoderSettings) -> Encoder:
    """The small network."""
    shipped = settings.weights in SHIPPED
    path = convnet_weights.shipped_path(settings.weights) if shipped else Path(settings.weights)
    if settings.image_size not in (None, VIEW):
        raise InputError(
            f"encoder.image_size: the network of encoder.weights = {settings.weights} encodes {VIEW} pixels, not "
            f"{settings.image_size}; leave it out."
        )
    layers, provenance = convnet_weights.load_convnet(path)
    checksum = provenance["sha256"]
    return Encoder(
        network="convnet",
        params=jax.tree.map(jnp.asarray, layers),
        name=f"{path.stem} {checksum[:8]}",
        fingerprint=_fingerprint(f"convnet {checksum}", VIEW),
        image_size=VIEW,
        trained_scenes=convnet_weights.trained_scenes(provenance),
    )


def _fingerprint(checksum: str, size: int) -> str:
    return hashlib.sha256(f"{checksum} {size} {VERSION}".encode()).hexdigest()[:16]


def encode(
    encoder: Encoder, views: np.ndarray, description: str = "encoding views"
) -> Float32[np.ndarray, "view feature"]:
    """Encode views in batches; each batch is distributed over all devices.

    Args:
        encoder: the encoder.
        views: uint8 RGB views (view, height, width, 3), all of the same size.
        description: label of the progress bar.

    Returns:
        One vector for each view.

    Raises:
        InputError: the views have a wrong type or shape.
    """
    if views.ndim != 4 or views.shape[-1] != 3 or views.dtype != np.uint8:
        raise InputError(f"views must be uint8 of shape (N, height, width, 3), not {views.dtype} {views.shape}.")
    mesh = jax.make_mesh((jax.device_count(),), ("view",), axis_types=(AxisType.Auto,))
    sharded, replicated = NamedSharding(mesh, PartitionSpec("view")), NamedSharding(mesh, PartitionSpec())
    params = jax.device_put(encoder.params, replicated)
    batch_size = NETWORKS[encoder.network].batch_size * jax.device_count()
    features = [np.zeros((0, encoder.n_features), np.float32)]
    with progress_bar(description, len(views), "views") as advance:
        for start in range(0, len(views), batch_size):
            batch = views[start : start + batch_size]
            padded = np.concatenate([batch, np.zeros((batch_size - len(batch), *views.shape[1:]), np.uint8)])
            output = encode_batch(params, jax.device_put(padded, sharded), encoder.image_size, encoder.network)
            features.append(np.asarray(output)[: len(batch)])
            advance(len(batch))
    return np.concatenate(features)


@partial(jax.jit, static_argnames=("size", "network"))
def encode_batch(
    params: weights.Params, views: UInt8[Array, "view height width 3"], size: int, network: NetworkName = "resnet50"
) -> Float32[Array, "view feature"]:
    """Encode one batch; compiled once for each shape of views.

    Args:
        params: parameters of the network.
        views: views of one size.
        size: height and width at which views are encoded.
        network: the network.

    Returns:
        One vector for each view.
    """
    return NETWORKS[network].apply(params, preprocess(views, size))


def preprocess(views: UInt8[Array, "view height width 3"], size: int) -> Float32[Array, "view {size} {size} 3"]:
    """Scale and crop views to a square and normalise their colours.

    Args:
        views: views of one size.
        size: height and width of the square.

    Returns:
        Normalised images.
    """
    return normalise(crop_and_scale(views, size))


def crop_and_scale(views: UInt8[Array, "view height width 3"], size: int) -> Float32[Array, "view {size} {size} 3"]:
    """Scale and crop views to a square.

    Args:
        views: views of one size.
        size: height and width of the square.

    Returns:
        Images with values from 0 to 255.
    """
    images = views.astype(jnp.float32)
    height, width = views.shape[1:3]
    if (height, width) != (size, size):
        shorter = min(height, width)
        scaled = (round(height * size / shorter), round(width * size / shorter))
        images = jax.image.resize(images, (len(views), *scaled, 3), "linear", antialias=True)
        top, left = (scaled[0] - size) // 2, (scaled[1] - size) // 2
        images = images[:, top : top + size, left : left + size]
    return images


def normalise(images: Float32[Array, "view height width 3"]) -> Float32[Array, "view height width 3"]:
    """Normalise colours by ImageNet's mean and standard deviation.

    Args:
        images: images with values from 0 to 255.

    Returns:
        Normalised images.
    """
    return (images / 255 - jnp.asarray(IMAGENET_MEAN)) / jnp.asarray(IMAGENET_STD)
