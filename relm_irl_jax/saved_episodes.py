"""Episodes of agents, as the stages save them for the report."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int32, UInt8
from numpy.typing import DTypeLike

from relm_irl_jax.files import save_arrays
from relm_irl_jax.saved_poses import FIELDS, Saved, ScenePoses, load_poses, load_saved, require


@dataclass(frozen=True, kw_only=True)
class EpisodeInScene:
    """One episode of an agent.

    Attributes:
        poses: poses of the scene's states.
        method: the method that trained the agent.
        seed: seed of the training.
        target: the target's state.
        category: category of the object that the target shows; empty if it was chosen by its position.
        path: states from the start to the last one.
    """

    poses: ScenePoses
    method: str
    seed: int
    target: int
    category: str
    path: Int32[np.ndarray, "path"]

    def __post_init__(self) -> None:
        """Check states."""
        self.poses.check_states("target", [self.target])
        self.poses.check_states("path", self.path)

    @property
    def success(self) -> bool:
        """Whether the episode ended at the target."""
        return int(self.path[-1]) == self.target


@dataclass(frozen=True, kw_only=True)
class SavedEpisode(EpisodeInScene):
    """One episode of an agent, beside a shortest path.

    Attributes:
        shortest_path: states of a shortest path from the start to the target.
        target_view: the target's view, RGB.
    """

    shortest_path: Int32[np.ndarray, "shortest"]
    target_view: UInt8[np.ndarray, "height width 3"]

    def __post_init__(self) -> None:
        """Check states and the shape of the view."""
        super().__post_init__()
        self.poses.check_states("shortest_path", self.shortest_path)
        view = self.target_view
        require(view.ndim == 3 and view.shape[2] == 3 and view.size > 0, "target_view is not an RGB image")


_ARRAYS = {"path": np.int32, "shortest_path": np.int32, "target_view": np.uint8}


def save_episodes(path: Path, episodes: Sequence[SavedEpisode]) -> None:
    """Write episodes.

    Args:
        path: the file, `RunFolder.episodes`.
        episodes: the episodes, in the order in which they are shown.
    """
    save_in_order(path, episodes, _ARRAYS)


def load_episodes(path: Path) -> list[SavedEpisode]:
    """Read episodes.

    Args:
        path: the file.

    Returns:
        The episodes, in the order in which they are shown.

    Raises:
        InputError: the file is missing or damaged.
    """
    return load_in_order(path, SavedEpisode, _ARRAYS)


def save_in_order(path: Path, episodes: Sequence[EpisodeInScene], arrays: Iterable[str]) -> None:
    """Write episodes with arrays of their own.

    Args:
        path: the file.
        episodes: the episodes.
        arrays: names of their arrays.
    """
    saved: dict[str, np.ndarray] = {}
    fields = []
    for number, episode in enumerate(episodes):
        poses = episode.poses
        saved |= {f"{number}/location": poses.location, f"{number}/rotation": poses.rotation}
        saved |= {f"{number}/{name}": getattr(episode, name) for name in arrays}
        texts = {"scene": poses.name, "room_type": poses.room_type, "method": episode.method}
        fields.append({**texts, "seed": episode.seed, "target": episode.target, "category": episode.category})
    save_arrays(path, saved, {FIELDS: json.dumps(fields)})


def load_in_order(path: Path, kind: Callable[..., Saved], arrays: Mapping[str, DTypeLike]) -> list[Saved]:
    """Read what `save_in_order` has written.

    Args:
        path: the file.
        kind: makes an episode from its fields and arrays.
        arrays: names and types of the arrays.

    Returns:
        The episodes.

    Raises:
        InputError: the file is missing or damaged.
    """

    def build(saved: Mapping[str, np.ndarray], fields: list[dict[str, Any]]) -> list[Saved]:
        return [
            kind(
                poses=load_poses(saved, episode, f"{number}/"),
                method=str(episode["method"]),
                seed=int(episode["seed"]),
                target=int(episode["target"]),
                category=str(episode["category"]),
                **{name: saved[f"{number}/{name}"].astype(dtype) for name, dtype in arrays.items()},
            )
            for number, episode in enumerate(fields)
        ]

    return load_saved(path, build)
