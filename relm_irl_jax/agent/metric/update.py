"""One update of the metric agent: act with every worker, remember the transitions, learn distances from them."""

from dataclasses import dataclass
from typing import cast

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, PRNGKeyArray

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.agent.metric.experience import (
    ExperienceGraph,
    exploring_action,
    record,
    steps_to_frontier,
)
from relm_irl_jax.agent.metric.loss import Losses, MetricSetting, hindsight_loss
from relm_irl_jax.agent.metric.network import MetricNetwork, distance, places_of
from relm_irl_jax.agent.rollout import EpisodeSums, rollout, sample_action
from relm_irl_jax.agent.settings import MetricSettings
from relm_irl_jax.env import Episode


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MetricLearner:
    """Everything that training carries from update to update.

    Attributes:
        parameters: the network's parameters.
        optimiser: the optimiser's state.
        episode: where each worker stands; every field is [scenes, batch].
        graph: transitions met so far.
        key: source of all later randomness.
    """

    parameters: Parameters
    optimiser: optax.OptState
    episode: Episode
    graph: ExperienceGraph
    key: PRNGKeyArray


def metric_optimiser(settings: MetricSettings, updates: int) -> optax.GradientTransformation:
    """Gradients clipped by their global norm, then Adam with a step size that falls along a cosine.

    Args:
        settings: the agent's settings.
        updates: number of updates of the whole training.

    Returns:
        The gradient transformation.
    """
    schedule = optax.cosine_decay_schedule(settings.learning_rate, updates, 0.02)
    return optax.chain(optax.clip_by_global_norm(settings.gradient_clip), optax.adam(schedule))


def update(
    learner: MetricLearner,
    setting: MetricSetting,
    network: MetricNetwork,
    settings: MetricSettings,
    cap: int,
    updates: int,
) -> tuple[MetricLearner, tuple[EpisodeSums, Losses]]:
    """Act t_max steps with every worker, then take one gradient step.

    Workers explore where there is something left to explore, and follow the policy elsewhere. The places of all views
    are computed once and serve both acting and learning.

    Args:
        learner: the state of training.
        setting: scenes, goals and costs to go.
        network: the network. Static.
        settings: the agent's settings. Static.
        cap: number of steps after which an episode is truncated. Static.
        updates: updates of the whole training, for the step size's schedule. Static.

    Returns:
        The next state of training, sums over the episodes that ended, and the parts of the loss.
    """
    key, rollout_key, pair_key = jax.random.split(learner.key, 3)
    world, targets = setting.world, setting.targets
    places, pull_back = jax.vjp(lambda theta: places_of(network, theta, world.features), learner.parameters)
    to_frontier = steps_to_frontier(learner.graph)

    def act(key: PRNGKeyArray, views: Array, target: Array) -> tuple[Array, None]:
        state = views[..., 0]
        explore_key, policy_key = jax.random.split(key)
        exploring, anything_left = exploring_action(explore_key, learner.graph, to_frontier, state)
        steps = distance(places.after[state], places.here[targets.state[target]][..., None, :], settings)
        return jnp.where(anything_left, exploring, sample_action(policy_key, -settings.sharpness * steps)), None

    episode, experience, sums = rollout(
        rollout_key,
        act,
        learner.episode,
        setting.lane,
        world,
        targets,
        setting.reward_model,
        jnp.int32(cap),
        settings.t_max,
    )
    of_places, losses = jax.grad(lambda p: hindsight_loss(pair_key, p, setting, settings), has_aux=True)(places)
    change, optimiser = metric_optimiser(settings, updates).update(
        pull_back(of_places)[0], learner.optimiser, learner.parameters
    )
    parameters = cast(Parameters, optax.apply_updates(learner.parameters, change))
    graph = record(learner.graph, experience)
    return MetricLearner(parameters, optimiser, episode, graph, key), (sums, losses)
