"""Training of the metric agent: explore and learn in compiled chunks, costs to go renewed as the experience grows."""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float64, Int32, PRNGKeyArray

from relm_irl_jax import env
from relm_irl_jax.agent.learning import (
    LearningCurve,
    Parameters,
    TrainingRecord,
    curve_of,
    cut,
    learning_row,
    run_chunks,
)
from relm_irl_jax.agent.metric.costs import Goals, costs_to_go, steps_of_best_ways
from relm_irl_jax.agent.metric.experience import UNTRIED, ExperienceGraph, coverage, no_experience
from relm_irl_jax.agent.metric.loss import Hindsight, Losses, MetricSetting, no_costs
from relm_irl_jax.agent.metric.network import MetricNetwork, metric_network
from relm_irl_jax.agent.metric.update import MetricLearner, metric_optimiser, update
from relm_irl_jax.agent.rollout import EpisodeSums
from relm_irl_jax.agent.settings import MetricSettings
from relm_irl_jax.env import Lane, scene_lanes
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.world import Targets, World


@dataclass(frozen=True)
class MetricCurve(LearningCurve):
    """Progress of the training, one entry a chunk of updates.

    Attributes:
        states_met: share of the states that have been met.
        actions_tried: share of all states' actions that have been tried.
        distance_loss: weighted squared error of distances, in squared mean steps.
        choice_loss: divergence of the policy from the best actions, in nats.
        successor_loss: squared distance of successor embeddings from what was met.
    """

    states_met: Float64[np.ndarray, "chunks"]
    actions_tried: Float64[np.ndarray, "chunks"]
    distance_loss: Float64[np.ndarray, "chunks"]
    choice_loss: Float64[np.ndarray, "chunks"]
    successor_loss: Float64[np.ndarray, "chunks"]


@partial(jax.jit, static_argnames=("network", "settings", "updates"))
def begin(
    key: PRNGKeyArray,
    world: World,
    targets: Targets,
    lane: Lane,
    network: MetricNetwork,
    settings: MetricSettings,
    updates: int,
) -> MetricLearner:
    """Draw parameters and first episodes.

    Args:
        key: source of all randomness of the training.
        world: the training scenes.
        targets: the training targets.
        lane: one lane a worker; fields are [scenes, workers / scenes].
        network: the network. Static.
        settings: the agent's settings. Static.
        updates: updates of the whole training. Static.

    Returns:
        The learner before its first update.
    """
    key, parameter_key, episode_key = jax.random.split(key, 3)
    parameters = network.init(parameter_key, world.features[:1])
    episode = env.reset_all(episode_key, targets, lane)
    state = metric_optimiser(settings, updates).init(parameters)
    return MetricLearner(parameters, state, episode, no_experience(len(world.scene)), key)


@partial(jax.jit, static_argnames=("network", "settings", "cap", "updates", "chunk"))
def run_chunk(
    learner: MetricLearner,
    setting: MetricSetting,
    *,
    network: MetricNetwork,
    settings: MetricSettings,
    cap: int,
    updates: int,
    chunk: int,
) -> tuple[MetricLearner, EpisodeSums, Losses]:
    """Run several updates as one program.

    Args:
        learner: the state of training.
        setting: scenes, goals and costs to go.
        network: the network. Static.
        settings: the agent's settings. Static.
        cap: number of steps after which an episode is truncated. Static.
        updates: updates of the whole training. Static.
        chunk: updates to run. Static.

    Returns:
        The next state of training, sums over the episodes that ended, and the mean losses.
    """
    learner, (sums, losses) = jax.lax.scan(
        lambda carry, _: update(carry, setting, network, settings, cap, updates), learner, length=chunk
    )
    return learner, jax.tree.map(jnp.sum, sums), jax.tree.map(jnp.mean, losses)


@partial(jax.jit, static_argnames="counts")
def look_back(
    graph: ExperienceGraph,
    world: World,
    goals: Goals,
    state: Int32[Array, "scenes locals"],
    n_locals: Int32[Array, "scenes"],
    counts: str | None,
) -> Hindsight:
    """Transitions, and costs to go on the graph as it is now.

    Args:
        graph: transitions met.
        world: the scenes.
        goals: the goals and what the way to each costs.
        state: world state of each scene's local states, padded.
        n_locals: number of states of each scene.
        counts: whether distances count `steps` or `costs`; None where no costs to go are wanted. Static.

    Returns:
        The costs to go.
    """
    own = jnp.arange(state.shape[1]) < n_locals[:, None]
    successor = graph.successor[state]
    following = jnp.where((successor != UNTRIED) & own[..., None], world.local[successor], UNTRIED)
    if counts is None:
        return no_costs(following, goals)
    reach = jax.lax.map(lambda row: costs_to_go(*row), (following, goals.state, goals.cost))
    if counts == "costs":
        return Hindsight(following, reach, reach)
    return Hindsight(
        following, reach, jax.lax.map(lambda row: steps_of_best_ways(*row), (following, goals.state, reach))
    )


