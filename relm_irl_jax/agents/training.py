"""The training loop over chunks of updates, and the learning curve: the parts of training that all agents share."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Float64, PRNGKeyArray

from relm_irl_jax.agents.rollout import EpisodeSums, Workers
from relm_irl_jax.errors import DivergenceError
from relm_irl_jax.types import Parameters, Row, State, TrainingLog

Curve = TypeVar("Curve")
"""A dataclass of columns of equal length, one of them named `frames`."""

UPDATES_PER_CHUNK = 8
"""Updates of one call of the compiled program, which gives one row of the learning curve."""


@dataclass(frozen=True)
class LearningCurve:
    """Training performance, one entry for each chunk of updates; metrics are NaN for chunks in which no episode ended.

    Attributes:
        frames: frames of all workers up to the end of the chunk.
        episodes: number of episodes that ended in the chunk.
        success_rate: share of these episodes that reached the target.
        path_length_error: mean path length minus shortest path of these episodes, in actions (Equation 36).
        spl: mean success weighted by path length of these episodes (Equation 37).
        reward: mean reward per frame.
    """

    frames: Float64[np.ndarray, "chunks"]
    episodes: Float64[np.ndarray, "chunks"]
    success_rate: Float64[np.ndarray, "chunks"]
    path_length_error: Float64[np.ndarray, "chunks"]
    spl: Float64[np.ndarray, "chunks"]
    reward: Float64[np.ndarray, "chunks"]


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TrainState:
    """The state of an actor-critic's training between updates.

    Attributes:
        parameters: θ, the network's parameters.
        optimizer: the optimiser's state.
        workers: the workers; fields are [groups, batch].
        key: source of the remaining randomness.
    """

    parameters: Parameters
    optimizer: optax.OptState
    workers: Workers
    key: PRNGKeyArray


@dataclass(frozen=True)
class Chunks:
    """The chunks of a training, all of the same size, so that one compiled program runs them.

    Attributes:
        count: number of chunks.
        updates: updates in a chunk.
        frames: frames of all workers in a chunk.
    """

    count: int
    updates: int
    frames: int


def split_into_chunks(frames: int, frames_per_update: int) -> Chunks:
    """Group the updates of a training into chunks.

    Args:
        frames: frames of the training; rounded up to whole chunks.
        frames_per_update: frames of one update.

    Returns:
        The chunks.
    """
    total_updates = -(-frames // frames_per_update)
    updates = min(UPDATES_PER_CHUNK, total_updates)
    return Chunks(count=-(-total_updates // updates), updates=updates, frames=updates * frames_per_update)


def run_chunks(
    state: State, run_chunk: Callable[[State, int], tuple[State, Row]], chunks: Chunks, log: TrainingLog
) -> tuple[State, list[Row]]:
    """Run all chunks of a training, on the host.

    Args:
        state: the state before the first chunk.
        run_chunk: maps a state and the index of the chunk, from 0, to the next state and the chunk's row. It must not
            depend on anything else that changes, so that an interrupted training continues with identical results.
        chunks: the chunks.
        log: receives the progress, and restores an interrupted training.

    Returns:
        The last state, and one row for each chunk.

    Raises:
        DivergenceError: a number of the training is not finite. The last valid state is stored, as after any other
            interruption.
    """
    finished = log.resume(state)
    try:
        for number in range(len(finished[1]), chunks.count):
            state, row = run_chunk(finished[0], number)
            check_finite(state, row)
            finished = state, [*finished[1], row]
            log.add(*finished)
    except (DivergenceError, KeyboardInterrupt, SystemExit):
        log.stop(*finished)
        raise
    return finished


def train_in_chunks(
    state: State,
    run_updates: Callable[[State, int], tuple[State, EpisodeSums]],
    frames: int,
    frames_per_update: int,
    log: TrainingLog,
) -> tuple[State, LearningCurve]:
    """Train an actor-critic.

    Args:
        state: the state before the first update.
        run_updates: maps a state and a number of updates to the next state, and sums over the episodes that ended.
        frames: frames of the training; rounded up to whole chunks.
        frames_per_update: frames of one update.
        log: receives the progress, and restores an interrupted training.

    Returns:
        The last state, and the learning curve.

    Raises:
        DivergenceError: see `run_chunks`.
    """
    chunks = split_into_chunks(frames, frames_per_update)

    def chunk(state: State, number: int) -> tuple[State, Row]:
        state, sums = run_updates(state, chunks.updates)
        return state, learning_row(sums, number, chunks)

    state, rows = run_chunks(state, chunk, chunks, log)
    return state, curve_from_rows(LearningCurve, rows)


def check_finite(state: State, row: Row) -> None:
    """Check that a training still computes with numbers.

    Args:
        state: the state after a chunk; costs in it may be infinite, where there is no path.
        row: the chunk's row; metrics of episodes are NaN if no episode ended.

    Raises:
        DivergenceError: a reward or loss is not finite, or an array of the state contains NaN.
    """
    for name, value in row.items():
        if name.endswith(("reward", "loss")) and not math.isfinite(value):
            raise _diverged(f"the mean {name.split('/')[-1].replace('_', ' ')}", row)
    real = [
        (path, leaf)
        for path, leaf in jax.tree_util.tree_leaves_with_path(state)
        if jnp.issubdtype(leaf.dtype, jnp.floating)
    ]
    for (path, _), undefined in zip(real, np.asarray(_any_nan([leaf for _, leaf in real])), strict=True):
        if undefined:
            raise _diverged(f"`{jax.tree_util.keystr(path, simple=True, separator='.')}`", row)


@jax.jit
def _any_nan(arrays: list[jax.Array]) -> jax.Array:
    return jnp.asarray([jnp.isnan(array).any() for array in arrays], bool)


def _diverged(what: str, row: Row) -> DivergenceError:
    return DivergenceError(
        f"the training diverged: {what} is not finite after {row['frames']:,.0f} frames; give a smaller learning rate "
        "or smaller rewards, and another run folder."
    )


def learning_row(sums: EpisodeSums, number: int, chunks: Chunks) -> dict[str, float]:
    """Compute the learning curve's row of a chunk.

    Args:
        sums: sums over the chunk.
        number: index of the chunk, from 0.
        chunks: the chunks.

    Returns:
        One entry of a `LearningCurve`.
    """
    total = {name: float(value) for name, value in jax.device_get(vars(sums)).items()}
    ended = total["episodes"] or np.nan
    return {
        "frames": float((number + 1) * chunks.frames),
        "episodes": total["episodes"],
        "success_rate": total["successes"] / ended,
        "path_length_error": total["excess_length"] / ended,
        "spl": total["weighted_successes"] / ended,
        "reward": total["reward"] / chunks.frames,
    }


def curve_from_rows(kind: type[Curve], rows: Sequence[Row]) -> Curve:
    """Turn rows into columns.

    Args:
        kind: the curve's type.
        rows: one for each chunk.

    Returns:
        The curve.
    """
    names = [field.name for field in dataclasses.fields(kind)]  # pyrefly: ignore
    return kind(**{name: np.asarray([row[name] for row in rows], np.float64) for name in names})


def apply_gradient(
    optimizer: optax.GradientTransformation, gradient: Parameters, state: optax.OptState, parameters: Parameters
) -> tuple[Parameters, optax.OptState]:
    """Take one gradient step.

    Args:
        optimizer: the gradient transformation.
        gradient: gradient of the loss.
        state: the optimiser's state.
        parameters: the network's parameters.

    Returns:
        The next parameters and state.
    """
    with jax.numpy_dtype_promotion("standard"):  # Adam raises a float to the power of an integer count
        change, state = optimizer.update(gradient, state, parameters)
    return cast(Parameters, optax.apply_updates(parameters, change)), state


def repeat_updates(
    update: Callable[[State], tuple[State, EpisodeSums]], state: State, updates: int
) -> tuple[State, EpisodeSums]:
    """Several updates one after the other, to be compiled as one program.

    Args:
        update: one update; its next state, and sums over the episodes that ended.
        state: the state of training.
        updates: number of updates. Static.

    Returns:
        The next state of training, and sums over the episodes of all updates.
    """
    state, sums = jax.lax.scan(lambda carry, _: update(carry), state, length=updates)
    return state, jax.tree.map(jnp.sum, sums)
