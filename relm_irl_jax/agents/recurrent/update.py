"""One update of the recurrent actor-critic: act t_max steps with every worker, then take one gradient step.

The gradient goes back through the memory to the first step of the rollout (truncated backpropagation through time).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float32, PRNGKeyArray

from relm_irl_jax.agents.actor_critic import LossWeights, Outputs, actor_critic_loss
from relm_irl_jax.agents.recurrent.network import Recurrent, RecurrentActorCritic, Seen
from relm_irl_jax.agents.recurrent.unroll import (
    EpisodeMemory,
    StepRecord,
    cell_inputs,
    episode_starts,
    heads_outputs,
    initial_memory,
    merge_time,
    next_values,
    observe,
    remember,
    split_time,
    tabulate,
    unroll,
)
from relm_irl_jax.agents.rollout import EpisodeSums, Experience, NavigationTask, Workers, rollout, sample_action
from relm_irl_jax.agents.training import TrainState, apply_gradient
from relm_irl_jax.types import Observation, Parameters


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class OptimizerNumbers:
    """Numbers of the optimiser.

    Attributes:
        learning_rate: Adam's step size.
        gradient_clip: largest global norm of a gradient.
    """

    learning_rate: Float32[Array, ""]
    gradient_clip: Float32[Array, ""]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class UpdateInputs:
    """The constant inputs of an update.

    Attributes:
        task: scenes, targets, reward and cap.
        loss: numbers of the loss.
        optimizer: numbers of the optimiser.
    """

    task: NavigationTask
    loss: LossWeights
    optimizer: OptimizerNumbers


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Sequences:
    """What a gradient is computed from.

    Attributes:
        first: recurrent state of each worker before the first step.
        experience: the steps; their `output` is a `StepRecord`.
        next_value: value of the state after each step.
    """

    first: Recurrent
    experience: Experience
    next_value: Float32[Array, "time groups batch"]


def make_optimizer(numbers: OptimizerNumbers) -> optax.GradientTransformation:
    """Adam on gradients that are clipped by their global norm.

    Args:
        numbers: the optimiser's numbers.

    Returns:
        The gradient transformation.
    """
    clip = optax.clip_by_global_norm(numbers.gradient_clip)  # pyrefly: ignore
    return optax.chain(clip, optax.adam(numbers.learning_rate))  # pyrefly: ignore


def update(
    state: TrainState, inputs: UpdateInputs, network: RecurrentActorCritic, t_max: int
) -> tuple[TrainState, EpisodeSums]:
    """Act t_max steps with every worker, then take one gradient step.

    Args:
        state: the state of training.
        inputs: scenes, targets, reward and numbers.
        network: the network. Static.
        t_max: steps of each worker. Static.

    Returns:
        The next state of training, and sums over the episodes that ended.
    """
    key, rollout_key = jax.random.split(state.key)
    workers, sequences, sums = collect(rollout_key, state, inputs.task, network, t_max)
    gradient = sequence_gradient(network, state.parameters, inputs, sequences)
    optimizer = make_optimizer(inputs.optimizer)
    parameters, optimizer_state = apply_gradient(optimizer, gradient, state.optimizer, state.parameters)
    return TrainState(parameters, optimizer_state, workers, key), sums


def collect(
    key: PRNGKeyArray, state: TrainState, task: NavigationTask, network: RecurrentActorCritic, t_max: int
) -> tuple[Workers, Sequences, EpisodeSums]:
    """Act t_max steps with every worker.

    Args:
        key: source of randomness.
        state: the state of training.
        task: scenes, targets, reward and cap.
        network: the network. Static.
        t_max: steps of each worker. Static.

    Returns:
        The next state of the workers, the steps, and sums over the episodes that ended.
    """
    theta, shape = state.parameters, task.target_range.first.shape
    heads = jnp.arange(network.n_heads)
    tables = tabulate(network, theta, task.world, task.targets, shape[0] * shape[1] * t_max)

    def look(before: Recurrent, seen: Seen) -> tuple[Array, Recurrent, Outputs]:
        inputs = cell_inputs(network, theta, tables, seen)
        after = remember(network, theta, before, inputs)
        return inputs, after, heads_outputs(network, theta, network.recall(after, inputs), heads)

    def act(
        key: PRNGKeyArray, memory: EpisodeMemory, observation: Observation, target: Array
    ) -> tuple[EpisodeMemory, Array, StepRecord]:
        seen = observe(memory, observation, target)
        inputs, after, outputs = look(memory.recurrent, seen)
        action = sample_action(key, outputs.logits)
        return EpisodeMemory(after, action), action, StepRecord(seen, inputs, after, outputs.value)

    workers, experience, sums = rollout(key, act, state.workers, task, initial_memory(network, shape), t_max)
    next_value = next_values(lambda before, seen: look(before, seen)[2].value, experience)
    return workers, Sequences(state.workers.memory.recurrent, experience, next_value), sums


def sequence_gradient(
    network: RecurrentActorCritic, parameters: Parameters, inputs: UpdateInputs, sequences: Sequences
) -> Parameters:
    """The gradient of the actor-critic loss.

    Args:
        network: the network. Static.
        parameters: θ, with which the workers acted.
        inputs: scenes, targets and numbers of the loss.
        sequences: the steps.

    Returns:
        The gradient with respect to θ.
    """
    experience: Experience = sequences.experience
    record: StepRecord = experience.output
    time, heads = len(experience.reward), jnp.arange(network.n_heads)

    def loss(theta: Parameters, inputs_of_cell: Array) -> Array:
        hidden = unroll(network, theta, sequences.first, inputs_of_cell, episode_starts(experience))
        outputs = heads_outputs(network, theta, merge_time(hidden), heads)
        outputs = jax.tree.map(lambda x: split_time(x, time), outputs)
        return actor_critic_loss(outputs, sequences.next_value, experience, inputs.loss, jnp.mean)

    above, grad_inputs = jax.grad(loss, (0, 1))(parameters, record.inputs)
    return jax.tree.map(jnp.add, above, gradient_below(network, parameters, inputs.task, record, grad_inputs))


def gradient_below(
    network: RecurrentActorCritic,
    parameters: Parameters,
    task: NavigationTask,
    record: StepRecord,
    grad_inputs: Float32[Array, "time groups batch gates"],
) -> Parameters:
    """The gradient of the layers below the memory.

    Args:
        network: the network. Static.
        parameters: θ.
        task: scenes and targets.
        record: the steps.
        grad_inputs: gradient with respect to the cell's inputs.

    Returns:
        The gradient with respect to θ.
    """
    seen = jax.tree.map(merge_time, record.seen)

    def below(theta: Parameters) -> Array:
        tables = tabulate(network, theta, task.world, task.targets, record.value.size)
        return cell_inputs(network, theta, tables, seen)

    # The last product is linear, so nothing uses its forward pass, and the compiler removes it.
    return jax.vjp(below, parameters)[1](merge_time(grad_inputs))[0]
