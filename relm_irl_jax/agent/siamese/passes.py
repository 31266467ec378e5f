"""The network's forward pass for acting, and its backward pass for learning, in one of two ways.

Both give the same numbers. *Through frames*, every frame is computed when a worker meets it, behind tables of what
depends on single views, and its layers are kept for the gradient. *Through pairs*, every pair of a state and a target
is computed before the first step, and frames are looked up.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.agent.rollout import Experience
from relm_irl_jax.agent.siamese.frames import backward, forward, tabulate
from relm_irl_jax.agent.siamese.network import Activations, SiameseActorCritic
from relm_irl_jax.agent.siamese.pairs import Outputs, Pairs, outputs_of
from relm_irl_jax.world import Targets, World

Views = Int32[Array, "groups batch history"]

Forward = Callable[[Views, Int32[Array, "groups batch"]], Activations | Outputs]
"""Maps last states and targets of all workers to policy and value."""

Pull = Callable[[Experience, Float32[Array, "time groups batch 4"], Float32[Array, "time groups batch"]], Parameters]
"""Maps the steps, and the gradient of a loss in their logits and values, to the gradient in θ."""


def passes(
    network: SiameseActorCritic,
    parameters: Parameters,
    world: World,
    targets: Targets,
    pairs: Pairs | None,
    frames: int,
) -> tuple[Forward, Pull]:
    """The network for acting and for learning, in the cheaper of two ways.

    Args:
        network: the network. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        pairs: all pairs of a state and a target, where these are to be computed.
        frames: frames of the update. Static.

    Returns:
        The forward pass for last states and targets of all workers, and its backward pass over all steps.
    """
    if pairs is None:
        return through_frames(network, parameters, world, targets, frames)
    return through_pairs(network, parameters, world, targets, pairs)


def through_frames(
    network: SiameseActorCritic, parameters: Parameters, world: World, targets: Targets, frames: int
) -> tuple[Forward, Pull]:
    """Compute each frame when it is met, from tables over states and over targets.

    Args:
        network: the network. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        frames: frames of the update. Static.

    Returns:
        The forward pass for last states and targets of all workers, and its backward pass over all steps.
    """
    heads = jnp.arange(network.n_heads)
    tables, pull_back = jax.vjp(
        lambda theta: tabulate(network, theta, world.features, targets.state, frames, targets.predicted), parameters
    )

    def pull(experience: Experience, of_logits: Array, of_value: Array) -> Parameters:
        of_heads, of_tables = backward(
            network,
            parameters,
            tables,
            experience.views,
            experience.target,
            heads,
            experience.record,
            of_logits,
            of_value,
        )
        return jax.tree.map(jnp.add, of_heads, pull_back(of_tables)[0])

    return lambda views, target: forward(network, parameters, tables, views, target, heads), pull


def through_pairs(
    network: SiameseActorCritic, parameters: Parameters, world: World, targets: Targets, pairs: Pairs
) -> tuple[Forward, Pull]:
    """Compute all pairs of a state and a target, and look frames up.

    Args:
        network: the network. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        pairs: the pairs.

    Returns:
        The forward pass for last states and targets of all workers, and its backward pass over all steps.
    """
    outputs, pull_back = jax.vjp(lambda theta: outputs_of(network, theta, world, targets, pairs), parameters)

    def look_up(views: Views, target: Array) -> Outputs:
        number = pairs.number(world, views[..., 0], target)
        return Outputs(outputs.logits[number], outputs.value[number])

    def pull(experience: Experience, of_logits: Array, of_value: Array) -> Parameters:
        number = pairs.number(world, experience.state, experience.target)
        of_steps = Outputs(of_logits, of_value)
        of_pairs = jax.tree.map(lambda out, of: jnp.zeros_like(out).at[number].add(of), outputs, of_steps)
        return pull_back(of_pairs)[0]

    return look_up, pull
