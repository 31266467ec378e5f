"""Training of the siamese actor-critic: preparation, and chunks of updates as one compiled program."""

from functools import partial
from typing import cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int, PRNGKeyArray

from relm_irl_jax.agents import heads
from relm_irl_jax.agents.actor_critic import LossWeights
from relm_irl_jax.agents.rollout import EpisodeSums, NavigationTask, init_workers
from relm_irl_jax.agents.settings import SiameseSettings
from relm_irl_jax.agents.siamese.network import SiameseActorCritic, as_distance
from relm_irl_jax.agents.siamese.state_target_pairs import StateTargetPairs, state_target_pairs
from relm_irl_jax.agents.siamese.update import (
    OptimizerNumbers,
    UpdateForm,
    UpdateInputs,
    initial_memory,
    make_optimizer,
    update,
)
from relm_irl_jax.agents.training import TrainState, repeat_updates
from relm_irl_jax.env import TargetRange
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import Parameters, TrainingProblem
from relm_irl_jax.world import World


def scene_heads(world: World, settings: SiameseSettings) -> Int[np.ndarray, "scenes"]:
    """Head of the network for each scene; see `relm_irl_jax.agents.heads.scene_heads`.

    Args:
        world: the scenes.
        settings: which scenes share a head.

    Returns:
        Numbers of heads.
    """
    return heads.scene_heads(world, settings.heads, "siamese")


def update_form(settings: SiameseSettings, n_heads: int) -> UpdateForm:
    """The static part of an update.

    Args:
        settings: the agent's settings.
        n_heads: number of heads.

    Returns:
        Network, rollout length and kind of optimiser.
    """
    uniform = settings.initialisation == "uniform"
    distance = settings.initialisation == "distance"
    network = SiameseActorCritic(n_heads, settings.width, settings.history, settings.observe_reward, uniform, distance)
    return UpdateForm(network, settings.t_max, settings.optimizer, settings.gradient)


