"""The metric agent's network: views are places, and the distance between places is the cost of walking there.

    h(x)  = ReLU(ReLU(x W + b) V + c)
    ψ(x)  = h(x) P                       the place of a view, be it the current one or the target's
    F(x)_a = ψ(x) + h(x) M_a             where action a would lead: the successor embedding
    D(x, g) = mean_k ‖ψ_k(x) − ψ_k(g)‖₂   over equal parts of the embedding

    V(s, g) = −D(s, g),   π(a | s, g) ∝ exp(−β ‖F(s)_a − ψ(g)‖)   with the same mean of norms

The critic is a function of the distance alone, and the policy walks downhill in it. Since one map places states and
targets, a view met only as a state is placed as a target, too. Where the way back may be longer than the way there,
mean_k max_i (ψ_ki(x) − ψ_ki(g))₊ is added, which obeys the triangle inequality but is not symmetric. With `interval`
distances, a part is the length of a union of intervals instead:

    D(x, g) = mean_k | ∪_i [ψ_ki(x), max(ψ_ki(x), ψ_ki(g))] |

Sources: Pitis et al., "An inductive bias for distances" (2020); Wang and Isola, "Improved representation of
asymmetrical distances with interval quasimetric embeddings" (2022); Wang et al., "Optimal goal-reaching reinforcement
learning via quasimetric learning" (2023); Barreto et al., "Successor features" (2017).
"""

from dataclasses import dataclass
from typing import cast

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.agent.settings import MetricSettings
from relm_irl_jax.scenes.scene import ACTIONS

LEAST_SQUARE = 1e-6
"""Floor of squared distances, where the root's gradient would not exist."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Places:
    """Embeddings of views.

    Attributes:
        here: ψ, the place of each view.
        after: F, the place behind each action.
    """

    here: Float32[Array, "*views dimension"]
    after: Float32[Array, "*views 4 dimension"]


class MetricNetwork(nn.Module):
    """Maps views to places.

    Attributes:
        width: units of each hidden layer.
        dimension: dimension of the embedding.
    """

    width: int = 512
    dimension: int = 128

    @nn.compact
    def __call__(self, view: Float32[Array, "*views feature"]) -> Places:
        """Embed views.

        Args:
            view: encoded views.

        Returns:
            Their places, and those behind each action.
        """
        he = nn.initializers.he_normal()
        hidden = nn.relu(nn.Dense(self.width, kernel_init=he, name="shared")(view))
        hidden = nn.relu(nn.Dense(self.width, kernel_init=he, name="hidden")(hidden))
        here = nn.Dense(self.dimension, name="place")(hidden)
        small = nn.initializers.variance_scaling(0.1, "fan_in", "truncated_normal")
        moves = nn.Dense(len(ACTIONS) * self.dimension, kernel_init=small, name="moves")(hidden)
        return Places(here, here[..., None, :] + moves.reshape(*moves.shape[:-1], len(ACTIONS), self.dimension))


def metric_network(settings: MetricSettings) -> MetricNetwork:
    """The network that the settings describe.

    Args:
        settings: the agent's settings.

    Returns:
        The network without parameters.
    """
    return MetricNetwork(settings.width, settings.dimension)


def places_of(network: MetricNetwork, parameters: Parameters, features: Float32[Array, "views feature"]) -> Places:
    """Apply the network.

    Args:
        network: the network. Static.
        parameters: its parameters.
        features: encoded views.

    Returns:
        The places.
    """
    return cast(Places, network.apply(parameters, features))


def distance(
    x: Float32[Array, "*batch dimension"], y: Float32[Array, "*batch dimension"], settings: MetricSettings
) -> Float32[Array, "*batch"]:
    """D between places, pair by pair; leading axes broadcast.

    Args:
        x: places to leave.
        y: places to reach.
        settings: the form of the distance. Static.

    Returns:
        The distances.
    """
    if settings.distance == "interval":
        return union_length(*(_ends(z, settings.groups) for z in jnp.broadcast_arrays(x, y))).mean(-1)
    difference = (x - y).reshape(*jnp.broadcast_shapes(x.shape, y.shape)[:-1], settings.groups, -1)
    result = jnp.sqrt(jnp.maximum((difference**2).sum(-1), LEAST_SQUARE)).mean(-1)
    return result if settings.symmetric else result + nn.relu(difference).max(-1).mean(-1)


def distances(
    x: Float32[Array, "*batch from dimension"], y: Float32[Array, "*batch to dimension"], settings: MetricSettings
) -> Float32[Array, "*batch from to"]:
    """D between all pairs of places.

    Euclidean distances take matrix products, ‖x‖² + ‖y‖² − 2x·y.

    Args:
        x: places to leave.
        y: places to reach.
        settings: the form of the distance. Static.

    Returns:
        The distances.
    """
    if settings.distance == "interval":
        x, y = (_ends(z, settings.groups) for z in (x, y))
        return union_length(x[..., :, None, :], y[..., None, :, :]).mean(-1)
    if not settings.symmetric:
        return distance(x[..., :, None, :], y[..., None, :, :], settings)
    x, y = (jnp.moveaxis(z.reshape(*z.shape[:-1], settings.groups, -1), -2, -3) for z in (x, y))
    square = (x**2).sum(-1)[..., :, None] + (y**2).sum(-1)[..., None, :] - 2 * x @ jnp.swapaxes(y, -1, -2)
    return jnp.sqrt(jnp.maximum(square, LEAST_SQUARE)).mean(-3)


def _ends(places: Float32[Array, "*batch dimension"], groups: int) -> Float32[Array, "interval *batch groups"]:
    """One end of every interval; groups come last, so that the processor takes many of them at once."""
    return jnp.moveaxis(places.reshape(*places.shape[:-1], groups, -1), -1, 0)


def union_length(
    begin: Float32[Array, "interval *batch"], reached: Float32[Array, "interval *batch"]
) -> Float32[Array, "*batch"]:
    """Length of the union of the intervals [b_i, max(b_i, r_i)].

    It is the sum of the ends that no other interval covers, minus that of such beginnings. All pairs of intervals are
    compared: they are few, and neither are they sorted, nor does the gradient scatter.

    Args:
        begin: where the intervals begin.
        reached: where they end, unless that is before they begin; the axes of a batch broadcast.

    Returns:
        The length.
    """
    end = jnp.maximum(begin, reached)
    fixed_begin, fixed_end = jax.lax.stop_gradient((begin, end))
    total = jnp.zeros(end.shape[1:], end.dtype)
    for i in range(len(begin)):
        first = last = jnp.array(True)
        for j in range(len(begin)):
            if i == j:
                continue
            # Of equal ends, that of the first interval counts.
            below = jnp.less_equal if j < i else jnp.less
            last &= ~((fixed_begin[j] <= fixed_end[i]) & below(fixed_end[i], fixed_end[j]))
            first &= ~((fixed_begin[i] <= fixed_end[j]) & below(fixed_begin[j], fixed_begin[i]))
        total += jnp.where(last, end[i], 0) - jnp.where(first, begin[i], 0)
    return total
