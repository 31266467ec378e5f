"""The target-driven actor-critic network (paper, Figure 2; section 5.3's siamese model).

    z(x)   = ReLU(x W + b)                        shared by the current view and the target view
    h      = ReLU(z(s) U + z(g) V + c)            fusion of the concatenation [z(s), z(g)]
    k      = ReLU(h H_i + d_i)                    layer of head i, one a room type
    logits = k P_i + p_i,   value = k q_i + r_i

Views are few and fixed, so z(·)U and z(·)V are computed once per update as tables over all states and all targets
(`fusion_tables`); a step then costs one look-up, one addition and the head (`forward`). Acting and learning see the
same parameters, so the layers computed while acting serve the gradient too (`backward`). The plain formulation
(`__call__`) is the same function, frame by frame.
"""

from dataclasses import dataclass
from typing import cast

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32, Shaped

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.scenes.scene import ACTIONS


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class FusionTables:
    """Both halves of the fusion layer before its non-linearity.

    Attributes:
        state: z(s) U + c for every state of the world.
        target: z(g) V for every target.
    """

    state: Float32[Array, "states width"]
    target: Float32[Array, "targets width"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Activations:
    """A forward pass, with what its backward pass needs.

    Attributes:
        fused: fusion layer.
        hidden: layer of the head.
        logits: action logits.
        value: values.
    """

    fused: Float32[Array, "*steps groups batch width"]
    hidden: Float32[Array, "*steps groups batch width"]
    logits: Float32[Array, "*steps groups batch 4"]
    value: Float32[Array, "*steps groups batch"]


class SiameseActorCritic(nn.Module):
    """Policy and value of every head.

    Attributes:
        n_heads: number of heads.
        width: units of each hidden layer.
    """

    n_heads: int
    width: int = 512

    def setup(self) -> None:
        """Declare the layers."""
        he = nn.initializers.he_normal()
        stacked = nn.initializers.variance_scaling(2.0, "fan_in", "truncated_normal", batch_axis=(0,))
        small = nn.initializers.variance_scaling(1e-4, "fan_in", "truncated_normal", batch_axis=(0,))
        zeros = nn.initializers.zeros
        self.shared = nn.Dense(self.width, kernel_init=he)
        self.fusion_state = nn.Dense(self.width)
        self.fusion_target = nn.Dense(self.width, use_bias=False)
        self.head_kernel = self.param("head_kernel", stacked, (self.n_heads, self.width, self.width))
        self.head_bias = self.param("head_bias", zeros, (self.n_heads, 1, self.width))
        self.policy_kernel = self.param("policy_kernel", small, (self.n_heads, self.width, len(ACTIONS)))
        self.policy_bias = self.param("policy_bias", zeros, (self.n_heads, 1, len(ACTIONS)))
        self.value_kernel = self.param("value_kernel", stacked, (self.n_heads, self.width, 1))
        self.value_bias = self.param("value_bias", zeros, (self.n_heads, 1, 1))

    def fusion_tables(
        self, features: Float32[Array, "states feature"], target_state: Int32[Array, "targets"]
    ) -> FusionTables:
        """Tabulate the shared layer and both halves of the fusion layer.

        Args:
            features: encoded view of every state.
            target_state: state of every target.

        Returns:
            The tables.
        """
        shared = nn.relu(self.shared(features))
        return FusionTables(self.fusion_state(shared), self.fusion_target(shared[target_state]))

    def head_layer(
        self, fused: Float32[Array, "groups batch width"], head: Int32[Array, "groups"]
    ) -> Float32[Array, "groups batch width"]:
        """Layer of the heads before its non-linearity, as one batched product over groups.

        Args:
            fused: fusion layer.
            head: head that serves each group.

        Returns:
            The pre-activations.
        """
        return fused @ self.head_kernel[head] + self.head_bias[head]

    def readout(
        self, hidden: Float32[Array, "groups batch width"], head: Int32[Array, "groups"]
    ) -> tuple[Float32[Array, "groups batch 4"], Float32[Array, "groups batch"]]:
        """Policy and value from the layer of the heads.

        Args:
            hidden: layer of the head.
            head: head that serves each group.

        Returns:
            Action logits and values.
        """
        logits = hidden @ self.policy_kernel[head] + self.policy_bias[head]
        value = hidden @ self.value_kernel[head] + self.value_bias[head]
        return logits, value[..., 0]

    def __call__(
        self,
        view: Float32[Array, "groups batch feature"],
        target: Float32[Array, "groups batch feature"],
        head: Int32[Array, "groups"],
    ) -> tuple[Float32[Array, "groups batch 4"], Float32[Array, "groups batch"]]:
        """Policy and value, every frame through the whole network.

        Args:
            view: encoded current views.
            target: encoded target views.
            head: head that serves each group.

        Returns:
            Action logits and values.
        """
        current, wanted = nn.relu(self.shared(view)), nn.relu(self.shared(target))
        fused = nn.relu(self.fusion_state(current) + self.fusion_target(wanted))
        return self.readout(nn.relu(self.head_layer(fused, head)), head)


def tabulate(
    network: SiameseActorCritic,
    parameters: Parameters,
    features: Float32[Array, "states feature"],
    target_state: Int32[Array, "targets"],
) -> FusionTables:
    """Apply `SiameseActorCritic.fusion_tables`.

    Args:
        network: the network. Static.
        parameters: θ.
        features: encoded view of every state.
        target_state: state of every target.

    Returns:
        The tables.
    """
    return cast(FusionTables, network.apply(parameters, features, target_state, method="fusion_tables"))


def forward(
    network: SiameseActorCritic,
    parameters: Parameters,
    tables: FusionTables,
    state: Int32[Array, "groups batch"],
    target: Int32[Array, "groups batch"],
    head: Int32[Array, "groups"],
) -> Activations:
    """Look up the tables and compute the heads.

    Args:
        network: the network. Static.
        parameters: θ.
        tables: both halves of the fusion layer.
        state: states in the world.
        target: rows of the targets.
        head: head that serves each group.

    Returns:
        Policy, value and the layers below.
    """
    fused = nn.relu(tables.state[state] + tables.target[target])
    hidden = nn.relu(cast(Array, network.apply(parameters, fused, head, method="head_layer")))
    logits, value = cast(tuple[Array, Array], network.apply(parameters, hidden, head, method="readout"))
    return Activations(fused, hidden, logits, value)


def backward(
    network: SiameseActorCritic,
    parameters: Parameters,
    tables: FusionTables,
    state: Int32[Array, "time groups batch"],
    target: Int32[Array, "time groups batch"],
    head: Int32[Array, "groups"],
    activations: Activations,
    of_logits: Float32[Array, "time groups batch 4"],
    of_value: Float32[Array, "time groups batch"],
) -> tuple[Parameters, FusionTables]:
    """Gradient of a loss from its gradient in logits and values, without computing the forward pass again.

    The products that `jax.vjp` evaluates along the way have no reader, and the compiler drops them.

    Args:
        network: the network. Static.
        parameters: θ.
        tables: both halves of the fusion layer.
        state: states in the world.
        target: rows of the targets.
        head: head that serves each group.
        activations: forward passes at these states and targets.
        of_logits: gradient of the loss in the logits.
        of_value: gradient of the loss in the values.

    Returns:
        Gradient in θ but through the tables, and gradient in the tables.
    """

    def pull(method: str, layer: Array, gradient: Array | tuple[Array, Array]) -> tuple[Parameters, Array]:
        """Gradient in θ and in the layer, of which nothing passes where it is cut off at zero."""
        apply = lambda parameters, layer: network.apply(parameters, layer, head, method=method)  # noqa: E731
        _, transposed = jax.vjp(apply, parameters, layer)
        of_parameters, of_layer = transposed(gradient)
        return of_parameters, jnp.where(layer > 0, of_layer, 0)

    fused, hidden, of_logits, of_value, state, target = (
        by_group(x) for x in (activations.fused, activations.hidden, of_logits, of_value, state, target)
    )
    of_readout, of_hidden = pull("readout", hidden, (of_logits, of_value))
    of_layer, of_fused = pull("head_layer", fused, of_hidden)
    of_tables = FusionTables(
        state=jnp.zeros_like(tables.state).at[state].add(of_fused),
        target=jnp.zeros_like(tables.target).at[target].add(of_fused),
    )
    return jax.tree.map(jnp.add, of_readout, of_layer), of_tables


def by_group(x: Shaped[Array, "time groups batch *rest"]) -> Shaped[Array, "groups time*batch *rest"]:
    """Fold time into the batch, so that every group is one large product.

    Args:
        x: values of all workers over time.

    Returns:
        The same values, group by group.
    """
    time, groups, batch, *rest = x.shape
    return jnp.moveaxis(x, 0, 1).reshape(groups, time * batch, *rest)
