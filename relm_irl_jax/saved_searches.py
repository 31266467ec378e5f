"""Searches of an agent for a target: what it believed at some moments of an episode, laid over the true room."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64, Int32, UInt8

from relm_irl_jax.errors import InputError
from relm_irl_jax.saved_episodes import EpisodeInScene, load_in_order, save_in_order

_ARRAYS = {
    "path": np.int32,
    "steps": np.int32,
    "origin": np.float64,
    "probability": np.float32,
    "free": np.float32,
    "coverage": np.float32,
    "views": np.uint8,
    "target_view": np.uint8,
}


@dataclass(frozen=True, kw_only=True)
class SavedSearch(EpisodeInScene):
    """One episode, and what the agent believed at some moments of it.

    The belief lies on a square of places whose axes are the room's: `origin` is the place in its middle.

    Attributes:
        steps: the moments, as numbers of steps taken.
        origin: position (x, z) of the middle of the square, in metres.
        probability: of each pose to be the target's, by heading, z and x.
        free: log odds that each place can be stood on, by moment, z and x.
        coverage: how much the agent had seen of each place, from 0 to 1, by moment, z and x.
        views: its view at each moment, RGB.
        target_view: the target's view, RGB.
    """

    steps: Int32[np.ndarray, "moments"]
    origin: Float64[np.ndarray, "2"]
    probability: Float32[np.ndarray, "moments 4 z x"]
    free: Float32[np.ndarray, "_ _ _"]
    coverage: Float32[np.ndarray, "_ _ _"]
    views: UInt8[np.ndarray, "_ height width 3"]
    target_view: UInt8[np.ndarray, "target_height target_width 3"]

    def __post_init__(self) -> None:
        """Check states and shapes."""
        super().__post_init__()
        moments, side = len(self.steps), self.probability.shape[-1]
        square = (moments, side, side)
        fits = (
            self.probability.shape == (moments, 4, side, side)
            and self.free.shape == self.coverage.shape == square
            and self.views.ndim == 4
            and len(self.views) == moments > 0
            and side % 2 == 1
            and self.origin.shape == (2,)
            and bool(((self.steps >= 0) & (self.steps < len(self.path))).all())
        )
        if not fits:
            raise InputError("the moments of a search do not fit one another")


def save_searches(path: Path, searches: Sequence[SavedSearch]) -> None:
    """Write searches.

    Args:
        path: the file, `RunFolder.searches`.
        searches: the searches, in the order in which they are shown.
    """
    save_in_order(path, searches, _ARRAYS)


def load_searches(path: Path) -> list[SavedSearch]:
    """Read searches.

    Args:
        path: the file.

    Returns:
        The searches, in the order in which they are shown.

    Raises:
        InputError: the file is missing or damaged.
    """
    return load_in_order(path, SavedSearch, _ARRAYS)
