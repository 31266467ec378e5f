"""Behaviour cloning: the policy fitted to demonstrated actions by maximum likelihood, without reward or environment.

    loss = mean over demonstrated (s, g, a) of −log π(a | s, g)

The network is the actor-critic's, and so are its optimiser and the number of pairs that one update sees, so that the
baseline differs from the other methods by its supervision alone. The value is not trained.
"""

from dataclasses import dataclass
from functools import partial
from typing import cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float64, Int32, PRNGKeyArray

from relm_irl_jax.agent.learning import Parameters, TrainingRecord, curve_of, cut, run_chunks
from relm_irl_jax.agent.settings import SiameseSettings
from relm_irl_jax.agent.siamese.frames import forward, tabulate
from relm_irl_jax.agent.siamese.network import SiameseActorCritic
from relm_irl_jax.agent.siamese.train import draw_parameters, network_of
from relm_irl_jax.agent.siamese.update import optimiser_of, over_steps
from relm_irl_jax.errors import InputError
from relm_irl_jax.world import Targets, World


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Decisions:
    """Demonstrated decisions, one row a head; rows are padded at the end.

    Attributes:
        views: last states in the world, the latest first.
        target: rows of `Targets`.
        action: action demonstrated there.
        count: number of valid entries in each row.
    """

    views: Int32[Array, "heads decisions history"]
    target: Int32[Array, "heads decisions"]
    action: Int32[Array, "heads decisions"]
    count: Int32[Array, "heads"]


@dataclass(frozen=True)
class CloningCurve:
    """Progress of the fit, one entry a chunk of updates.

    Attributes:
        frames: demonstrated pairs seen, repetitions counted, up to the end of the chunk.
        loss: mean −log π of the demonstrated action, in nats.
        accuracy: share of pairs whose demonstrated action is the most probable one.
    """

    frames: Float64[np.ndarray, "chunks"]
    loss: Float64[np.ndarray, "chunks"]
    accuracy: Float64[np.ndarray, "chunks"]


def views_along(states: Int32[np.ndarray, "steps"], history: int) -> Int32[np.ndarray, "steps history"]:
    """What is seen along a walk.

    Args:
        states: the states in which an action was taken.
        history: number of last views that are seen.

    Returns:
        At every step the last states, the latest first; the first one, repeated, where the walk is younger.
    """
    step = np.arange(len(states))[:, None] - np.arange(history)
    return np.asarray(states)[np.maximum(step, 0)]


def decisions_of(
    views: Int32[np.ndarray, "decisions history"],
    target: Int32[np.ndarray, "decisions"],
    action: Int32[np.ndarray, "decisions"],
    world: World,
    n_heads: int,
) -> Decisions:
    """Sort demonstrated decisions by the head that takes them.

    Args:
        views: last states in the world, the latest first.
        target: rows of `Targets`.
        action: action demonstrated there.
        world: the training scenes.
        n_heads: number of heads.

    Returns:
        The decisions.

    Raises:
        InputError: nothing is demonstrated for a head.
    """
    head = np.asarray(world.head)[views[:, 0]]
    count = np.bincount(head, minlength=n_heads)
    if count.min() == 0:
        raise InputError(
            "tasks.training_targets: some head of the network has no demonstration to clone; ask for more targets."
        )

    def rows(values: np.ndarray) -> Array:
        padded = np.zeros((n_heads, count.max(), *values.shape[1:]), np.int32)
        for number in range(n_heads):
            padded[number, : count[number]] = values[head == number]
        return jnp.asarray(padded)

    return Decisions(rows(views), rows(target), rows(action), jnp.asarray(count, jnp.int32))


@partial(jax.jit, static_argnames=("network", "settings", "updates"))
def _run_chunk(
    carry: tuple[Parameters, optax.OptState],
    key: PRNGKeyArray,
    decisions: Decisions,
    world: World,
    targets: Targets,
    *,
    network: SiameseActorCritic,
    settings: SiameseSettings,
    updates: int,
) -> tuple[tuple[Parameters, optax.OptState], tuple[Array, Array]]:
    """Take several gradient steps, each on pairs drawn with replacement, as many for every head."""
    heads = jnp.arange(network.n_heads)
    share = settings.workers // network.n_heads * settings.t_max

    def update(carry, key):
        parameters, optimiser = carry
        place = jax.random.randint(key, (network.n_heads, share), 0, decisions.count[:, None])
        views, target, action = (
            x[heads[:, None], place] for x in (decisions.views, decisions.target, decisions.action)
        )

        def loss(parameters):
            tables = tabulate(network, parameters, world.features, targets.state, place.size, targets.predicted)
            logits = forward(network, parameters, tables, views, target, heads).logits
            likelihood = jnp.take_along_axis(jax.nn.log_softmax(logits), action[..., None], -1)
            loss = over_steps(-likelihood, settings)
            return loss, (-likelihood.mean(), (jnp.argmax(logits, -1) == action).mean())

        (_, measured), gradient = jax.value_and_grad(loss, has_aux=True)(parameters)
        change, optimiser = optimiser_of(settings).update(gradient, optimiser, parameters)
        return (cast(Parameters, optax.apply_updates(parameters, change)), optimiser), measured

    carry, measured = jax.lax.scan(update, carry, jax.random.split(key, updates))
    return carry, jax.tree.map(jnp.mean, measured)


def clone(
    key: PRNGKeyArray,
    world: World,
    targets: Targets,
    decisions: Decisions,
    n_heads: int,
    settings: SiameseSettings,
    frames: int,
    record: TrainingRecord = TrainingRecord(),  # noqa: B008  it has no state
) -> tuple[Parameters, CloningCurve]:
    """Fit the policy to demonstrations.

    Args:
        key: source of all randomness.
        world: the training scenes.
        targets: the training targets.
        decisions: what was demonstrated.
        n_heads: number of heads.
        settings: the agent's settings; of the loss only the optimiser's are used.
        frames: pairs seen, repetitions counted; rounded up to whole chunks of updates.
        record: where the course of the fit is left, and found again.

    Returns:
        The network's parameters and the course of the fit.
    """
    network = network_of(settings, n_heads)
    key, parameter_key = jax.random.split(key)
    parameters = draw_parameters(parameter_key, network, world)
    carry = parameters, optimiser_of(settings).init(parameters)
    chunks = cut(frames, n_heads * (settings.workers // n_heads) * settings.t_max)

    def chunk(carry: tuple[Parameters, optax.OptState], number: int):
        carry, (loss, accuracy) = _run_chunk(
            carry,
            jax.random.fold_in(key, number * chunks.updates),
            decisions,
            world,
            targets,
            network=network,
            settings=settings,
            updates=chunks.updates,
        )
        seen = float((number + 1) * chunks.frames)
        return carry, {"frames": seen, "loss": float(loss), "accuracy": float(accuracy)}

    carry, rows = run_chunks(carry, chunk, chunks, record)
    return carry[0], curve_of(CloningCurve, rows)
