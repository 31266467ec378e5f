"""The target-driven actor-critic network (paper, Figure 2; section 5.3's siamese model).

    z(x)   = ReLU(Σ_j x_j W_j + b)                shared by current and target view; x_0, x_1, … are the last views,
                                                  the latest first, and for the target its one view repeated
    h      = ReLU(z(s) U + z(g) V + c)            fusion of the concatenation [z(s), z(g)]; with `comparison` of
                                                  [z(s), z(g), z(s)⊙z(g)], with `sees_reward` of r̂(s, g), too
    k      = ReLU(h H_i + d_i)                    layer of head i, one a room type or a scene
    logits = k P_i + p_i,   value = k q_i + r_i

Views are few and fixed, so what depends on single views is computed once per update as a table over all states
(`tabulate`): z(·)U where one view is seen, the products (·)W_j where several are; z(·)V over all targets always. A step
then costs a look-up for each view and the layers behind (`forward`). Where an update computes fewer views than there
are states, tables would cost more than they save, and every view goes through the shared layer. Acting and learning
see the same parameters, so the layers computed while acting serve the gradient too (`backward`); with `comparison` or
`sees_reward` they are computed again. Where an update has more frames than there are pairs of a state and a target,
`relm_irl_jax.agent.siamese.pairs` goes further. The plain formulation (`__call__`) is the same function, frame by
frame.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import cast

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32, Shaped

from relm_irl_jax.agent.learning import Parameters
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
    """

    n_heads: int
    width: int = 512
    history: int = 1
    comparison: bool = False
    sees_reward: bool = False

    def setup(self) -> None:
        """Declare the layers."""
        he = nn.initializers.he_normal()
        stacked = nn.initializers.variance_scaling(2.0, "fan_in", "truncated_normal", batch_axis=(0,))
        # Few outputs stand in rows: the gradient in them is then a few long rows, which is three times as fast.
        rows = partial(nn.initializers.variance_scaling, in_axis=-1, out_axis=-2, batch_axis=(0,))
        small, plain = rows(1e-4, "fan_in", "truncated_normal"), rows(2.0, "fan_in", "truncated_normal")
        zeros = nn.initializers.zeros
        self.shared = nn.Dense(self.width, kernel_init=he)
        self.fusion_state = nn.Dense(self.width)
        self.fusion_target = nn.Dense(self.width, use_bias=False)
        if self.comparison:
            self.fusion_product = nn.Dense(self.width, use_bias=False)
        if self.sees_reward:
            self.fusion_reward = self.param("fusion_reward", nn.initializers.normal(1.0), (self.width,))
        self.head_kernel = self.param("head_kernel", stacked, (self.n_heads, self.width, self.width))
        self.head_bias = self.param("head_bias", zeros, (self.n_heads, 1, self.width))
        self.policy_kernel = self.param("policy_kernel", small, (self.n_heads, len(ACTIONS), self.width))
        self.policy_bias = self.param("policy_bias", zeros, (self.n_heads, 1, len(ACTIONS)))
        self.value_kernel = self.param("value_kernel", plain, (self.n_heads, 1, self.width))
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


def tabulate(
    network: SiameseActorCritic,
    parameters: Parameters,
    features: Float32[Array, "states feature"],
    target_state: Int32[Array, "targets"],
    frames: int | None = None,
    predicted: Float32[Array, "targets states"] | None = None,
) -> Tables:
    """Apply `SiameseActorCritic.tables` where they cost less than encoding the views of all frames.

    Args:
        network: the network. Static.
        parameters: θ.
        features: encoded view of every state.
        target_state: state of every target.
        frames: frames for which these parameters serve; None for any number. Static.
        predicted: r̂(s, g), where the network sees it.

    Returns:
        The tables, which cover all states if these are no more than the frames.
    """
    every_state = frames is None or len(features) <= frames
    tables = cast(Tables, network.apply(parameters, features, target_state, every_state, method="tables"))
    return replace(tables, predicted=predicted) if network.sees_reward else tables


