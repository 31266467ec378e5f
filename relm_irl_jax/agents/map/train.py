"""Training of the mapping agent: where is the target, after each prefix of a walk?

For a walk with distinct views 1 … n and a target at pose g in the walk's frame, the loss is

    −Σ_{k ∈ prefixes, g not among views 1 … k} log P(g | views 1 … k)  +  λ Σ_{places} BCE(p_free, place is free)

averaged over walks, prefixes and targets: cross-entropy of the true pose, and of the places that can be stood on. The
labels are the walks' own odometry.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float32, Int32

from relm_irl_jax.agents.map.geometry import GRID, RADIUS, SIDE
from relm_irl_jax.agents.map.memory import Odometry, free_logits, grid_rows, summarise, turned
from relm_irl_jax.agents.map.network import RECORD, VIEW, MapNetwork, Projections
from relm_irl_jax.agents.map.posterior import (
    N_BINS,
    all_scores,
    distance_bins,
    kernel_spectrum,
    log_posterior,
    memory_spectrum,
)
from relm_irl_jax.agents.map.training_data import Room, Walks, draw_walks
from relm_irl_jax.agents.training import apply_gradient
from relm_irl_jax.types import Parameters

PREFIXES = (1, 2, 4, 8, 16, 32)
"""Numbers of distinct views after which the posterior is judged."""


@dataclass(frozen=True)
class MapSettings:
    """How the mapping agent is trained.

    Attributes:
        steps: updates.
        walks: walks of an update, all in one room.
        targets: targets of an update.
        best_share: share of the targets that are best views of objects.
        learning_rate: of AdamW; constant over the first half, then down to 0 along a cosine.
        weight_decay: of AdamW.
        free_weight: λ.
        clip: greatest norm of a gradient.
    """

    steps: int = 3000
    walks: int = 2
    targets: int = 16
    best_share: float = 0.7
    learning_rate: float = 1.5e-3
    weight_decay: float = 1e-2
    free_weight: float = 1.0
    clip: float = 1.0


class TrainState(NamedTuple):
    """Parameters and the optimiser's state."""

    parameters: Parameters
    optimiser: optax.OptState


def initial_parameters(network: MapNetwork, seed: int = 0) -> Parameters:
    """Parameters before training.

    Args:
        network: the network.
        seed: seed of its initial weights.

    Returns:
        `network`, its weights, and `prior`: the profiles over the distance from the start and κ.
    """
    views = jnp.zeros((1, VIEW, VIEW, 3), jnp.uint8)
    far = jnp.arange(N_BINS, dtype=jnp.float32)
    return {
        "network": jax.jit(network.init)(jax.random.key(seed), views),
        "prior": {
            "free": 1.0 - 0.3 * far,
            "pose": jnp.zeros(N_BINS),
            "scale": jnp.float32(1.0),
        },
    }


def optimiser(settings: MapSettings) -> optax.GradientTransformation:
    """AdamW with its schedule."""
    half = settings.steps // 2
    warm = min(100, half)
    schedule = optax.join_schedules(
        [
            optax.linear_schedule(0.0, settings.learning_rate, warm),
            optax.constant_schedule(settings.learning_rate),
            optax.cosine_decay_schedule(settings.learning_rate, max(settings.steps - half, 1)),
        ],
        [warm, half],
    )
    return optax.chain(
        optax.clip_by_global_norm(settings.clip), optax.adamw(schedule, weight_decay=settings.weight_decay)
    )


def prefix_memories(
    record: Float32[Array, "walks steps cells record"], walks: Walks
) -> tuple[Float32[Array, "walks prefixes grid grid record"], Odometry]:
    """Grids and odometries after each prefix of each walk."""
    n_walks, steps = walks.pose.shape[:2]
    part = jnp.asarray(np.searchsorted(PREFIXES, np.arange(1, steps + 1)))

    def draw(record, pose, valid):
        rows = jax.vmap(grid_rows)(pose)
        values = jax.vmap(turned)(record, pose[:, 0]) * valid[:, None, None].astype(record.dtype)
        grid = jnp.zeros((len(PREFIXES), GRID * GRID, RECORD)).at[part[:, None], rows].add(values)
        grid = jnp.cumsum(grid, 0).reshape(len(PREFIXES), GRID, GRID, RECORD)
        seen = jnp.zeros((len(PREFIXES), 4, SIDE, SIDE), jnp.int32)
        seen = seen.at[part, pose[:, 0], pose[:, 1] + RADIUS, pose[:, 2] + RADIUS].add(1)
        return grid, jnp.cumsum(seen, 0) > 0

    grid, seen = jax.vmap(draw)(record, walks.pose, walks.valid)
    blocked = jnp.zeros((n_walks, len(PREFIXES), SIDE, SIDE), bool)
    return grid, Odometry(jnp.zeros((n_walks, len(PREFIXES), 3), jnp.int32), seen, blocked)


class Losses(NamedTuple):
    """What training reports.

    Attributes:
        pose: cross-entropy of the target's pose in nats, for each prefix.
        top: share of targets whose pose is the most probable one, for each prefix.
        free: cross-entropy of a place's being free.
    """

    pose: Float32[Array, "prefixes"]
    top: Float32[Array, "prefixes"]
    free: Float32[Array, ""]


