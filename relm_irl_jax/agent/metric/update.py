"""One update of the metric agent: act with every worker, remember the transitions, regress distances on costs to go.

    loss = mean w(s,g) (D(s,g) − N(s,g))² + mean w(s,g) (D(F(s)_a, g) − N(s'_a, g))²       w = 1 / (1 + N(s,g))
         + c_choice · mean KL( best actions ‖ π(· | s, g) )
         + c_successor · mean ‖F(s)_a − ψ(s'_a)‖²

over pairs of states and goals that the experience graph connects. C is the least cost to go on it by the method's own
reward, N the number of steps of that way, or C itself (`costs`, `metric.counts`). The best actions are those that lead
to the least C, or to little more (`metric.tolerance`); they share the probability.
"""

from dataclasses import dataclass
from typing import cast

import jax
import jax.numpy as jnp
import optax
from jaxtyping import Array, Float32, Int32, PRNGKeyArray

from relm_irl_jax.agent.learning import Parameters
from relm_irl_jax.agent.metric.costs import Goals
from relm_irl_jax.agent.metric.experience import (
    UNTRIED,
    ExperienceGraph,
    exploring_action,
    record,
    steps_to_frontier,
)
from relm_irl_jax.agent.metric.network import (
    MetricNetwork,
    Places,
    distance,
    distances,
    places_of,
)
from relm_irl_jax.agent.rollout import EpisodeSums, rollout, sample_action
from relm_irl_jax.agent.settings import MetricSettings
from relm_irl_jax.env import Episode, Lane
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.world import Targets, World


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


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Hindsight:
    """What the graph, as it was at some time, says about the goals.

    Attributes:
        following: local state behind each action, or `UNTRIED`.
        reach: C, least cost from each local state to each goal; infinite where the graph knows no way.
        length: N, what the distance between them is to say: the steps of that way, or its cost.
    """

    following: Int32[Array, "scenes locals 4"]
    reach: Float32[Array, "scenes locals goals"]
    length: Float32[Array, "scenes locals goals"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class MetricSetting:
    """What an update looks up and does not change.

    Attributes:
        world: the training scenes.
        targets: the training targets.
        lane: targets that each worker may be sent to; every field is [scenes, batch].
        reward_model: the reward, for the learning curve.
        goals: views that the agent sets itself as targets.
        state: world state of each scene's local states; rows are padded with the scene's first state.
        n_locals: number of states of each scene.
        hindsight: costs to go.
    """

    world: World
    targets: Targets
    lane: Lane
    reward_model: RewardModel
    goals: Goals
    state: Int32[Array, "scenes locals"]
    n_locals: Int32[Array, "scenes"]
    hindsight: Hindsight


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Losses:
    """Parts of the loss.

    Attributes:
        distance: weighted squared error of distances, in squared units of a mean step.
        choice: Kullback-Leibler divergence from the best actions, in nats.
        successor: squared distance of successor embeddings from what was met.
    """

    distance: Float32[Array, ""]
    choice: Float32[Array, ""]
    successor: Float32[Array, ""]


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


def hindsight_loss(
    key: PRNGKeyArray, places: Places, setting: MetricSetting, settings: MetricSettings
) -> tuple[Float32[Array, ""], Losses]:
    """The loss over drawn states and goals of every scene; pairs that the graph does not connect are left out.

    Args:
        key: source of randomness.
        places: places of all states of the world.
        setting: scenes, goals and costs to go.
        settings: the agent's settings. Static.

    Returns:
        The loss and its parts.
    """
    state_key, goal_key = jax.random.split(key)
    scenes = len(setting.n_locals)
    of_scene = jnp.arange(scenes)[:, None]
    local = jax.random.randint(state_key, (scenes, settings.states), 0, setting.n_locals[:, None])
    kind_key, goal_key = jax.random.split(goal_key)
    trained = jax.random.bernoulli(kind_key, settings.target_share, (scenes, settings.goals))
    among = jnp.where(trained, setting.goals.trained[:, None], setting.goals.count[:, None])
    column = jax.random.randint(goal_key, (scenes, settings.goals), 0, among)
    hindsight, following = setting.hindsight, setting.hindsight.following[of_scene, local]
    untried = following[..., None] == UNTRIED
    here = (of_scene[..., None], local[:, :, None], column[:, None, :])
    beyond = (of_scene[..., None, None], following[..., None], column[:, None, None, :])
    wanted, wanted_behind = (hindsight.length[here], jnp.where(untried, jnp.inf, hindsight.length[beyond]))
    behind = jnp.where(untried, jnp.inf, hindsight.reach[beyond])
    goal = setting.state[of_scene, jnp.take_along_axis(setting.goals.state, column, 1)]
    at = jax.tree.map(lambda table: table[setting.state[of_scene, local]], places)
    there = places.here[goal]
    found = distances(at.here, there, settings)
    after = at.after.reshape(scenes, -1, at.after.shape[-1])
    found_behind = distances(after, there, settings).reshape(behind.shape)
    weight = 1 / (1 + wanted)
    squared = lambda found, wanted: jnp.where(jnp.isfinite(wanted), found - wanted, 0.0) ** 2  # noqa: E731
    error = (weight * squared(found, wanted)).mean()
    error_behind = (weight[:, :, None] * squared(found_behind, wanted_behind)).mean()

    best = (behind <= behind.min(2, keepdims=True) + settings.tolerance) & jnp.isfinite(behind)
    share = best / jnp.maximum(best.sum(2, keepdims=True), 1)
    cross = -(share * jax.nn.log_softmax(-settings.sharpness * found_behind, axis=2)).sum(2)
    decided = jnp.isfinite(wanted) & (wanted > 0) & best.any(2)
    choice = jnp.where(decided, cross - jnp.log(jnp.maximum(best.sum(2), 1)), 0.0).mean()

    met = setting.hindsight.following != UNTRIED
    known = (jnp.arange(met.shape[1]) < setting.n_locals[:, None])[..., None] & met
    arrived = setting.state[of_scene[..., None], jnp.maximum(setting.hindsight.following, 0)]
    apart = (places.after[setting.state] - places.here[arrived]) ** 2
    parts = apart.reshape(*apart.shape[:-1], settings.groups, -1).sum(-1).mean(-1)
    successor = jnp.where(known, parts, 0.0).sum() / jnp.maximum(known.sum(), 1)

    losses = Losses(error + error_behind, choice, successor)
    total = losses.distance + settings.choice_weight * choice + settings.successor_weight * successor
    return total, losses
