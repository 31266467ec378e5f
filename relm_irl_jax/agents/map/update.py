"""One update of the mapping agent: one step of AdamW on walks through one room."""

from functools import partial
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import optax
from jax.typing import ArrayLike
from jaxtyping import Array, Float32

from relm_irl_jax.agents.map.loss import Losses, compute_loss
from relm_irl_jax.agents.map.network import MapNetwork
from relm_irl_jax.agents.map.walks import Walks
from relm_irl_jax.agents.training import apply_gradient
from relm_irl_jax.types import Parameters

GRADIENT_CLIP = 1.0
"""Largest global norm of a gradient."""

WARM_UP = 100.0
"""Updates over which the step size rises from 0, at most half of all."""


class Numbers(NamedTuple):
    """Numbers of the loss and the optimiser.

    Attributes:
        learning_rate: largest step size.
        weight_decay: of AdamW.
        free_weight: λ of the loss.
        updates: updates of the whole training.
    """

    learning_rate: Float32[Array, ""]
    weight_decay: Float32[Array, ""]
    free_weight: Float32[Array, ""]
    updates: Float32[Array, ""]


class TrainState(NamedTuple):
    """The state of a training between updates.

    Attributes:
        parameters: the agent's parameters.
        optimizer: the optimiser's state.
    """

    parameters: Parameters
    optimizer: optax.OptState


def make_optimizer(numbers: Numbers) -> optax.GradientTransformation:
    """AdamW with clipped gradients; its step size rises, is constant, and falls to 0 along a cosine in the second half.

    Args:
        numbers: the optimiser's numbers.

    Returns:
        The gradient transformation.
    """

    def rate(count: ArrayLike) -> ArrayLike:
        count, half = jnp.asarray(count, jnp.float32), numbers.updates / 2
        rising = jnp.clip(count / jnp.minimum(WARM_UP, half), 0.0, 1.0)
        falling = 0.5 * (1.0 + jnp.cos(jnp.pi * jnp.clip((count - half) / half, 0.0, 1.0)))
        return numbers.learning_rate * rising * falling

    decay = cast(float, numbers.weight_decay)
    return optax.chain(optax.clip_by_global_norm(GRADIENT_CLIP), optax.adamw(rate, weight_decay=decay))


@partial(jax.jit, static_argnames="network", donate_argnums=0)
def update(state: TrainState, walks: Walks, numbers: Numbers, network: MapNetwork) -> tuple[TrainState, Losses]:
    """Take one gradient step.

    Args:
        state: the state of training.
        walks: walks and targets.
        numbers: numbers of the loss and the optimiser.
        network: the network. Static.

    Returns:
        The next state and the losses before the step.
    """
    gradient, losses = jax.grad(compute_loss, has_aux=True)(state.parameters, walks, network, numbers.free_weight)
    return TrainState(*apply_gradient(make_optimizer(numbers), gradient, state.optimizer, state.parameters)), losses
