"""A small convolutional network for views of 64 × 64 pixels, with batch norm folded into the weights that encode.

    64 × 64 × 3 --patches of 8 × 8, stride 4--> 16 × 16 × 48 --3 × 3, stride 2--> 8 × 8 × 96 --3 × 3, residual-->
    8 × 8 × 96 --3 × 3, stride 2--> 4 × 4 × 160 --flattened--> 512

Each layer but the last ends in max(0, x). The last feature map is not averaged over positions: where something is seen
says where the camera stands. Convolutions are matrix products of shifted copies. Measured forward and backward on two
busy cores, in views for each CPU second: five layers of which the first has 32 × 32 positions, 217 to 256 with
`lax.conv` and 266 to 296 as products; nearly these layers, without the residual connection, 599.

During training (`ConvNet(train=True)`) batch norm follows each product. A product followed by a batch norm with fixed
statistics is one product with a bias; see `relm_irl_jax.features.resnet`.
"""

from collections.abc import Mapping
from typing import Any

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from relm_irl_jax.features.settings import SMALL_IMAGE_SIZE

VIEW = SMALL_IMAGE_SIZE
"""Rows and columns of a view."""

N_FEATURES = 512
"""Length of a feature vector."""

LAYERS = ("patches", "stage_1", "residual", "stage_2", "features")
"""Names of the layers, from input to output."""

WIDTHS = (48, 96, 96, 160, N_FEATURES)
"""Output channels of each layer."""

PATCH_SIZES = (8 * 8 * 3, 9 * 48, 9 * 96, 9 * 96, 4 * 4 * 160)
"""Input channels of each layer, as patches."""

EPSILON = 1e-5
"""Number that batch norm adds to the variance."""

MOMENTUM = 0.98
"""Weight of the past in the running statistics of batch norm."""

Images = Float[Array, "views height width channels"]
"""A batch of images or feature maps."""

Patches = Float[Array, "views rows columns patch"]
"""The values of a patch of images at each position."""


def _shifted(x: Array, rows: int, columns: int) -> Array:
    """Move the content of images: the pixel at (i, j) is the old one at (i + rows, j + columns), 0 beyond the edge."""
    height, width = x.shape[1:3]
    padding = [(0, 0), (max(-rows, 0), max(rows, 0)), (max(-columns, 0), max(columns, 0))]
    padded = jnp.pad(x, padding + [(0, 0)] * (x.ndim - 3))
    return padded[:, max(rows, 0) : max(rows, 0) + height, max(columns, 0) : max(columns, 0) + width]


def _blocks(x: Images, side: int) -> Float[Array, "views rows columns side side channels"]:
    """Cut images into blocks of side × side pixels."""
    n, height, width, channels = x.shape
    cut = x.reshape(n, height // side, side, width // side, side, channels)
    return cut.transpose(0, 1, 3, 2, 4, 5)


def large_patches(x: Images) -> Patches:
    """Patches of 8 × 8 pixels with stride 4, each from the top left of its block of 4 × 4."""
    blocks = _blocks(x, 4)
    blocks = blocks.reshape(*blocks.shape[:3], -1)
    wide = jnp.concatenate([blocks, _shifted(blocks, 0, 1)], -1)
    return jnp.concatenate([wide, _shifted(wide, 1, 0)], -1)


def neighbourhoods(x: Images) -> Patches:
    """Patches of 3 × 3 with stride 1, centred."""
    return jnp.concatenate([_shifted(x, i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)], -1)


def halving_neighbourhoods(x: Images) -> Patches:
    """Patches of 3 × 3 with stride 2, centred at the top left of each block of 2 × 2."""
    blocks = _blocks(x, 2)
    n, rows, columns = blocks.shape[:3]
    parts = (
        blocks,
        _shifted(blocks[:, :, :, 1], -1, 0),
        _shifted(blocks[:, :, :, :, 1], 0, -1),
        _shifted(blocks[:, :, :, 1, 1], -1, -1),
    )
    return jnp.concatenate([part.reshape(n, rows, columns, -1) for part in parts], -1)


class ConvNet(nn.Module):
    """Normalised images to feature vectors.

    Attributes:
        train: whether batch norm follows each product, by the statistics of the batch.
    """

    train: bool = False

    @nn.compact
    def __call__(self, images: Float[Array, "views 64 64 3"]) -> Float[Array, "views 512"]:
        """Compute the features."""
        names = iter(zip(LAYERS, WIDTHS, strict=True))

        def product(patches: Array) -> Array:
            name, width = next(names)
            y = nn.Dense(width, use_bias=not self.train, kernel_init=nn.initializers.he_normal(), name=name)(patches)
            if self.train:
                y = nn.BatchNorm(False, momentum=MOMENTUM, epsilon=EPSILON, name=f"{name}_norm")(y)
            return y

        x = nn.relu(product(large_patches(images)))
        x = nn.relu(product(halving_neighbourhoods(x)))
        x = x + nn.relu(product(neighbourhoods(x)))
        x = nn.relu(product(halving_neighbourhoods(x)))
        return product(x.reshape(len(x), -1))


def initial_variables(key: Array) -> dict[str, Any]:
    """Parameters and running statistics before training.

    Args:
        key: source of randomness.

    Returns:
        Variables of `ConvNet(train=True)`.
    """
    return jax.jit(ConvNet(train=True).init)(key, jnp.zeros((1, VIEW, VIEW, 3)))


def fold_batch_norms(variables: Mapping[str, Any]) -> dict[str, dict[str, np.ndarray]]:
    """Fold batch norms with their running statistics into the products before them.

    Args:
        variables: parameters and statistics of `ConvNet(train=True)`.

    Returns:
        Parameters of `ConvNet()`: a kernel and a bias for each layer.
    """
    folded = {}
    for name in LAYERS:
        norm, statistics = variables["params"][f"{name}_norm"], variables["batch_stats"][f"{name}_norm"]
        scale = np.asarray(norm["scale"], np.float64) / np.sqrt(np.asarray(statistics["var"], np.float64) + EPSILON)
        kernel = np.asarray(variables["params"][name]["kernel"]) * scale
        bias = np.asarray(norm["bias"]) - np.asarray(statistics["mean"]) * scale
        folded[name] = {"kernel": kernel.astype(np.float32), "bias": bias.astype(np.float32)}
    return folded
