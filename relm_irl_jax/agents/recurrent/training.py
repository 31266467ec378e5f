"""Training of the recurrent actor-critic: preparation, and chunks of updates as one compiled program."""

from functools import partial
from typing import cast

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.actor_critic import LossWeights
from relm_irl_jax.agents.heads import scene_heads, worker_target_ranges
from relm_irl_jax.agents.recurrent.network import NO_ACTION, RecurrentActorCritic, Seen
from relm_irl_jax.agents.recurrent.unroll import initial_memory
from relm_irl_jax.agents.recurrent.update import OptimizerNumbers, UpdateInputs, make_optimizer, update
from relm_irl_jax.agents.rollout import EpisodeSums, NavigationTask, init_workers
from relm_irl_jax.agents.settings import RecurrentSettings
from relm_irl_jax.agents.training import TrainState, repeat_updates
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import Parameters, TrainingProblem
from relm_irl_jax.world import World


def make_network(settings: RecurrentSettings, n_heads: int) -> RecurrentActorCritic:
    """The network.

    Args:
        settings: its sizes.
        n_heads: number of heads.

    Returns:
        The network.
    """
    return RecurrentActorCritic(n_heads, settings.width, settings.memory, settings.cell)


def update_inputs(problem: TrainingProblem, settings: RecurrentSettings, agent: str) -> tuple[UpdateInputs, int]:
    """The constant inputs of all updates.

    Args:
        problem: the learning problem.
        settings: the agent's settings.
        agent: name of the agent's settings, for messages.

    Returns:
        The inputs, and the number of heads.

    Raises:
        InputError: the settings do not suit the problem.
    """
    if problem.cap < settings.t_max:  # a worker could be truncated twice in a rollout
        raise InputError(f"{agent}.t_max: {settings.t_max} exceeds the cap of {problem.cap} steps; lower it.")
    scene_head = scene_heads(problem.world, settings.heads, agent)
    n_heads = int(scene_head.max()) + 1
    ranges = worker_target_ranges(problem.targets, scene_head, n_heads, settings.workers, agent)
    task = NavigationTask(problem.world, problem.targets, ranges, problem.reward, jnp.int32(problem.cap))
    loss = LossWeights(
        discount=jnp.float32(settings.discount),
        value=jnp.float32(settings.value_weight),
        entropy=jnp.float32(settings.entropy_weight),
        return_scale=jnp.float32(problem.return_scale),
    )
    optimizer = OptimizerNumbers(jnp.float32(settings.learning_rate), jnp.float32(settings.gradient_clip))
    return UpdateInputs(task, loss, optimizer), n_heads


def init_parameters(key: PRNGKeyArray, network: RecurrentActorCritic, world: World) -> Parameters:
    """Draw the network's initial parameters.

    Args:
        key: source of randomness.
        network: the network.
        world: the scenes, which give the number of features.

    Returns:
        The parameters.
    """
    zeros = jnp.zeros((network.n_heads, 1), jnp.int32)
    seen = Seen(zeros, zeros, zeros + NO_ACTION, zeros > 0)
    drawn = jax.jit(network.init)(key, world.features[:1], jnp.zeros(1, jnp.int32), seen, jnp.arange(network.n_heads))
    return cast(Parameters, drawn)


@partial(jax.jit, static_argnames="network")
def init_train_state(key: PRNGKeyArray, inputs: UpdateInputs, network: RecurrentActorCritic) -> TrainState:
    """Draw parameters and start episodes.

    Args:
        key: source of all randomness of the training.
        inputs: scenes, targets and numbers.
        network: the network. Static.

    Returns:
        The state before the first update.
    """
    key, parameter_key, episode_key = jax.random.split(key, 3)
    parameters = init_parameters(parameter_key, network, inputs.task.world)
    workers = init_workers(episode_key, inputs.task, initial_memory(network, inputs.task.target_range.first.shape))
    return TrainState(parameters, make_optimizer(inputs.optimizer).init(parameters), workers, key)


@partial(jax.jit, static_argnames=("network", "t_max", "updates"))
def run_updates(
    state: TrainState, inputs: UpdateInputs, *, network: RecurrentActorCritic, t_max: int, updates: int
) -> tuple[TrainState, EpisodeSums]:
    """Run several updates as one program.

    Args:
        state: the state of training.
        inputs: scenes, targets, reward and numbers.
        network: the network. Static.
        t_max: steps of each worker in an update. Static.
        updates: number of updates. Static.

    Returns:
        The next state of training, and sums over the episodes that ended.
    """
    return repeat_updates(lambda carry: update(carry, inputs, network, t_max), state, updates)
