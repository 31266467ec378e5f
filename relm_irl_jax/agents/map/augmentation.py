"""Changes of views before the network sees them.

*Gamma correction* brightens dark views: v′ = 255 (v / 255)^γ, the same for all views of a run.

*Random convolution* changes colours and textures in training and keeps shapes:

    x′ = K ∗ x,    K ∈ R^(3 × 3 × 3 × 3),    K ~ N(0, 2 / (27 + 27)) with probability 1 − α, else the identity

One K for all views of an update, pixels x in [−1, 1]. Source: Lee et al., "Network randomization: a simple technique
for generalization in deep reinforcement learning" (2020), with their α = 0.1 and Glorot's variance.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float32, UInt8

UNCHANGED = 0.1
"""Probability α of the identity."""


def draw_filter(generator: np.random.Generator) -> Float32[np.ndarray, "3 3 3 3"]:
    """Draw the weights of a convolution.

    Args:
        generator: source of randomness.

    Returns:
        K by row, column, input and output channel.
    """
    weights = generator.normal(0.0, np.sqrt(2.0 / 54.0), (3, 3, 3, 3)).astype(np.float32)
    if generator.random() < UNCHANGED:
        weights[:] = 0.0
        weights[1, 1] = np.eye(3)
    return weights


def gamma_corrected(views: UInt8[np.ndarray, "*views 3"], gamma: float) -> UInt8[np.ndarray, "*views 3"]:
    """Brighten or darken views.

    Args:
        views: RGB views.
        gamma: γ; below 1 brightens.

    Returns:
        The corrected views.
    """
    if gamma == 1.0:
        return views
    return np.rint(255 * (np.arange(256) / 255) ** gamma).astype(np.uint8)[views]


def random_convolution(
    views: UInt8[Array, "views height width 3"], weights: Float32[np.ndarray | Array, "3 3 3 3"]
) -> Float32[Array, "views height width 3"]:
    """Filter views; zeros lie beyond their edges.

    Args:
        views: RGB views.
        weights: K.

    Returns:
        The filtered views in the units of the given ones: 0 and 255 stand for −1 and 1, which results may exceed.
    """
    pixels = views.astype(jnp.float32) / 127.5 - 1.0
    filtered = jax.lax.conv_general_dilated(
        pixels, jnp.asarray(weights), (1, 1), "SAME", dimension_numbers=("NHWC", "HWIO", "NHWC")
    )
    return (filtered + 1.0) * 127.5
