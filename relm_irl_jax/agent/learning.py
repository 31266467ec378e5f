"""What the training of every agent shares: parameters, the host's loop over chunks, and the learning curve."""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import jax
import numpy as np
from jaxtyping import Float64

from relm_irl_jax.agent.rollout import EpisodeSums

Parameters = Mapping[str, Mapping[str, Any]]
"""A network's parameters θ: nested dictionaries of arrays."""

State = TypeVar("State")
"""Everything that a training carries from chunk to chunk: a tree of arrays."""

Curve = TypeVar("Curve")
"""A dataclass of equally long columns, one of them named `frames`."""

Row = Mapping[str, float]
"""One entry of a curve: a number for each column."""

UPDATES_PER_CHUNK = 8
"""Updates between two looks at the program: one row of the learning curve and one movement of the progress bar."""


@dataclass(frozen=True)
class LearningCurve:
    """Training performance, one entry a chunk of updates; NaN where no episode ended in a chunk.

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
    """How a training is cut into chunks; all are alike, so that one compiled program serves.

    Attributes:
        count: number of chunks.
        updates: updates of a chunk.
        frames: frames of a chunk, all workers together.
    """

    count: int
    updates: int
    frames: int


class TrainingRecord:
    """Where a training leaves its course, and where it finds what an earlier attempt left; here nowhere."""

    def resume(self, state: State) -> tuple[State, list[Row]]:
        """Find where an earlier attempt at the same training stopped.

        Args:
            state: the state before the first chunk.

        Returns:
            The state to go on from, and the rows of the chunks done before it.
        """
        return state, []

    def add(self, state: State, rows: list[Row]) -> None:
        """Take note of a chunk.

        Args:
            state: the state after it.
            rows: the rows of all chunks so far.
        """


def cut(frames: int, frames_per_update: int) -> Chunks:
    """Cut a training into chunks.

    Args:
        frames: frames wanted; rounded up to whole chunks.
        frames_per_update: frames of one update.

    Returns:
        The chunks.
    """
    wanted = -(-frames // frames_per_update)
    updates = min(UPDATES_PER_CHUNK, wanted)
    return Chunks(count=-(-wanted // updates), updates=updates, frames=updates * frames_per_update)


def run_chunks(
    state: State, run_chunk: Callable[[State, int], tuple[State, Row]], chunks: Chunks, record: TrainingRecord
) -> tuple[State, list[Row]]:
    """The host's loop of every training.

    Args:
        state: the state before the first chunk.
        run_chunk: maps a state and the number of the chunk, from 0, to the next state and the chunk's row. It depends
            on nothing else that changes, so that a training that was cut off goes on as if it had not been.
        chunks: the chunks.
        record: where the course is left.

    Returns:
        The last state, and one row a chunk.
    """
    state, rows = record.resume(state)
    for number in range(len(rows), chunks.count):
        state, row = run_chunk(state, number)
        rows.append(row)
        record.add(state, rows)
    return state, rows


def learning_row(sums: EpisodeSums, number: int, chunks: Chunks) -> dict[str, float]:
    """Turn a chunk's sums into means.

    Args:
        sums: over the chunk.
        number: of the chunk, from 0.
        chunks: the chunks.

    Returns:
        One entry of a `LearningCurve`.
    """
    total = {name: float(value) for name, value in vars(jax.device_get(sums)).items()}
    ended = total["episodes"] or np.nan
    return {
        "frames": float((number + 1) * chunks.frames),
        "episodes": total["episodes"],
        "success_rate": total["successes"] / ended,
        "path_length_error": total["excess"] / ended,
        "spl": total["weighted"] / ended,
        "reward": total["reward"] / chunks.frames,
    }


def curve_of(kind: type[Curve], rows: list[Row]) -> Curve:
    """Stand the rows' numbers in columns.

    Args:
        kind: the curve's type.
        rows: one a chunk.

    Returns:
        The curve.
    """
    names = [field.name for field in dataclasses.fields(kind)]  # pyrefly: ignore
    return kind(**{name: np.asarray([row[name] for row in rows], np.float64) for name in names})
