"""The target-driven actor-critic network (paper, Figure 2; the siamese model of section 5.3).

    z(x)   = ReLU(Σ_j x_j W_j + b)           shared by current and target view; x_0, x_1, … are the last views, the
                                             latest first; for the target, its view is repeated
    h      = ReLU(z(s) U + z(g) V + c)       fusion of the concatenation [z(s), z(g)]; optionally also of r(s, g)
    k      = ReLU(h H_i + d_i)               layer of head i, one for each room type or scene
    logits = k P_i + p_i,   value = k q_i + r_i

There are few distinct views. Layers that depend on single views are therefore computed once for each update, as tables
over all states and all targets (`tables`); the layers that combine view and target look these up (`evaluate`). If an
update has fewer frames than there are states, tables over all states would take more time than they save; the shared
layer is then applied to the views of each frame.
"""

from dataclasses import dataclass
from functools import partial

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.scenes.scene import ACTIONS
from relm_irl_jax.types import Parameters

DISTANCE = 2.0
"""Size of the initial values, in units of the return scale, if they are distances."""

DISTANCE_NOISE = 0.1
"""Size of the random part of a head's first layer then, relative to He's distribution."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Tables:
    """Tables that are computed once for each update; exactly one of the first three is present.

    Attributes:
        fusion: z(s) U + c for every state, if one view is observed.
        shared: x W_j for every state and each of the last views, if several views are observed.
        features: encoded views, if there are no tables over states.
        target: z(g) V for every target.
        predicted_reward: r(s, g), if it is observed.
    """

    fusion: Float32[Array, "states width"] | None
    shared: Float32[Array, "history states width"] | None
    features: Float32[Array, "states feature"] | None
    target: Float32[Array, "targets width"]
    predicted_reward: Float32[Array, "targets states"] | None = None


class SiameseActorCritic(nn.Module):
    """Policy and value of every head.

    Attributes:
        n_heads: number of heads.
        width: units of each hidden layer.
        history: number of last views that are observed.
        observe_reward: whether the fusion layer also receives the predicted reward r(s, g).
        uniform: whether initial weights are uniform on ±1/√inputs, as in the original agent, instead of He's normal
            distribution with small weights for the policy.
        distance: whether initial values are negative distances between z(s) U and z(g) U; see `as_distance`.
    """

    n_heads: int
    width: int = 512
    history: int = 1
    observe_reward: bool = False
    uniform: bool = False
    distance: bool = False

    def setup(self) -> None:
        """Declare the layers."""
        draw = partial(nn.initializers.variance_scaling, batch_axis=(0,))
        # Kernels with few outputs have these as rows, which makes the gradient three times as fast.
        draw_rows = partial(draw, in_axis=-1, out_axis=-2)
        if self.uniform:
            # Variance of the uniform distribution on ±1/√inputs; each half of the fusion layer has half the inputs.
            distribution = (1 / 3, "fan_in", "uniform")
            layer, policy, value = draw(*distribution), draw_rows(*distribution), draw_rows(*distribution)
            shared, half = (
                nn.initializers.variance_scaling(*distribution),
                nn.initializers.variance_scaling(1 / 6, *distribution[1:]),
            )
        else:
            distribution = (2.0, "fan_in", "truncated_normal")
            layer, policy, value = draw(*distribution), draw_rows(1e-4, *distribution[1:]), draw_rows(*distribution)
            shared, half = nn.initializers.he_normal(), nn.initializers.lecun_normal()
        zeros = nn.initializers.zeros
        self.shared = nn.Dense(self.width, kernel_init=shared)
        self.fusion_state = nn.Dense(self.width, kernel_init=half)
        self.fusion_target = nn.Dense(self.width, use_bias=False, kernel_init=half)
        if self.observe_reward:
            self.fusion_reward = self.param("fusion_reward", nn.initializers.normal(1.0), (self.width,))
        self.head_kernel = self.param("head_kernel", layer, (self.n_heads, self.width, self.width))
        self.head_bias = self.param("head_bias", zeros, (self.n_heads, 1, self.width))
        self.policy_kernel = self.param("policy_kernel", policy, (self.n_heads, len(ACTIONS), self.width))
        self.policy_bias = self.param("policy_bias", zeros, (self.n_heads, 1, len(ACTIONS)))
        self.value_kernel = self.param("value_kernel", value, (self.n_heads, 1, self.width))
        self.value_bias = self.param("value_bias", zeros, (self.n_heads, 1, 1))

    def __call__(
        self,
        features: Float32[Array, "states feature"],
        target_state: Int32[Array, "targets"],
        views: Int32[Array, "groups batch history"],
        target: Int32[Array, "groups batch"],
        head: Int32[Array, "groups"],
        predicted_reward: Float32[Array, "targets states"] | None = None,
    ) -> Outputs:
        """Policy and value of frames, without tables over states.

        Args:
            features: encoded view of every state.
            target_state: state of every target.
            views: last states in the world, the latest first.
            target: rows of the targets.
            head: head of each group.
            predicted_reward: r(s, g), if it is observed.

        Returns:
            Action logits and values.
        """
        tables = self.tables(features, target_state, predicted_reward, every_state=False)
        return self.evaluate(tables, views, target, head)

    def tables(
        self,
        features: Float32[Array, "states feature"],
        target_state: Int32[Array, "targets"],
        predicted_reward: Float32[Array, "targets states"] | None = None,
        *,
        every_state: bool,
    ) -> Tables:
        """Compute the shared layer and both halves of the fusion layer for single views.

        Args:
            features: encoded view of every state.
            target_state: state of every target.
            predicted_reward: r(s, g), if it is observed.
            every_state: whether to compute tables over all states, or only over targets. Static.

        Returns:
            The tables.
        """
        predicted_reward = predicted_reward if self.observe_reward else None
        if every_state and self.history == 1:
            encoded = nn.relu(self.shared(features))
            target = self.fusion_target(encoded[target_state])
            return Tables(self.fusion_state(encoded), None, None, target, predicted_reward)
        repeated = jnp.tile(features[target_state], self.history)
        target = self.fusion_target(nn.relu(self.shared(repeated)))
        if not every_state:
            return Tables(None, None, features, target, predicted_reward)
        kernel = self.shared.variables["params"]["kernel"].reshape(self.history, -1, self.width)
        return Tables(None, jnp.einsum("sf,hfw->hsw", features, kernel), None, target, predicted_reward)

    def evaluate(
        self,
        tables: Tables,
        views: Int32[Array, "groups batch history"],
        target: Int32[Array, "groups batch"],
        head: Int32[Array, "groups"],
    ) -> Outputs:
        """Policy and value of frames, from the tables.

        Args:
            tables: the tables.
            views: last states in the world, the latest first.
            target: rows of the targets.
            head: head of each group.

        Returns:
            Action logits and values.
        """
        return self.combine(tables, self.state_part(tables, views), views, target, head)

    def state_part(
        self, tables: Tables, views: Int32[Array, "groups batch history"]
    ) -> Float32[Array, "groups batch width"]:
        """The layers that depend only on the views, up to the first non-linearity that is not in a table.

        The result is linear in the parameters and in the tables, so that its gradient needs no forward pass.

        Args:
            tables: the tables.
            views: last states in the world, the latest first.

        Returns:
            z(s) U + c if there is a table of it; otherwise the shared layer before its ReLU.
        """
        if tables.fusion is not None:
            return tables.fusion[views[..., 0]]
        if tables.shared is not None:
            bias = self.shared.variables["params"]["bias"]
            return sum((tables.shared[j][views[..., j]] for j in range(self.history)), bias)
        assert tables.features is not None
        return self.shared(tables.features[views].reshape(*views.shape[:-1], -1))

    def combine(
        self,
        tables: Tables,
        state_part: Float32[Array, "groups batch width"],
        views: Int32[Array, "groups batch history"],
        target: Int32[Array, "groups batch"],
        head: Int32[Array, "groups"],
    ) -> Outputs:
        """Policy and value from the layers that depend only on the views, the target and the head.

        Args:
            tables: the tables.
            state_part: the result of `state_part`.
            views: last states in the world, the latest first.
            target: rows of the targets.
            head: head of each group.

        Returns:
            Action logits and values.
        """
        half = state_part if tables.fusion is not None else self.fusion_state(nn.relu(state_part))
        fusion = half + tables.target[target]
        if tables.predicted_reward is not None:
            fusion += tables.predicted_reward[target, views[..., 0]][..., None] * self.fusion_reward
        return self._outputs(nn.relu(fusion), head)

    def every_pair(
        self, state_part: Float32[Array, "states width"], target_part: Float32[Array, "states targets width"], head: int
    ) -> Outputs:
        """Policy and value of every state with each of its targets.

        Args:
            state_part: rows of `Tables.fusion`.
            target_part: rows of `Tables.target` for each state.
            head: head of the states' scenes. Static.

        Returns:
            Action logits and values; the pairs of a state are consecutive.
        """
        fusion = nn.relu(state_part[:, None] + target_part)
        outputs = self._outputs(fusion.reshape(1, -1, self.width), jnp.asarray([head], jnp.int32))
        return Outputs(outputs.logits[0], outputs.value[0])

    def _outputs(self, fusion: Float32[Array, "groups batch width"], head: Int32[Array, "groups"]) -> Outputs:
        """The heads."""
        hidden = nn.relu(fusion @ self.head_kernel[head] + self.head_bias[head])
        project = partial(jnp.einsum, "gbw,gow->gbo", hidden)
        logits = project(self.policy_kernel[head]) + self.policy_bias[head]
        value = project(self.value_kernel[head]) + self.value_bias[head]
        return Outputs(logits, value[..., 0])


def as_distance(parameters: Parameters) -> Parameters:
    """Initial weights that make values negative distances.

        V = −U,   H = I + noise,   q = −DISTANCE / width:   value ≈ −DISTANCE · mean ReLU((z(s) − z(g)) U)

    The order of views by their distance to a target is then learned by moving their embeddings, which all targets
    share. From random weights the network must first find out that two views are to be compared.

    Args:
        parameters: He's initial weights.

    Returns:
        The weights.
    """
    layers = dict(parameters["params"])
    noise = layers["head_kernel"]
    layers["fusion_target"] = {"kernel": -layers["fusion_state"]["kernel"]}
    layers["head_kernel"] = jnp.eye(noise.shape[-1]) + DISTANCE_NOISE * noise
    layers["value_kernel"] = jnp.full_like(layers["value_kernel"], -DISTANCE / noise.shape[-1])
    return {"params": layers}
