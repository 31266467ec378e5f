"""What the training of every agent shares: the host's loop over chunks of updates, and the learning curve."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import jax
import numpy as np
from jaxtyping import Float64

from relm_irl_jax.agents.rollout import EpisodeSums
from relm_irl_jax.types import Row, State, TrainingLog

Curve = TypeVar("Curve")
"""A dataclass of equally long columns, one of them named `frames`."""

UPDATES_PER_CHUNK = 8
"""Updates that one call of a compiled program runs: one row of the learning curve and one step of the progress bar."""


@dataclass(frozen=True)
class LearningCurve:
    """Training performance, one entry for each chunk of updates; NaN where no episode ended in a chunk.

    Attributes:
        frames: frames of all workers up to the end of the chunk.
        episodes: episodes ended in the chunk.
        success_rate: share of them that reached the target.
        path_length_error: their mean path length minus shortest path, in actions (Equation 36).
        spl: their success weighted by path length (Equation 37).
        reward: mean reward a frame.
    """

    frames: Float64[np.ndarray, "chunks"]
    episodes: Float64[np.ndarray, "chunks"]
    success_rate: Float64[np.ndarray, "chunks"]
    path_length_error: Float64[np.ndarray, "chunks"]
    spl: Float64[np.ndarray, "chunks"]
    reward: Float64[np.ndarray, "chunks"]


@dataclass(frozen=True)
class Chunks:
    """How the updates of a training are grouped; all chunks are alike, so that one compiled program runs them.

    Attributes:
        count: number of chunks.
        updates: updates of a chunk.
        frames: frames of a chunk, all workers together.
    """

    count: int
    updates: int
    frames: int


def split_into_chunks(frames: int, frames_per_update: int) -> Chunks:
    """Group the updates of a training into chunks.

    Args:
        frames: frames asked for; rounded up to whole chunks.
        frames_per_update: frames of one update.

    Returns:
        The chunks.
    """
    wanted = -(-frames // frames_per_update)
    updates = min(UPDATES_PER_CHUNK, wanted)
    return Chunks(count=-(-wanted // updates), updates=updates, frames=updates * frames_per_update)


def run_chunks(
    state: State, run_chunk: Callable[[State, int], tuple[State, Row]], chunks: Chunks, log: TrainingLog
) -> tuple[State, list[Row]]:
    """The host's loop of every training.

    Args:
        state: the state before the first chunk.
        run_chunk: maps a state and the number of the chunk, from 0, to the next state and the chunk's row. It depends
            on nothing else that changes, so that an interrupted training continues as if it had not been interrupted.
        chunks: the chunks.
        log: receives the progress, and restores an interrupted training.

    Returns:
        The last state, and one row for each chunk.
    """
    state, rows = log.resume(state)
    for number in range(len(rows), chunks.count):
        state, row = run_chunk(state, number)
        rows.append(row)
        log.add(state, rows)
    return state, rows


def learning_row(sums: EpisodeSums, number: int, chunks: Chunks) -> dict[str, float]:
    """Means of a chunk from its sums.

    Args:
        sums: over the chunk.
        number: of the chunk, from 0.
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
