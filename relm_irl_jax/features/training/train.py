"""Training of the small encoder.

Scenes take turns: a pool of them is in memory, and views of an update come from some of the pool. Every few updates the
next scene takes the place of the one that has been there longest. Built-in rooms are rendered as they enter.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import cycle, islice
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float32, UInt8

from relm_irl_jax.features.convnet import VIEW, ConvNet, initial_variables
from relm_irl_jax.features.encoder import normalise
from relm_irl_jax.features.training.heads import Heads, HeadSettings, Losses, Readings, losses
from relm_irl_jax.features.training.labels import LabelledScene, ViewGroups, draw_groups
from relm_irl_jax.features.training.settings import TrainingSettings

Variables = dict[str, Any]
"""Nested dictionaries of arrays."""

LoadScene = Callable[[], LabelledScene]
"""Reads or generates a scene."""


class TrainState(NamedTuple):
    """Parameters of network and heads, running statistics of batch norms, and the optimiser's state."""

    parameters: Variables
    statistics: Variables
    optimiser: optax.OptState


def optimiser(settings: TrainingSettings) -> optax.GradientTransformation:
    """AdamW with its schedule."""
    warm = min(100, settings.steps // 4)
    schedule = optax.warmup_cosine_decay_schedule(0.0, settings.learning_rate, warm, settings.steps)
    return optax.chain(
        optax.clip_by_global_norm(settings.clip), optax.adamw(schedule, weight_decay=settings.weight_decay)
    )


def initial_state(settings: TrainingSettings, heads: HeadSettings, seed: int) -> TrainState:
    """The state before training.

    Args:
        settings: the settings.
        heads: what is learned.
        seed: seed of the initial weights.

    Returns:
        The state.
    """
    network, head = jax.random.split(jax.random.key(seed))
    variables = initial_variables(network)
    readers = Heads(heads.categories)
    features = jnp.zeros((1, 1, 512))
    parameters = {"network": variables["params"], "heads": jax.jit(readers.init)(head, features)["params"]}
    return TrainState(parameters, variables["batch_stats"], optimiser(settings).init(parameters))


def read_groups(
    parameters: Variables, statistics: Variables, views: UInt8[Array, "groups members height width 3"], categories: int
) -> tuple[Readings, Variables]:
    """Apply network and heads to the views of an update, with batch norm by the views' own statistics.

    Args:
        parameters: parameters of network and heads.
        statistics: running statistics.
        views: the views.
        categories: number of categories. Static.

    Returns:
        The readings, and the next running statistics.
    """
    groups, members = views.shape[:2]
    images = normalise(views.reshape(-1, VIEW, VIEW, 3).astype(jnp.float32))
    variables = {"params": parameters["network"], "batch_stats": statistics}
    features, changed = ConvNet(train=True).apply(variables, images, mutable=["batch_stats"])
    readings = Heads(categories).apply({"params": parameters["heads"]}, features.reshape(groups, members, -1))
    return cast(Readings, readings), cast(Variables, changed["batch_stats"])


@partial(jax.jit, static_argnames=("settings", "heads"), donate_argnums=0)
def update(
    state: TrainState, groups: ViewGroups, settings: TrainingSettings, heads: HeadSettings
) -> tuple[TrainState, Losses]:
    """One step of AdamW.

    Args:
        state: the state.
        groups: the views of the update.
        settings: the settings. Static.
        heads: what is learned. Static.

    Returns:
        The next state, and the losses before the step.
    """

    def loss(parameters: Variables) -> tuple[Float32[Array, ""], tuple[Losses, Variables]]:
        views = jnp.asarray(groups.views)
        readings, statistics = read_groups(parameters, state.statistics, views, heads.categories)
        parts = losses(readings, groups, heads)
        return jnp.stack(parts).sum(), (parts, statistics)

    gradient, (parts, statistics) = jax.grad(loss, has_aux=True)(state.parameters)
    with jax.numpy_dtype_promotion("standard"):  # Adam raises a float to the power of an integer count
        changes, next_optimiser = optimiser(settings).update(gradient, state.optimiser, state.parameters)
    parameters = cast(Variables, optax.apply_updates(state.parameters, changes))
    return TrainState(parameters, statistics, next_optimiser), parts


def batches(scenes: Sequence[LoadScene], settings: TrainingSettings, seed: int) -> Iterator[ViewGroups]:
    """Views for one update after the other, without end.

    Args:
        scenes: the scenes, in the order of their turns.
        settings: numbers of views, and how scenes take turns.
        seed: seed of the draws.

    Yields:
        Groups of views.
    """
    generator = np.random.default_rng([seed, 2])
    following = cycle(scenes)
    pool = deque(load() for load in islice(following, min(settings.pool, len(scenes))))
    step = 0
    while True:
        yield draw_groups(list(pool), generator, groups=settings.groups, members=settings.members)
        step += 1
        if len(scenes) > settings.pool and step % settings.turn == 0:
            pool.popleft()
            pool.append(next(following)())


def scenes_met(scenes: int, settings: TrainingSettings) -> int:
    """How many scenes have had a turn when training ends.

    Args:
        scenes: number of scenes.
        settings: numbers of updates and of updates in a turn.

    Returns:
        The number; the others have not been loaded for an update.
    """
    return min(scenes, settings.pool + (settings.steps - 1) // settings.turn)


def train(
    scenes: Sequence[LoadScene],
    settings: TrainingSettings,
    heads: HeadSettings,
    seed: int,
    report: Callable[[int, Losses], None] | None = None,
) -> TrainState:
    """Train on scenes.

    Args:
        scenes: the scenes.
        settings: the settings.
        heads: what is learned.
        seed: seed of initial weights and draws.
        report: called after every update with their number and the losses.

    Returns:
        The state after training.
    """
    state = initial_state(settings, heads, seed)
    stream = batches(scenes, settings, seed)
    parts: Losses | None = None
    with ThreadPoolExecutor(1) as host:  # the views of the next update are drawn while this one is computed
        following = host.submit(next, stream)
        for number in range(1, settings.steps + 1):
            groups = following.result()
            following = host.submit(next, stream)
            previous, (state, parts) = parts, update(state, groups, settings, heads)
            jax.block_until_ready(previous)  # not more than one update ahead, so that memory holds few views
            if report is not None:
                report(number, parts)
    return state
