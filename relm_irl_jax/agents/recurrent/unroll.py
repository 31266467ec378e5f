"""The network along the steps of a rollout: acting step by step, then one gradient for all steps.

Acting stores the cell's inputs. Learning differentiates the memory and the layers above it with respect to them
(`unroll`), and hands the result on to the layers below the memory, in large products over all steps. The forward pass
of these layers is not repeated: only the fusion layer is computed again, from the tables.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Float32, Int32

from relm_irl_jax import env
from relm_irl_jax.agents.actor_critic import Outputs
from relm_irl_jax.agents.recurrent.network import NO_ACTION, Recurrent, RecurrentActorCritic, Seen, Tables
from relm_irl_jax.agents.rollout import Experience
from relm_irl_jax.types import Observation, Parameters
from relm_irl_jax.world import Targets, World

Shape = tuple[int, ...]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class EpisodeMemory:
    """What an agent remembers of its episode.

    Attributes:
        recurrent: the recurrent state after the last observation.
        last_action: the last action; `NO_ACTION` before the first one.
    """

    recurrent: Recurrent
    last_action: Int32[Array, "*batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class StepRecord:
    """What acting stores of a step.

    Attributes:
        seen: what was observed.
        inputs: the cell's inputs.
        recurrent: the recurrent state after the observation.
        value: the value, of the parameters that acted.
    """

    seen: Seen
    inputs: Float32[Array, "*time groups batch gates"]
    recurrent: Recurrent
    value: Float32[Array, "*time groups batch"]


def initial_memory(network: RecurrentActorCritic, shape: Shape) -> EpisodeMemory:
    """Memory at the start of episodes.

    Args:
        network: the network.
        shape: leading axes.

    Returns:
        The memory.
    """
    return EpisodeMemory(network.initial(shape), jnp.full(shape, NO_ACTION, jnp.int32))


def tabulate(
    network: RecurrentActorCritic, parameters: Parameters, world: World, targets: Targets, frames: int | None = None
) -> Tables:
    """Compute the layers of single views; for all states if there are no more states than frames.

    Args:
        network: the network. Static.
        parameters: θ.
        world: the scenes.
        targets: the targets.
        frames: number of frames that are evaluated with these parameters; None if unknown. Static.

    Returns:
        The tables.
    """
    every = frames is None or len(world.features) <= frames
    return network.apply(parameters, world.features, targets.state, every_state=every, method="tables")  # pyrefly: ignore


def cell_inputs(
    network: RecurrentActorCritic, parameters: Parameters, tables: Tables, seen: Seen
) -> Float32[Array, "groups batch gates"]:
    """The layers below the memory.

    Args:
        network: the network. Static.
        parameters: θ.
        tables: tables that `tabulate` computed from the same θ.
        seen: what is observed.

    Returns:
        The cell's inputs.
    """
    return cast(Array, network.apply(parameters, tables, seen, method="inputs"))


def remember(
    network: RecurrentActorCritic, parameters: Parameters, before: Recurrent, inputs: Float[Array, "groups batch gates"]
) -> Recurrent:
    """One step of the memory.

    Args:
        network: the network. Static.
        parameters: θ.
        before: the recurrent state before the step.
        inputs: the cell's inputs.

    Returns:
        The recurrent state after the step.
    """
    return cast(Recurrent, network.apply(parameters, before, inputs, method="step"))


def heads_outputs(
    network: RecurrentActorCritic,
    parameters: Parameters,
    hidden: Float[Array, "groups batch memory"],
    head: Int32[Array, "groups"],
) -> Outputs:
    """The layers above the memory.

    Args:
        network: the network. Static.
        parameters: θ.
        hidden: what `RecurrentActorCritic.recall` returns.
        head: head of each group.

    Returns:
        Policy and value.
    """
    return cast(Outputs, network.apply(parameters, hidden, head, method="outputs"))


def observe(memory: EpisodeMemory, observation: Observation, target: Int32[Array, "groups batch"]) -> Seen:
    """What the network is given in a step.

    Args:
        memory: the memory before the step.
        observation: the observation.
        target: rows of the targets.

    Returns:
        What is seen.
    """
    return Seen(observation.view, target, memory.last_action, observation.collided)


def unroll(
    network: RecurrentActorCritic,
    parameters: Parameters,
    first: Recurrent,
    inputs: Float[Array, "time groups batch gates"],
    starts: Bool[Array, "time groups batch"],
) -> Float[Array, "time groups batch memory"]:
    """What the heads are given along the steps of a rollout.

    Args:
        network: the network. Static.
        parameters: θ.
        first: recurrent state before the first step; no gradient reaches the steps before it.
        inputs: the cell's inputs.
        starts: whether an episode starts with the step, so that nothing is remembered.

    Returns:
        What the heads are given in each step; see `RecurrentActorCritic.recall`.
    """
    empty = network.initial(starts.shape[1:])

    def advance(before: Recurrent, step: tuple[Array, Array]) -> tuple[Recurrent, Array]:
        inputs, starts = step
        after = remember(network, parameters, env.select(starts, empty, before), inputs)
        return after, network.recall(after, inputs)

    return jax.lax.scan(advance, first, (inputs, starts))[1]


def episode_starts(experience: Experience) -> Bool[Array, "time groups batch"]:
    """Whether an episode starts with each step of a rollout.

    Args:
        experience: the steps.

    Returns:
        True after the end of an episode. False at the first step, whose memory is the worker's.
    """
    ends = experience.terminated | experience.truncated
    return jnp.concatenate([jnp.zeros_like(ends[:1]), ends[:-1]])


def next_values(
    value: Callable[[Recurrent, Seen], Float32[Array, "groups batch"]], experience: Experience
) -> Float32[Array, "time groups batch"]:
    """Value of the state after each step, before any reset, with the memory that the agent has then.

    Within an episode it is the value at the next step. It is computed here for the rollout's last step and for
    truncated steps. Since the cap is at least t_max, each worker is truncated at most once in a rollout.

    Args:
        value: value of an observation, given the recurrent state before it.
        experience: the steps; their `output` is a `StepRecord`.

    Returns:
        The values; arbitrary for steps that reached the target.
    """
    record: StepRecord = experience.output
    collided = experience.next_state == experience.state
    after = Seen(experience.next_state, experience.target, experience.action, collided)

    def at(step: Int32[Array, "1 groups batch"]) -> Array:
        def take(x: Array) -> Array:
            return jnp.take_along_axis(x, step.reshape(step.shape + (1,) * (x.ndim - step.ndim)), 0)[0]

        return value(jax.tree.map(take, record.recurrent), jax.tree.map(take, after))

    after_truncation = at(jnp.argmax(experience.truncated, axis=0)[None].astype(jnp.int32))
    after_last = at(jnp.full((1, *collided.shape[1:]), len(collided) - 1, jnp.int32))
    after_others = jnp.where(experience.truncated[:-1], after_truncation, record.value[1:])
    return jnp.concatenate([after_others, after_last[None]])


def merge_time(x: Float[Array, "time groups batch *rest"] | Array) -> Array:
    """Merge time into the batch, [time groups batch …] → [groups time·batch …], for one large product per group.

    Args:
        x: the array.

    Returns:
        The same numbers.
    """
    time, groups, batch, *rest = x.shape
    return jnp.moveaxis(x, 0, 1).reshape(groups, time * batch, *rest)


def split_time(x: Array, time: int) -> Array:
    """Undo `merge_time`.

    Args:
        x: [groups, time·batch, …].
        time: number of steps.

    Returns:
        [time, groups, batch, …].
    """
    groups, merged, *rest = x.shape
    return jnp.moveaxis(x.reshape(groups, time, merged // time, *rest), 1, 0)
