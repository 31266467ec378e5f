"""The target-driven actor-critic network (paper, Figure 2; section 5.3's siamese model).

    z(x)   = ReLU(Σ_j x_j W_j + b)                shared by current and target view; x_0, x_1, … are the last views,
                                                  the latest first, and for the target its one view repeated
    h      = ReLU(z(s) U + z(g) V + c)            fusion of the concatenation [z(s), z(g)]; with `comparison` of
                                                  [z(s), z(g), z(s)⊙z(g)], with `sees_reward` of r̂(s, g), too
    k      = ReLU(h H_i + d_i)                    layer of head i, one a room type or a scene
    logits = k P_i + p_i,   value = k q_i + r_i

The plain formulation (`__call__`) computes that frame by frame. Views are few and fixed, and acting and learning use it
in cheaper forms that are the same function: see `relm_irl_jax.agent.siamese.passes`.
"""

from dataclasses import dataclass
from functools import partial

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.scenes.scene import ACTIONS


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Tables:
    """What is computed once per update. One of the first three is there, and says how views are encoded.

    Attributes:
        fusion: z(s) U + c for every state, where one view is seen.
        shared: x W_j for every state and each of the last views.
        features: encoded views, of which nothing is computed in advance.
        target: z(g) V for every target.
        encoded: z(s) for every state, where one view is seen and compared.
        wanted: z(g) for every target, where views are compared.
        predicted: r̂(s, g), where the network sees it.
    """

    fusion: Float32[Array, "states width"] | None
    shared: Float32[Array, "history states width"] | None
    features: Float32[Array, "states feature"] | None
    target: Float32[Array, "targets width"]
    encoded: Float32[Array, "states width"] | None = None
    wanted: Float32[Array, "targets width"] | None = None
    predicted: Float32[Array, "targets states"] | None = None


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Activations:
    """A forward pass, with what its backward pass needs.

    Attributes:
        current: z(s); None where the gradient does not need it.
        fused: fusion layer.
        hidden: layer of the head.
        logits: action logits.
        value: values.
    """

    current: Float32[Array, "*steps groups batch width"] | None
    fused: Float32[Array, "*steps groups batch width"]
    hidden: Float32[Array, "*steps groups batch width"]
    logits: Float32[Array, "*steps groups batch 4"]
    value: Float32[Array, "*steps groups batch"]


