"""What is read from features during training, and its loss.

    L = Σ_c BCE(object c is shown) / 5  +  2 Σ_c (√share_c − ŝ_c)²  +  ½ Σ_{ahead, right, left} CE(free steps)
      + CE(relative heading)  +  Huber(displacement / 4 steps)

averaged over views and over pairs of views, and for encoders that learn shortest paths

      + CE(first actions of shortest paths)  +  Huber(log(1 + distance))

Readings of a single view are linear in its features. Those of a pair are a network of two hidden layers. The heads are
not kept: only the features are.
"""

from dataclasses import dataclass
from typing import NamedTuple

import flax.linen as nn
import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Bool, Float32

from relm_irl_jax.features.training.labels import MAX_FREE, ViewGroups
from relm_irl_jax.scenes.objects import MINIMUM_SHARE

PAIR_HIDDEN = (256, 128)
"""Widths of the hidden layers for pairs."""

DISPLACEMENT_UNIT = 4.0
"""Steps in a unit of the displacement."""


class Readings(NamedTuple):
    """What the heads read from the features of groups of views.

    Attributes:
        shown: log odds that an object of each category is shown.
        share: square root of the category's share of the view.
        free: log probabilities of the numbers of free steps ahead, to the right and to the left, up to a constant.
        heading: log probabilities of the second view's heading relative to the first, up to a constant.
        displacement: place of the second view in the frame of the first, in steps.
        action: log probabilities of the first action of a shortest path, up to a constant.
        log_distance: log(1 + number of actions).
    """

    shown: Float32[Array, "groups members categories"]
    share: Float32[Array, "groups members categories"]
    free: Float32[Array, "groups members 3 counts"]
    heading: Float32[Array, "groups members members 4"]
    displacement: Float32[Array, "groups members members 2"]
    action: Float32[Array, "groups members members 4"]
    log_distance: Float32[Array, "groups members members"]


class Losses(NamedTuple):
    """Parts of the loss, as weighted."""

    shown: Float32[Array, ""]
    share: Float32[Array, ""]
    free: Float32[Array, ""]
    heading: Float32[Array, ""]
    displacement: Float32[Array, ""]
    action: Float32[Array, ""]
    log_distance: Float32[Array, ""]


@dataclass(frozen=True)
class HeadSettings:
    """What is learned.

    Attributes:
        categories: number of categories of objects.
        paths: whether shortest paths are learned as well.
    """

    categories: int
    paths: bool


class Heads(nn.Module):
    """Reads labels from features.

    Attributes:
        categories: number of categories of objects.
    """

    categories: int

    @nn.compact
    def __call__(self, features: Float32[Array, "groups members 512"]) -> Readings:
        """Read."""
        counts = MAX_FREE + 1
        small = nn.initializers.variance_scaling(0.01, "fan_in", "normal")
        free = nn.Dense(3 * counts, kernel_init=small, name="free")(features)
        first = nn.Dense(PAIR_HIDDEN[0], name="pair_first")(features)
        second = nn.Dense(PAIR_HIDDEN[0], use_bias=False, name="pair_second")(features)
        pair = nn.relu(first[:, :, None] + second[:, None])
        pair = nn.relu(nn.Dense(PAIR_HIDDEN[1], name="pair_hidden")(pair))
        return Readings(
            shown=nn.Dense(self.categories, kernel_init=small, name="shown")(features),
            share=nn.Dense(self.categories, kernel_init=small, name="share")(features),
            free=free.reshape(*features.shape[:2], 3, counts),
            heading=nn.Dense(4, kernel_init=small, name="heading")(pair),
            displacement=DISPLACEMENT_UNIT * nn.Dense(2, kernel_init=small, name="displacement")(pair),
            action=nn.Dense(4, kernel_init=small, name="action")(pair),
            log_distance=nn.Dense(1, kernel_init=small, name="log_distance")(pair)[..., 0],
        )


def _masked_mean(values: Float32[Array, "*shape"], mask: Bool[Array, "*shape"]) -> Float32[Array, ""]:
    """Mean of the values where the mask is true; 0 if it is nowhere."""
    return jnp.where(mask, values, 0.0).sum() / jnp.maximum(mask.sum(), 1).astype(jnp.float32)


def losses(readings: Readings, groups: ViewGroups, settings: HeadSettings) -> Losses:
    """The parts of the loss of one update.

    Args:
        readings: what the heads read.
        groups: what is known.
        settings: what is learned. Static.

    Returns:
        The parts, whose sum is the loss; 0 for what is not learned.
    """
    share = jnp.asarray(groups.share)
    shown = optax.sigmoid_binary_cross_entropy(readings.shown, (share >= MINIMUM_SHARE).astype(jnp.float32)).sum(-1)
    root = ((jnp.sqrt(share) - readings.share) ** 2).sum(-1)
    labelled = jnp.broadcast_to(jnp.asarray(groups.labelled)[:, None], shown.shape)
    free = optax.softmax_cross_entropy_with_integer_labels(readings.free, jnp.asarray(groups.free)).sum(-1)
    heading = optax.softmax_cross_entropy_with_integer_labels(readings.heading, jnp.asarray(groups.heading))
    displacement = optax.huber_loss(readings.displacement / DISPLACEMENT_UNIT, groups.displacement / DISPLACEMENT_UNIT)
    action = log_distance = jnp.float32(0.0)
    if settings.paths:
        best = jnp.asarray(groups.best)
        distance = jnp.asarray(groups.distance).astype(jnp.float32)
        away = best.any(-1)
        probability = jnp.where(best, jax.nn.log_softmax(readings.action), -jnp.inf)
        # Any of the actions with which a shortest path begins is right.
        right = jax.nn.logsumexp(jnp.where(away[..., None], probability, 0.0), -1)
        action = _masked_mean(-right, away)
        log_distance = _masked_mean(optax.huber_loss(readings.log_distance, jnp.log1p(distance)), away)
    return Losses(
        shown=_masked_mean(shown, labelled) / 5,
        share=_masked_mean(root, labelled) * 2,
        free=free.mean() / 2,
        heading=heading.mean(),
        displacement=displacement.sum(-1).mean(),
        action=action,
        log_distance=log_distance,
    )
