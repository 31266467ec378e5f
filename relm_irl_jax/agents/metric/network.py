"""The metric agent's network: an embedding of views whose distances are the number of steps between them.

    h(x)  = ReLU(ReLU(x W + b) V + c)
    ψ(x)  = h(x) P                        embedding of a current view or a target view
    F(x)_a = ψ(x) + h(x) M_a              successor embedding: the predicted embedding after action a
    D(x, g) = mean_k ‖ψ_k(x) − ψ_k(g)‖₂   over equal parts ψ_k of the embedding

    V(s, g) = −D(s, g),   π(a | s, g) ∝ exp(−β D(F(s)_a, ψ(g)))

The value is a function of the distance, and the policy prefers actions that reduce it. Since one map embeds current and
target views, a view that was never a target in training also has an embedding as a target. If the two directions of a
path may differ in length, mean_k max_i (ψ_ki(x) − ψ_ki(g))₊ is added, which satisfies the triangle inequality but is
not symmetric.

Sources: Pitis et al., "An inductive bias for distances" (2020); Wang et al., "Optimal goal-reaching reinforcement
learning via quasimetric learning" (2023); Barreto et al., "Successor features" (2017).
"""

from dataclasses import dataclass
from typing import cast

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32

from relm_irl_jax.scenes.scene import ACTIONS
from relm_irl_jax.types import Parameters

SMALLEST_SQUARE = 1e-6
"""Lower bound of squared distances, since the square root is not differentiable at 0."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Embeddings:
    """Embeddings of views.

    Attributes:
        state: ψ, embedding of each view.
        successor: F, predicted embedding after each action.
    """

    state: Float32[Array, "*views dimension"]
    successor: Float32[Array, "*views 4 dimension"]


@dataclass(frozen=True)
class DistanceForm:
    """Form of the distance.

    Attributes:
        groups: number of equal parts of the embedding whose Euclidean distances are averaged.
        symmetric: whether both directions have the same distance.
    """

    groups: int
    symmetric: bool


class MetricNetwork(nn.Module):
    """Embeds views.

    Attributes:
        width: units of each hidden layer.
        dimension: dimension of the embedding.
    """

    width: int = 512
    dimension: int = 128

    @nn.compact
    def __call__(self, view: Float32[Array, "*views feature"]) -> Embeddings:
        """Embed views.

        Args:
            view: encoded views.

        Returns:
            Their embeddings, and the predicted embeddings after each action.
        """
        he = nn.initializers.he_normal()
        hidden = nn.relu(nn.Dense(self.width, kernel_init=he, name="shared")(view))
        hidden = nn.relu(nn.Dense(self.width, kernel_init=he, name="hidden")(hidden))
        state = nn.Dense(self.dimension, name="place")(hidden)
        small = nn.initializers.variance_scaling(0.1, "fan_in", "truncated_normal")
        moves = nn.Dense(len(ACTIONS) * self.dimension, kernel_init=small, name="moves")(hidden)
        moves = moves.reshape(*moves.shape[:-1], len(ACTIONS), self.dimension)
        return Embeddings(state, state[..., None, :] + moves)


def embed(network: MetricNetwork, parameters: Parameters, features: Float32[Array, "*views feature"]) -> Embeddings:
    """Apply the network.

    Args:
        network: the network. Static.
        parameters: its parameters.
        features: encoded views.

    Returns:
        The embeddings.
    """
    return cast(Embeddings, network.apply(parameters, features))


def distance(
    x: Float32[Array, "*#batch dimension"], y: Float32[Array, "*#batch dimension"], form: DistanceForm
) -> Float32[Array, "*batch"]:
    """D between embeddings, pair by pair; leading axes broadcast.

    Args:
        x: embeddings of current views.
        y: embeddings of targets.
        form: form of the distance. Static.

    Returns:
        The distances, in steps.
    """
    difference = (x - y).reshape(*jnp.broadcast_shapes(x.shape, y.shape)[:-1], form.groups, -1)
    result = jnp.sqrt(jnp.maximum((difference**2).sum(-1), SMALLEST_SQUARE)).mean(-1)
    return result if form.symmetric else result + nn.relu(difference).max(-1).mean(-1)


def pairwise_distances(
    x: Float32[Array, "*batch from dimension"], y: Float32[Array, "*batch to dimension"], form: DistanceForm
) -> Float32[Array, "*batch from to"]:
    """D between all pairs of embeddings; symmetric distances use matrix products, ‖x‖² + ‖y‖² − 2x·y.

    Args:
        x: embeddings of current views.
        y: embeddings of targets.
        form: form of the distance. Static.

    Returns:
        The distances, in steps.
    """
    if not form.symmetric:
        return distance(x[..., :, None, :], y[..., None, :, :], form)
    x, y = (jnp.moveaxis(z.reshape(*z.shape[:-1], form.groups, -1), -2, -3) for z in (x, y))
    square = (x**2).sum(-1)[..., :, None] + (y**2).sum(-1)[..., None, :] - 2.0 * x @ jnp.swapaxes(y, -1, -2)
    return jnp.sqrt(jnp.maximum(square, SMALLEST_SQUARE)).mean(-3)