def reachable_states(world: World, targets: Targets) -> Bool[np.ndarray, "states"]:
    """States in which an episode can begin or end, against which coverage is counted.

    Args:
        world: the scenes.
        targets: the training targets.

    Returns:
        Whether each state is one of them.
    """
    found = np.zeros(len(world.scene), bool)
    for row, count in zip(np.asarray(targets.start), np.asarray(targets.n_starts), strict=True):
        found[row[:count]] = True
    found[np.asarray(targets.state)] = True
    return found


def one_way(graph: ExperienceGraph) -> Bool[Array, "states 4"]:
    """Transitions that no single action takes back, as far as all actions behind them were tried.

    Args:
        graph: transitions met.

    Returns:
        Whether each is one.
    """
    behind = graph.successor[jnp.maximum(graph.successor, 0)]
    back = (behind == jnp.arange(len(graph.successor))[:, None, None]).any(-1)
    return (graph.successor != UNTRIED) & (behind != UNTRIED).all(-1) & ~back


def train_metric(
    key: PRNGKeyArray,
    world: World,
    targets: Targets,
    reward_model: RewardModel,
    goals: Goals,
    settings: MetricSettings,
    cap: int,
    frames: int,
    record: TrainingRecord = TrainingRecord(),  # noqa: B008  it has no state
) -> tuple[Parameters, MetricCurve]:
    """Train a metric agent.

    Args:
        key: source of all randomness of the training.
        world: the training scenes.
        targets: the training targets; every scene has one.
        reward_model: the reward, for the learning curve.
        goals: views that the agent may set itself as targets, and what the way to each costs.
        settings: the agent's settings.
        cap: number of steps after which an episode is truncated.
        frames: frames of all workers together; rounded up to whole chunks of updates.
        record: where the course of training is left, and found again.

    Returns:
        The network's parameters and the course of training.

    Raises:
        InputError: there are too few workers, a scene has no target, the embedding cannot be divided into its groups,
            or the distance is symmetric and the world is not.
    """
    scenes = int(world.scene[-1]) + 1
    _check(world, targets, settings, scenes)
    network = metric_network(settings)
    lane = scene_lanes(targets, scenes, settings.workers // scenes)
    chunks = cut(frames, lane.first.size * settings.t_max)
    updates = chunks.count * chunks.updates
    n_locals = np.bincount(np.asarray(world.scene))
    local = np.arange(n_locals.max())
    first = np.cumsum(n_locals) - n_locals
    state = jnp.asarray(first[:, None] + np.where(local < n_locals[:, None], local, 0), jnp.int32)
    nothing = no_costs(jnp.full((*state.shape, 4), UNTRIED, jnp.int32), goals)
    setting = MetricSetting(world, targets, lane, reward_model, goals, state, jnp.asarray(n_locals, jnp.int32), nothing)
    learner = begin(key, world, targets, lane, network, settings, updates)
    reachable = jnp.asarray(reachable_states(world, targets))

    def chunk(state: tuple[MetricLearner, Hindsight, Array], number: int):
        learner, hindsight, tried_before = state
        learner, sums, losses = run_chunk(
            learner,
            replace(setting, hindsight=hindsight),
            network=network,
            settings=settings,
            cap=cap,
            updates=updates,
            chunk=chunks.updates,
        )
        met, tried = coverage(learner.graph, reachable)
        if tried > tried_before:
            if settings.distance == "euclidean" and settings.symmetric and bool(one_way(learner.graph).any()):
                raise InputError("metric.symmetric: some step cannot be taken back in these scenes; set it to false.")
            counts = None if settings.bootstrap else settings.counts
            hindsight = look_back(learner.graph, world, goals, setting.state, setting.n_locals, counts)
        row = learning_row(sums, number, chunks) | {
            "states_met": float(met),
            "actions_tried": float(tried),
            **{f"{name}_loss": float(value) for name, value in vars(jax.device_get(losses)).items()},
        }
        return (learner, hindsight, tried), row

    (learner, *_), rows = run_chunks((learner, nothing, jnp.float32(0.0)), chunk, chunks, record)
    return learner.parameters, curve_of(MetricCurve, rows)


def _check(world: World, targets: Targets, settings: MetricSettings, scenes: int) -> None:
    if settings.workers < scenes:
        raise InputError(f"metric.workers: {settings.workers} workers cannot serve {scenes} scenes; ask for more.")
    if np.bincount(np.asarray(targets.scene), minlength=scenes).min() == 0:
        raise InputError("tasks.training_targets: some scene has no training target; ask for more.")
    if settings.dimension % settings.groups:
        raise InputError(
            f"metric.groups: {settings.groups} equal parts of {settings.dimension} dimensions do not exist; "
            "give a divisor of metric.dimension."
        )