def optimizer_numbers(settings: SiameseSettings, frames: int) -> OptimizerNumbers:
    """The optimiser's numbers. If gradients are summed, the bound on their norm is multiplied by the number of workers.

    Args:
        settings: the agent's settings.
        frames: frames of the training.

    Returns:
        The numbers.
    """
    decay = -(-frames // (settings.workers * settings.t_max)) if settings.decay == "linear" else np.inf
    clip = settings.gradient_clip * (settings.workers if settings.gradient == "sum" else 1)
    return OptimizerNumbers(jnp.float32(settings.learning_rate), jnp.float32(decay), jnp.float32(clip))


def pairs_if_cheaper(
    problem: TrainingProblem, scene_head: Int[np.ndarray, "scenes"], network: SiameseActorCritic, frames: int
) -> StateTargetPairs | None:
    """All pairs of a state and a target, if there are no more pairs than frames.

    Args:
        problem: the problem, which has the scenes and targets.
        scene_head: head of each scene.
        network: the network.
        frames: frames of an update on one device.

    Returns:
        The pairs; None if there are more pairs than frames, or if several views are observed.
    """
    if network.history > 1:
        return None
    pairs = state_target_pairs(problem.world, problem.targets, scene_head, network.n_heads)
    return pairs if pairs.count <= frames else None


def update_inputs(
    problem: TrainingProblem, settings: SiameseSettings, target_range: TargetRange, pairs: StateTargetPairs | None
) -> UpdateInputs:
    """The constant inputs of all updates.

    Args:
        problem: the learning problem.
        settings: the agent's settings.
        target_range: targets of each worker.
        pairs: all pairs, if updates evaluate pairs; otherwise None.

    Returns:
        The inputs.

    Raises:
        InputError: the cap is below t_max, so that a worker could be truncated twice in a rollout.
    """
    if problem.cap < settings.t_max:
        raise InputError(f"siamese.t_max: {settings.t_max} exceeds the cap of {problem.cap} steps; lower it.")
    task = NavigationTask(problem.world, problem.targets, target_range, problem.reward, jnp.int32(problem.cap))
    return UpdateInputs(
        task, loss_weights(settings, problem.return_scale), optimizer_numbers(settings, problem.frames), pairs
    )


def loss_weights(settings: SiameseSettings, return_scale: float) -> LossWeights:
    """The numbers of the loss.

    Args:
        settings: the agent's settings.
        return_scale: size of a typical return.

    Returns:
        The numbers.
    """
    return LossWeights(
        discount=jnp.float32(settings.discount),
        value=jnp.float32(settings.value_weight),
        entropy=jnp.float32(settings.entropy_weight),
        return_scale=jnp.float32(return_scale),
    )


def init_parameters(key: PRNGKeyArray, network: SiameseActorCritic, world: World) -> Parameters:
    """Draw the network's initial parameters.

    Args:
        key: source of randomness.
        network: the network.
        world: the scenes, which give the number of features.

    Returns:
        The parameters.
    """
    numbers = jnp.arange(network.n_heads)
    one = jnp.zeros((network.n_heads, 1), jnp.int32)
    views = jnp.zeros((network.n_heads, 1, network.history), jnp.int32)
    predicted = jnp.zeros((1, 1), jnp.float32) if network.observe_reward else None
    drawn = jax.jit(network.init)(key, world.features[:1], jnp.zeros(1, jnp.int32), views, one, numbers, predicted)
    return as_distance(cast(Parameters, drawn)) if network.distance else cast(Parameters, drawn)


def prepare_training(
    key: PRNGKeyArray, problem: TrainingProblem, settings: SiameseSettings, n_devices: int = 1
) -> tuple[TrainState, UpdateInputs, UpdateForm]:
    """Prepare a training.

    Args:
        key: source of all randomness of the training.
        problem: the learning problem.
        settings: the agent's settings.
        n_devices: devices that share the workers of each head.

    Returns:
        The state before the first update, the inputs of updates, and their static part.

    Raises:
        InputError: the settings do not suit the problem.
    """
    scene_head = scene_heads(problem.world, settings)
    form = update_form(settings, int(scene_head.max()) + 1)
    target_range = heads.worker_target_ranges(
        problem.targets, scene_head, form.network.n_heads, settings.workers, "siamese"
    )
    frames_of_device = target_range.first.size * settings.t_max // n_devices
    pairs = pairs_if_cheaper(problem, scene_head, form.network, frames_of_device)
    inputs = update_inputs(problem, settings, target_range, pairs)
    return init_train_state(key, inputs, form), inputs, form


@partial(jax.jit, static_argnames="form")
def init_train_state(key: PRNGKeyArray, inputs: UpdateInputs, form: UpdateForm) -> TrainState:
    """Draw parameters and start episodes.

    Args:
        key: source of all randomness of the training.
        inputs: scenes, targets and numbers.
        form: the static part. Static.

    Returns:
        The state before the first update.
    """
    key, parameter_key, episode_key = jax.random.split(key, 3)
    parameters = init_parameters(parameter_key, form.network, inputs.task.world)
    memory = initial_memory(inputs.task.target_range.first.shape, form.network.history)
    workers = init_workers(episode_key, inputs.task, memory)
    return TrainState(parameters, make_optimizer(form, inputs.optimizer).init(parameters), workers, key)


@partial(jax.jit, static_argnames=("form", "updates"))
def run_updates(
    state: TrainState, inputs: UpdateInputs, *, form: UpdateForm, updates: int
) -> tuple[TrainState, EpisodeSums]:
    """Run several updates as one program.

    Args:
        state: the state of training.
        inputs: scenes, targets, reward and numbers.
        form: the static part. Static.
        updates: number of updates. Static.

    Returns:
        The next state of training, and sums over the episodes that ended.
    """
    return repeat_updates(lambda carry: update(carry, inputs, form), state, updates)
