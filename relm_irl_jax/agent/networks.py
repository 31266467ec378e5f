"""The target-driven actor-critic network (paper, Figure 2; section 5.3's siamese model).

    z(x)   = ReLU(x W + b)                        shared by the current view and the target view
    h      = ReLU(z(s) U + z(g) V + c)            fusion of the concatenation [z(s), z(g)]
    k      = ReLU(h H_i + d_i)                    layer of head i, one a room type
    logits = k P_i + p_i,   value = k q_i + r_i

Views are few and fixed, so z(·)U and z(·)V are computed once per update as tables over all states and all targets
(`fusion_tables`); a step then costs one look-up, one addition and the head (`heads`). The plain formulation
(`__call__`) is the same function, frame by frame.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import flax.linen as nn
import jax
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.scenes.scene import ACTIONS

Parameters = Mapping[str, Mapping[str, Any]]
"""The network's parameters θ: nested dictionaries of arrays."""


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

    def heads(
        self, fusion: Float32[Array, "groups batch width"], head: Int32[Array, "groups"]
    ) -> tuple[Float32[Array, "groups batch 4"], Float32[Array, "groups batch"]]:
        """Policy and value from the fusion layer's pre-activation, as one batched product over groups.

        Args:
            fusion: sum of both halves of the fusion layer.
            head: head that serves each group.

        Returns:
            Action logits and values.
        """
        hidden = nn.relu(fusion)
        hidden = nn.relu(hidden @ self.head_kernel[head] + self.head_bias[head])
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
        return self.heads(self.fusion_state(current) + self.fusion_target(wanted), head)


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


def policy_and_value(
    network: SiameseActorCritic,
    parameters: Parameters,
    tables: FusionTables,
    state: Int32[Array, "groups batch"],
    target: Int32[Array, "groups batch"],
    head: Int32[Array, "groups"],
) -> tuple[Float32[Array, "groups batch 4"], Float32[Array, "groups batch"]]:
    """Look up the tables and apply `SiameseActorCritic.heads`.

    Args:
        network: the network. Static.
        parameters: θ.
        tables: both halves of the fusion layer.
        state: states in the world.
        target: rows of the targets.
        head: head that serves each group.

    Returns:
        Action logits and values.
    """
    fusion = tables.state[state] + tables.target[target]
    return cast(tuple[Array, Array], network.apply(parameters, fusion, head, method="heads"))
