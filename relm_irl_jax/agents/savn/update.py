"""One meta-update: act with every worker, adapting on the way, then take one step along the meta-gradient.

A rollout is cut into windows of K steps. After a window that lies within one episode, the worker's weights change. All
workers do so at once, so that in training an episode's first change comes after K to 2K − 1 steps; a policy's after K.
The meta-gradient goes through the changes of the rollout; those before it are taken as they are, as is the memory.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int32, PRNGKeyArray

from relm_irl_jax import env
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
from relm_irl_jax.agents.recurrent.update import (
    OptimizerNumbers,
    Sequences,
    gradient_below,
    make_optimizer,
)
from relm_irl_jax.agents.rollout import EpisodeSums, Experience, NavigationTask, Workers, rollout, sample_action
from relm_irl_jax.agents.savn.adaptation import Adaptation, Change, Window, adapt_where, policy_logits
from relm_irl_jax.agents.training import TrainState, apply_gradient
from relm_irl_jax.types import Observation, Parameters


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class AdaptiveMemory:
    """What a worker carries through its episode.

    Attributes:
        episode: the memory of the recurrent network.
        change: Δ.
        changes: number of inner steps so far.
    """

    episode: EpisodeMemory
    change: Change
    changes: Int32[Array, "*batch"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MetaInputs:
    """The constant inputs of an update.

    Attributes:
        task: scenes, targets, reward and cap.
        loss: numbers of the loss.
        optimizer: numbers of the optimiser.
        adaptation: how weights change.
    """

    task: NavigationTask
    loss: LossWeights
    optimizer: OptimizerNumbers
    adaptation: Adaptation


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Adapting:
    """When the weights of a rollout's workers change.

    Attributes:
        first: Δ before the first step.
        due: whether the weights change after each window.
    """

    first: Change
    due: Bool[Array, "windows groups batch"]


def worker_memory(network: RecurrentActorCritic, adaptation: Adaptation, shape: tuple[int, ...]) -> AdaptiveMemory:
    """A worker's memory at the start of episodes.

    Args:
        network: the network.
        adaptation: how weights change.
        shape: groups and batch.

    Returns:
        The memory.
    """
    change = adaptation.unchanged(shape, network.memory)
    return AdaptiveMemory(initial_memory(network, shape), change, jnp.zeros(shape, jnp.int32))


def hidden_layer(
    parameters: Parameters, hidden: Float[Array, "*time groups batch memory"], head: Int32[Array, "groups"]
) -> Float[Array, "*time groups batch memory"]:
    """The head's hidden layer before its ReLU, with unchanged weights.

    Args:
        parameters: θ.
        hidden: what the heads are given.
        head: head of each group.

    Returns:
        The layer.
    """
    weights = parameters["params"]
    return hidden @ weights["head_kernel"][head] + weights["head_bias"][head]


def update(
    state: TrainState, inputs: MetaInputs, network: RecurrentActorCritic, windows: int
) -> tuple[TrainState, EpisodeSums]:
    """Act with every worker, then take one step along the meta-gradient.

    Args:
        state: the state of training; the workers' memories are `AdaptiveMemory`.
        inputs: scenes, targets, reward and numbers.
        network: the network. Static.
        windows: number of windows of a rollout. Static.

    Returns:
        The next state of training, and sums over the episodes that ended.
    """
    key, rollout_key = jax.random.split(state.key)
    workers, (sequences, adapting), sums = collect(rollout_key, state, inputs, network, windows)
    gradient = meta_gradient(network, state.parameters, inputs, sequences, adapting)
    optimizer = make_optimizer(inputs.optimizer)
    parameters, optimizer_state = apply_gradient(optimizer, gradient, state.optimizer, state.parameters)
    return TrainState(parameters, optimizer_state, workers, key), sums


def collect(
    key: PRNGKeyArray, state: TrainState, inputs: MetaInputs, network: RecurrentActorCritic, windows: int
) -> tuple[Workers, tuple[Sequences, Adapting], EpisodeSums]:
    """Act window by window, and adapt after each.

    Args:
        key: source of randomness.
        state: the state of training.
        inputs: scenes, targets, reward and numbers.
        network: the network. Static.
        windows: number of windows. Static.

    Returns:
        The next state of the workers; the steps, and when weights changed; and sums over the episodes that ended.
    """
    theta, task, adaptation = state.parameters, inputs.task, inputs.adaptation
    shape, heads, interval = task.target_range.first.shape, jnp.arange(network.n_heads), adaptation.interval
    tables = tabulate(network, theta, task.world, task.targets, shape[0] * shape[1] * interval * windows)

    def look(before: Recurrent, seen: Seen) -> tuple[Array, Recurrent, Array]:
        inputs = cell_inputs(network, theta, tables, seen)
        after = remember(network, theta, before, inputs)
        return inputs, after, heads_outputs(network, theta, network.recall(after, inputs), heads).value

    def act(
        key: PRNGKeyArray, memory: AdaptiveMemory, observation: Observation, target: Array
    ) -> tuple[AdaptiveMemory, Array, StepRecord]:
        seen = observe(memory.episode, observation, target)
        inputs, after, value = look(memory.episode.recurrent, seen)
        recalled = network.recall(after, inputs)
        step = Window(recalled, hidden_layer(theta, recalled, heads))
        action = sample_action(key, policy_logits(theta, step, memory.change, heads))
        memory = AdaptiveMemory(EpisodeMemory(after, action), memory.change, memory.changes)
        return memory, action, StepRecord(seen, inputs, after, value)

    empty = worker_memory(network, adaptation, shape)

    def window(workers: Workers, key: PRNGKeyArray) -> tuple[Workers, tuple[Experience, Array, EpisodeSums]]:
        workers, experience, sums = rollout(key, act, workers, task, empty, interval)
        memory, record = workers.memory, experience.output
        hidden = network.recall(record.recurrent, record.inputs)
        due = ~ends(experience).any(0) & (memory.changes < adaptation.inner_steps)
        seen = Window(hidden, hidden_layer(theta, hidden, heads))
        change = adapt_where(due, theta, seen, memory.change, heads, adaptation)
        memory = AdaptiveMemory(memory.episode, change, memory.changes + due.astype(jnp.int32))
        return Workers(workers.episode, memory, workers.collided), (experience, due, sums)

    workers, (experience, due, sums) = jax.lax.scan(window, state.workers, jax.random.split(key, windows))
    experience = jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), experience)
    next_value = next_values(lambda before, seen: look(before, seen)[2], experience)
    memory = state.workers.memory
    sequences = Sequences(memory.episode.recurrent, experience, next_value)
    return workers, (sequences, Adapting(memory.change, due)), jax.tree.map(jnp.sum, sums)


def ends(experience: Experience) -> Bool[Array, "*time groups batch"]:
    """Whether an episode ends with each step."""
    return experience.terminated | experience.truncated


def adapted_logits(
    parameters: Parameters,
    steps: Window,
    over: Bool[Array, "time groups batch"],
    adapting: Adapting,
    adaptation: Adaptation,
) -> tuple[Float[Array, "time groups batch 4"], Change]:
    """The policy's logits along a rollout, with the weights that each step had.

    Args:
        parameters: θ, with F and f.
        steps: the steps.
        over: whether an episode ends with each step.
        adapting: when weights changed.
        adaptation: how weights change.

    Returns:
        Action logits, and Δ after the last step.
    """
    heads = jnp.arange(steps.hidden.shape[1], dtype=jnp.int32)

    def window(change: Change, now: tuple[Window, Array, Array]) -> tuple[Change, Array]:
        steps, over, due = now
        # Episodes that start within the window have unchanged weights.
        earlier = jnp.concatenate([jnp.zeros_like(over[:1]), over[:-1]])
        logits = policy_logits(parameters, steps, change, heads, jnp.cumsum(earlier, 0) == 0)
        change = env.select(over.any(0), jax.tree.map(jnp.zeros_like, change), change)
        return adapt_where(due, parameters, steps, change, heads, adaptation), logits

    cut = jax.tree.map(lambda x: x.reshape(len(adapting.due), -1, *x.shape[1:]), (steps, over))
    last, logits = jax.lax.scan(window, adapting.first, (*cut, adapting.due))
    return logits.reshape(-1, *logits.shape[2:]), last


def meta_gradient(
    network: RecurrentActorCritic,
    parameters: Parameters,
    inputs: MetaInputs,
    sequences: Sequences,
    adapting: Adapting,
) -> Parameters:
    """The gradient of the actor-critic loss of adapted policies.

    Args:
        network: the network. Static.
        parameters: θ, with F and f.
        inputs: scenes, targets and numbers.
        sequences: the steps.
        adapting: when weights changed.

    Returns:
        The gradient with respect to θ, F and f.
    """
    experience: Experience = sequences.experience
    record: StepRecord = experience.output
    time, heads = len(experience.reward), jnp.arange(network.n_heads)

    def loss(theta: Parameters, inputs_of_cell: Array) -> Array:
        hidden = unroll(network, theta, sequences.first, inputs_of_cell, episode_starts(experience))
        merged = merge_time(hidden)
        value = split_time(heads_outputs(network, theta, merged, heads).value, time)
        steps = Window(hidden, split_time(hidden_layer(theta, merged, heads), time))
        logits, _ = adapted_logits(theta, steps, ends(experience), adapting, inputs.adaptation)
        return actor_critic_loss(Outputs(logits, value), sequences.next_value, experience, inputs.loss, jnp.mean)

    above, grad_inputs = jax.grad(loss, (0, 1))(parameters, record.inputs)
    return jax.tree.map(jnp.add, above, gradient_below(network, parameters, inputs.task, record, grad_inputs))