def forward(
    network: SiameseActorCritic,
    parameters: Parameters,
    tables: Tables,
    views: Int32[Array, "groups batch history"],
    target: Int32[Array, "groups batch"],
    head: Int32[Array, "groups"],
) -> Activations:
    """Look up the tables and compute the layers behind them.

    Args:
        network: the network. Static.
        parameters: θ.
        tables: what was computed in advance.
        views: last states in the world, the latest first.
        target: rows of the targets.
        head: head that serves each group.

    Returns:
        Policy, value and the layers below.
    """
    if tables.fusion is not None:
        current, half = None, tables.fusion[views[..., 0]]
    else:
        current = nn.relu(cast(Array, network.apply(parameters, tables, views, method="shared_layer")))
        half = cast(Array, network.apply(parameters, current, method="fusion_half"))
    half += tables.target[target]
    if tables.wanted is not None:
        current = tables.encoded[views[..., 0]] if tables.encoded is not None else current
        half += cast(Array, network.apply(parameters, current, tables.wanted[target], method="compare"))
        current = None
    if tables.predicted is not None:
        reward = jax.lax.stop_gradient(tables.predicted[target, views[..., 0]])
        half += cast(Array, network.apply(parameters, reward, method="weigh"))
    fused = nn.relu(half)
    hidden = nn.relu(cast(Array, network.apply(parameters, fused, head, method="head_layer")))
    logits, value = cast(tuple[Array, Array], network.apply(parameters, hidden, head, method="readout"))
    return Activations(current, fused, hidden, logits, value)


def backward(
    network: SiameseActorCritic,
    parameters: Parameters,
    tables: Tables,
    views: Int32[Array, "time groups batch history"],
    target: Int32[Array, "time groups batch"],
    head: Int32[Array, "groups"],
    activations: Activations,
    of_logits: Float32[Array, "time groups batch 4"],
    of_value: Float32[Array, "time groups batch"],
) -> tuple[Parameters, Tables]:
    """Gradient of a loss from its gradient in logits and values, without computing the forward pass again.

    The products that `jax.vjp` evaluates along the way have no reader, and the compiler drops them.

    Args:
        network: the network. Static.
        parameters: θ.
        tables: what was computed in advance.
        views: last states in the world, the latest first.
        target: rows of the targets.
        head: head that serves each group.
        activations: forward passes at these views and targets.
        of_logits: gradient of the loss in the logits.
        of_value: gradient of the loss in the values.

    Returns:
        Gradient in θ but through the tables, and gradient in the tables.
    """

    def pull(
        method: str, layer: Array, gradient: Array | tuple[Array, Array], *rest: Array
    ) -> tuple[Parameters, Array]:
        """Gradient in θ and in the layer, of which nothing passes where it is cut off at zero."""
        apply = lambda parameters, layer: network.apply(parameters, layer, *rest, method=method)  # noqa: E731
        _, transposed = jax.vjp(apply, parameters, layer)
        of_parameters, of_layer = transposed(gradient)
        return of_parameters, jnp.where(layer > 0, of_layer, 0)

    seen, of_logits, of_value, views, target = jax.tree.map(by_group, (activations, of_logits, of_value, views, target))
    if network.comparison or network.sees_reward:

        def outputs(parameters: Parameters, tables: Tables) -> tuple[Array, Array]:
            again = forward(network, parameters, tables, views, target, head)
            return again.logits, again.value

        return jax.vjp(outputs, parameters, tables)[1]((of_logits, of_value))
    of_readout, of_hidden = pull("readout", seen.hidden, (of_logits, of_value), head)
    of_layer, of_fused = pull("head_layer", seen.fused, of_hidden, head)
    gradient = jax.tree.map(jnp.add, of_readout, of_layer)
    of_target = jnp.zeros_like(tables.target).at[target].add(of_fused)
    if tables.fusion is not None:
        return gradient, Tables(jnp.zeros_like(tables.fusion).at[views[..., 0]].add(of_fused), None, None, of_target)
    of_half, of_current = pull("fusion_half", seen.current, of_fused)
    encode = lambda parameters, tables: network.apply(parameters, tables, views, method="shared_layer")  # noqa: E731
    _, transposed = jax.vjp(encode, parameters, tables)
    of_shared, of_tables = transposed(of_current)
    gradient = jax.tree.map(lambda *parts: sum(parts), gradient, of_half, of_shared)
    return gradient, replace(of_tables, target=of_target)


def by_group(x: Shaped[Array, "time groups batch *rest"]) -> Shaped[Array, "groups time*batch *rest"]:
    """Fold time into the batch, so that every group is one large product.

    Args:
        x: values of all workers over time.

    Returns:
        The same values, group by group.
    """
    time, groups, batch, *rest = x.shape
    return jnp.moveaxis(x, 0, 1).reshape(groups, time * batch, *rest)
