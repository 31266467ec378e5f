"""What a view says about the ground plane in front of the camera.

The camera is level, so an image column is a bearing and a row is an elevation. The network keeps columns apart and
folds rows away:

    64 × 64 pixels --patches of 8 × 4, stride 4 × 2--> 16 × 32 --3 × 3, stride 2 × 1--> 8 × 32
                   --rows become channels, convolution of 3 columns--> 32 columns --two residual blocks of 3 columns-->
                   for each column and each of 12 depths:  features f ∈ R^C, confidence c ∈ (0, 1), occupancy o ∈ R
                   and, by a head of its own for the view of a target, the kernel k ∈ R^(C+2)

`relm_irl_jax.agents.map.geometry` projects columns and depths to the cells of the view region, each weighted by its
confidence. Most convolutions are matrix products of shifted copies, which compilers for CPUs differentiate faster.

*Directions.* C = S + 4D. The first S features do not turn. The others are D fields over the four directions relative to
the camera (ahead, right, behind, left), so that a wall can say which way it faces. Placed at heading h, direction d
becomes (d + h) mod 4: the features turn with the camera (a regular representation of the group of rotations C4).

Sources: Henriques and Vedaldi, "MapNet: an allocentric spatial memory for mapping environments" (2018), for the
ground-plane features and their correlation; Gupta et al., "Cognitive mapping and planning for visual navigation"
(2017), and Chaplot et al., "Learning to explore using active neural SLAM" (2020), for egocentric maps with
confidences; Cohen and Welling, "Group equivariant convolutional networks" (2016), for features that turn.
"""

from dataclasses import dataclass
from functools import partial
from typing import cast

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Float32, UInt8

from relm_irl_jax.agents.map.geometry import REACH, VIEW_CELLS, projection_weights
from relm_irl_jax.types import Parameters

VIEW = 64
"""Rows and columns of a view."""

COLUMNS = 32
"""Image columns that are kept apart."""

SCALARS = 8
"""Features S that do not turn."""

FIELDS = 4
"""Features D that have a value for each of the four directions."""

CHANNELS = SCALARS + 4 * FIELDS
"""Features C of a cell."""

RECORD = CHANNELS + 2
"""Numbers that a view adds to a cell of the memory: C weighted features, the confidence, the weighted occupancy."""

KERNEL = CHANNELS + 2
"""Numbers that a target's kernel holds for a cell: C features, the coverage, the occupancy."""

DEPTHS = REACH + 1
"""Depths of each column, in cells."""

Views = UInt8[Array, "views height width 3"] | Float32[Array, "views height width 3"]

