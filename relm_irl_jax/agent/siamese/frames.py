"""The network behind tables: what acting computes for a frame, and what learning computes from it.

Views are few and fixed, so what depends on single views is computed once per update as a table over all states
(`tabulate`): z(·)U where one view is seen, the products (·)W_j where several are; z(·)V over all targets always. A step
then costs a look-up for each view and the layers behind (`forward`). Where an update computes fewer views than there
are states, tables would cost more than they save, and every view goes through the shared layer. Acting and learning
see the same parameters, so the layers computed while acting serve the gradient too (`backward`); with `comparison` or
`sees_reward` they are computed again.
"""

from dataclasses import replace
from typing import cast

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32, Shaped

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.agent.siamese.network import Activations, SiameseActorCritic, Tables


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
