"""One update of the metric agent: act with every worker, add transitions to the experience graph, learn distances."""

from dataclasses import dataclass
from typing import cast

import jax
import jax.numpy as jnp
import optax
from jax.typing import ArrayLike
from jaxtyping import Array, Float32, PRNGKeyArray

from relm_irl_jax.agents.metric.drawn_scenes import draw_scenes
from relm_irl_jax.agents.metric.experience_graph import (
    ExperienceGraph,
    add_transitions,
    exploring_action,
    steps_to_frontier,
)
from relm_irl_jax.agents.metric.loss import Losses, LossForm, LossInputs, metric_loss
from relm_irl_jax.agents.metric.network import MetricNetwork, distance, embed
from relm_irl_jax.agents.rollout import EpisodeSums, NavigationTask, Workers, rollout, sample_action
from relm_irl_jax.agents.training import apply_gradient
from relm_irl_jax.types import NO_MEMORY, Memory, Observation, Parameters

FINAL_RATE = 0.02
"""Final step size, as a share of the initial one."""


@dataclass(frozen=True)
class UpdateForm:
    """The static part of an update: one program is compiled for each.

    Attributes:
        network: the network.
        loss: the loss's static part.
        t_max: steps of each worker.
        scenes_at_once: scenes whose distances an update learns, at most.
    """

    network: MetricNetwork
    loss: LossForm
    t_max: int
    scenes_at_once: int


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class OptimizerNumbers:
    """Numbers of the optimiser.

    Attributes:
        learning_rate: initial step size.
        updates: updates of the whole training, over which the step size decreases.
        gradient_clip: largest global norm of a gradient.
    """

    learning_rate: Float32[Array, ""]
    updates: Float32[Array, ""]
    gradient_clip: Float32[Array, ""]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class UpdateInputs:
    """The constant inputs of an update.

    Attributes:
        task: scenes, targets, reward and cap.
        loss: goals, costs to go and numbers of the loss.
        optimizer: numbers of the optimiser.
    """

    task: NavigationTask
    loss: LossInputs
    optimizer: OptimizerNumbers


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TrainState:
    """The state of a training between updates.

    Attributes:
        parameters: the network's parameters.
        optimizer: the optimiser's state.
        workers: the workers; fields are [scenes, batch].
        graph: transitions observed so far.
        key: source of the remaining randomness.
    """

    parameters: Parameters
    optimizer: optax.OptState
    workers: Workers
    graph: ExperienceGraph
    key: PRNGKeyArray


def make_optimizer(numbers: OptimizerNumbers) -> optax.GradientTransformation:
    """The optimiser: gradients clipped by their global norm, then Adam with a step size that decreases along a cosine.

    Args:
        numbers: the optimiser's numbers.

    Returns:
        The gradient transformation.
    """

    def rate(count: ArrayLike) -> ArrayLike:
        done = jnp.minimum(jnp.asarray(count, jnp.float32), numbers.updates)
        cosine = 0.5 * (1.0 + jnp.cos(jnp.pi * done / numbers.updates))
        return numbers.learning_rate * ((1.0 - FINAL_RATE) * cosine + FINAL_RATE)

    return optax.chain(optax.clip_by_global_norm(cast(float, numbers.gradient_clip)), optax.adam(rate))


def update(state: TrainState, inputs: UpdateInputs, form: UpdateForm) -> tuple[TrainState, tuple[EpisodeSums, Losses]]:
    """Act t_max steps with every worker, then take one gradient step.

    Workers explore if they can reach an untried action, and follow the policy otherwise. Where an update learns from
    all scenes, the embeddings of all views are computed once, for both acting and learning.

    Args:
        state: the state of training.
        inputs: scenes, goals, costs to go and numbers.
        form: the static part. Static.

    Returns:
        The next state of training, sums over the episodes that ended, and the parts of the loss.
    """
    key, rollout_key, pair_key = jax.random.split(state.key, 3)
    task, network, theta = inputs.task, form.network, state.parameters
    features, goal_state = task.world.features, task.targets.state
    whole = len(inputs.loss.scenes.count) <= form.scenes_at_once
    if whole:
        shown, learned = features, inputs.loss
    else:
        states, learned = draw_scenes(jax.random.fold_in(pair_key, 1), inputs.loss, form.scenes_at_once)
        shown = features[states]
    embeddings, vjp = jax.vjp(lambda theta: embed(network, theta, shown), theta)
    goal_embeddings = embeddings.state[goal_state] if whole else embed(network, theta, features[goal_state]).state
    to_frontier = steps_to_frontier(state.graph)

    def successors(view: Array) -> Array:
        return embeddings.successor[view] if whole else embed(network, theta, features[view]).successor

    def act(key: PRNGKeyArray, memory: Memory, observation: Observation, target: Array) -> tuple[Memory, Array, None]:
        explore_key, policy_key = jax.random.split(key)
        exploring, unexplored = exploring_action(explore_key, state.graph, to_frontier, observation.view)
        steps = distance(successors(observation.view), goal_embeddings[target][..., None, :], form.loss.distance)
        logits = -inputs.loss.weights.inverse_temperature * steps
        return memory, jnp.where(unexplored, exploring, sample_action(policy_key, logits)), None

    workers, experience, sums = rollout(rollout_key, act, state.workers, task, NO_MEMORY, form.t_max)

    grad_embeddings, losses = jax.grad(lambda e: metric_loss(pair_key, e, learned, form.loss), has_aux=True)(embeddings)
    parameters, optimizer_state = apply_gradient(
        make_optimizer(inputs.optimizer), vjp(grad_embeddings)[0], state.optimizer, state.parameters
    )
    graph = add_transitions(state.graph, experience)
    return TrainState(parameters, optimizer_state, workers, graph, key), (sums, losses)
