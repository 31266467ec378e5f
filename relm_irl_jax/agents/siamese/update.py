"""One update of the actor-critic: act t_max steps with every worker, then take one gradient step.

All workers act with the same parameters θ, and their gradients are combined into one update. This is the synchronous
limit of A3C, in which no gradient is stale. In A3C, workers apply their gradients one after the other, so θ moves by
about the sum of them. Adam's step does not depend on the scale of the gradient; the default is therefore the mean,
which does not depend on the number of workers. The original agent's RMSProp is close to gradient descent and needs the
sum.
"""

from dataclasses import dataclass
from typing import Literal, cast

import jax
import jax.numpy as jnp
import optax
from jax.typing import ArrayLike
from jaxtyping import Array, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agents.actor_critic import LossWeights, actor_critic_loss
from relm_irl_jax.agents.rollout import EpisodeSums, NavigationTask, rollout, sample_action
from relm_irl_jax.agents.siamese.forward import Evaluation, passes_by_frames, passes_by_pairs
from relm_irl_jax.agents.siamese.network import SiameseActorCritic
from relm_irl_jax.agents.siamese.next_values import next_values
from relm_irl_jax.agents.siamese.state_target_pairs import StateTargetPairs
from relm_irl_jax.agents.training import TrainState, apply_gradient
from relm_irl_jax.types import NO_MEMORY, Memory, Observation

NO_VIEW = -1
"""Entry of the memory for views before the start of the episode."""


@dataclass(frozen=True)
class UpdateForm:
    """The static part of an update: one program is compiled for each.

    Attributes:
        network: the network.
        t_max: steps of each worker.
        optimizer: `adam` or `rmsprop`.
        gradient: `mean` or `sum` over the steps of all workers.
    """

    network: SiameseActorCritic
    t_max: int
    optimizer: Literal["adam", "rmsprop"]
    gradient: Literal["mean", "sum"]

    def reduce(self, loss: Float32[Array, "*steps"]) -> Float32[Array, ""]:
        """Mean or sum of the losses of all steps."""
        return loss.mean() if self.gradient == "mean" else loss.sum()


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class OptimizerNumbers:
    """Numbers of the optimiser.

    Attributes:
        learning_rate: step size.
        decay_updates: updates over which the step size decreases linearly to 0; infinite for a constant step size.
        gradient_clip: largest global norm of a gradient.
    """

    learning_rate: Float32[Array, ""]
    decay_updates: Float32[Array, ""]
    gradient_clip: Float32[Array, ""]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class UpdateInputs:
    """The constant inputs of an update.

    Attributes:
        task: scenes, targets, reward and cap.
        loss: numbers of the loss.
        optimizer: numbers of the optimiser.
        pairs: all pairs of a target and a state, if evaluating them takes less time than evaluating every frame.
    """

    task: NavigationTask
    loss: LossWeights
    optimizer: OptimizerNumbers
    pairs: StateTargetPairs | None = None


def make_optimizer(form: UpdateForm, numbers: OptimizerNumbers) -> optax.GradientTransformation:
    """The optimiser: gradients clipped by their global norm, then Adam, or the original agent's RMSProp:

        ν ← 0.99 ν + 0.01 g²,   θ ← θ − η g / √(ν + 0.1),   initially ν = 1

    with η constant or decreasing linearly.

    Args:
        form: the update's static part, which has the kind of optimiser.
        numbers: the optimiser's numbers.

    Returns:
        The gradient transformation.
    """

    def rate(count: ArrayLike) -> ArrayLike:
        return numbers.learning_rate * (1.0 - jnp.minimum(jnp.asarray(count, jnp.float32) / numbers.decay_updates, 1.0))

    if form.optimizer == "adam":
        step = optax.adam(rate)
    else:
        step = optax.rmsprop(rate, decay=0.99, eps=0.1, initial_scale=1.0, eps_in_sqrt=True)
    return optax.chain(optax.clip_by_global_norm(cast(float, numbers.gradient_clip)), step)


def initial_memory(shape: tuple[int, ...], history: int) -> Memory:
    """Memory before the first observation: no earlier views.

    Args:
        shape: groups and batch.
        history: number of last views that the network observes.

    Returns:
        Earlier views [groups batch history-1], the latest first; empty if one view is observed.
    """
    return jnp.full((*shape, history - 1), NO_VIEW, jnp.int32) if history > 1 else NO_MEMORY


def observe_views(memory: Memory, observation: Observation) -> tuple[Memory, Int32[Array, "groups batch history"]]:
    """The last views, the latest first. Before the start of the episode, its first view is repeated.

    Args:
        memory: earlier views.
        observation: the current observation.

    Returns:
        The next memory, and the views that the network observes.
    """
    view = observation.view[..., None]
    if isinstance(memory, tuple):
        return memory, view
    views = jnp.concatenate([view, jnp.where(memory == NO_VIEW, view, memory)], -1)
    return views[..., :-1], views


def update(state: TrainState, inputs: UpdateInputs, form: UpdateForm) -> tuple[TrainState, EpisodeSums]:
    """Act t_max steps with every worker, then take one gradient step.

    Args:
        state: the state of training.
        inputs: scenes, targets, reward and numbers.
        form: the static part. Static.

    Returns:
        The next state of training, and sums over the episodes that ended.
    """
    key, rollout_key = jax.random.split(state.key)
    task, network, shape = inputs.task, form.network, inputs.task.target_range.first.shape
    if inputs.pairs is None:
        frames = shape[0] * shape[1] * form.t_max
        forward, backward = passes_by_frames(network, state.parameters, task.world, task.targets, frames)
    else:
        forward, backward = passes_by_pairs(network, state.parameters, task.world, task.targets, inputs.pairs)

    def act(
        key: PRNGKeyArray, memory: Memory, observation: Observation, target: Array
    ) -> tuple[Memory, Array, Evaluation]:
        memory, views = observe_views(memory, observation)
        evaluation = forward(views, target)
        return memory, sample_action(key, evaluation.outputs.logits), evaluation

    memory = initial_memory(shape, network.history)
    workers, experience, sums = rollout(rollout_key, act, state.workers, task, memory, form.t_max)
    next_value = next_values(lambda views, target: forward(views, target).outputs.value, experience)
    grad_outputs = jax.grad(actor_critic_loss)(
        experience.output.outputs, next_value, experience, inputs.loss, form.reduce
    )
    gradient = backward(experience.output, grad_outputs)
    optimizer = make_optimizer(form, inputs.optimizer)
    parameters, optimizer_state = apply_gradient(optimizer, gradient, state.optimizer, state.parameters)
    return TrainState(parameters, optimizer_state, workers, key), sums