def compute_loss(
    parameters: Parameters, walks: Walks, network: MapNetwork, free_weight: Float32[Array, ""]
) -> tuple[Float32[Array, ""], Losses]:
    """The loss of one update.

    Args:
        parameters: as `initial_parameters` gives them.
        walks: walks and targets.
        network: the network. Static.
        free_weight: λ.

    Returns:
        The loss and its parts.
    """
    n_walks, steps = walks.pose.shape[:2]
    n_targets = len(walks.target_views)
    views = jnp.concatenate([walks.views.reshape(-1, VIEW, VIEW, 3), walks.target_views])
    projections = cast(Projections, network.apply(parameters["network"], views))
    record = projections.record[:-n_targets].reshape(n_walks, steps, -1, RECORD)
    grid, odometry = prefix_memories(record, walks)
    seen, evidence = summarise(grid)
    bins = jnp.asarray(distance_bins())
    prior: dict[str, Array] = dict(parameters["prior"])
    free = free_logits(evidence, prior["free"][bins], prior["scale"], odometry)

    score = all_scores(
        memory_spectrum(seen.reshape(-1, *seen.shape[2:])), kernel_spectrum(projections.kernel[-n_targets:])
    )
    score = score.reshape(n_walks, len(PREFIXES), n_targets, 4, SIDE, SIDE)
    posterior = log_posterior(score, free[:, :, None], prior["pose"][bins], ~odometry.seen[:, :, None])

    heading, z, x = (walks.target_pose[..., i] + (RADIUS if i else 0) for i in range(3))
    cell = ((heading * SIDE + z) * SIDE + x)[:, None, :, None]
    flat = posterior.reshape(*posterior.shape[:3], -1)
    met = jnp.take_along_axis(odometry.seen.reshape(*odometry.seen.shape[:2], 1, -1), cell, -1)[..., 0]
    right = jnp.take_along_axis(flat, cell, -1)[..., 0]
    weight = (~met).astype(jnp.float32)
    total = jnp.maximum(weight.sum((0, 2)), 1)
    pose = -(jnp.where(met, 0.0, right)).sum((0, 2)) / total
    top = jnp.where(right >= flat.max(-1), weight, 0.0).sum((0, 2)) / total
    entropy = optax.sigmoid_binary_cross_entropy(free, walks.free[:, None].astype(jnp.float32))
    known = odometry.seen.any(-3)
    free_loss = jnp.where(known, 0.0, entropy).mean() * 10
    return pose.mean() + free_weight * free_loss, Losses(pose, top, free_loss)


@partial(jax.jit, static_argnames=("network", "settings"), donate_argnums=0)
def update(state: TrainState, walks: Walks, network: MapNetwork, settings: MapSettings) -> tuple[TrainState, Losses]:
    """One step of AdamW.

    Args:
        state: parameters and optimiser.
        walks: walks and targets.
        network: the network. Static.
        settings: the settings. Static.

    Returns:
        The next state and the losses before the step.
    """
    gradient, losses = jax.grad(compute_loss, has_aux=True)(
        state.parameters, walks, network, jnp.float32(settings.free_weight)
    )
    return TrainState(*apply_gradient(optimiser(settings), gradient, state.optimiser, state.parameters)), losses


def batches(rooms: Sequence[Room], settings: MapSettings, seed: int) -> Iterator[Walks]:
    """Walks for one update after the other, without end.

    Args:
        rooms: where to walk, drawn uniformly.
        settings: how many walks and targets.
        seed: seed of the walks.

    Yields:
        Walks in one room.
    """
    generator = np.random.default_rng([seed, 1])
    while True:
        room = rooms[int(generator.integers(len(rooms)))]
        yield draw_walks(
            room,
            generator,
            walks=settings.walks,
            steps=PREFIXES[-1],
            targets=settings.targets,
            best_share=settings.best_share,
        )


@dataclass(frozen=True)
class Curve:
    """Losses of a training, averaged over `interval` updates a row.

    Attributes:
        update: number of updates.
        pose: cross-entropy of the target's pose for each of `PREFIXES`.
        top: share of targets whose pose is the most probable one, for each of `PREFIXES`.
        free: cross-entropy of a place's being free.
    """

    update: Int32[np.ndarray, "rows"]
    pose: Float32[np.ndarray, "rows prefixes"]
    top: Float32[np.ndarray, "rows prefixes"]
    free: Float32[np.ndarray, "rows"]


Report = Callable[[int, Losses, TrainState], None]
"""Takes the number of updates, their mean losses and the state."""


def train_map(
    rooms: Sequence[Room],
    settings: MapSettings,
    seed: int,
    network: MapNetwork,
    report: Report | None = None,
    *,
    interval: int = 50,
    start: Parameters | None = None,
) -> tuple[Parameters, Curve]:
    """Train on walks through rooms.

    Args:
        rooms: where to walk; drawn uniformly, so a room that is named twice is walked twice as often.
        settings: the settings.
        seed: seed of initial weights and walks.
        network: the network.
        report: called every `interval` updates with their number, their mean losses and the state.
        interval: updates of a row of the curve.
        start: parameters to begin with, instead of drawn ones.

    Returns:
        The parameters and the curve.
    """
    parameters = initial_parameters(network, seed) if start is None else start
    state = TrainState(parameters, optimiser(settings).init(parameters))
    stream = batches(rooms, settings, seed)
    rows: list[Losses] = []
    with ThreadPoolExecutor(1) as host:  # walks of the next update are drawn while this one is computed
        following = host.submit(next, stream)
        pending: list[Losses] = []
        for number in range(1, settings.steps + 1):
            walks = following.result()
            following = host.submit(next, stream)
            state, losses = update(state, walks, network, settings)
            pending.append(losses)
            if number % interval == 0 or number == settings.steps:
                rows.append(jax.tree.map(lambda *parts: np.mean([np.asarray(part) for part in parts], 0), *pending))
                pending = []
                if report is not None:
                    report(number, rows[-1], state)
    pose, top, free = (np.stack(column).astype(np.float32) for column in zip(*rows, strict=True))
    numbers = np.minimum(np.arange(1, len(rows) + 1) * interval, settings.steps).astype(np.int32)
    return state.parameters, Curve(numbers, pose, top, free)
