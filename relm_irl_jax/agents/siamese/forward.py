"""The network's forward pass for acting and its backward pass for learning, either by frames or by pairs.

Both variants compute the same function. *Frames*: each frame is evaluated when a worker reaches it, from tables of the
layers that depend on single views; learning evaluates all frames of the update again, in one batch, to differentiate
them. *Pairs*: many workers visit most pairs of a training target and a state of its scene in each update, often
repeatedly. If there are no more pairs than frames, all pairs are evaluated before the first step, in a few large matrix
products. Acting then looks up the logits, and the gradient with respect to logits and values is summed over the frames
of each pair before backpropagation. The cost of an update is then independent of its number of frames.
"""

from collections.abc import Callable
from typing import cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Int32

from relm_irl_jax.agents.siamese.network import Outputs, SiameseActorCritic, Tables
from relm_irl_jax.agents.siamese.state_target_pairs import StateTargetPairs
from relm_irl_jax.types import Parameters
from relm_irl_jax.world import Targets, World

Views = Int32[Array, "groups batch history"]
Target = Int32[Array, "groups batch"]

Forward = Callable[[Views, Target], Outputs]
"""Maps last states and targets of all workers to policy and value."""

Backward = Callable[[Int32[Array, "time groups batch history"], Int32[Array, "time groups batch"], Outputs], Parameters]
"""Maps views and targets of all steps, and the gradient of a loss with respect to their outputs, to the gradient with
respect to the parameters."""


def tabulate(
    network: SiameseActorCritic, parameters: Parameters, world: World, targets: Targets, frames: int | None = None
) -> Tables:
    """Compute the network's tables; over all states if there are no more states than frames.

    Args:
        network: the network. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        frames: number of frames that are evaluated with these parameters; None if unknown. Static.

    Returns:
        The tables.
    """
    every_state = frames is None or len(world.features) <= frames
    tables = network.apply(
        parameters,
        world.features,
        targets.state,
        targets.predicted_reward,
        every_state=every_state,
        method="tables",
    )
    return cast(Tables, tables)


def evaluate(
    network: SiameseActorCritic,
    parameters: Parameters,
    tables: Tables,
    views: Views,
    target: Target,
    head: Int32[Array, "groups"],
) -> Outputs:
    """Evaluate the network on frames.

    Args:
        network: the network. Static.
        parameters: θ.
        tables: tables that `tabulate` computed from the same θ.
        views: last states in the world, the latest first.
        target: rows of the targets.
        head: head of each group.

    Returns:
        Policy and value.
    """
    return cast(Outputs, network.apply(parameters, tables, views, target, head, method="evaluate"))


def evaluate_pairs(
    network: SiameseActorCritic, parameters: Parameters, world: World, targets: Targets, pairs: StateTargetPairs
) -> Outputs:
    """Evaluate the network on every pair of a state and a target.

    Args:
        network: the network; it observes one view. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        pairs: the pairs.

    Returns:
        Policy and value of each pair, in the order of `StateTargetPairs.index`.
    """
    tables = tabulate(network, parameters, world, targets)
    heads = [
        evaluate(network, parameters, tables, state[None, :, None], target[None], jnp.asarray([head], jnp.int32))
        for head, (state, target) in enumerate(zip(pairs.state, pairs.target, strict=True))
    ]
    return Outputs(
        logits=jnp.concatenate([outputs.logits[0] for outputs in heads]),
        value=jnp.concatenate([outputs.value[0] for outputs in heads]),
    )


def passes_by_frames(
    network: SiameseActorCritic, parameters: Parameters, world: World, targets: Targets, frames: int
) -> tuple[Forward, Backward]:
    """Forward and backward pass by frames, from tables over states and over targets.

    Args:
        network: the network. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        frames: frames of the update. Static.

    Returns:
        The forward pass, and the backward pass over all steps.
    """
    heads = jnp.arange(network.n_heads)
    tables, tables_vjp = jax.vjp(lambda theta: tabulate(network, theta, world, targets, frames), parameters)

    def forward(views: Views, target: Target) -> Outputs:
        return evaluate(network, parameters, tables, views, target, heads)

    def backward(views: Array, target: Array, grad_outputs: Outputs) -> Parameters:
        views, target, grad_outputs = jax.tree.map(_merge_time, (views, target, grad_outputs))
        _, vjp = jax.vjp(lambda theta, t: evaluate(network, theta, t, views, target, heads), parameters, tables)
        grad_parameters, grad_tables = vjp(grad_outputs)
        return jax.tree.map(jnp.add, grad_parameters, tables_vjp(grad_tables)[0])

    return forward, backward


def passes_by_pairs(
    network: SiameseActorCritic, parameters: Parameters, world: World, targets: Targets, pairs: StateTargetPairs
) -> tuple[Forward, Backward]:
    """Forward and backward pass by pairs: all pairs of a state and a target are evaluated in advance.

    Args:
        network: the network; it observes one view. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        pairs: the pairs.

    Returns:
        The forward pass, and the backward pass over all steps.
    """
    outputs, vjp = jax.vjp(lambda theta: evaluate_pairs(network, theta, world, targets, pairs), parameters)

    def forward(views: Views, target: Target) -> Outputs:
        index = pairs.index(world, views[..., 0], target)
        return Outputs(outputs.logits[index], outputs.value[index])

    def backward(views: Array, target: Array, grad_outputs: Outputs) -> Parameters:
        index = pairs.index(world, views[..., 0], target)
        grad_pairs = jax.tree.map(lambda out, grad: jnp.zeros_like(out).at[index].add(grad), outputs, grad_outputs)
        return vjp(grad_pairs)[0]

    return forward, backward


def _merge_time(x: Array) -> Array:
    """Merge time into the batch, [time groups batch …] → [groups time·batch …], for one large product per group."""
    time, groups, batch, *rest = x.shape
    return jnp.moveaxis(x, 0, 1).reshape(groups, time * batch, *rest)
