"""The network's forward pass for acting and its backward pass for learning, either by frames or by pairs.

Both variants compute the same function. *Frames*: each frame is evaluated when a worker reaches it, from tables of the
layers that depend on single views. Learning reuses the stored result of the expensive layers, which depend only on the
views, and evaluates the layers after them again, for all frames in one batch, to differentiate them. *Pairs*: many
workers visit most pairs of a training target and a state of its scene in each update, often repeatedly. If there are no
more pairs than frames, all pairs are evaluated before the first step, in a few large matrix products. Acting then looks
up the logits, and the gradient with respect to logits and values is summed over the frames of each pair before
backpropagation. The cost of an update is then independent of its number of frames.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.agents.siamese.network import SiameseActorCritic, Tables
from relm_irl_jax.agents.siamese.state_target_pairs import StateTargetPairs
from relm_irl_jax.types import Parameters
from relm_irl_jax.world import Targets, World

Views = Int32[Array, "groups batch history"]
Target = Int32[Array, "groups batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Evaluation:
    """Frames and their evaluation.

    Attributes:
        outputs: policy and value.
        views: states whose views were observed, the latest first.
        target: rows of the targets.
        state_part: result of the layers that depend only on the views; see `SiameseActorCritic.state_part`. None if
            pairs are evaluated.
    """

    outputs: Outputs
    views: Int32[Array, "*time groups batch history"]
    target: Int32[Array, "*time groups batch"]
    state_part: Float32[Array, "*time groups batch width"] | None


Forward = Callable[[Views, Target], Evaluation]
"""Evaluates the network on the last states and the targets of all workers."""

Backward = Callable[[Evaluation, Outputs], Parameters]
"""Maps all evaluated steps, and the gradient of a loss with respect to their outputs, to the gradient with respect to
the parameters."""


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

    def state_part(theta: Parameters, tables: Tables, views: Array) -> Array:
        return cast(Array, network.apply(theta, tables, views, method="state_part"))

    def combine(theta: Parameters, tables: Tables, part: Array, views: Array, target: Array) -> Outputs:
        return cast(Outputs, network.apply(theta, tables, part, views, target, heads, method="combine"))

    def forward(views: Views, target: Target) -> Evaluation:
        part = state_part(parameters, tables, views)
        return Evaluation(combine(parameters, tables, part, views, target), views, target, part)

    def backward(steps: Evaluation, grad_outputs: Outputs) -> Parameters:
        views, target, part = (_merge_time(x) for x in (steps.views, steps.target, steps.state_part))
        grad_outputs = Outputs(_merge_time(grad_outputs.logits), _merge_time(grad_outputs.value))
        _, vjp = jax.vjp(lambda theta, t, p: combine(theta, t, p, views, target), parameters, tables, part)
        grad_combined, grad_tables, grad_part = vjp(grad_outputs)
        # `state_part` is linear, so nothing uses the forward pass of this jax.vjp, and the compiler removes it.
        _, vjp = jax.vjp(lambda theta, t: state_part(theta, t, views), parameters, tables)
        grad_state_part, more_grad_tables = vjp(grad_part)
        grad_tabulated = tables_vjp(jax.tree.map(jnp.add, grad_tables, more_grad_tables))[0]
        return jax.tree.map(lambda *parts: sum(parts), grad_combined, grad_state_part, grad_tabulated)

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

    def forward(views: Views, target: Target) -> Evaluation:
        index = pairs.index(world, views[..., 0], target)
        return Evaluation(Outputs(outputs.logits[index], outputs.value[index]), views, target, None)

    def backward(steps: Evaluation, grad_outputs: Outputs) -> Parameters:
        index = pairs.index(world, steps.views[..., 0], steps.target)
        grad_pairs = jax.tree.map(lambda out, grad: jnp.zeros_like(out).at[index].add(grad), outputs, grad_outputs)
        return vjp(grad_pairs)[0]

    return forward, backward


def _merge_time(x: Array | None) -> Array:
    """Merge time into the batch, [time groups batch …] → [groups time·batch …], for one large product per group."""
    assert x is not None
    time, groups, batch, *rest = x.shape
    return jnp.moveaxis(x, 0, 1).reshape(groups, time * batch, *rest)
