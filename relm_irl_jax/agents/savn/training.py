"""Meta-training: preparation, and chunks of updates as one compiled program."""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import PRNGKeyArray

from relm_irl_jax.agents.recurrent.network import RecurrentActorCritic
from relm_irl_jax.agents.recurrent.training import init_parameters, update_inputs
from relm_irl_jax.agents.recurrent.update import make_optimizer
from relm_irl_jax.agents.rollout import EpisodeSums, init_workers
from relm_irl_jax.agents.savn.adaptation import INTERACTION, Adaptation, init_interaction
from relm_irl_jax.agents.savn.update import MetaInputs, update, worker_memory
from relm_irl_jax.agents.settings import SavnSettings
from relm_irl_jax.agents.training import TrainState, repeat_updates
from relm_irl_jax.errors import InputError
from relm_irl_jax.types import TrainingProblem


def make_adaptation(settings: SavnSettings, inner_steps: int | None = None) -> Adaptation:
    """How weights change.

    Args:
        settings: the agent's settings.
        inner_steps: largest number of changes in an episode; None for that of the settings.

    Returns:
        The same as arrays.
    """
    return Adaptation(
        inner_steps=jnp.int32(settings.inner_steps if inner_steps is None else inner_steps),
        rate=jnp.float32(settings.inner_rate),
        adapted=settings.adapted,
        interval=settings.interval,
        first_order=settings.meta_gradient == "first-order",
    )


def meta_inputs(problem: TrainingProblem, settings: SavnSettings) -> tuple[MetaInputs, int]:
    """The constant inputs of all updates.

    Args:
        problem: the learning problem.
        settings: the agent's settings.

    Returns:
        The inputs, and the number of heads.

    Raises:
        InputError: the settings do not suit the problem.
    """
    if settings.t_max % settings.interval:
        raise InputError(
            f"savn.t_max: {settings.t_max} is no multiple of savn.interval, {settings.interval}; give a multiple."
        )
    inputs, n_heads = update_inputs(problem, settings, "savn")
    return MetaInputs(inputs.task, inputs.loss, inputs.optimizer, make_adaptation(settings)), n_heads


@partial(jax.jit, static_argnames="network")
def init_train_state(key: PRNGKeyArray, inputs: MetaInputs, network: RecurrentActorCritic) -> TrainState:
    """Draw parameters and start episodes.

    Args:
        key: source of all randomness of the training.
        inputs: scenes, targets and numbers.
        network: the network. Static.

    Returns:
        The state before the first update. Network and episodes are those of the recurrent agent for the same key.
    """
    key, parameter_key, episode_key = jax.random.split(key, 3)
    interaction = init_interaction(jax.random.fold_in(key, 1), inputs.adaptation.interval, network.memory)
    parameters = {**init_parameters(parameter_key, network, inputs.task.world), INTERACTION: interaction}
    memory = worker_memory(network, inputs.adaptation, inputs.task.target_range.first.shape)
    workers = init_workers(episode_key, inputs.task, memory)
    return TrainState(parameters, make_optimizer(inputs.optimizer).init(parameters), workers, key)


@partial(jax.jit, static_argnames=("network", "windows", "updates"))
def run_updates(
    state: TrainState, inputs: MetaInputs, *, network: RecurrentActorCritic, windows: int, updates: int
) -> tuple[TrainState, EpisodeSums]:
    """Run several updates as one program.

    Args:
        state: the state of training.
        inputs: scenes, targets, reward and numbers.
        network: the network. Static.
        windows: number of windows of a rollout. Static.
        updates: number of updates. Static.

    Returns:
        The next state of training, and sums over the episodes that ended.
    """
    return repeat_updates(lambda carry: update(carry, inputs, network, windows), state, updates)