class SiameseActorCritic(nn.Module):
    """Policy and value of every head.

    Attributes:
        n_heads: number of heads.
        width: units of each hidden layer.
        history: number of last views that are seen.
        comparison: whether the fusion layer sees the product z(s)⊙z(g), too.
        sees_reward: whether it sees the predicted reward r̂(s, g), too.
        uniform: whether weights are drawn uniformly from ±1/√inputs, as the original agent's, instead of He's normal
            ones with small ones for the policy.
    """

    n_heads: int
    width: int = 512
    history: int = 1
    comparison: bool = False
    sees_reward: bool = False
    uniform: bool = False

    def setup(self) -> None:
        """Declare the layers."""
        drawn = partial(nn.initializers.variance_scaling, batch_axis=(0,))
        # Few outputs stand in rows: the gradient in them is then a few long rows, which is three times as fast.
        rows = partial(drawn, in_axis=-1, out_axis=-2)
        if self.uniform:
            # Variance of the uniform distribution on ±1/√inputs; a part of the fusion layer has a share of the inputs.
            law = (1 / 3, "fan_in", "uniform")
            layer, policy, value = drawn(*law), rows(*law), rows(*law)
            shared = nn.initializers.variance_scaling(*law)
            part = nn.initializers.variance_scaling(1 / (3 * (2 + self.comparison)), *law[1:])
        else:
            law = (2.0, "fan_in", "truncated_normal")
            layer, policy, value = drawn(*law), rows(1e-4, *law[1:]), rows(*law)
            shared, part = nn.initializers.he_normal(), nn.initializers.lecun_normal()
        zeros = nn.initializers.zeros
        self.shared = nn.Dense(self.width, kernel_init=shared)
        self.fusion_state = nn.Dense(self.width, kernel_init=part)
        self.fusion_target = nn.Dense(self.width, use_bias=False, kernel_init=part)
        if self.comparison:
            self.fusion_product = nn.Dense(self.width, use_bias=False, kernel_init=part)
        if self.sees_reward:
            self.fusion_reward = self.param("fusion_reward", nn.initializers.normal(1.0), (self.width,))
        self.head_kernel = self.param("head_kernel", layer, (self.n_heads, self.width, self.width))
        self.head_bias = self.param("head_bias", zeros, (self.n_heads, 1, self.width))
        self.policy_kernel = self.param("policy_kernel", policy, (self.n_heads, len(ACTIONS), self.width))
        self.policy_bias = self.param("policy_bias", zeros, (self.n_heads, 1, len(ACTIONS)))
        self.value_kernel = self.param("value_kernel", value, (self.n_heads, 1, self.width))
        self.value_bias = self.param("value_bias", zeros, (self.n_heads, 1, 1))

    def tables(
        self, features: Float32[Array, "states feature"], target_state: Int32[Array, "targets"], every_state: bool
    ) -> Tables:
        """Tabulate the shared layer and both halves of the fusion layer, as far as they depend on single views.

        Args:
            features: encoded view of every state.
            target_state: state of every target.
            every_state: whether to compute anything but the targets in advance. Static.

        Returns:
            The tables.
        """
        if every_state and self.history == 1:
            encoded = nn.relu(self.shared(features))
            wanted = encoded[target_state]
            compared = (encoded, wanted) if self.comparison else (None, None)
            return Tables(self.fusion_state(encoded), None, None, self.fusion_target(wanted), *compared)
        wanted = self.still(features[target_state])
        target, compared = self.fusion_target(wanted), wanted if self.comparison else None
        if not every_state:
            return Tables(None, None, features, target, wanted=compared)
        kernel = self.shared.variables["params"]["kernel"].reshape(self.history, -1, self.width)
        return Tables(None, jnp.einsum("sf,hfw->hsw", features, kernel), None, target, wanted=compared)

    def still(self, view: Float32[Array, "*batch feature"]) -> Float32[Array, "*batch width"]:
        """Encode a view that was all there was to see.

        Args:
            view: encoded views.

        Returns:
            z.
        """
        return nn.relu(self.shared(jnp.tile(view, self.history)))

    def shared_layer(
        self, tables: Tables, views: Int32[Array, "groups batch history"]
    ) -> Float32[Array, "groups batch width"]:
        """Shared layer before its non-linearity, from tables that leave it to be computed.

        Args:
            tables: products with its weights, or the features.
            views: last states, the latest first.

        Returns:
            The pre-activations.
        """
        if tables.shared is not None:
            bias = self.shared.variables["params"]["bias"]
            return sum((tables.shared[j][views[..., j]] for j in range(self.history)), bias)
        assert tables.features is not None
        return self.shared(tables.features[views].reshape(*views.shape[:-1], -1))

    def fusion_half(self, current: Float32[Array, "groups batch width"]) -> Float32[Array, "groups batch width"]:
        """The current view's half of the fusion layer, z(s) U + c.

        Args:
            current: z(s).

        Returns:
            The half, before the non-linearity.
        """
        return self.fusion_state(current)

    def compare(
        self, current: Float32[Array, "groups batch width"], wanted: Float32[Array, "groups batch width"]
    ) -> Float32[Array, "groups batch width"]:
        """The product's part of the fusion layer.

        Args:
            current: z(s).
            wanted: z(g).

        Returns:
            The part, before the non-linearity.
        """
        return self.fusion_product(current * wanted)

    def weigh(self, predicted: Float32[Array, "groups batch"]) -> Float32[Array, "groups batch width"]:
        """The predicted reward's part of the fusion layer.

        Args:
            predicted: r̂(s, g).

        Returns:
            The part, before the non-linearity.
        """
        return predicted[..., None] * self.fusion_reward

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
        onto = partial(jnp.einsum, "gbw,gow->gbo", hidden)
        logits = onto(self.policy_kernel[head]) + self.policy_bias[head]
        value = onto(self.value_kernel[head]) + self.value_bias[head]
        return logits, value[..., 0]

    def __call__(
        self,
        view: Float32[Array, "groups batch history feature"],
        target: Float32[Array, "groups batch feature"],
        head: Int32[Array, "groups"],
        predicted: Float32[Array, "groups batch"] | None = None,
    ) -> tuple[Float32[Array, "groups batch 4"], Float32[Array, "groups batch"]]:
        """Policy and value, every frame through the whole network.

        Args:
            view: encoded last views, the latest first.
            target: encoded target views.
            head: head that serves each group.
            predicted: r̂(s, g), where the network sees it.

        Returns:
            Action logits and values.
        """
        current, wanted = nn.relu(self.shared(view.reshape(*target.shape[:-1], -1))), self.still(target)
        fused = self.fusion_state(current) + self.fusion_target(wanted)
        if self.comparison:
            fused += self.compare(current, wanted)
        if self.sees_reward:
            assert predicted is not None
            fused += self.weigh(predicted)
        return self.readout(nn.relu(self.head_layer(nn.relu(fused), head)), head)
