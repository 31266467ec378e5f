"""Training: many updates in one compiled program, with what happened in between as a few numbers."""

from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray

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
from relm_irl_jax.agent.rollout import EpisodeSums
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.devices import over_devices, usable
from relm_irl_jax.agent.siamese.network import SiameseActorCritic
from relm_irl_jax.agent.siamese.pairs import Pairs, pairs_of
from relm_irl_jax.agent.siamese.update import Learner, Setting, optimiser_of, update
from relm_irl_jax.env import Lane
from relm_irl_jax.errors import InputError
from relm_irl_jax.rewards.model import RewardModel
from relm_irl_jax.world import Targets, World


def network_of(settings: SiameseSettings, n_heads: int) -> SiameseActorCritic:
    """The network that the settings describe.

    Args:
        settings: the agent's settings.
        n_heads: number of heads.

    Returns:
        The network without parameters.
    """
    return SiameseActorCritic(
        n_heads,
        settings.width,
        settings.history,
        settings.fusion == "comparison",
        settings.sees_reward,
        settings.initial == "uniform",
    )


def worker_lanes(targets: Targets, world: World, n_heads: int, workers: int) -> Lane:
    """Tie workers to targets: an equal share of the workers to each head, and each to all targets of that head.

    Args:
        targets: the training targets, sorted so that those of one head are consecutive.
        world: the training scenes.
        n_heads: number of heads.
        workers: number of workers.

    Returns:
        One lane a worker; fields are [heads, workers / heads].

    Raises:
        InputError: there are fewer workers than heads, or a head has no target.
    """
    head = np.asarray(world.head)[np.asarray(targets.state)]
    first = np.asarray([np.searchsorted(head, number) for number in range(n_heads)])
    count = np.bincount(head, minlength=n_heads)
    if count.min() == 0:
        raise InputError("tasks.training_targets: some head of the network has no training target; ask for more.")
    if workers < n_heads:
        raise InputError(f"siamese.workers: {workers} workers cannot serve {n_heads} heads; ask for more.")
    share = (n_heads, workers // n_heads)
    spread = lambda values: jnp.asarray(np.broadcast_to(values[:, None], share), jnp.int32)  # noqa: E731
    return Lane(first=spread(first), count=spread(count))


def check_cap(cap: int, settings: SiameseSettings) -> None:
    """Refuse a cap so low that a worker may be truncated twice in a rollout.

    Args:
        cap: number of steps after which an episode is truncated.
        settings: the agent's settings.

    Raises:
        InputError: the cap is below t_max.
    """
    if cap < settings.t_max:
        raise InputError(
            f"tasks.cap: {cap} is below siamese.t_max ({settings.t_max}); raise the one or lower the other."
        )


def cheaper_pairs(world: World, targets: Targets, network: SiameseActorCritic, frames: int) -> Pairs | None:
    """All pairs of a state and a target, where there are no more of them than frames in an update.

    Args:
        world: the training scenes.
        targets: the training targets.
        network: the network.
        frames: frames of an update that one device computes.

    Returns:
        The pairs; None where frames are computed one by one, as they are where several views are seen.
    """
    if network.history > 1:
        return None
    pairs = pairs_of(world, targets, network.n_heads)
    return pairs if pairs.count <= frames else None


def draw_parameters(key: PRNGKeyArray, network: SiameseActorCritic, world: World) -> Parameters:
    """Draw the network's first parameters.

    Args:
        key: source of randomness.
        network: the network.
        world: gives the number of features of a view.

    Returns:
        The parameters.
    """
    target = jnp.zeros((network.n_heads, 1, world.features.shape[1]), jnp.float32)
    view = jnp.repeat(target[:, :, None], network.history, 2)
    predicted = jnp.zeros(target.shape[:-1]) if network.sees_reward else None
    return jax.jit(network.init)(key, view, target, jnp.arange(network.n_heads), predicted)


@partial(jax.jit, static_argnames=("network", "settings"))
def begin(
    key: PRNGKeyArray,
    world: World,
    targets: Targets,
    lane: Lane,
    network: SiameseActorCritic,
    settings: SiameseSettings,
) -> Learner:
    """Draw parameters and first episodes.

    Args:
        key: source of all randomness of the training.
        world: the training scenes.
        targets: the training targets.
        lane: one lane a worker.
        network: the network. Static.
        settings: the agent's settings. Static.

    Returns:
        The learner before its first update.
    """
    key, parameter_key, episode_key = jax.random.split(key, 3)
    parameters = draw_parameters(parameter_key, network, world)
    episode = env.reset_all(episode_key, targets, lane, network.history)
    return Learner(parameters, optimiser_of(settings).init(parameters), episode, key)


@partial(jax.jit, static_argnames=("network", "settings", "cap", "updates"))
def run_chunk(
    learner: Learner,
    setting: Setting,
    *,
    network: SiameseActorCritic,
    settings: SiameseSettings,
    cap: int,
    updates: int,
) -> tuple[Learner, EpisodeSums]:
    """Run several updates as one program.

    Args:
        learner: the state of training.
        setting: scenes, targets, lanes and reward.
        network: the network. Static.
        settings: the agent's settings. Static.
        cap: number of steps after which an episode is truncated. Static.
        updates: number of updates. Static.

    Returns:
        The next state of training, and sums over the episodes that ended.
    """
    learner, sums = jax.lax.scan(
        lambda carry, _: update(carry, setting, network, settings, cap), learner, length=updates
    )
    return learner, jax.tree.map(jnp.sum, sums)


def train(
    key: PRNGKeyArray,
    world: World,
    targets: Targets,
    reward_model: RewardModel,
    return_scale: float,
    n_heads: int,
    settings: SiameseSettings,
    cap: int,
    frames: int,
    record: TrainingRecord = TrainingRecord(),  # noqa: B008  it has no state
    devices: Sequence[jax.Device] | None = None,
) -> tuple[Parameters, LearningCurve]:
    """Train an agent.

    Args:
        key: source of all randomness of the training.
        world: the training scenes.
        targets: the training targets.
        reward_model: the reward.
        return_scale: size of a typical return, by which returns are divided.
        n_heads: number of heads.
        settings: the agent's settings.
        cap: number of steps after which an episode is truncated, at least `settings.t_max`.
        frames: frames of all workers together; rounded up to whole chunks of updates.
        record: where the course of training is left, and found again.
        devices: devices that share the workers; all where None.

    Returns:
        The network's parameters and the learning curve.

    Raises:
        InputError: the cap is below t_max, or the lanes cannot be laid.
    """
    check_cap(cap, settings)
    network = network_of(settings, n_heads)
    lane = worker_lanes(targets, world, n_heads, settings.workers)
    share = lane.first.size // len(usable(lane.first.shape[1], devices))
    pairs = cheaper_pairs(world, targets, network, share * settings.t_max)
    setting = Setting(world, targets, lane, reward_model, jnp.float32(return_scale), pairs)
    learner, setting = over_devices(begin(key, world, targets, lane, network, settings), setting, devices)
    chunks = cut(frames, lane.first.size * settings.t_max)

    def chunk(learner: Learner, number: int):
        learner, sums = run_chunk(learner, setting, network=network, settings=settings, cap=cap, updates=chunks.updates)
        return learner, learning_row(sums, number, chunks)

    learner, rows = run_chunks(learner, chunk, chunks, record)
    return learner.parameters, curve_of(LearningCurve, rows)
