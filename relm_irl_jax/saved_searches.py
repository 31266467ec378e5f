"""Searches of an agent for a target: what it believed at some moments of an episode, laid over the true room."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int32, UInt8

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import save_arrays
from relm_irl_jax.saved_maps import FIELDS, ScenePoses, load_poses, load_saved

_ARRAYS = ("path", "steps", "origin", "probability", "free", "coverage", "views", "target_view")


@dataclass(frozen=True, kw_only=True)
class SavedSearch:
    """One episode, and what the agent believed at some moments of it.

    The belief lies on a square of places whose axes are the room's: `origin` is the place in its middle.

    Attributes:
        poses: poses of the scene's states.
        method: the method that trained the agent.
        seed: seed of the training.
        target: the target's state.
        category: category of the object that the target shows; empty if it was chosen by its position.
        path: states from the start to the last one.
        steps: the moments, as numbers of steps taken.
        origin: position (x, z) of the middle of the square, in metres.
        probability: of each pose to be the target's, by heading, z and x.
        free: log odds that each place can be stood on, by moment, z and x.
        coverage: how much the agent had seen of each place, from 0 to 1, by moment, z and x.
        views: its view at each moment, RGB.
        target_view: the target's view, RGB.
    """

    poses: ScenePoses
    method: str
    seed: int
    target: int
    category: str
    path: Int32[np.ndarray, "path"]
    steps: Int32[np.ndarray, "moments"]
    origin: Float64[np.ndarray, "2"]
    probability: Float32[np.ndarray, "moments 4 z x"]
    free: Float32[np.ndarray, "_ _ _"]
    coverage: Float32[np.ndarray, "_ _ _"]
    views: UInt8[np.ndarray, "_ height width 3"]
    target_view: UInt8[np.ndarray, "target_height target_width 3"]

    def __post_init__(self) -> None:
        """Check states and shapes."""
        self.poses.check_states("target", [self.target])
        self.poses.check_states("path", self.path)
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

    @property
    def success(self) -> bool:
        """Whether the episode ended at the target."""
        return int(self.path[-1]) == self.target


def save_searches(path: Path, searches: Sequence[SavedSearch]) -> None:
    """Write searches.

    Args:
        path: the file, `RunFolder.searches`.
        searches: the searches, in the order in which they are shown.
    """
    arrays: dict[str, np.ndarray] = {}
    fields = []
    for number, search in enumerate(searches):
        arrays |= {f"{number}/{name}": getattr(search, name) for name in _ARRAYS}
        arrays |= {f"{number}/location": search.poses.location, f"{number}/rotation": search.poses.rotation}
        texts = {"scene": search.poses.name, "room_type": search.poses.room_type, "method": search.method}
        fields.append({**texts, "seed": search.seed, "target": search.target, "category": search.category})
    save_arrays(path, arrays, {FIELDS: json.dumps(fields)})


def load_searches(path: Path) -> list[SavedSearch]:
    """Read searches.

    Args:
        path: the file.

    Returns:
        The searches, in the order in which they are shown.

    Raises:
        InputError: the file is missing or damaged.
    """

    def build(arrays: Mapping[str, np.ndarray], fields: list[dict[str, Any]]) -> list[SavedSearch]:
        return [
            SavedSearch(
                poses=load_poses(arrays, search, f"{number}/"),
                method=str(search["method"]),
                seed=int(search["seed"]),
                target=int(search["target"]),
                category=str(search["category"]),
                **{name: arrays[f"{number}/{name}"] for name in _ARRAYS},
            )
            for number, search in enumerate(fields)
        ]

    return load_saved(path, build)