Bearings = Float32[Array, "views columns channels"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Projections:
    """What views say about the cells of their projections.

    Attributes:
        record: Σ_j L c f, Σ_j L c, Σ_j L c o for each cell: what memory adds up.
        kernel: Σ_j L k for each cell: what a target's view is looked for by.
    """

    record: Float32[Array, "views cells record"]
    kernel: Float32[Array, "views cells kernel"]


def _neighbours(x: Float[Array, "*batch columns channels"]) -> Float[Array, "*batch columns three_channels"]:
    """Each column beside its left and right neighbour, zero beyond the image."""
    padded = jnp.pad(x, [(0, 0)] * (x.ndim - 2) + [(1, 1), (0, 0)])
    return jnp.concatenate([padded[..., :-2, :], x, padded[..., 2:, :]], -1)


class RowPairs(nn.Module):
    """3 × 3 convolution with stride 2 × 1 of pairs of rows, zero beyond the image.

    Attributes:
        channels: its outputs.
    """

    channels: int

    @nn.compact
    def __call__(self, pairs: Float32[Array, "views pairs columns both"]) -> Float32[Array, "views pairs columns out"]:
        """Apply the convolution.

        Args:
            pairs: upper and lower row of each pair.

        Returns:
            Its outputs, one row for each pair, whose lower two rows are the pair.
        """
        width = pairs.shape[-1] * 3 // 2
        kernel = self.param("kernel", nn.initializers.he_normal(), (3 * width, self.channels))
        bias = self.param("bias", nn.initializers.zeros, (self.channels,))
        above = jnp.pad(pairs[:, :-1, :, pairs.shape[-1] // 2 :], [(0, 0), (1, 0), (0, 0), (0, 0)])
        three = jnp.concatenate([above, pairs], -1)
        # One product for the columns on the left, in the middle and on the right. Fused with what comes before and
        # after, it would take twice as long.
        by_column = kernel.reshape(3, width, self.channels).swapaxes(0, 1).reshape(width, -1)
        product = jax.lax.optimization_barrier(jax.lax.optimization_barrier(three) @ by_column)
        left, middle, right = jnp.split(product, 3, -1)
        side = [(0, 0), (0, 0), (1, 1), (0, 0)]
        return jnp.pad(left, side)[:, :, :-2] + middle + jnp.pad(right, side)[:, :, 2:] + bias


class MapNetwork(nn.Module):
    """Maps views to projections, and holds the few numbers that turn correlations into probabilities.

    Attributes:
        width: channels along the columns.
        channels: channels of the first two layers.
    """

    width: int = 128
    channels: int = 32

    def setup(self) -> None:
        """Declare the layers."""
        he = nn.initializers.he_normal()
        small = nn.initializers.variance_scaling(0.5, "fan_in", "normal")
        weak = nn.initializers.variance_scaling(0.003, "fan_in", "normal")
        self.patches = nn.Dense(self.channels, kernel_init=he)
        self.rows = RowPairs(self.channels)
        self.columns = nn.Dense(self.width, kernel_init=he)
        self.residual_1 = nn.Dense(self.width, kernel_init=small)
        self.residual_2 = nn.Dense(self.width, kernel_init=small)
        self.record = nn.Dense(DEPTHS * RECORD, kernel_init=small)
        self.kernel = nn.Dense(DEPTHS * KERNEL, kernel_init=weak)

    def __call__(self, view: Views) -> Projections:
        """Look at views, each of which may be met or be a target's.

        Args:
            view: RGB views of `VIEW` × `VIEW` pixels from 0 to 255; filtered ones may exceed that.

        Returns:
            Their projections.
        """
        bearings = self.bearings(view)
        return Projections(self.records(bearings), self.kernels(bearings))

    def bearings(self, view: Views) -> Bearings:
        """What views show at each bearing: all layers but the heads.

        Args:
            view: as above.

        Returns:
            Channels of each image column.
        """
        n = len(view)
        # Patches of 4 × 2 pixels, in pairs of rows, each beside the next one to the right and below.
        patches = view.reshape(n, 8, 2, 4, 32, 6).transpose(0, 1, 4, 2, 3, 5).reshape(n, 8, COLUMNS, 2, 24)
        wide = jnp.concatenate([patches, jnp.roll(patches, -1, 2)], -1)
        upper, lower = wide[..., :1, :], wide[..., 1:, :]
        below = jnp.concatenate([lower, jnp.concatenate([upper[:, 1:], lower[:, -1:]], 1)], 3)
        pixels = jnp.concatenate([wide, below], -1).astype(jnp.float32) / 127.5 - 1.0
        x = nn.relu(self.patches(pixels)).reshape(n, 8, COLUMNS, -1)
        x = nn.relu(self.rows(x))
        x = nn.relu(self.columns(_neighbours(x.swapaxes(1, 2).reshape(n, COLUMNS, -1))))
        for block in (self.residual_1, self.residual_2):
            x = x + nn.relu(block(_neighbours(x)))
        return x

    def records(self, bearings: Bearings) -> Float32[Array, "views cells record"]:
        """What memory adds up of views.

        Args:
            bearings: what `bearings` returns.

        Returns:
            Σ_j L c f, Σ_j L c, Σ_j L c o for each cell.
        """
        place = self.record(bearings).reshape(len(bearings), COLUMNS, DEPTHS, RECORD)
        confidence = nn.sigmoid(place[..., -2:-1])
        return _to_cells(jnp.concatenate([confidence * place[..., :-2], confidence, confidence * place[..., -1:]], -1))

    def kernels(self, bearings: Bearings) -> Float32[Array, "views cells kernel"]:
        """What views of targets are looked for by.

        Args:
            bearings: what `bearings` returns.

        Returns:
            Σ_j L k for each cell.
        """
        return _to_cells(self.kernel(bearings).reshape(len(bearings), COLUMNS, DEPTHS, KERNEL))


def _to_cells(columns: Float[Array, "views columns depths channels"]) -> Float[Array, "views cells channels"]:
    """Project columns and depths to the cells of the view region."""
    return jnp.concatenate(
        [
            jnp.einsum("uj,njf->nuf", jnp.asarray(projection_weights(depth, columns.shape[1])), at_depth[:, :, 0])
            for depth, at_depth in enumerate(jnp.split(columns, columns.shape[2], 2))
        ],
        1,
    )


def turn_features(cells: Float[Array, "*batch channels"], heading: int) -> Float[Array, "*batch channels"]:
    """Turn the directions of features from the camera's frame to the map's.

    Args:
        cells: features C and any number of further channels that do not turn.
        heading: heading of the camera in the map.

    Returns:
        The features as the map holds them.
    """
    fields = cells[..., SCALARS:CHANNELS]
    turned = jnp.roll(fields.reshape(*fields.shape[:-1], FIELDS, 4), heading, -1).reshape(fields.shape)
    return jnp.concatenate([cells[..., :SCALARS], turned, cells[..., CHANNELS:]], -1)


@partial(jax.jit, static_argnums=0)
def _look(network: MapNetwork, parameters: Parameters, views: UInt8[Array, "views height width 3"]) -> Projections:
    return cast(Projections, network.apply(parameters, views))


def look(
    network: MapNetwork, parameters: Parameters, views: UInt8[Array, "views height width 3"], batch: int = 256
) -> Projections:
    """Apply the network to many views, a batch at a time.

    Args:
        network: the network.
        parameters: its parameters.
        views: RGB views.
        batch: views of a batch.

    Returns:
        Their projections.
    """
    n = len(views)
    padded = jnp.pad(jnp.asarray(views), [(0, -n % batch), (0, 0), (0, 0), (0, 0)])
    parts = [_look(network, parameters, padded[start : start + batch]) for start in range(0, len(padded), batch)]
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves)[:n], *parts)


assert VIEW_CELLS.shape[0] == (REACH + 1) ** 2
