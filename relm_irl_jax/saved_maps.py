"""Data of the report's maps, which the stages save: values of all states of a scene, and episodes.

The report draws them without the scene and the agent.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float64, Int32, UInt8

from relm_irl_jax.errors import InputError, first_line
from relm_irl_jax.files import load_arrays_and_metadata, save_arrays
from relm_irl_jax.scenes.scene import HEADINGS, Scene

SHORTEST_PATH = "shortest-path"
"""Name of the true distances in a map of distances."""

FIELDS = "fields"
"""Metadata key of all values that are not arrays, as JSON."""

_VALUES = "values/"
"""Prefix of the names of a map's value arrays."""

Saved = TypeVar("Saved")


@dataclass(frozen=True)
class ScenePoses:
    """The poses of a scene's states.

    Attributes:
        name: the scene's name.
        room_type: its room type.
        location: position (x, z) of each state, in metres.
        rotation: heading of each state, in degrees; 0 faces +z and 90 faces +x.
    """

    name: str
    room_type: str
    location: Float64[np.ndarray, "states 2"]
    rotation: Float64[np.ndarray, "states"]

    def __post_init__(self) -> None:
        """Check shapes and values."""
        _require(self.rotation.ndim == 1 and len(self.rotation) > 0, "rotation does not have one number for each state")
        _require(self.location.shape == (len(self.rotation), 2), "location does not have two numbers for each state")
        _require(bool(np.isfinite(self.location).all()), "location is not finite")
        _require(bool(np.isin(self.rotation, HEADINGS).all()), f"rotation is not one of {HEADINGS}")

    def check_states(self, name: str, states: Int32[np.ndarray, "n"] | Sequence[int]) -> None:
        """Raise an InputError unless all numbers are states of the scene."""
        numbers = np.asarray(states)
        inside = (numbers >= 0) & (numbers < len(self.rotation))
        valid = numbers.ndim == 1 and len(numbers) > 0 and bool(inside.all())
        _require(valid, f"{name} is not a state of {self.name}")


def poses_of(scene: Scene) -> ScenePoses:
    """The poses of a scene.

    Args:
        scene: the scene.

    Returns:
        Its poses.
    """
    return ScenePoses(scene.name, scene.room_type, scene.location, scene.rotation)


