"""What the training of every agent shares: the parameters' type, the length of a chunk, and the learning curve."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from relm_irl_jax.agent.rollout import EpisodeSums

Parameters = Mapping[str, Mapping[str, Any]]
"""A network's parameters θ: nested dictionaries of arrays."""

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


def learning_curve(sums: Sequence[EpisodeSums], frames: int) -> LearningCurve:
    """Turn sums over chunks into means.

    Args:
        sums: of each chunk.
        frames: frames of a chunk; all chunks are alike.

    Returns:
        The curve.
    """
    column = lambda name: column_of(sums, name)  # noqa: E731
    episodes = column("episodes")
    ended = np.where(episodes > 0, episodes, np.nan)
    return LearningCurve(
        frames=frames * np.arange(1.0, len(sums) + 1),
        episodes=episodes,
        success_rate=column("successes") / ended,
        path_length_error=column("excess") / ended,
        spl=column("weighted") / ended,
        reward=column("reward") / frames,
    )


def column_of(records: Sequence[Any], name: str) -> Float64[np.ndarray, "records"]:
    """One field of many records.

    Args:
        records: structures of numbers.
        name: the field.

    Returns:
        Its values.
    """
    return np.asarray([getattr(record, name) for record in records], np.float64)
