"""The loss of the mapping agent: where is the target, after each prefix of a walk?

For a walk with distinct views 1 … n and a target at pose g in the walk's frame, the loss is

    −Σ_{k ∈ prefixes, g not among views 1 … k} log P(g | views 1 … k)  +  λ Σ_{places} BCE(p_free, place is free)

averaged over walks, prefixes and the targets in a walk's extent: cross-entropy of the true pose, and of the places that
can be stood on. The labels are the walks' own odometry.
"""

from functools import partial
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float32

from relm_irl_jax.agents.map.augmentation import random_convolution
from relm_irl_jax.agents.map.memory import Odometry, free_logits, grid_rows, summarise, turned
from relm_irl_jax.agents.map.network import RECORD, VIEW, MapNetwork
from relm_irl_jax.agents.map.posterior import (
    N_BINS,
    all_scores,
    distance_bins,
    kernel_spectrum,
    log_posterior,
    memory_spectrum,
)
from relm_irl_jax.agents.map.walks import Walks
from relm_irl_jax.types import Parameters


def prefix_lengths(views: int) -> tuple[int, ...]:
    """Numbers of distinct views after which the posterior is judged: the powers of two below the walk's length, and it.

    Args:
        views: distinct views of a walk.

    Returns:
        The lengths, ascending.
    """
    return tuple(sorted({2**k for k in range(views.bit_length()) if 2**k < views} | {views}))


def initial_parameters(network: MapNetwork, seed: int = 0) -> Parameters:
    """Parameters before training.

    Args:
        network: the network.
        seed: seed of its initial weights.

    Returns:
        `network`, its weights, and `prior`: the profiles over the distance from the start and κ.
    """
    views = jnp.zeros((1, VIEW, VIEW, 3), jnp.uint8)
    far = jnp.arange(N_BINS, dtype=jnp.float32)
    return {
        "network": jax.jit(network.init)(jax.random.key(seed), views),
        "prior": {"free": 1.0 - 0.3 * far, "pose": jnp.zeros(N_BINS), "scale": jnp.float32(1.0)},
    }


def prefix_memories(
    record: Float32[Array, "walks steps cells record"], walks: Walks
) -> tuple[Float32[Array, "walks prefixes grid grid record"], Odometry]:
    """Grids and odometries after each prefix of each walk.

    Args:
        record: what each view says about the cells of its region.
        walks: the walks.

    Returns:
        Sums of the records on the grid, and poses seen.
    """
    n_walks, steps = walks.pose.shape[:2]
    lengths, extent = prefix_lengths(steps), walks.extent
    radius, side, size = extent.radius, extent.side, extent.grid
    part = jnp.asarray(np.searchsorted(lengths, np.arange(1, steps + 1)))

    def draw(record, pose, valid):
        rows = jax.vmap(partial(grid_rows, extent=extent))(pose)
        values = jax.vmap(turned)(record, pose[:, 0]) * valid[:, None, None].astype(record.dtype)
        grid = jnp.zeros((len(lengths), size * size, RECORD)).at[part[:, None], rows].add(values)
        # A sum over few prefixes is fastest as a product.
        grid = jnp.einsum("pq,qcr->pcr", jnp.tri(len(lengths)), grid).reshape(-1, size, size, RECORD)
        seen = jnp.zeros((len(lengths), 4, side, side), jnp.int32)
        seen = seen.at[part, pose[:, 0], pose[:, 1] + radius, pose[:, 2] + radius].add(1)
        return grid, jnp.cumsum(seen, 0) > 0

    grid, seen = jax.vmap(draw)(record, walks.pose, walks.valid)
    blocked = jnp.zeros((n_walks, len(lengths), side, side), bool)
    return grid, Odometry(jnp.zeros((n_walks, len(lengths), 3), jnp.int32), seen, blocked)


class Losses(NamedTuple):
    """What training reports.

    Attributes:
        pose: cross-entropy of the target's pose in nats, for each prefix.
        top: share of targets whose pose is the most probable one, for each prefix.
        free: cross-entropy of a place's being free.
    """

    pose: Float32[Array, "prefixes"]
    top: Float32[Array, "prefixes"]
    free: Float32[Array, ""]


def compute_loss(
    parameters: Parameters, walks: Walks, network: MapNetwork, free_weight: Float32[Array, ""]
) -> tuple[Float32[Array, ""], Losses]:
    """The loss of one update.

    Args:
        parameters: as `initial_parameters` gives them.
        walks: walks and targets.
        network: the network. Static.
        free_weight: λ.

    Returns:
        The loss and its parts.
    """
    n_walks, steps = walks.pose.shape[:2]
    n_targets = len(walks.target_views)
    views = jnp.concatenate([jnp.asarray(walks.views).reshape(-1, VIEW, VIEW, 3), jnp.asarray(walks.target_views)])
    if walks.convolution is not None:
        views = random_convolution(views, walks.convolution)
    # Only the head that is needed: of the views met, what memory adds up; of the targets', what they are looked for by.
    apply = partial(network.apply, parameters["network"])
    bearings = cast(Array, apply(views, method="bearings"))
    record = cast(Array, apply(bearings[:-n_targets], method="records"))
    kernel = cast(Array, apply(bearings[-n_targets:], method="kernels"))
    grid, odometry = prefix_memories(record.reshape(n_walks, steps, -1, RECORD), walks)
    seen, evidence = summarise(grid)
    extent = walks.extent
    bins = jnp.asarray(distance_bins(extent))
    prior: dict[str, Array] = dict(parameters["prior"])
    free = free_logits(evidence, prior["free"][bins], prior["scale"], odometry)

    score = all_scores(memory_spectrum(seen.reshape(-1, *seen.shape[2:])), kernel_spectrum(kernel, extent))
    score = score.reshape(n_walks, -1, n_targets, *score.shape[2:])
    posterior = log_posterior(score, free[:, :, None], prior["pose"][bins], ~odometry.seen[:, :, None])

    place = jnp.asarray(walks.target_pose)[..., 1:]
    near = (jnp.abs(place) <= extent.radius).all(-1)[:, None]
    z, x = jnp.moveaxis(jnp.clip(place + extent.radius, 0, extent.side - 1), -1, 0)
    cell = ((walks.target_pose[..., 0] * extent.side + z) * extent.side + x)[:, None, :, None]
    flat = posterior.reshape(*posterior.shape[:3], -1)
    met = jnp.take_along_axis(odometry.seen.reshape(*odometry.seen.shape[:2], 1, -1), cell, -1)[..., 0]
    right = jnp.take_along_axis(flat, cell, -1)[..., 0]
    counted = near & ~met
    weight = counted.astype(jnp.float32)
    total = jnp.maximum(weight.sum((0, 2)), 1)
    pose = -(jnp.where(counted, right, 0.0)).sum((0, 2)) / total
    top = jnp.where(right >= flat.max(-1), weight, 0.0).sum((0, 2)) / total
    entropy = optax.sigmoid_binary_cross_entropy(free, jnp.asarray(walks.free)[:, None].astype(jnp.float32))
    known = odometry.seen.any(-3)
    free_loss = jnp.where(known, 0.0, entropy).mean() * 10
    return pose.mean() + free_weight * free_loss, Losses(pose, top, free_loss)