@dataclass(frozen=True, kw_only=True)
class StateMap:
    """Values of all states of a scene for one target, by several methods.

    Attributes:
        poses: poses of the states.
        seed: seed of the methods and of the target.
        target: the target's state.
        category: category of the object that the target shows; empty if it was chosen by its position.
        values: for each method, or `SHORTEST_PATH`, the value of every state: a reward, or a distance in actions. NaN
            or infinite if there is no value; for `SHORTEST_PATH`, negative if there is no path.
        start: the state for which rewards are predicted; None if values do not depend on a start.
        limits: ends of the colour scale, to which the agents' rewards are clipped; None for the range of the values.
    """

    poses: ScenePoses
    seed: int
    target: int
    category: str
    values: Mapping[str, Float64[np.ndarray, "states"]]
    start: int | None = None
    limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check states, shapes and limits."""
        self.poses.check_states("target", [self.target])
        self.poses.check_states("start", [self.target if self.start is None else self.start])
        _require(len(self.values) > 0, "there are no values")
        for name, values in self.values.items():
            _require(values.shape == self.poses.rotation.shape, f"values of {name} are not one number for each state")
        _require(self.limits is None or self.limits[0] < self.limits[1], "limits are not ascending")


def save_map(path: Path, saved: StateMap) -> None:
    """Write a map.

    Args:
        path: the file, `RunFolder.reward_map` or `RunFolder.distance_map`.
        saved: the map.
    """
    fields = {
        "scene": saved.poses.name,
        "room_type": saved.poses.room_type,
        "seed": saved.seed,
        "target": saved.target,
        "category": saved.category,
        "methods": list(saved.values),
        "start": saved.start,
        "limits": saved.limits,
    }
    arrays = {f"{_VALUES}{name}": values for name, values in saved.values.items()}
    arrays |= {"location": saved.poses.location, "rotation": saved.poses.rotation}
    save_arrays(path, arrays, {FIELDS: json.dumps(fields)})


def load_map(path: Path) -> StateMap:
    """Read a map.

    Args:
        path: the file.

    Returns:
        The map.

    Raises:
        InputError: the file is missing or damaged.
    """

    def build(arrays: Mapping[str, np.ndarray], fields: dict[str, Any]) -> StateMap:
        return StateMap(
            poses=load_poses(arrays, fields),
            seed=int(fields["seed"]),
            target=int(fields["target"]),
            category=str(fields["category"]),
            values={name: arrays[f"{_VALUES}{name}"].astype(np.float64) for name in fields["methods"]},
            start=None if fields["start"] is None else int(fields["start"]),
            limits=None if fields["limits"] is None else (float(fields["limits"][0]), float(fields["limits"][1])),
        )

    return load_saved(path, build)


@dataclass(frozen=True, kw_only=True)
class SavedEpisode:
    """One episode of an agent.

    Attributes:
        poses: poses of the scene's states.
        method: the method that trained the agent.
        seed: seed of the training.
        target: the target's state.
        category: category of the object that the target shows; empty if it was chosen by its position.
        path: states from the start to the last one.
        shortest_path: states of a shortest path from the start to the target.
        target_view: the target's view, RGB.
    """

    poses: ScenePoses
    method: str
    seed: int
    target: int
    category: str
    path: Int32[np.ndarray, "path"]
    shortest_path: Int32[np.ndarray, "shortest"]
    target_view: UInt8[np.ndarray, "height width 3"]

    def __post_init__(self) -> None:
        """Check states and the shape of the view."""
        self.poses.check_states("target", [self.target])
        self.poses.check_states("path", self.path)
        self.poses.check_states("shortest_path", self.shortest_path)
        view = self.target_view
        _require(view.ndim == 3 and view.shape[2] == 3 and view.size > 0, "target_view is not an RGB image")

    @property
    def success(self) -> bool:
        """Whether the episode ended at the target."""
        return int(self.path[-1]) == self.target


def save_episodes(path: Path, episodes: Sequence[SavedEpisode]) -> None:
    """Write episodes.

    Args:
        path: the file, `RunFolder.episodes`.
        episodes: the episodes, in the order in which they are shown.
    """
    arrays: dict[str, np.ndarray] = {}
    fields = []
    for number, episode in enumerate(episodes):
        poses = episode.poses
        arrays |= {
            f"{number}/location": poses.location,
            f"{number}/rotation": poses.rotation,
            f"{number}/path": episode.path,
            f"{number}/shortest_path": episode.shortest_path,
            f"{number}/target_view": episode.target_view,
        }
        texts = {"scene": poses.name, "room_type": poses.room_type, "method": episode.method}
        fields.append({**texts, "seed": episode.seed, "target": episode.target, "category": episode.category})
    save_arrays(path, arrays, {FIELDS: json.dumps(fields)})


def load_episodes(path: Path) -> list[SavedEpisode]:
    """Read episodes.

    Args:
        path: the file.

    Returns:
        The episodes, in the order in which they are shown.

    Raises:
        InputError: the file is missing or damaged.
    """

    def build(arrays: Mapping[str, np.ndarray], fields: list[dict[str, Any]]) -> list[SavedEpisode]:
        return [
            SavedEpisode(
                poses=load_poses(arrays, episode, f"{number}/"),
                method=str(episode["method"]),
                seed=int(episode["seed"]),
                target=int(episode["target"]),
                category=str(episode["category"]),
                path=arrays[f"{number}/path"].astype(np.int32),
                shortest_path=arrays[f"{number}/shortest_path"].astype(np.int32),
                target_view=arrays[f"{number}/target_view"].astype(np.uint8),
            )
            for number, episode in enumerate(fields)
        ]

    return load_saved(path, build)


def load_poses(arrays: Mapping[str, np.ndarray], fields: Mapping[str, Any], prefix: str = "") -> ScenePoses:
    """Poses of a scene from a file's contents.

    Args:
        arrays: the file's arrays.
        fields: the fields of what was saved, with the scene's name and room type.
        prefix: what the names of the arrays begin with.

    Returns:
        The poses.
    """
    location, rotation = (arrays[prefix + name].astype(np.float64) for name in ("location", "rotation"))
    return ScenePoses(str(fields["scene"]), str(fields["room_type"]), location, rotation)


def load_saved(path: Path, build: Callable[[Mapping[str, np.ndarray], Any], Saved]) -> Saved:
    """Read a file of arrays and fields, and build an object from them.

    Args:
        path: the file.
        build: makes the object from the arrays and the fields.

    Returns:
        The object.

    Raises:
        InputError: the file is missing or damaged.
    """
    arrays, metadata = load_arrays_and_metadata(path)
    try:
        return build(arrays, json.loads(metadata[FIELDS]))
    except KeyError as error:
        raise InputError(f"{path}: {error} is missing; remove the file and run `relm-irl evaluate` again.") from error
    except (TypeError, ValueError, IndexError, OverflowError) as error:
        raise InputError(f"{path}: {first_line(error)}; remove the file and run `relm-irl evaluate` again.") from error


def _require(condition: bool, fault: str) -> None:
    if not condition:
        raise InputError(fault)
