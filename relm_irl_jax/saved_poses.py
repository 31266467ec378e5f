"""Poses of a scene's states, and files of arrays and fields, as the stages save them for the report.

The report draws from them without the scene and the agent.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float64, Int32

from relm_irl_jax.errors import InputError, first_line
from relm_irl_jax.files import load_arrays_and_metadata
from relm_irl_jax.scenes.scene import HEADINGS, Scene

FIELDS = "fields"
"""Metadata key of all values that are not arrays, as JSON."""

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
        require(self.rotation.ndim == 1 and len(self.rotation) > 0, "rotation does not have one number for each state")
        require(self.location.shape == (len(self.rotation), 2), "location does not have two numbers for each state")
        require(bool(np.isfinite(self.location).all()), "location is not finite")
        require(bool(np.isin(self.rotation, HEADINGS).all()), f"rotation is not one of {HEADINGS}")

    def check_states(self, name: str, states: Int32[np.ndarray, "n"] | Sequence[int]) -> None:
        """Raise an InputError unless all numbers are states of the scene."""
        numbers = np.asarray(states)
        inside = (numbers >= 0) & (numbers < len(self.rotation))
        valid = numbers.ndim == 1 and len(numbers) > 0 and bool(inside.all())
        require(valid, f"{name} is not a state of {self.name}")


def poses_of(scene: Scene) -> ScenePoses:
    """The poses of a scene.

    Args:
        scene: the scene.

    Returns:
        Its poses.
    """
    return ScenePoses(scene.name, scene.room_type, scene.location, scene.rotation)


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


def require(condition: bool, fault: str) -> None:
    """Raise an InputError with the fault unless a condition holds."""
    if not condition:
        raise InputError(fault)
