"""Values of all states of a scene, as the stages save them for the report's maps."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from relm_irl_jax.files import save_arrays
from relm_irl_jax.saved_poses import FIELDS, ScenePoses, load_poses, load_saved, require

SHORTEST_PATH = "shortest-path"
"""Name of the true distances in a map of distances."""

_VALUES = "values/"
"""Prefix of the names of a map's value arrays."""


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
        require(len(self.values) > 0, "there are no values")
        for name, values in self.values.items():
            require(values.shape == self.poses.rotation.shape, f"values of {name} are not one number for each state")
        require(self.limits is None or self.limits[0] < self.limits[1], "limits are not ascending")


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
